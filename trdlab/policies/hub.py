"""Agents on the Hugging Face hub: `hf:OWNER/REPO`, downloaded once."""

import re
from pathlib import Path

from trdlab.errors import InputError, closest

HUB = "hf:"
"""What the names of those agents begin with."""

_NAME = re.compile(r"hf:([\w.-]+/[\w.-]+)(?:@([\w.-]+))?(?:/(.+))?")
_KINDS = ("*.cleanrl_model", "*.zip", "*.pt", "*.pth", "*.safetensors")


def from_hub(name: str) -> Path:
    """Returns the file of an agent on the Hugging Face hub; it is downloaded if it is not here yet.

    Nothing of it is executed: it is read like any other file.

    Args:
        name: `hf:OWNER/REPO`, `hf:OWNER/REPO@REVISION`, and where a repository has several files of
            agents `/FILE` after that.

    Raises:
        InputError: huggingface_hub is not installed, there is no network, no such repository or
            revision, or not just one file.
    """
    try:
        from huggingface_hub import snapshot_download
        from huggingface_hub.errors import HfHubHTTPError
    except ImportError as error:
        raise InputError(
            f"'{name}' is on the Hugging Face hub, and huggingface_hub is not installed.",
            "Run: pip install 'trdlab[hub]'",
        ) from error
    found = _NAME.fullmatch(name)
    if found is None:
        raise InputError(f"The name is '{name}'.", "Write it as hf:OWNER/REPO or …@REVISION.")
    repository, revision, wanted = found.groups()
    try:
        folder = Path(snapshot_download(repository, revision=revision, allow_patterns=list(_KINDS)))
    except (OSError, ValueError, HfHubHTTPError) as error:
        reason = str(error).strip().partition("\n")[0]
        raise InputError(
            f"'{name}' cannot be downloaded: {reason.rstrip('.')}.",
            "Is there a network, and is that its name? A file that is here needs none.",
        ) from error
    files = sorted(str(path.relative_to(folder)) for kind in _KINDS for path in folder.rglob(kind))
    if wanted is None and len(files) == 1:
        return folder / files[0]
    if wanted in files:
        return folder / wanted
    if wanted is not None and files:
        raise InputError(f"'{repository}' has no file '{wanted}'.", closest(wanted, files))
    several = ", ".join(files) or "none"
    raise InputError(
        f"'{repository}' has these files of agents: {several}.",
        f"Name one: {HUB}{repository}/{files[0]}" if files else "Choose another repository.",
    )
