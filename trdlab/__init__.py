"""trdlab: when does an agent expect which reward, and how far can that be trusted?"""

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from trdlab.decomposition import RewardDecomposition
    from trdlab.estimator import Estimator, Future
    from trdlab.time_axis import TimeAxis
    from trdlab.training.loading import load

__version__ = "0.1.0"
__all__ = ["Estimator", "Future", "RewardDecomposition", "TimeAxis", "__version__", "load"]

_HOMES = {
    "RewardDecomposition": "trdlab.decomposition",
    "TimeAxis": "trdlab.time_axis",
    "Estimator": "trdlab.estimator",
    "Future": "trdlab.estimator",
    "load": "trdlab.training.loading",
}


def __getattr__(name: str) -> object:
    """Imports what is here when it is first asked for, so that `import trdlab` costs nothing."""
    if name not in _HOMES:
        raise AttributeError(f"module 'trdlab' has no attribute '{name}'")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)


# Whoever has imported Gymnasium will want to `make` our maps; nobody else should pay for it.
if "gymnasium" in sys.modules:
    from importlib import import_module

    import_module("trdlab.envs")
