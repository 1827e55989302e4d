"""Prepares docstrings, and the signatures above them, for the reference pages."""

import re
from typing import Any

from griffe import ExprCall, Extension, Function, Object

_EXAMPLE = re.compile(r"^>>> .*?(?=\n[ \t]*\n|\Z)", re.DOTALL | re.MULTILINE)
_ERRATA = re.compile(r"\(errata [^)]*\)")
_ROW = re.compile(r"\b([PC]\d+)\b")


class Docstrings(Extension):
    """Fences the examples of a docstring as code, and links the rows of the errata it names.

    Of a setting's default, help and so on (`_option` in `trdlab.deep.settings`) only the default is
    left: signatures are shown with it.
    """

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Changes the docstring of a module, class, function or attribute."""
        if obj.docstring:
            obj.docstring.value = prepared(obj.docstring.value)
        for parameter in obj.parameters if isinstance(obj, Function) else ():
            default = parameter.default
            if isinstance(default, ExprCall) and str(default.function) == "_option":
                parameter.default = default.arguments[0]


def prepared(docstring: str) -> str:
    """Returns a docstring in the Markdown that the pages need.

    >>> prepared("Counts from 0 (errata P8).")
    'Counts from 0 (errata [P8](../errata.md#p8)).'
    """
    fenced = _EXAMPLE.sub(lambda example: f"```pycon\n{example[0]}\n```", docstring)
    return _ERRATA.sub(lambda found: _ROW.sub(_link, found[0]), fenced)


def _link(row: re.Match[str]) -> str:
    return f"[{row[0]}](../errata.md#{row[0].lower()})"
