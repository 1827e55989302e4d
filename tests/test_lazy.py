"""Packages import when they are asked: what a type checker is told is what there is."""

import ast
from importlib import import_module
from pathlib import Path

import pytest

import trdlab

HOME = Path(trdlab.__file__).parent
LAZY = [path for path in HOME.rglob("__init__.py") if "lazily(" in path.read_text(encoding="utf-8")]


@pytest.mark.parametrize("path", LAZY, ids=lambda path: path.parent.name)
def test_a_lazy_package_has_the_names_that_it_tells_a_type_checker(path):
    package = import_module(".".join(path.parent.relative_to(HOME.parent).parts))
    for block in ast.parse(path.read_text(encoding="utf-8")).body:
        if not isinstance(block, ast.If) or ast.unparse(block.test) != "TYPE_CHECKING":
            continue
        for line in block.body:
            assert isinstance(line, ast.ImportFrom)
            for name in (alias.name for alias in line.names):
                assert getattr(package, name) is getattr(import_module(str(line.module)), name)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = package.nothing
