"""The playground: gridworlds to edit in a browser, solved and explained there.

It is written as ES modules, a style sheet and a layout beside this file. Browsers refuse modules in
files of their own on pages that are opened from disk, so `script` puts them all into one.
"""

import json
import re
from base64 import b64encode
from hashlib import sha256
from pathlib import Path

from trdlab.gridworld import icons, map_names
from trdlab.gridworld.gridmap import MAX_WIND, map_text

MODULES = ("world", "solver", "flips", "numbers", "words", "address", "pictures", "playground")
"""In the order of their imports."""

_HERE = Path(__file__).parent
_IMPORT = re.compile(r"^import [^;]*;\n", re.MULTILINE)
_EXPORT = re.compile(r"^export ", re.MULTILINE)
_DRAWINGS = {
    "wall": [*icons.wall(), *icons.bricks()],
    "frame": icons.terminal_frame(),
    "start": icons.start_pad(),
    "one-way": icons.one_way(),
    "coin": icons.coin(),
    "coin-taken": icons.coin_taken(),
    "treasure": icons.chest(),
    "treasure-taken": icons.chest_taken(),
    "hazard": icons.hazard(),
    "fountain": icons.fountain(),
    "exit": icons.exit_flag(),
    "drone": icons.drone(),
    **{f"wind-{strength}": icons.wind(strength) for strength in range(1, MAX_WIND + 1)},
}


def script() -> str:
    """Returns the playground as one script, which defines the element `<trdlab-playground>`.

    It runs as a module and as a classic script, inline or from a file, and needs nothing else:
    the maps that come with trdlab, the drawings and the style are in it.
    """
    held = {
        "MAPS": {name: map_text(name) for name in map_names()},
        "ICONS": {name: [_drawn(shape) for shape in shapes] for name, shapes in _DRAWINGS.items()},
        "LAYOUT": _read("layout.html"),
        "STYLE": _read("style.css"),
    }
    data = [
        f"const {name} = {json.dumps(of, separators=(',', ':'))};\n" for name, of in held.items()
    ]
    modules = [_EXPORT.sub("", _IMPORT.sub("", _read(f"{name}.js"))) for name in MODULES]
    return "\n".join(['"use strict";', "{", *data, *modules, "}", ""])


def page() -> str:
    """Returns the page that `trdlab playground` shows: one file that needs nothing else."""
    code, style = script().replace("</", "<\\/"), _read("page.css")
    hashes = {"{script_hash}": _hash(code), "{style_hash}": _hash(style)}
    made = _read("page.html")
    for slot, text in {**hashes, "{style}": style, "{script}": code}.items():
        made = made.replace(slot, text)
    return made


def _drawn(shape: icons.Shape) -> tuple[str, str]:
    """Returns the outline of a shape as the path of an SVG, and its colour; y grows downwards."""
    corners = (f"{x:.3f} {-y:.3f}" for x, y in shape.outline.tolist())
    colour = "var(--floor)" if shape.colour == icons.FLOOR else shape.colour  # dark pages dim it
    return f"M{'L'.join(corners)}Z", colour


def _read(name: str) -> str:
    return (_HERE / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"
