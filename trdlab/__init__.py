"""trdlab: when does an agent expect which reward, and how far can that be trusted?"""

import sys

__version__ = "0.1.0"

# Whoever has imported Gymnasium will want to `make` our maps; nobody else should pay for it.
if "gymnasium" in sys.modules:
    from importlib import import_module

    import_module("trdlab.envs")
