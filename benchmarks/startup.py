"""How long `trdlab gridworld` takes from start to finish, against importing what it stands on.

Runs both in turn and prints the ratio pair by pair: machines drift, ratios hold.

    python benchmarks/startup.py
"""

import statistics
import subprocess
import sys
import time

BASELINE = [sys.executable, "-c", "import numpy, typer, rich"]
COMMAND = [sys.executable, "-m", "trdlab", "gridworld", "--gamma", "0.95", "--N", "2", "--w", "2"]
ROUNDS = 15


def seconds(command: list[str]) -> float:
    start = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


def main() -> None:
    seconds(BASELINE), seconds(COMMAND)  # warm the file cache
    pairs = [(seconds(COMMAND), seconds(BASELINE)) for _ in range(ROUNDS)]
    ratios = sorted(command / baseline for command, baseline in pairs)
    print(f"trdlab gridworld   median {statistics.median(c for c, _ in pairs):.3f} s")
    print(f"imports alone      median {statistics.median(b for _, b in pairs):.3f} s")
    print(f"ratio              median {statistics.median(ratios):.2f}", end="")
    print(f"  (min {ratios[0]:.2f}, max {ratios[-1]:.2f}; to reach: at most 2)")


if __name__ == "__main__":
    main()
