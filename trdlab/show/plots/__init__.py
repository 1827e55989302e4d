"""Pictures: axes in, axes out; `figure` of any noun, and one style, which also saves them."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.show.plots.figures import figure as figure
    from trdlab.show.plots.style import save as save
else:
    __getattr__ = lazily(__name__, {"figures": "figure", "style": "save"})
