"""Prints constraints.txt with the lowest versions that pyproject.toml declares in place of ours.

But for PyTorch: its older wheels bring gigabytes for graphics cards along.
"""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
LOWEST = dict(line.split(">=") for line in PROJECT["dependencies"])

for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines():
    name, version = re.split("==", line)
    print(f"{name}=={version if name == 'torch' else LOWEST.get(name, version)}")
