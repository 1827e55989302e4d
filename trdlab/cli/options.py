"""The options of a training run, made from the fields of its settings: said once, there."""

import inspect
from collections.abc import Callable
from dataclasses import fields
from typing import Annotated, Any

import typer

from trdlab.deep.presets import preset, with_teacher
from trdlab.deep.settings import Kind, TrainSettings

_POSITIONAL = ("kind", "env")


def with_settings(kind: Kind) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Gives a command an option for each setting; those that are used arrive in `given`, by key.

    Args:
        kind: whose default preset the help shows.
    """
    usual = preset(kind, "")
    taught = with_teacher(kind, usual)
    shown = {key: of.default for key, of in _keys().items()} | usual.to_config()
    shown |= {key: taught[key] for key in ("teacher_steps", "offline_updates")}

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        own = [
            parameter
            for parameter in inspect.signature(command, eval_str=True).parameters.values()
            if parameter.name != "given"
        ]
        options = {key: _option(key, shown[key]) for key in _keys()}
        signature = inspect.Signature([*own, *options.values()])

        def run(**values: Any) -> Any:
            given = {
                key: value for key in options if (value := _given(key, values.pop(key))) is not None
            }
            return command(**values, given=given)

        run.__name__, run.__doc__ = command.__name__, command.__doc__
        run.__signature__ = signature  # type: ignore[attr-defined]
        run.__annotations__ = {name: p.annotation for name, p in signature.parameters.items()}
        return run

    return decorate


def flag(key: str) -> str:
    """Returns how a key of the configuration is written on the command line.

    >>> flag("agent_steps"), flag("N")
    ('--agent-steps', '--N')
    """
    return "--" + key.replace("_", "-")


def _keys() -> dict[str, Any]:
    return {
        of.metadata.get("key") or of.name: of
        for of in fields(TrainSettings)
        if of.name not in _POSITIONAL
    }


def _option(key: str, default: Any) -> inspect.Parameter:
    of = _keys()[key]
    kind: Any = of.metadata["kind"]
    names = flag(key)
    if kind is bool:
        names = f"{names}/--no-{names.removeprefix('--')}"
    elif key == "env_arg":  # given once for each
        kind, default = list[str], None
    elif isinstance(of.default, tuple):
        kind, default = str, ",".join(map(str, default or ())) or None
    about = typer.Option(
        names,
        metavar=of.metadata["metavar"],
        help=of.metadata["help"],
        rich_help_panel=of.metadata["panel"],
        show_default=str(default) if default is not None else False,
    )
    return inspect.Parameter(
        key, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Annotated[kind | None, about]
    )


def _given(key: str, value: Any) -> Any:
    """Returns an option's value as the configuration writes it; None where it was not used."""
    of = _keys()[key]
    if value is None or key == "env_arg" or not isinstance(of.default, tuple):
        return value
    words = [word.strip() for word in value.split(",") if word.strip()]
    try:
        return [of.metadata["kind"](word) for word in words]
    except ValueError as error:
        raise typer.BadParameter(
            f"{flag(key)} is '{value}': give sizes, such as 128,128"
        ) from error
