"""Agents on the Hugging Face hub, by a stand-in for the library: nothing here uses a network."""

import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

import trdlab
from archives import cartpole_dqn
from trdlab.errors import InputError
from trdlab.policies.hub import from_hub


class HfHubHTTPError(Exception):
    pass


@pytest.fixture
def hub(monkeypatch, tmp_path) -> Callable[..., Path]:
    """Puts files into a repository, and returns its folder; what was asked for is in `asked`."""
    folder = tmp_path / "downloaded"
    folder.mkdir()

    def snapshot_download(repository, *, revision, allow_patterns):
        if repository != "some/one":
            raise HfHubHTTPError("401 Client Error.\nRepository Not Found")
        if revision not in (None, "v2"):
            raise ConnectionError("[Errno -2] Name or service not known")
        return str(folder)

    library, errors = ModuleType("huggingface_hub"), ModuleType("huggingface_hub.errors")
    library.snapshot_download = snapshot_download
    errors.HfHubHTTPError = HfHubHTTPError
    monkeypatch.setitem(sys.modules, "huggingface_hub", library)
    monkeypatch.setitem(sys.modules, "huggingface_hub.errors", errors)
    return folder


def test_an_agent_is_read_like_any_other_file(hub):
    cartpole_dqn(hub / "model.zip")
    (hub / "README.md").write_text("# A model")
    for name in ("hf:some/one", "hf:some/one@v2", "hf:some/one/model.zip"):
        assert from_hub(name) == hub / "model.zip"
    agent = trdlab.agent("hf:some/one@v2,activation=tanh", env="CartPole-v1")
    assert agent.name == "model"
    assert agent.origin is not None
    assert agent.origin.words[0] == "hf:some/one@v2,activation=tanh"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("hf:some/one", r"files of agents: a\.zip, b/c\.pt\. Name one: hf:some/one/a\.zip"),
        ("hf:some/one/a.zap", r"has no file 'a\.zap'\. Did you mean 'a\.zip'\?"),
        ("hf:some", r"The name is 'hf:some'\. Write it as hf:OWNER/REPO"),
        ("hf:an/other", r"cannot be downloaded: 401 Client Error\. Is there a network"),
        ("hf:some/one@v3", r"cannot be downloaded: \[Errno -2\] Name or .* needs none\."),
    ],
)
def test_what_cannot_be_had_is_told(hub, name, said):
    for path in ("a.zip", "b/c.pt"):
        (hub / path).parent.mkdir(exist_ok=True)
        (hub / path).write_bytes(b"")
    with pytest.raises(InputError, match=said):
        trdlab.agent(name, env="CartPole-v1")


def test_without_the_library_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "huggingface_hub", None)
    with pytest.raises(InputError, match=r"Run: pip install 'trdlab\[hub\]'"):
        trdlab.agent("hf:some/one", env="CartPole-v1")
