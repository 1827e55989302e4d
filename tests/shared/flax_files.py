"""Files as flax writes them (`flax.serialization.to_bytes`), without flax or msgpack."""

import struct
from typing import Any

import numpy as np


def packed(value: Any) -> bytes:
    """Returns a value in msgpack, an array as flax's extension for it."""
    if isinstance(value, dict):
        parts = [packed(name) + packed(part) for name, part in value.items()]
        return _headed(len(parts), 0x80, 16, {2: 0xDE, 4: 0xDF}) + b"".join(parts)
    if isinstance(value, list | tuple):
        return _headed(len(value), 0x90, 16, {2: 0xDC, 4: 0xDD}) + b"".join(map(packed, value))
    if isinstance(value, str):
        text = value.encode()
        return _headed(len(text), 0xA0, 32, {1: 0xD9, 2: 0xDA, 4: 0xDB}) + text
    if isinstance(value, bytes):
        return _headed(len(value), 0, 0, {1: 0xC4, 2: 0xC5, 4: 0xC6}) + value
    if isinstance(value, np.ndarray):
        content = packed((value.shape, value.dtype.name, value.tobytes()))
        return _headed(len(content), 0, 0, {1: 0xC7, 2: 0xC8, 4: 0xC9}) + b"\x01" + content
    return _headed(value, 0, 128, {1: 0xCC, 2: 0xCD, 4: 0xCE, 8: 0xCF})


def _headed(count: int, first: int, below: int, kinds: dict[int, int]) -> bytes:
    if count < below:
        return bytes([first + count])
    size = next(size for size in kinds if count < 256**size)
    return bytes([kinds[size]]) + struct.pack(f">{'_BH_I___Q'[size]}", count)


def q_network(outputs: int, seed: int = 0, side: int = 7) -> dict[str, Any]:
    """Returns the parameters of CleanRL's network in JAX; large enough to have opinions."""
    rng = np.random.default_rng(seed)
    shapes = {
        "Conv_0": (8, 8, 4, 32),
        "Conv_1": (4, 4, 32, 64),
        "Conv_2": (3, 3, 64, 64),
        "Dense_0": (side * side * 64, 16),
        "Dense_1": (16, outputs),
    }

    def drawn(*shape: int) -> np.ndarray:
        scale = 2.0 / np.sqrt(np.prod(shape[:-1]) or 1)
        return rng.normal(size=shape, scale=scale).astype(np.float32)

    layers = {
        name: {"bias": drawn(shape[-1]), "kernel": drawn(*shape)} for name, shape in shapes.items()
    }
    return {"params": layers}


def said(params: dict[str, Any], stacks: np.ndarray) -> np.ndarray:
    """Returns what that network says of stacks `[B, 4, 84, 84]`, by its definition, in numpy."""
    layers, x = params["params"], stacks.transpose(0, 2, 3, 1) / 255.0
    for name, stride in (("Conv_0", 4), ("Conv_1", 2), ("Conv_2", 1)):
        kernel = layers[name]["kernel"]
        side = kernel.shape[0]
        views = np.lib.stride_tricks.sliding_window_view(x, (side, side), axis=(1, 2))
        views = views[:, ::stride, ::stride]  # [B, H, W, C, side, side]
        x = np.einsum("bhwcij,ijco->bhwo", views, kernel, optimize=True) + layers[name]["bias"]
        x = np.maximum(x, 0.0)
    x = x.reshape(len(x), -1) @ layers["Dense_0"]["kernel"] + layers["Dense_0"]["bias"]
    return np.maximum(x, 0.0) @ layers["Dense_1"]["kernel"] + layers["Dense_1"]["bias"]
