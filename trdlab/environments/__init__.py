"""Environments as an agent acts in them: B at a time, ends told exactly, restorable to the bit."""

from typing import TYPE_CHECKING

from trdlab.environments.protocol import CopyableEnvironments as CopyableEnvironments
from trdlab.environments.protocol import Environments as Environments
from trdlab.environments.protocol import NotCopyable as NotCopyable
from trdlab.environments.protocol import NotParallel as NotParallel
from trdlab.environments.protocol import NotReproducible as NotReproducible
from trdlab.environments.protocol import Padding as Padding
from trdlab.environments.protocol import Step as Step
from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.environments.batches import in_batches as in_batches
    from trdlab.environments.gym import GymEnvironments as GymEnvironments
    from trdlab.environments.making import make_environment as make_environment
else:
    __getattr__ = lazily(__name__)
