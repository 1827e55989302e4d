"""Lists of names and sentences for the reference, read from the source, so that none goes stale.

A line of a page such as `<!-- names: trdlab.explanations.moment -->` is replaced by a list:

- `table: P`: what package P exports, a row for each name with the first sentence about it; of a
  package that exports nothing, what its modules define;
- `names: P`: the same in full, but only what lies in P itself and not deeper; P may be a room of
  the package that exports it;
- `modules: P`: the modules of P that define something public, each in full;
- `sentences: P`: a section on what the rules in the modules of P say, and when; none without rules.

Where a page would be too long, `P only a b` lists a part, and `P except a b` the rest: exported
names, or modules where nothing is exported.
"""

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from docstrings import prepared

_LINE = re.compile(
    r"^<!-- (table|names|modules|sentences): ([\w.]+)(?: (only|except) ([\w ]+))? -->$",
    re.MULTILINE,
)

Definition = ast.ClassDef | ast.FunctionDef
Choice = Callable[[str], bool]


def expanded(markdown: str, root: Path) -> str:
    """Returns a page with its lists.

    Args:
        markdown: the page.
        root: the folder in which the package lies.

    Raises:
        LookupError: there is no such package, or nothing to list.
    """

    def listed(found: re.Match[str]) -> str:
        package = root.joinpath(*found[2].split("."))
        if not (package / "__init__.py").is_file():
            raise LookupError(f"there is no package {found[2]}")
        part, word = set((found[4] or "").split()), found[3]

        def is_meant(name: str) -> bool:
            return not word or (name in part) == (word == "only")

        blocks = list(_LISTS[found[1]](package, root, is_meant))
        if blocks or found[1] == "sentences":
            return "\n".join(blocks)
        raise LookupError(f"there are no {found[1]} to list of {found[2]}")

    return _LINE.sub(listed, markdown)


def exports(package: Path, root: Path) -> Iterator[tuple[str, Path]]:
    """Yields the names that a package exports, and the file that each of them is defined in."""
    tree = _parsed(package / "__init__.py")
    imported = [
        (name, _file(node.module, root))
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module
        for name in node.names
    ]
    homes = {name.name: home for name, home in imported}
    lists = [
        node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
    ]
    again = [name.name for name, _ in imported if name.asname == name.name]  # as type checkers say
    for name in ast.literal_eval(lists[0]) if lists else again:
        if not name.startswith("_"):
            yield name, homes.get(name, package / "__init__.py")


def _table(package: Path, root: Path, is_meant: Choice) -> Iterator[str]:
    named = list(exports(package, root))
    listed = [(name, home) for name, home in named if is_meant(name)]
    for module in [] if named else _chosen(package, is_meant):
        listed += [(name, module) for name, of in public(module) if ast.get_docstring(of)]
    rows = [
        f"| [`{name}`][{_module(home, root)}.{name}] | {_about(name, home)} |"
        for name, home in listed
    ]
    yield from ["| name | what it is |", "|---|---|", *rows] if rows else []


def _names(package: Path, root: Path, is_meant: Choice) -> Iterator[str]:
    exporter = package if list(exports(package, root)) else package.parent
    for name, home in exports(exporter, root):
        if home.parent == package and is_meant(name):
            yield _in_full(f"{_dotted(exporter, root)}.{name}")


def _modules(package: Path, root: Path, is_meant: Choice) -> Iterator[str]:
    for module in _chosen(package, is_meant):
        if any(public(module)):
            yield _in_full(_dotted(module.with_suffix(""), root), path=True)


def _chosen(package: Path, is_meant: Choice) -> list[Path]:
    return [path for path in sorted(package.glob("[!_]*.py")) if is_meant(path.stem)]


def _sentences(package: Path, root: Path, is_meant: Choice) -> Iterator[str]:
    heading = "## What it can say\n\nThe kinds of sentences, and when each is said.\n"
    for module in _chosen(package, is_meant):
        known = _constants(module)
        rules = [
            (kind, says, ast.get_docstring(node))
            for node in _parsed(module).body
            if isinstance(node, ast.FunctionDef)
            for kind, says in _rules(node, known)
        ]
        if rules:
            about = _first(ast.get_docstring(_parsed(module))).rstrip(".")
            yield f"{heading}\n### {about}\n"
            heading = ""
        for kind, says, why in rules:
            paragraphs = [f"“{_shown(says)}”", *(why or "").split("\n\n")]
            lines = prepared("\n\n    ".join(" ".join(of.split()) for of in paragraphs if of))
            yield f"`{kind}`\n\n:   {lines}\n"


def _rules(function: ast.FunctionDef, known: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Yields the kinds of claims that a function finds, each with its sentence."""
    for call in function.decorator_list:
        makes = getattr(call.func, "attr", "") if isinstance(call, ast.Call) else ""
        if makes == "rule":
            given = {of.arg: ast.literal_eval(of.value) for of in call.keywords if of.arg == "kind"}
            kind = given.get("kind") or function.name.strip("_").replace("_", "-")
            yield kind, _value(call.args[0], known)
        elif makes == "kinds":
            yield from _value(call.args[0], known).items()


def _constants(module: Path) -> dict[str, Any]:
    """Returns the names of a module that stand for what is made of nothing but such names."""
    known: dict[str, Any] = {}
    for node in _parsed(module).body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            used = {of.id for of in ast.walk(node.value) if isinstance(of, ast.Name)}
            if used <= known.keys():
                known[node.targets[0].id] = _value(node.value, known)
    return known


def _value(node: ast.expr, known: dict[str, Any]) -> Any:
    return eval(compile(ast.Expression(node), "docs", "eval"), {"__builtins__": {}}, known)


def _shown(says: str) -> str:
    """Returns a sentence with the names of its slots in place of their values."""
    apart = re.sub(r"(?<=[\w}])\{", " {", says)  # slots that may stay empty bring their own blank
    return re.sub(r"\{(\w+)(?::\w+)?\}", lambda of: f"<var>{of[1].replace('_', ' ')}</var>", apart)


def _in_full(identifier: str, *, path: bool = False) -> str:
    lines = [
        f"::: {identifier}",
        "    options:",
        "      show_root_heading: true",
        "      show_root_toc_entry: true",
        f"      show_root_full_path: {str(path).lower()}",
        "      heading_level: 3",
    ]
    return "\n".join([*lines, ""])


def _about(name: str, home: Path) -> str:
    node = dict(public(home)).get(name)
    return _first(ast.get_docstring(node) if node else None)


def _first(docstring: str | None) -> str:
    return " ".join((docstring or "").split("\n\n")[0].split())


def public(module: Path) -> Iterator[tuple[str, Definition]]:
    """Yields the public classes and functions of a module, each with its name."""
    for node in _parsed(module).body:
        if isinstance(node, Definition) and not node.name.startswith("_"):
            yield node.name, node


def _parsed(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


def _file(module: str, root: Path) -> Path:
    path = root.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def _module(file: Path, root: Path) -> str:
    return _dotted(file.with_suffix(""), root).removesuffix(".__init__")


def _dotted(path: Path, root: Path) -> str:
    return ".".join(path.relative_to(root).parts)


_LISTS = {"table": _table, "names": _names, "modules": _modules, "sentences": _sentences}
