"""Prepares docstrings, and the signatures above them, for the reference pages."""

import re
from typing import Any

from griffe import (
    Class,
    ExprCall,
    Extension,
    Function,
    Object,
    Parameter,
    ParameterKind,
    Parameters,
)

_EXAMPLE = re.compile(r"^>>> .*?(?=\n[ \t]*\n|\Z)", re.DOTALL | re.MULTILINE)
_ERRATA = re.compile(r"\(errata [^)]*\)")
_ROW = re.compile(r"\b([PC]\d+)\b")


class Docstrings(Extension):
    """Prepares what docstrings and signatures say.

    Examples are fenced as code, and the rows of the errata are linked. A named tuple gets the
    signature that it is made with, as data classes do. Of a setting's default, help and so on
    (`_option` in `trdlab.deep.settings`) only the default is left: signatures are shown with it.
    """

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Changes the docstring of a module, class, function or attribute."""
        if obj.docstring:
            obj.docstring.value = prepared(obj.docstring.value)
        for parameter in obj.parameters if isinstance(obj, Function) else ():
            default = parameter.default
            if isinstance(default, ExprCall) and str(default.function) == "_option":
                parameter.default = default.arguments[0]

    def on_class_members(self, *, cls: Class, **_: Any) -> None:
        """Gives a named tuple its signature."""
        if "NamedTuple" in map(str, cls.bases) and "__init__" not in cls.members:
            fields = [one for one in cls.attributes.values() if one.annotation is not None]
            kind = ParameterKind.positional_or_keyword
            parameters = [
                Parameter(one.name, annotation=one.annotation, kind=kind, default=one.value)
                for one in fields
            ]
            itself = Parameter("self", kind=kind)
            init = Function("__init__", parameters=Parameters(itself, *parameters), returns="None")
            cls.set_member("__init__", init)


def prepared(docstring: str) -> str:
    """Returns a docstring in the Markdown that the pages need.

    >>> prepared("Counts from 0 (errata P8).")
    'Counts from 0 (errata [P8][p8]).'
    """
    fenced = _EXAMPLE.sub(lambda example: f"```pycon\n{example[0]}\n```", docstring)
    return _ERRATA.sub(lambda found: _ROW.sub(_link, found[0]), fenced)


def _link(row: re.Match[str]) -> str:
    return f"[{row[0]}][{row[0].lower()}]"  # a heading of errata.md, from any page
