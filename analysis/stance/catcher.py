"""The catcher's throws: what became of each, by the simulator's truth, and how its filter and its joints did meanwhile.

Frames: A the arm's base, which stands in W's origin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import configuration, signals
from .series import Array, Floats, Integers, Run, match
from .urdf import Robot

PLAN, ESTIMATE, TRUTH = "CATCH_PLAN", "BALL_ESTIMATE", "BALL_TRUTH"
VERDICTS = ("open", "caught", "bounce", "reach", "time", "estimation", "facing")
"""of ball_truth_t"""
PHASES = ("uncalibrated", "waiting", "catching", "holding", "returning")
"""of catch_plan_t"""
FREEDOM = 3  # degrees, of an observation
ACTIVE = 0  # of joint_command_t


@dataclass(frozen=True)
class Throw:
    """One throw."""

    number: int
    time: float
    """s, when the ball was first there"""
    verdict: str
    """one of VERDICTS; open where the log ends before it is over"""
    crossed: bool
    """the cup's plane, from the front, within its radius and 60 degrees"""
    retained: bool
    """in the cup for 0.5 s"""
    crossing_offset: float | None
    """m, from the cup's axis; None where it did not come by"""
    crossing_angle_deg: float | None


@dataclass(frozen=True)
class Catching:
    """What came of a run's throws."""

    throws: list[Throw]
    crossed: float
    """share of the throws that are over"""
    retained: float
    """the same"""
    ball_error_rms: float | None
    """m, of the estimated position of balls in flight; None where none was"""
    nis: float | None
    """mean over the observations of balls in flight that were believed, per degree of freedom"""
    joint_error_max: float | None
    """rad, of a joint: true less reference"""
    cup_error_max: float | None
    """m, the cup's true place from its reference"""


def catches(run: Run) -> bool:
    """Whether the log holds catch plans, the ball's truth, and the robot's body."""
    return PLAN in run and TRUTH in run and configuration.robot(run) is not None


def throws(run: Run) -> list[Throw]:
    """Every throw of the run, in order."""
    if TRUTH not in run:
        return []
    number, present = run.field(TRUTH, "throw_number"), run.field(TRUTH, "present") != 0
    found = []
    for each in np.unique(number[number > 0]):
        rows = np.flatnonzero(number == each)
        last = rows[-1]
        offset = float(run.field(TRUTH, "crossing_offset")[last])
        angle = float(np.degrees(run.field(TRUTH, "crossing_angle")[last]))
        came = bool(np.isfinite(offset))
        found.append(
            Throw(
                number=int(each),
                time=float(run.time(TRUTH)[rows[present[rows]][0] if present[rows].any() else rows[0]]),
                verdict=VERDICTS[int(run.field(TRUTH, "verdict")[last])],
                crossed=bool(run.field(TRUTH, "crossed")[last]),
                retained=bool(run.field(TRUTH, "retained")[last]),
                crossing_offset=offset if came else None,
                crossing_angle_deg=angle if came else None,
            )
        )
    return found


def measure(run: Run) -> Catching | None:
    """None for another robot."""
    if not catches(run):
        return None
    over = [one for one in throws(run) if one.verdict != "open"]
    error, nis = ball_error(run)[in_flight(run)], run.field(ESTIMATE, "nis")[in_flight(run)]
    joint, cup = joint_error(run), cup_error(run)
    error, nis = (
        error[np.isfinite(error).all(axis=1)],
        nis[nis <= float(configuration.value(run, "controller.filter.gate"))],
    )
    return Catching(
        throws=throws(run),
        crossed=float(np.mean([one.crossed for one in over])) if over else 0.0,
        retained=float(np.mean([one.retained for one in over])) if over else 0.0,
        ball_error_rms=float(np.sqrt((error**2).sum(axis=1).mean())) if len(error) else None,
        nis=float(nis.mean()) if len(nis) else None,
        joint_error_max=signals.largest(np.abs(joint)),
        cup_error_max=signals.largest(cup),
    )


# ---- what is drawn, too ----------------------------------------------------------------------------------------------


def in_flight(run: Run) -> Array:
    """Whether each estimate is of a ball that is on its way, and known, (n,)."""
    rows = match(run.field(ESTIMATE, "seq"), run.field(PLAN, "seq"))
    new = np.append(True, np.diff(run.field(ESTIMATE, "observation_seq")) > 0)
    return np.asarray((run.field(PLAN, "phase")[rows] == PHASES.index("catching")) & (rows >= 0) & new)


def ball_error(run: Run) -> Floats:
    """m, (n, 3): each estimate less the truth of its instant; nan where the log lacks that."""
    rows = match(run.field(ESTIMATE, "utime"), run.field(TRUTH, "utime"))
    known = (rows >= 0) & (run.field(TRUTH, "present")[rows] != 0)
    error = np.full((len(rows), 3), np.nan)
    error[known] = run.field(ESTIMATE, "p_ABall")[known] - run.field(TRUTH, "p_WBall")[rows[known]]
    return error


def _truth_rows(run: Run) -> Integers:
    """The row of TRUTH of each plan's instant, or -1."""
    return match(run.field(PLAN, "state_seq"), run.field("TRUTH", "seq"))


def joint_error(run: Run) -> Floats:
    """rad, (n, joints): true joint angles less each plan's reference; nan where the log lacks the truth or the arm is
    not led."""
    joints = body_of(run).moving
    error = np.full((run.count(PLAN), len(joints)), np.nan)
    rows = _truth_rows(run)
    commands = match(run.field(PLAN, "seq"), run.field("JOINT_COMMAND", "seq"))
    known = (rows >= 0) & (commands >= 0) & (run.field("JOINT_COMMAND", "mode")[commands] == ACTIVE)
    true = run.field("TRUTH", "joint_position")[rows[known], : len(joints)]
    error[known] = true - run.field(PLAN, "q_ref")[known, : len(joints)]
    return error


def body_of(run: Run) -> Robot:
    body = configuration.robot(run)
    assert body is not None
    return body


def cup_places(run: Run, q: Array) -> Floats:
    """m, (n, 3), of the cup's centre in A, by the URDF that stands in the log; q [rad] (n, joints)."""
    link = str(configuration.value(run, "cup.link"))
    place = np.append(np.asarray(configuration.value(run, "cup.position"), float), 1.0)
    return np.asarray((body_of(run).forward(q)[link] @ place)[:, :3])


def cup_error(run: Run) -> Floats:
    """m, (n,): the cup's true place from its reference; nan likewise."""
    error = joint_error(run)
    reference = run.field(PLAN, "q_ref")[:, : error.shape[1]]
    known = np.isfinite(error).all(axis=1)
    distance = np.full(len(error), np.nan)
    apart = cup_places(run, reference[known] + error[known]) - cup_places(run, reference[known])
    distance[known] = np.linalg.norm(apart, axis=1)
    return distance


def manipulability(run: Run, q: Array) -> Floats:
    """m^3, (n,): sqrt det J J^T of the cup's velocity by the joints' (Yoshikawa); J by central differences."""
    step = 1e-6
    columns = []
    for joint in range(q.shape[1]):
        turned = np.zeros(q.shape[1])
        turned[joint] = step
        columns.append((cup_places(run, q + turned) - cup_places(run, q - turned)) / (2.0 * step))
    jacobian = np.stack(columns, axis=2)
    return np.asarray(np.sqrt(np.maximum(np.linalg.det(jacobian @ np.swapaxes(jacobian, 1, 2)), 0.0)))
