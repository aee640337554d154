"""A stand-in for stance-rollout: it falls by the size of the scenario's push, and tells what it was asked."""

from __future__ import annotations

import hashlib
import json
import math
import os
import sys
import time
from pathlib import Path

import yaml

TOUGH = 5.0
"""N s, the largest push that it stands"""
SEEN = "FAKE_ROLLOUT_SEEN"
"""environment variable that names a file: a line there for each call"""
HANG = "FAKE_ROLLOUT_HANG"
"""environment variable with a seed from which on it does not come to an end"""
FICKLE = "FAKE_ROLLOUT_FICKLE"
"""environment variable that makes it come out otherwise each time"""


def main() -> int:
    words = [word for word in sys.argv[1:] if word != "--json"]
    option = dict(zip(words[::2], words[1::2], strict=True))
    scenario = yaml.safe_load(Path(option["--scenario"]).read_text())
    seed = int(option["--seed"])
    robot = yaml.safe_load((Path(os.environ["STANCE_SHARE"]) / "robots/biped/biped.yaml").read_text())
    if scenario["robot"] == "broken":
        print("stance-rollout: scenario.yaml: unknown key frictoin", file=sys.stderr)
        return 2
    if seed >= int(os.environ.get(HANG, sys.maxsize)):
        time.sleep(600.0)
    impulse = sum(
        push.get("impulse", math.hypot(*push.get("force_W", (0.0,))[:2]) * push["duration"])
        for push in scenario["pushes"]
    )
    fallen = impulse > TOUGH
    if "--log" in option:
        from synthetic import Synthetic  # not before it is needed: it takes longer than all else here

        fall_at = 0.1 if fallen else None
        Synthetic(duration=0.6, pushes=[], seed=seed, fall_at=fall_at).write(Path(option["--log"]))
    with Path(os.environ[SEEN]).open("a") as file:
        print(json.dumps([option, scenario]), file=file)
    salt = os.getpid() if FICKLE in os.environ else ""
    told = {
        "duration_s": 0.6,
        "drawn": {"pushes[1].direction": 0.25},
        "fallen": fallen,
        "first_fall_s": 0.5 if fallen else None,
        "fall_reason": "body_on_ground" if fallen else None,
        "fallen_on": "shank_l" if fallen else None,
        "friction": robot["controller"]["force_qp"]["friction"],
        "max_tilt_rad": 0.1 * impulse + 0.01 * seed,
        "qp_iterations_max": 10 * seed,
        "tick_cpu": {
            "max_us": 100.0,
            "first_edge_us": 1,
            "bins_per_decade": 1,
            "counts": [0, 59, 1, 0],
        },
        "command_hash": hashlib.sha256(f"{impulse} {seed} {salt}".encode()).hexdigest(),
    }
    print(json.dumps(told))
    return int(fallen)


def install(directory: Path) -> None:
    """Puts it where STANCE_BIN_DIR is to point."""
    program = directory / "stance-rollout"
    paths = ":".join(path for path in sys.path if path)
    program.write_text(f'#!/bin/sh\nPYTHONPATH="{paths}" exec "{sys.executable}" "{Path(__file__).resolve()}" "$@"\n')
    program.chmod(0o755)


if __name__ == "__main__":
    sys.exit(main())
