"""trdlab: when does an agent expect which reward, and how far can that be trusted?

The verbs: `solve` a model, `train` a network, or name an `agent`; then `calibrate`, `explain`,
`report` and `compare` it. The nouns: `Agent`, `Estimator`, `Future`, `RewardDecomposition`,
`TimeAxis`.
"""

import os
import sys
from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.agents.agent import Agent
    from trdlab.decomposition import RewardDecomposition
    from trdlab.estimator import Estimator, Future
    from trdlab.policies.protocol import Policy
    from trdlab.time_axis import TimeAxis
    from trdlab.training.loading import load
    from trdlab.verbs.asking import calibrate, compare, explain
    from trdlab.verbs.fitting import fit
    from trdlab.verbs.making import agent, solve, train
    from trdlab.verbs.reporting import report

__version__ = "0.1.0"
__all__ = [
    "Agent",
    "Estimator",
    "Future",
    "Policy",
    "RewardDecomposition",
    "TimeAxis",
    "__version__",
    "agent",
    "calibrate",
    "compare",
    "explain",
    "fit",
    "load",
    "report",
    "solve",
    "train",
]

__getattr__ = lazily(__name__)

# A command started from a notebook inherits the notebook's backend, which may not be installed
# here, and then matplotlib could not even be imported.
if os.environ.get("MPLBACKEND", "").startswith("module://"):
    from importlib.util import find_spec

    if find_spec(os.environ["MPLBACKEND"].removeprefix("module://").partition(".")[0]) is None:
        del os.environ["MPLBACKEND"]

# Whoever has imported Gymnasium will want to `make` our maps; nobody else should pay for it.
if "gymnasium" in sys.modules:
    from importlib import import_module

    import_module("trdlab.envs")
