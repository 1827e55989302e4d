"""Renderings of explanations: text for a terminal, plain data, and pictures (in `plots`)."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.show.explained import check_explained, summary

__all__ = [
    "check_explained",
    "summary",
]

_HOMES = {
    "check_explained": "explained",
    "summary": "explained",
}

__getattr__ = lazily(__name__, _HOMES)
