"""Files as flax writes them (`flax.serialization.to_bytes`), without flax."""

from typing import Any

import msgpack
import numpy as np


def packed(value: Any) -> bytes:
    """Returns a value in msgpack, an array as flax's extension for it."""

    def extension(array: np.ndarray) -> msgpack.ExtType:
        content = msgpack.packb((array.shape, array.dtype.name, array.tobytes()))
        return msgpack.ExtType(1, content)

    return bytes(msgpack.packb(value, default=extension))


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
