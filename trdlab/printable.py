"""What prints as people read it: as text where text is shown, as a page in a notebook."""

from importlib import import_module
from typing import Any


class Printable:
    """A noun that is rendered by `trdlab.show`: printed, shown in a notebook, drawn, made data of.

    The renderings are found by name when they are first asked for: they know the nouns, and the
    nouns know nothing of them.
    """

    def __repr__(self) -> str:
        heading = import_module("trdlab.show.document").document(self).heading
        return f"<{type(self).__name__}: {heading}>"

    def __str__(self) -> str:
        return str(import_module("trdlab.show.text").text(self).plain)

    def _repr_html_(self) -> str:
        return str(import_module("trdlab.show.html").html(self))

    def details(self) -> str:
        """Returns all there is to tell, as text; printing tells what matters most."""
        return str(import_module("trdlab.show.text").text(self, details=True).plain)

    def to_dict(self) -> dict[str, Any]:
        """Returns everything as plain data at full precision, as `--json` prints it."""
        data: dict[str, Any] = import_module("trdlab.show.data").data(self)
        return data

    def plot(self) -> Any:
        """Returns the picture: a matplotlib `Figure`, which notebooks show."""
        return import_module("trdlab.show.plots.figures").figure(self)
