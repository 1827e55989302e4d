"""How much disk trdlab takes with all that it needs, and without the two heavy packages.

Counts the files that pip has noted of each package of this environment, in megabytes.
"""

import re
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

HEAVY = {"torch", "ale-py"}


def needed(name: str, leave_out: set[str]) -> set[str]:
    """Returns a package and all that it needs, without extras, as far as it is installed."""
    found, open_ones = set(), [name]
    while open_ones:
        name = open_ones.pop().lower()
        if name in found | leave_out:
            continue
        try:
            requires = distribution(name).requires or []
        except PackageNotFoundError:  # of another system, or another Python
            continue
        found.add(name)
        open_ones += [re.split(r"[^\w.-]", line)[0] for line in requires if "extra ==" not in line]
    return found


def megabytes(name: str) -> float:
    """Returns how large the files of a package are that lie on the disk."""
    paths = [Path(str(file.locate())) for file in distribution(name).files or []]
    return sum(path.stat().st_size for path in paths if path.is_file()) / 1e6


def main() -> None:
    plain = {name: megabytes(name) for name in needed("trdlab", set())}
    light = {name: plain[name] for name in needed("trdlab", HEAVY)}
    for kind, sizes in (("all that it needs", plain), ("without torch and ale-py", light)):
        print(f"{kind}: {sum(sizes.values()):,.0f} MB in {len(sizes)} packages")
        largest = sorted(sizes, key=lambda name: -sizes[name])[:6]
        print("  " + ", ".join(f"{name} {sizes[name]:,.0f}" for name in largest))


if __name__ == "__main__":
    main()
