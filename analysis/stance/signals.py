"""What a run's messages say at each instant, and how a quantity over many instants is told in short.

Pure functions of a `Run` or of arrays, which what measures and what draws share.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .series import Array, Floats, Integers, Run, match
from .urdf import rotation_from_quaternion

MIN_NORMAL_FORCE = 5.0  # N, below it a contact's friction ratio says nothing
BEHAVIOURS = ("stand", "walk", "lie_down", "track", "catch", "track_smooth")  # values of user_command_t.behaviour
STANDING, DOUBLE_SUPPORT, SINGLE_SUPPORT = range(3)  # values of controller_trace_t.gait_phase
PATH_STEP = 1.0  # s between the points that measure a path, so that sway is none of it


@dataclass(frozen=True)
class Percentiles:
    """Of one quantity over a run, in the unit that its name says: values that did occur, never between two."""

    p50: float
    p99: float
    p99_9: float
    max: float

    @classmethod
    def of(cls, values: Array) -> Percentiles | None:
        """None where there are no finite values."""
        finite = np.asarray(values, float)
        finite = finite[np.isfinite(finite)]
        if not len(finite):
            return None
        p50, p99, p99_9 = (float(value) for value in np.percentile(finite, [50.0, 99.0, 99.9], method="higher"))
        return cls(p50, p99, p99_9, float(finite.max()))


@dataclass(frozen=True)
class Spread:
    """Of a quantity that comes once a step or so, in the unit that its name says."""

    mean: float
    std: float
    min: float
    max: float

    @classmethod
    def of(cls, values: Array) -> Spread | None:
        """None where there are none."""
        if not len(values):
            return None
        return cls(float(np.mean(values)), float(np.std(values)), float(np.min(values)), float(np.max(values)))


def period(run: Run) -> float:
    """s, the control period: the samples of one ROBOT_STATE together."""
    samples = run.field("ROBOT_STATE", "sample_period")
    count = run.field("ROBOT_STATE", "gyro").shape[1]
    nominal = float(np.median(samples)) * count if len(samples) else 0.0
    if nominal > 0.0:
        return nominal
    steps = np.diff(run.field("ROBOT_STATE", "utime"))
    return float(np.median(steps)) * 1e-6 if len(steps) else 0.01


def num_contacts(run: Run) -> int:
    """Contacts in use: feet."""
    for channel in ("ROBOT_STATE", "TRUTH", "FORCE_PLAN"):
        if channel in run:
            return int(run.field(channel, "num_contacts").max())
    return 0


def on_fixed_base(run: Run) -> bool:
    """Whether the robot has no feet: it neither stands nor falls, and no force QP holds it up."""
    return ("ROBOT_STATE" in run or "TRUTH" in run) and num_contacts(run) == 0


def num_joints(run: Run) -> int:
    """Joints in use."""
    return int(run.field("ROBOT_STATE", "num_joints").max()) if "ROBOT_STATE" in run else 0


def z_axis(quat_WB: Array) -> Floats:
    """B's z axis in W: (..., 4) → (..., 3)."""
    return rotation_from_quaternion(quat_WB)[..., 2]


def tilt(quat_WB: Array) -> Floats:
    """rad, angle of B's z axis from W's: (..., 4) → (...)."""
    z = z_axis(quat_WB)
    return np.asarray(np.arctan2(np.hypot(z[..., 0], z[..., 1]), z[..., 2]))


def roll_pitch_yaw(quat_WB: Array) -> Floats:
    """rad, of R = Rz(yaw) Ry(pitch) Rx(roll): (..., 4) → (..., 3)."""
    R = rotation_from_quaternion(quat_WB)
    roll, yaw = np.arctan2(R[..., 2, 1], R[..., 2, 2]), np.arctan2(R[..., 1, 0], R[..., 0, 0])
    return np.stack([roll, np.arcsin(np.clip(-R[..., 2, 0], -1.0, 1.0)), yaw], axis=-1)


def in_heading(vectors: Array, yaw: Array) -> Floats:
    """Vectors (n, 3) of W in the frame that is turned by `yaw` [rad] (n,) about W's z."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    x, y, z = vectors.T
    return np.column_stack([cos * x + sin * y, cos * y - sin * x, z])


def truth_of_ticks(run: Run) -> tuple[Integers, Integers]:
    """Rows of CONTROLLER_TRACE that took a new state, and the rows of TRUTH of the same instants."""
    found = match(run.field("CONTROLLER_TRACE", "state_seq"), run.field("TRUTH", "seq"))
    rows = np.flatnonzero((found >= 0) & (run.field("CONTROLLER_TRACE", "state_is_new") != 0))
    return rows, found[rows]


def intervals(active: Array) -> list[tuple[int, int]]:
    """First and last row of each stretch of true values, (n,) bool."""
    edges = np.diff(np.concatenate([[0], np.asarray(active, np.int8), [0]]))
    firsts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    return [(int(first), int(end) - 1) for first, end in zip(firsts, ends, strict=True)]


def path_length(position: Array, time: Array) -> float:
    """m, horizontal, of positions (n, 3) at times [s] (n,)."""
    rows = np.searchsorted(time, np.arange(time[0], time[-1], PATH_STEP))
    points = position[np.append(rows, len(time) - 1), :2]
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def largest(values: Array) -> float | None:
    """Of those that are numbers; None where none is."""
    finite = values[~np.isnan(values)]
    return float(finite.max()) if finite.size else None


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if np.size(values) else 0.0


def name_of(names: tuple[str, ...], value: int) -> str:
    """Of a value of a message."""
    return names[value] if 0 <= value < len(names) else f"unknown_{value}"
