"""Studies: many seeded rollouts of one question, counted with intervals. Here: pushes on a standing biped."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from random import Random
from typing import Any

import yaml
from scipy.stats import binomtest

from .errors import RunError, StanceError
from .programs import SOURCE_TREE, find_program

DIRECTIONS = 8
SEMI_AXES = (0.8, 4.0)
"""N s, forward and to the side: the ellipse that scale 1 means"""
PUSH_DURATION = 0.1  # s
FIRST_MOMENT, LAST_MOMENT = 5.0, 7.0  # s, when the estimator has settled
AFTER = 6.0  # s, that the robot must stand after the push
UNREACHED = {"capture": [0.9, 0.9], "capture_pitch": 1.5, "capture_lead": 0.0}  # m, rad: a robot that would step there has fallen

Progress = Callable[[int, int], None]
"""called with the trials done and in all"""


@dataclass(frozen=True)
class Trial:
    """One push on one standing robot."""

    scale: float
    """of the ellipse"""
    direction: int
    """0 forward, then counter-clockwise in eighths of a turn of the ellipse's parameter"""
    moment: float
    """s"""
    seed: int
    fallen: bool = False
    max_tilt: float = 0.0
    """rad, of the trunk"""

    @property
    def impulse(self) -> tuple[float, float]:
        """N s, forward and to the left."""
        angle = 2.0 * math.pi * self.direction / DIRECTIONS
        return self.scale * SEMI_AXES[0] * math.cos(angle), self.scale * SEMI_AXES[1] * math.sin(angle)


@dataclass(frozen=True)
class Cell:
    """All trials of one scale of the ellipse."""

    scale: float
    trials: int
    survived: int
    interval: tuple[float, float]
    """Wilson's, 95%, of the survival rate"""
    max_tilt: float
    """rad, the largest of those that survived"""


def standing_pushes(
    scenario: str,
    scales: Sequence[float],
    moments: int = 5,
    seed: int = 10_000,
    robot: str = "biped",
    with_steps: bool = True,
    workers: int | None = None,
    progress: Progress | None = None,
) -> list[Trial]:
    """Pushes in 8 directions on scaled ellipses, at `moments` random moments each, every one in a rollout of its own.

    `seed` gives the moments, and each trial its sensors' noise. `with_steps` False: the robot as it ships, but that it
    never steps. Raises StanceError where the scenario is missing and RunError where a rollout does not run.
    """
    random = Random(seed)
    trials = [
        Trial(scale, direction, round(random.uniform(FIRST_MOMENT, LAST_MOMENT), 3), seed + number)
        for scale in scales
        for number, direction in enumerate(d for d in range(DIRECTIONS) for _ in range(moments))
    ]
    base = _scenario_text(robot, scenario)
    program = find_program("stance-rollout")
    done: list[Trial] = []
    with ThreadPoolExecutor(workers or os.cpu_count()) as pool, tempfile.TemporaryDirectory() as directory:
        share = _share() if with_steps else _share_without_steps(robot, Path(directory))
        for trial in pool.map(lambda one: _run(program, robot, base, Path(directory), share, one), trials):
            done.append(trial)
            if progress is not None:
                progress(len(done), len(trials))
    return done


def summarise(trials: Sequence[Trial]) -> list[Cell]:
    """A cell for each scale, in the order in which they come."""
    cells = []
    for scale in dict.fromkeys(trial.scale for trial in trials):
        here = [trial for trial in trials if trial.scale == scale]
        stood = [trial for trial in here if not trial.fallen]
        tilt = max((trial.max_tilt for trial in stood), default=0.0)
        interval = binomtest(len(stood), len(here)).proportion_ci(0.95, method="wilson")
        cells.append(Cell(scale, len(here), len(stood), (float(interval.low), float(interval.high)), tilt))
    return cells


def as_text(cells: Sequence[Cell]) -> str:
    """The table that the README shows."""
    rows = ["| ellipse, N s (x, y) | survived | 95% interval | largest tilt |", "|---|---|---|---|"]
    for cell in cells:
        x, y = (cell.scale * axis for axis in SEMI_AXES)
        low, high = cell.interval
        rows.append(
            f"| {x:.2f}, {y:.1f} | {cell.survived}/{cell.trials} | {low:.2f} to {high:.2f} | "
            f"{math.degrees(cell.max_tilt):.0f}° |"
        )
    return "\n".join(rows)


def as_dict(cells: Sequence[Cell], trials: Sequence[Trial]) -> dict[str, Any]:
    """For JSON."""
    return {"cells": [asdict(cell) for cell in cells], "trials": [asdict(trial) for trial in trials]}


def _share() -> Path:
    return Path(os.environ.get("STANCE_SHARE", SOURCE_TREE))


def _share_without_steps(robot: str, directory: Path) -> Path:
    shutil.copytree(_share() / "robots", directory / "robots")
    path = directory / "robots" / robot / f"{robot}.yaml"
    configuration = yaml.safe_load(path.read_text())
    configuration["controller"]["stepping"].update(UNREACHED)
    path.write_text(yaml.safe_dump(configuration))
    return directory


def _scenario_text(robot: str, scenario: str) -> dict[str, Any]:
    path = Path(scenario) if scenario.endswith(".yaml") else _share() / "sim/scenarios" / robot / f"{scenario}.yaml"
    try:
        loaded = yaml.safe_load(path.read_text())
    except OSError as error:
        raise StanceError(f"no scenario {path}: give a name below sim/scenarios/{robot}/ or a .yaml file") from error
    except yaml.YAMLError:
        loaded = None
    if not isinstance(loaded, dict):
        raise StanceError(f"{path} is no scenario: it must be a YAML mapping")
    return loaded


def _run(program: Path, robot: str, base: dict[str, Any], directory: Path, share: Path, trial: Trial) -> Trial:
    force = [component / PUSH_DURATION for component in trial.impulse]
    push = {"time": trial.moment, "duration": PUSH_DURATION, "force_W": [*force, 0.0], "point_B": [0.0, 0.0, 0.0]}
    scenario = directory / f"{trial.scale}_{trial.direction}_{trial.seed}.yaml"
    scenario.write_text(yaml.safe_dump({**base, "pushes": [push]}))
    words = ["--robot", robot, "--scenario", str(scenario), "--duration", str(trial.moment + AFTER)]
    done = subprocess.run(
        [str(program), *words, "--seed", str(trial.seed), "--json"],
        env={**os.environ, "STANCE_SHARE": str(share)},
        capture_output=True,
        text=True,
        check=False,
    )
    try:
        result = json.loads(done.stdout)
    except ValueError as error:
        raise RunError(f"stance-rollout failed: {done.stderr.strip() or f'exit {done.returncode}'}") from error
    return Trial(
        trial.scale, trial.direction, trial.moment, trial.seed, bool(result["fallen"]), float(result["max_tilt_rad"])
    )
