"""Weights come back from every kind of file that holds them, and code is never executed."""

import io
import os
import pickle
import tarfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from trdlab.errors import InputError
from trdlab.policies.weights import read_weights

WEIGHTS = {"head.weight": torch.arange(6.0).reshape(2, 3), "steps": torch.tensor(7)}


class Mark:
    """Pickled code: whoever executes the file leaves a mark."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return os.system, (f"touch '{self.path}'",)


def is_whole(weights: dict[str, np.ndarray]) -> bool:
    return (
        sorted(weights) == ["head.weight", "steps"]
        and weights["head.weight"].tolist() == [[0, 1, 2], [3, 4, 5]]
        and weights["head.weight"].dtype == np.float32
        and weights["steps"] == 7
    )


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16, torch.float32, torch.float64])
def test_safetensors_and_state_dicts_in_any_precision(tmp_path, dtype):
    held = {**WEIGHTS, "head.weight": WEIGHTS["head.weight"].to(dtype)}
    save_file(held, tmp_path / "a.safetensors")
    torch.save(held, tmp_path / "a.pt")
    torch.save(held, tmp_path / "a.pth", _use_new_zipfile_serialization=False)
    for name in ("a.safetensors", "a.pt", "a.pth"):
        assert is_whole(read_weights(tmp_path / name))


@pytest.mark.parametrize("key", ["state_dict", "model_state_dict", "q_network", "model"])
def test_a_state_dict_beside_other_things(tmp_path, key):
    torch.save({"epoch": 3, key: WEIGHTS, "args": {"lr": 0.1}}, tmp_path / "a.pt")
    assert is_whole(read_weights(tmp_path / "a.pt"))


def write_torch(path: Path, held: Any) -> None:
    torch.save({"head.weight": torch.zeros(2), "x": held}, path)


def write_old_torch(path: Path, held: Any) -> None:
    torch.save(held, path, _use_new_zipfile_serialization=False)


def write_pickle(path: Path, held: Any) -> None:
    path.write_bytes(pickle.dumps(held))


def write_plain_pickle(path: Path, held: Any) -> None:
    path.write_bytes(pickle.dumps(held, protocol=2))


def write_tar(path: Path, held: Any) -> None:
    """The format of PyTorch before 0.4, which some versions unpickled without looking."""
    with tarfile.open(path, "w") as archive:
        for name in ("storages", "tensors", "pickle"):
            data = pickle.dumps(0, protocol=2) + pickle.dumps(held, protocol=2)
            entry = tarfile.TarInfo(name)
            entry.size = len(data)
            archive.addfile(entry, io.BytesIO(data))


WRITERS = [write_torch, write_old_torch, write_pickle, write_plain_pickle, write_tar]


@pytest.mark.parametrize("suffix", [".pt", ".safetensors"])
@pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)
def test_code_is_refused_and_not_executed(tmp_path, write, suffix):
    path, mark = tmp_path / f"weights{suffix}", tmp_path / "mark"
    write(path, Mark(mark))
    with pytest.raises(InputError) as refusal:
        read_weights(path)
    assert not mark.exists()
    assert str(refusal.value).startswith(f"'{path}' ")
    assert "\n" not in str(refusal.value)
    assert "weights_only" not in str(refusal.value)  # PyTorch's advice is to execute it
    if suffix == ".pt" and write is write_torch:
        assert "holds code (posix.system)" in str(refusal.value)
        assert "Nothing was executed." in str(refusal.value)


def test_the_files_with_code_are_dangerous(tmp_path):
    write_torch(tmp_path / "a.pt", Mark(tmp_path / "mark"))
    torch.load(tmp_path / "a.pt", weights_only=False)
    assert (tmp_path / "mark").exists()


def test_a_torn_file_is_refused_wherever_it_ends(tmp_path):
    save_file(WEIGHTS, tmp_path / "a.safetensors")
    torch.save(WEIGHTS, tmp_path / "a.pt")
    for name in ("a.safetensors", "a.pt"):
        whole = (tmp_path / name).read_bytes()
        for length in (0, 1, 8, 50, len(whole) // 2, len(whole) - 1):
            (tmp_path / name).write_bytes(whole[:length])
            with pytest.raises(InputError, match=r"is torn, or holds no weights|is no file of"):
                read_weights(tmp_path / name)


def test_what_holds_no_weights_is_refused(tmp_path):
    for number, held in enumerate([{}, [], 3, {"a": 1}, {"state_dict": 1}, torch.zeros(2)]):
        torch.save(held, tmp_path / f"{number}.pt")
        with pytest.raises(InputError, match=r"holds no weights by name\. Give a state dict"):
            read_weights(tmp_path / f"{number}.pt")
    with pytest.raises(InputError, match=r"none\.pt' cannot be read: No such file"):
        read_weights(tmp_path / "none.pt")
    with pytest.raises(InputError, match=r"cannot be read: "):
        read_weights(tmp_path)
