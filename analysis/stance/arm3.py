"""The 3-joint arm's motions: how they were tracked, and the document's printout of their steps.

A motion is a stretch of ARM3_MOTION whose steps count 1, 2, 3, ... Its reference theta is integrated by Euler's method
from the calculated joint rates, its map by the end effector's velocity alone (document 004). Forward kinematics are the
URDF's. Frames: A the arm's base, 3 the end effector.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from . import configuration, signals
from .errors import StanceError
from .series import Array, Floats, Integers, Run, match

CHANNEL = "ARM3_MOTION"
JOINTS = 3
TERMINAL_STEP = 600  # at which the document's terminal prints


@dataclass(frozen=True)
class Motion:
    """One motion that was played, from its first step to its last."""

    behaviour: str
    """one of signals.BEHAVIOURS"""
    start: float
    """s"""
    steps: int
    error_max: float
    """rad, of a joint: true less reference"""
    error_rms: float
    """rad, over joints and instants"""
    tool_error_max: float
    """m, the end effector's true place from its reference"""
    rate_error_max: float
    """rad/s, calculated less given joint rates"""
    map_error_at_600: float | None
    """m, |p| of the map less forward kinematics after 600 steps; None in a shorter motion"""
    map_error_final: float
    """m, the same after the last step"""
    orthonormality_max: float
    """largest entry of |R^T R - 1| over the maps"""


def plays(run: Run) -> bool:
    """Whether the log holds motions of the arm, and the body whose end effector moved."""
    body = configuration.robot(run)
    return CHANNEL in run and body is not None and configuration.value(run, "controller.tool") in body.links


def spans(run: Run) -> list[Integers]:
    """Rows of CHANNEL, a list for each motion: those whose step goes on from the one before."""
    if CHANNEL not in run:
        return []
    step = run.field(CHANNEL, "step")
    rows = []
    for first, last in signals.intervals(step > 0):
        begins = first + 1 + np.flatnonzero(np.diff(step[first : last + 1]) < 0)
        rows += np.split(np.arange(first, last + 1), begins - first)
    return rows


def tool_poses(run: Run, theta: Array) -> Floats:
    """T_A3, (n, 4, 4), of joint angles [rad] (n, 3), by the URDF that stands in the log."""
    body = configuration.robot(run)
    assert body is not None
    return body.forward(theta)[str(configuration.value(run, "controller.tool"))]


def after_step(run: Run) -> Floats:
    """rad, (n, 3), theta of every row's reference after its step: where its map stands."""
    rate = run.field(CHANNEL, "calculated_rate")
    return np.asarray(run.field(CHANNEL, "theta") + rate * signals.period(run))


def map_error(run: Run) -> Floats:
    """m, (n,): |p| of every row's map less forward kinematics."""
    place = tool_poses(run, after_step(run))[:, :3, 3]
    return np.asarray(np.linalg.norm(run.field(CHANNEL, "map_A3")[:, :3, 3] - place, axis=1))


def joint_error(run: Run) -> Floats:
    """rad, (n, 3): true joint angles less the reference of the same instant; nan where the log lacks the truth."""
    error = np.full((run.count(CHANNEL), JOINTS), np.nan)
    if "TRUTH" in run:
        rows = match(run.field(CHANNEL, "state_seq"), run.field("TRUTH", "seq"))
        stale = np.append(False, np.diff(run.field(CHANNEL, "state_seq")) == 0)  # such a tick's reference stood still
        known = (rows >= 0) & ~stale
        true = run.field("TRUTH", "joint_position")[rows[known], :JOINTS]
        error[known] = true - run.field(CHANNEL, "theta")[known]
    return error


def tool_error(run: Run) -> Floats:
    """m, (n,): the end effector's true place from its reference; nan likewise."""
    theta, error = run.field(CHANNEL, "theta"), joint_error(run)
    known = np.isfinite(error).all(axis=1)
    distance = np.full(len(theta), np.nan)
    wanted, true = tool_poses(run, theta[known]), tool_poses(run, theta[known] + error[known])
    distance[known] = np.linalg.norm((true - wanted)[:, :3, 3], axis=1)
    return distance


