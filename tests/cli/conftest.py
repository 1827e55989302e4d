"""What the tests of several commands share."""

import json
from collections.abc import Callable
from pathlib import Path

import jsonschema
import pytest

from trdlab.cli import common, main

SCHEMA = json.loads(
    (Path(__file__).parents[2] / "docs" / "reference" / "trdlab.schema.json").read_text("utf-8")
)
KINDS = {
    of["properties"]["schema"]["const"]: name
    for name, of in SCHEMA["$defs"].items()
    if "schema" in of.get("properties", {})
}

Outcome = tuple[int, str, str]
Trdlab = Callable[..., Outcome]


@pytest.fixture
def trdlab(capsys, monkeypatch, tmp_path) -> Trdlab:
    """Returns a function that runs `trdlab` in an empty folder: exit code, stdout, stderr."""
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.chdir(tmp_path)

    def run(*words: object) -> Outcome:
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main([*map(str, words)])
        out, err = capsys.readouterr()
        return int(end.value.code or 0), out, err

    return run


@pytest.fixture(scope="session")
def trained(tmp_path_factory) -> Path:
    """Returns a run with two checkpoints; not to be changed."""
    from small_runs import train  # with PyTorch, which most of these tests do without

    return train(
        tmp_path_factory.mktemp("runs") / "drone",
        "trdlab/DroneGridworld-v0",
        agent_steps=1000,
        checkpoint_every=500,
        gamma=0.9,
        N=6,
        hidden=[16],
        clip_rewards=True,
        env_arg=["slip=0.2"],
    )


@pytest.fixture(autouse=True)
def every_json_is_as_the_schema_says(monkeypatch) -> None:
    """Holds each JSON that a test prints against the schema in the documentation."""
    print_json = common.print_json

    def checked(data: object) -> None:
        kind = KINDS[data["schema"]] if isinstance(data, dict) else "maps"
        schema = {"$defs": SCHEMA["$defs"], "$ref": f"#/$defs/{kind}"}
        jsonschema.validate(json.loads(json.dumps(data)), schema)
        print_json(data)

    monkeypatch.setattr(common, "print_json", checked)
