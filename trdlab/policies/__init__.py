"""Policies: who acts, with memory where there is some, and who else's agents can be read."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.policies.protocol import Policy as Policy
    from trdlab.policies.protocol import ask as ask
    from trdlab.policies.protocol import rows as rows
    from trdlab.policies.ready import EpsilonGreedy as EpsilonGreedy
    from trdlab.policies.ready import Greedy as Greedy
    from trdlab.policies.ready import Likeliest as Likeliest
    from trdlab.policies.ready import Memoryless as Memoryless
    from trdlab.policies.ready import Who as Who
    from trdlab.policies.ready import acting as acting
    from trdlab.policies.ready import greedy as greedy
else:
    __getattr__ = lazily(__name__)
