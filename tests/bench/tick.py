"""Times of the tick: a real-time run over LCM, and walks in stance-rollout with each engine over several horizons.

Of the real-time run each stage's and the wake-up's p50, p99, p99.9 and maximum, and the share of a core that it takes.
cyclictest runs beside it where it is installed (Debian: rt-tests), with the same period and priority: compare wake-ups.
Of the walks the tick's CPU time, how many times real time they run on one core, the ticks' share of that, and the
highest rate that one core holds: that at which 999 of 1000 ticks end within their period. Figures, not a test: the
machine is shared.
`python tests/bench/tick.py [SECONDS] [--json FILE] [--no-real-time]`.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from stance.errors import StanceError
from stance.log import Log
from stance.metrics import STAGES
from stance.network import ensure
from stance.programs import find_program, share_directory
from stance.run import RunRequest, record
from stance.signals import Percentiles

ENGINES = ("structured", "osqp-condensed", "osqp-sparse")
HORIZONS = {
    "20": {"num_fine": 10, "num_coarse": 10, "coarse_periods": 3},
    "22, the biped's own": {"num_fine": 10, "num_coarse": 12, "coarse_periods": 3},
    "50 of 0.01 s": {"num_fine": 50, "num_coarse": 0, "coarse_periods": 1},
    "100 of 0.01 s": {"num_fine": 100, "num_coarse": 0, "coarse_periods": 1},
}
SCENARIO = "walk_noisy"
WALK = 30.0  # s


def walk(engine: str, horizon: dict[str, int]) -> dict[str, Any]:
    """What stance-rollout says of a walk with this engine and horizon, on one core."""
    with tempfile.TemporaryDirectory() as directory:
        share = Path(directory)
        shutil.copytree(share_directory() / "robots", share / "robots")
        (share / "sim").symlink_to(share_directory() / "sim")
        file = share / "robots/biped/biped.yaml"
        robot = yaml.safe_load(file.read_text())
        robot["controller"]["walk"]["horizon"] = horizon
        file.write_text(yaml.safe_dump(robot, sort_keys=False))
        words = ["--robot", "biped", "--scenario", SCENARIO, "--duration", str(WALK), "--solver", engine, "--json"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        said = subprocess.run(
            [str(find_program("stance-rollout")), *words],
            env={**os.environ, "STANCE_SHARE": directory},
            stdout=subprocess.PIPE,
            text=True,
            check=False,
            preexec_fn=lambda: os.sched_setaffinity(0, {max(os.sched_getaffinity(0))}),
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if not said.stdout:
        raise StanceError(f"stance-rollout did not walk with {engine} and {horizon}")
    told: dict[str, Any] = json.loads(said.stdout)
    # By the CPU, so that what else runs on the machine does not count.
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return told | {"times_real_time": told["duration_s"] / cpu, "cpu_s": cpu}


def _ticks_cpu(cpu: dict[str, Any]) -> float:
    """s, of all ticks, by the middles of the bins that they are counted in."""
    counts = np.array(cpu["counts"])
    middles = cpu["first_edge_us"] * 10.0 ** ((np.arange(len(counts)) + 0.5) / cpu["bins_per_decade"])
    return float(counts @ middles) * 1e-6


def walks() -> list[dict[str, Any]]:
    """A row for each engine and horizon."""
    rows = []
    for stages, horizon in HORIZONS.items():
        for engine in ENGINES:
            told = walk(engine, horizon)
            cpu = told["tick_cpu"]
            rows.append(
                {
                    "stages": stages,
                    "engine": engine,
                    "walked_s": told["duration_s"],
                    "failed_qps": told["qp_failures"],
                    "times_real_time": told["times_real_time"],
                    "ticks_share": _ticks_cpu(cpu) / told["cpu_s"],
                    **{f"tick_{name}": cpu[name] for name in ("p50_us", "p99_us", "p99_9_us", "max_us")},
                    "highest_rate_Hz": 1e6 / cpu["p99_9_us"],
                }
            )
    return rows


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
        cpu = run.field("CONTROLLER_TIMING", "cpu_us")
        result["core"] = {"share": float(cpu.sum() / run.field("CONTROLLER_TIMING", "period_us").sum())}
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


def show_real_time(result: dict[str, dict[str, float]]) -> None:
    print(f"{'us':<14}{'p50':>9}{'p99':>9}{'p99.9':>9}{'max':>9}")
    for name, values in result.items():
        if "p50" in values:
            print(f"{name:<14}" + "".join(f"{values[key]:>9.1f}" for key in ("p50", "p99", "p99_9", "max")))
    print(f"missed ticks: {result['missed']['ticks']:.0f}; the ticks take {result['core']['share']:.2%} of a core")
    if "cyclictest" not in result:
        print("cyclictest is not installed: apt-get install rt-tests to see this machine's own wake-ups beside")


def show_walks(rows: list[dict[str, Any]]) -> None:
    print(f"\na noisy walk of {WALK:.0f} s in stance-rollout, us of the CPU a tick:")
    head = (
        "stages",
        "engine",
        "p50",
        "p99",
        "p99.9",
        "max",
        "real time",
        "of ticks",
        "rate, Hz",
        "walked, s",
        "failed",
    )
    print(f"{head[0]:<36}{head[1]:<16}" + "".join(f"{word:>11}" for word in head[2:]))
    for row in rows:
        times = "".join(f"{row[f'tick_{name}_us']:>11.0f}" for name in ("p50", "p99", "p99_9", "max"))
        rates = f"{row['times_real_time']:>10.1f}x{row['ticks_share']:>11.0%}{row['highest_rate_Hz']:>11.0f}"
        rest = f"{row['walked_s']:>11.1f}{row['failed_qps']:>11}"
        print(f"{row['stages']:<36}{row['engine']:<16}{times}{rates}{rest}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seconds", nargs="?", type=float, default=20.0)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--no-real-time", action="store_true", help="the walks alone")
    options = parser.parse_args()
    result: dict[str, Any] = {}
    try:
        if not options.no_real_time:
            ensure("auto", sys.argv)
            result["real_time"] = measure(options.seconds)
            show_real_time(result["real_time"])
        result["walks"] = walks()
        show_walks(result["walks"])
    except StanceError as error:
        sys.exit(str(error))
    if options.json:
        options.json.write_text(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
