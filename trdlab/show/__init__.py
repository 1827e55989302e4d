"""Renderings of explanations: sentences that can be checked, text for a terminal, and pictures.

Pictures live in `trdlab.show.plots`, `trdlab.show.trust` and `trdlab.show.explained_plots`, which
import matplotlib. What is said of agents that play is imported when it is first asked for.
"""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily
from trdlab.show.sentences import UnsupportedSentenceError, check, sentence, sentences

if TYPE_CHECKING:
    from trdlab.show.explained import check_explained, summary
    from trdlab.show.trust_data import trust_to_dict
    from trdlab.show.verdicts import check_trust, trust_sentences

__all__ = [
    "UnsupportedSentenceError",
    "check",
    "check_explained",
    "check_trust",
    "sentence",
    "sentences",
    "summary",
    "trust_sentences",
    "trust_to_dict",
]

_HOMES = {
    "check_explained": "explained",
    "summary": "explained",
    "trust_to_dict": "trust_data",
    "check_trust": "verdicts",
    "trust_sentences": "verdicts",
}

__getattr__ = lazily(__name__, _HOMES)
