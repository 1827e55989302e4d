"""Renderings of explanations: sentences that can be checked, text for a terminal, and pictures.

Pictures live in `trdlab.show.plots`, which imports matplotlib.
"""

from trdlab.show.sentences import UnsupportedSentenceError, check, sentence, sentences

__all__ = ["UnsupportedSentenceError", "check", "sentence", "sentences"]
