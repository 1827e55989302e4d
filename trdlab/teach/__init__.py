"""Teaching: exercises that check themselves, with a worked solution for each."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.teach.checking import check, solution

__all__ = ["check", "solution"]

__getattr__ = lazily(__name__)
