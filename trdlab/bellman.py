"""The law: how the components of a state follow from those of the next one."""

from typing import Any

import numpy as np
from array_api_compat import array_namespace

from trdlab.errors import InputError

Array = Any  # numpy or torch: the law is the same


def target(reward: Array, discount: Array, next_components: Array) -> Array:
    """Returns the target components: the reward in front, the last two entries folded into one.

    With r the discounted reward of the next w steps, d = γ^w·(1 − terminated) and n the next
    components, the target is `[r, d·n₀, …, d·n_(N−2), d·(n_(N−1) + n_N)]`. For N = 1 it is
    `[r, d·(n₀ + n₁)]`, and for N = 0 it is `[r + d·n₀]`, the target of Q-learning.
    Its sum is always r + d·Σn.

    Args:
        reward: `[...]`, the discounted reward of the next w steps.
        discount: `[...]`, γ^w where the episode goes on, 0 where it terminated.
        next_components: `[..., N+1]`, those of the action that maximises their sum, or their
            expectation under the policy that is evaluated.

    Returns:
        `[..., N+1]`, of the kind (numpy, torch) of `next_components`.

    Raises:
        InputError: `next_components` has no component axis or holds no floating-point numbers,
            or the shapes do not fit.

    Source: the paper's Eq. trd-loss, corrected (errata P1, P2, P4).

    >>> import numpy as np
    >>> target(np.float64(1.0), np.float64(0.5), np.array([2.0, 4.0, 6.0]))
    array([1., 1., 5.])
    """
    is_numpy = isinstance(next_components, np.ndarray)  # its own namespace is there already
    xp = np if is_numpy else array_namespace(next_components)
    if next_components.ndim == 0 or next_components.shape[-1] == 0:
        raise InputError(
            f"next_components has shape {tuple(next_components.shape)}: it has no component.",
            "Give an array of shape [..., N+1].",
        )
    if not xp.isdtype(next_components.dtype, "real floating"):  # r and d would be cut to integers
        raise InputError(
            f"next_components has type {next_components.dtype}.", "Give floating-point numbers."
        )
    options = {"dtype": next_components.dtype, "device": getattr(next_components, "device", None)}
    reward, discount = xp.asarray(reward, **options), xp.asarray(discount, **options)
    batch = next_components.shape[:-1]
    for name, array in (("reward", reward), ("discount", discount)):
        if array.shape not in ((), batch):
            raise InputError(
                f"{name} has shape {tuple(array.shape)}, next_components has the batch shape "
                f"{tuple(batch)}.",
                f"Give one {name} for each vector of components, or a scalar.",
            )
    front = xp.broadcast_to(reward[..., None], (*batch, 1))  # [..., 1]
    shifted = xp.concat([front, discount[..., None] * next_components], axis=-1)  # [..., N+2]
    folded = shifted[..., -2:-1] + shifted[..., -1:]  # [..., 1]
    return xp.concat([shifted[..., :-2], folded], axis=-1)  # [..., N+1]
