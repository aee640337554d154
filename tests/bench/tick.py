"""Times of the tick: a real-time run over LCM, each stage's and the wake-up's p50, p99, p99.9 and maximum.

cyclictest runs beside it where it is installed (Debian: rt-tests), with the same period and priority: compare wake-ups.
Figures, not a test: the machine is shared. `python tests/bench/tick.py [SECONDS] [--json FILE]`.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

import numpy as np
from stance.errors import StanceError
from stance.log import Log
from stance.metrics import STAGES
from stance.network import ensure
from stance.run import RunRequest, record
from stance.signals import Percentiles


def percentiles(values: np.ndarray) -> dict[str, float]:
    found = Percentiles.of(values)
    return asdict(found) if found is not None else {}


def measure(seconds: float) -> dict[str, dict[str, float]]:
    """us, by name. Must run where LCM's multicast goes by the loopback."""
    words = ["-t1", "-p80", "-i10000", f"-l{int(seconds * 100)}", "-m", "-q", "-h20000"]
    peer = shutil.which("cyclictest")
    with tempfile.TemporaryDirectory() as directory:
        beside = subprocess.Popen([peer, *words], stdout=subprocess.PIPE, text=True) if peer else None
        outcome = record(RunRequest(out=Path(directory), scenario="demo", duration=seconds))
        run = Log.open(outcome.log).run()
        stage = run.field("CONTROLLER_TIMING", "stage_us")
        result = {name: percentiles(stage[:, i]) for i, name in enumerate(STAGES)}
        for name in ("tick_us", "cpu_us", "period_us", "wake_latency_us", "slack_us"):
            result[name.removesuffix("_us")] = percentiles(run.field("CONTROLLER_TIMING", name)[1:])
        result["missed"] = {"ticks": float(run.field("CONTROLLER_TIMING", "missed_ticks")[-1])}
    if beside is not None:
        said, _ = beside.communicate()
        result["cyclictest"] = histogram(said)
    return result


def histogram(text: str) -> dict[str, float]:
    """Percentiles [us] of cyclictest's histogram."""
    rows = [line.split() for line in text.splitlines() if re.match(r"^\d{6}\s+\d+", line)]
    late = np.repeat([int(row[0]) for row in rows], [int(row[1]) for row in rows])
    return percentiles(late)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seconds", nargs="?", type=float, default=20.0)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    try:
        ensure("auto", sys.argv)
    except StanceError as error:
        sys.exit(str(error))
    result = measure(options.seconds)
    if options.json:
        options.json.write_text(json.dumps(result, indent=2))
    print(f"{'us':<14}{'p50':>9}{'p99':>9}{'p99.9':>9}{'max':>9}")
    for name, values in result.items():
        if "p50" in values:
            print(f"{name:<14}" + "".join(f"{values[key]:>9.1f}" for key in ("p50", "p99", "p99_9", "max")))
    print(f"missed ticks: {result['missed']['ticks']:.0f}")
    if "cyclictest" not in result:
        print("cyclictest is not installed: apt-get install rt-tests to see this machine's own wake-ups beside")


if __name__ == "__main__":
    main()
