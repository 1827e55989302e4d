"""Renderings of explanations: text for a terminal, plain data, and pictures (in `plots`)."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.show.explained import check_explained, summary
    from trdlab.show.trust_data import trust_to_dict

__all__ = [
    "check_explained",
    "summary",
    "trust_to_dict",
]

_HOMES = {
    "check_explained": "explained",
    "summary": "explained",
    "trust_to_dict": "trust_data",
}

__getattr__ = lazily(__name__, _HOMES)
