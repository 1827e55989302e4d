"""The playground: gridworlds to edit in a browser, solved and explained there.

It is written as ES modules and a style sheet beside this file. Browsers refuse modules in files of
their own on pages that are opened from disk, so `script` puts them together as one.
"""

from trdlab.gridworld.gridmap import _FOLDER, map_names


def maps() -> dict[str, str]:
    return {name: (_FOLDER / f"{name}.txt").read_text(encoding="utf-8") for name in map_names()}