def motions(run: Run) -> list[Motion]:
    """Every motion of the run, in order; empty for another robot."""
    if not plays(run):
        return []
    time, step = run.time(CHANNEL), run.field(CHANNEL, "step")
    error, tool, off = joint_error(run), tool_error(run), map_error(run)
    rate = np.abs(run.field(CHANNEL, "calculated_rate") - run.field(CHANNEL, "given_rate")).max(axis=1)
    rotation = run.field(CHANNEL, "map_A3")[:, :3, :3]
    defect = np.abs(np.swapaxes(rotation, 1, 2) @ rotation - np.eye(3)).max(axis=(1, 2))
    found = []
    for rows in spans(run):
        at_600 = rows[step[rows] == TERMINAL_STEP]
        known = error[rows][np.isfinite(error[rows]).all(axis=1)]
        found.append(
            Motion(
                behaviour=_behaviour(run, float(time[rows[0]])),
                start=float(time[rows[0]]),
                steps=int(step[rows[-1]]),
                error_max=float(np.abs(known).max(initial=0.0)),
                error_rms=signals.rms(known),
                tool_error_max=signals.largest(tool[rows]) or 0.0,
                rate_error_max=float(rate[rows].max()),
                map_error_at_600=float(off[at_600[0]]) if len(at_600) else None,
                map_error_final=float(off[rows[-1]]),
                orthonormality_max=float(defect[rows].max()),
            )
        )
    return found


def _behaviour(run: Run, time: float) -> str:
    """What the controller does at `time` [s]."""
    if "CONTROLLER_TRACE" not in run:
        return "unknown"
    row = int(np.argmin(np.abs(run.time("CONTROLLER_TRACE") - time)))
    return signals.name_of(signals.BEHAVIOURS, int(run.field("CONTROLLER_TRACE", "behaviour")[row]))


@dataclass(frozen=True)
class Step:
    """One step of a motion, as the document's terminal prints it."""

    step: int
    time: float
    """s, from the motion's beginning to the step's"""
    v: list[float]
    """m/s, of the end effector in A"""
    omega: list[float]
    """rad/s"""
    dphi: list[float]
    """rad"""
    dp: list[float]
    """m"""
    map: list[list[float]]
    """T_A3 after the step, 4 x 4"""
    jacobian: list[list[float]]
    """6 x 3, of (v, omega)"""

    def as_text(self) -> str:
        """In the words, the order and the six digits of the document."""
        parts = (
            ("Printing linear velocity:", [self.v]),
            ("Printing angular velocity:", [self.omega]),
            ("Orientation change:", [self.dphi]),
            ("Position change:", [self.dp]),
            ("Printing final(updated) kinematic map", self.map),
            ("Printing Jacobian:", self.jacobian),
        )
        lines = [f"step {self.step}, {self.time:.2f} s"]
        for heading, rows in parts:
            lines += [heading, *(" ".join(f"{value:.6g}" for value in row) for row in rows)]
        return "\n".join(lines)


def steps(run: Run, motion: int = 1, first: int = 1, last: int | None = None) -> Iterator[Step]:
    """Steps `first` to `last` of a motion, which counts from 1. Raises StanceError where the log has none such."""
    found = spans(run)
    if not found:
        raise StanceError(f"no motion in this log: it holds no {CHANNEL} with a step; play one by the behaviour track")
    if not 1 <= motion <= len(found):
        raise StanceError(f"no motion {motion} in this log: it holds {len(found)}, counted from 1")
    rows = found[motion - 1]
    number = run.field(CHANNEL, "step")[rows]
    rows = rows[(number >= first) & (number <= (np.inf if last is None else last))]
    if not len(rows):
        raise StanceError(f"no such step in motion {motion}: it goes from step {number[0]} to {number[-1]}")
    return (_step(run, row) for row in rows.tolist())


def _step(run: Run, row: int) -> Step:
    def at(name: str) -> list[float]:
        return list(run.field(CHANNEL, name)[row].tolist())

    return Step(
        step=int(run.field(CHANNEL, "step")[row]),
        time=float(run.field(CHANNEL, "time")[row]),
        v=at("v"),
        omega=at("omega"),
        dphi=at("dphi"),
        dp=at("dp"),
        map=run.field(CHANNEL, "map_A3")[row].tolist(),
        jacobian=run.field(CHANNEL, "jacobian")[row].tolist(),
    )
