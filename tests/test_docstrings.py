"""Every public name is documented: what it is, its arguments, and the errors it raises."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

import trdlab

PACKAGE = Path(trdlab.__file__).parent
MODULES = [path for path in sorted(PACKAGE.rglob("*.py")) if path.parent.name != "cli"]
GLOSSARY = PACKAGE.parent / "docs" / "reference" / "glossary.md"


class Public(NamedTuple):
    """A public class or function, and the classes around it."""

    where: str
    node: ast.ClassDef | ast.FunctionDef
    inside: ast.ClassDef | None

    @property
    def docstring(self) -> str:
        return ast.get_docstring(self.node) or ""


def public(tree: ast.Module | ast.ClassDef, where: str) -> Iterator[Public]:
    inside = tree if isinstance(tree, ast.ClassDef) else None
    for node in tree.body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
            name = f"{where}.{node.name}"
            yield Public(name, node, inside)
            if isinstance(node, ast.ClassDef):
                yield from public(node, name)


@pytest.fixture(scope="module")
def names() -> list[Public]:
    return [
        found
        for path in MODULES
        for found in public(
            ast.parse(path.read_text(encoding="utf-8")),
            ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts),
        )
    ]


def is_rule(node: ast.ClassDef | ast.FunctionDef) -> bool:
    """Returns whether a function is documented by the sentences that it decides on."""
    calls = [call.func for call in node.decorator_list if isinstance(call, ast.Call)]
    return any(isinstance(of, ast.Attribute) and of.attr in ("rule", "kinds") for of in calls)


def overrides(found: Public) -> bool:
    return found.inside is not None and bool(found.inside.bases)


def raised(function: ast.FunctionDef) -> set[str]:
    """Returns the errors that a function itself raises, and not another one inside it."""
    errors, nodes = set(), list(ast.iter_child_nodes(function))
    while nodes:
        node = nodes.pop()
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            errors.add(ast.unparse(node.exc.func).rpartition(".")[2])
        if not isinstance(node, ast.FunctionDef | ast.Lambda | ast.ClassDef):
            nodes.extend(ast.iter_child_nodes(node))
    return errors


def test_every_public_name_has_a_docstring(names: list[Public]) -> None:
    bare = [of for of in names if not of.docstring and not is_rule(of.node) and not overrides(of)]
    assert [of.where for of in bare] == []


def test_every_docstring_names_the_errors_that_are_raised(names: list[Public]) -> None:
    """Those of `trdlab.errors`, by the function itself."""
    ours = {of.node.name for of in names if of.where.startswith("trdlab.errors.")}
    assert [
        f"{found.where}: {error}"
        for found in names
        if isinstance(found.node, ast.FunctionDef) and found.docstring
        for error in sorted(raised(found.node) & ours)
        if not re.search(rf"\b{error}\b", found.docstring)
    ] == []


def exported() -> set[str]:
    """Returns the names that packages export, and that have no underscore."""
    return {
        f"{node.module}.{name.name}"
        for path in PACKAGE.rglob("__init__.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module
        for name in node.names
    }


def test_every_argument_of_an_exported_name_is_told(names: list[Public]) -> None:
    """By the docstring, by its type if that is a noun of trdlab, or by the glossary."""
    table = GLOSSARY.read_text(encoding="utf-8").split("## Arguments")[1].split("\n## ")[0]
    known = set(re.findall(r"`(\w+)`", table))
    nouns = {found.node.name for found in names if isinstance(found.node, ast.ClassDef)}
    open_to_all = exported()
    assert [
        f"{found.where}: {argument.arg}"
        for found in names
        if isinstance(found.node, ast.FunctionDef) and found.docstring
        if (found.where.rpartition(".")[0] if found.inside else found.where) in open_to_all
        for arguments in [found.node.args]
        for argument in [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
        if argument.arg not in {"self", "cls", *known}
        if not re.search(rf"\b{argument.arg}\b", found.docstring)
        if not argument.annotation
        or not nouns & set(re.findall(r"\w+", ast.unparse(argument.annotation)))
    ] == []
