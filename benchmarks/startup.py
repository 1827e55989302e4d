"""How long commands take from start to finish, against importing what they stand on.

Runs both in turn and prints the ratio pair by pair: machines drift, ratios hold. Bytecode is
written first and read from then on, as it is where trdlab has been installed.

    python benchmarks/startup.py
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROUNDS = 15
EXACT = ["gridworld", "--gamma", "0.95", "--N", "2", "--w", "2"]
EXPLAINED = ["explain", "gridworld:ledge", "--out"]  # a folder; pictures are in the time
TIMED = (
    (EXACT, "import numpy, typer, rich", 2),
    (EXPLAINED, "import numpy, typer, rich, gymnasium, matplotlib.pyplot", 3),
)


def seconds(*words: str) -> float:
    start, compiled = time.perf_counter(), {**os.environ, "PYTHONDONTWRITEBYTECODE": ""}
    subprocess.run([sys.executable, *words], check=True, capture_output=True, env=compiled)
    return time.perf_counter() - start


def main() -> None:
    for words, imports, most in TIMED:
        with tempfile.TemporaryDirectory() as folder:

            def command(number: int, folder: str = folder, words: list[str] = words) -> float:
                out = [str(Path(folder, str(number)))] if words is EXPLAINED else []
                return seconds("-m", "trdlab", *words, *out)

            command(0), seconds("-c", imports)  # warm the file cache
            pairs = [(command(i), seconds("-c", imports)) for i in range(1, ROUNDS + 1)]
        ratios = sorted(of / alone for of, alone in pairs)
        print(
            f"trdlab {' '.join(words[:2])}: median {statistics.median(c for c, _ in pairs):.3f} s"
        )
        print(f"{imports}: median {statistics.median(alone for _, alone in pairs):.3f} s")
        print(f"ratio: median {statistics.median(ratios):.2f}", end="")
        print(f" ({ratios[0]:.2f} to {ratios[-1]:.2f}; to reach: at most {most})")


if __name__ == "__main__":
    main()
