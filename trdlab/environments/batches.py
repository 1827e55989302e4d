"""Episodes beside each other, or one after another where no second environment can be made."""

from collections.abc import Callable, Iterator
from contextlib import closing

import numpy as np

from trdlab.environments.protocol import Environments, NotParallel

Make = Callable[[int, int], Environments]
"""From the number of environments and their seed to the environments."""


def in_batches(make: Make, count: int, seed: int) -> Iterator[Environments]:
    """Yields environments for some episodes: all at once, or else one after another.

    Where all can be there at once, they are yielded together, made with the seed. Where that raises
    `NotParallel`, there are as many batches of one, each with a seed of its own. A batch is closed
    when the next is asked for, or when the caller leaves the loop for good.

    Args:
        make: makes them.
        count: how many episodes are to be played, one in each environment.
        seed: of all.

    Raises:
        InputError: none can be made.

    >>> from trdlab.environments import GymEnvironments
    >>> make = lambda count, seed: GymEnvironments("CartPole-v1", count, seed=seed)
    >>> [environments.num_envs for environments in in_batches(make, 3, seed=0)]
    [3]
    """
    try:
        together = make(count, seed)
    except NotParallel:
        for own in (np.random.SeedSequence(seed).generate_state(count) >> 1).tolist():
            with closing(make(1, own)) as alone:
                yield alone
        return
    with closing(together):
        yield together
