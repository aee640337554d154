"""How the robot walked: its steps, what became of each command, how its feet followed, and what it cost.

A step is one swing of a foot, from the tick that lifts it off to the tick that finds it on the ground. Heading frame: W
turned about its z by the trunk's yaw; "forward" and "left" are along it. Places of a foot are of its tip, the centre of
its ball. The truth is told where it is logged, else the controller's estimate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from . import configuration, signals
from .series import Array, Floats, Run
from .signals import BEHAVIOURS, SINGLE_SUPPORT, STANDING, Percentiles, Spread
from .urdf import foot_radius, rotation_from_quaternion, transform

SETTLING = 3.0  # s of a segment that its means leave out, at most; as rollout/summary.cpp
MIN_PATH = 1.0  # m, below it no cost is a cost of transport
GRAVITY = 9.81  # m/s^2, of the cost of transport


@dataclass(frozen=True)
class Touchdown:
    """The end of a swing."""

    time: float
    """s"""
    swing_time: float
    """s, since lift-off"""
    reached: Floats
    """m, (3,) in W, by the estimate"""
    error: tuple[float, float]
    """m, forward and left: the step from the standing foot that was made less the one that was planned last; each in
    its own heading frame, since neither position nor yaw are observed"""


@dataclass(frozen=True)
class Step:
    """One swing. Positions [m] (3,) in W, by the controller's estimate."""

    foot: int
    """index of the contact"""
    rows: tuple[int, int]
    """of CONTROLLER_TRACE: the first and the last tick of the swing"""
    lift_off: float
    """s"""
    touchdown: Touchdown | None
    """None where the robot stood, fell or the log ended before"""
    planned_time: float
    """s, of the swing, as planned at lift-off"""
    first_foothold: Floats
    """planned at lift-off"""
    foothold: Floats
    """planned in the swing's last tick"""
    recovering: bool
    """in any of its ticks"""
    crossing: bool
    """to the other side of the standing foot, planned in the last tick"""


@dataclass(frozen=True)
class Segment:
    """A stretch between two user commands that want different things. The means leave out its first 3 s, or half."""

    start: float
    """s"""
    end: float
    """s"""
    behaviour: str
    """wanted, one of BEHAVIOURS"""
    wanted_velocity: tuple[float, float]
    """m/s, forward and left"""
    wanted_yaw_rate: float
    """rad/s"""
    measured_from: float
    """s"""
    velocity: tuple[float, float]
    """m/s, mean of the centre of mass in the heading frame"""
    yaw_rate: float
    """rad/s, mean"""
    distance: float
    """m, horizontal, from where the centre of mass was at the start to where it was at the end"""
    steps: int
    """touchdowns"""
    cost_of_transport: float | None
    """of all of it; None for a path below 1 m"""


@dataclass(frozen=True)
class Walking:
    """Of all the time in which the robot had a gait."""

    steps: int
    """touchdowns"""
    recovering: int
    """of these, steps that got over a push"""
    crossing: int
    step_time: Spread | None
    """s, from one touchdown to the next"""
    swing_time: Spread | None
    """s"""
    swing_time_change: Spread | None
    """s, the swing's time less the one planned at lift-off"""
    foothold_forward: Spread | None
    """m, reached less planned, both from the standing foot"""
    foothold_left: Spread | None
    foothold_error: Percentiles | None
    """m, length of the same"""
    foothold_change: Percentiles | None
    """m, from the foothold planned at lift-off to the one planned last"""
    swing_error: Percentiles | None
    """m, of a swing foot from its reference, by the estimate"""
    slip: Percentiles | None
    """m, that a stance's contact moved over the ground at most; None without the truth or the robot's URDF"""
    distance: float
    """m, length of the centre of mass's horizontal path"""
    cost_of_transport: float | None
    """sum of the joints' |mechanical work| over weight and way; None for a path below 1 m"""


def phases(run: Run) -> tuple[Floats, Array]:
    """(t [s], (n, contacts) bool: whether the gait has the foot on the ground); all are where there is no gait."""
    phase, swing = (run.field("CONTROLLER_TRACE", name) for name in ("gait_phase", "swing_foot"))
    feet = np.arange(signals.num_contacts(run))
    return run.time("CONTROLLER_TRACE"), (phase[:, None] != SINGLE_SUPPORT) | (swing[:, None] != feet)


def steps(run: Run) -> list[Step]:
    """Every swing of a robot with two feet, in order; the last may have no touchdown."""
    if "CONTROLLER_TRACE" not in run or signals.num_contacts(run) != 2:
        return []
    time = run.time("CONTROLLER_TRACE")
    names = ("steps", "swing_foot", "p_WF", "foothold", "swing_time", "recovering", "crossing")
    count, foot, feet, foothold, swing_time, recovering, crossing = (
        run.field("CONTROLLER_TRACE", name) for name in names
    )
    # Two swings with no tick between them are two all the same.
    edges = np.flatnonzero(np.diff(count) != 0)
    spans = [
        (int(part[0]), int(part[-1]))
        for first, last in signals.intervals(run.field("CONTROLLER_TRACE", "gait_phase") == SINGLE_SUPPORT)
        for part in np.split(np.arange(first, last + 1), edges[(edges >= first) & (edges < last)] - first + 1)
    ]
    planned, made = _steps_along_heading(run, foothold, foot), _feet_apart(run)
    found = []
    for first, last in spans:
        swing, row = int(foot[last]), last + 1
        touchdown = None
        if row < len(time) and count[row] == count[last] + 1:
            error = (1 - 2 * swing) * made[row] - planned[last]
            reached = (float(error[0]), float(error[1]))
            touchdown = Touchdown(float(time[row]), float(time[row] - time[first]), feet[row, swing], reached)
        found.append(
            Step(
                foot=swing,
                rows=(first, last),
                lift_off=float(time[first]),
                touchdown=touchdown,
                planned_time=float(swing_time[first]),
                first_foothold=foothold[first],
                foothold=foothold[last],
                recovering=bool(recovering[first : last + 1].any()),
                crossing=bool(crossing[last] != 0),
            )
        )
    return found


def _steps_along_heading(run: Run, foothold: Array, swing: Array) -> Floats:
    """m, (n, 3), forward, left and up: from the standing foot to the planned foothold, by the estimate."""
    support = run.field("CONTROLLER_TRACE", "p_WF")[np.arange(len(swing)), 1 - swing]
    return signals.in_heading(foothold - support, _yaw(run, "CONTROLLER_TRACE"))


def _feet_apart(run: Run) -> Floats:
    """m, (n, 3), forward, left and up: from the right foot to the left, by the truth where it is logged."""

    def of(channel: str) -> Floats:
        feet = run.field(channel, "p_WF")
        return signals.in_heading(feet[:, 0] - feet[:, 1], _yaw(run, channel))

    apart = of("CONTROLLER_TRACE")
    if "TRUTH" in run:
        rows, truth_rows = signals.truth_of_ticks(run)
        apart[rows] = of("TRUTH")[truth_rows]
    return apart


def _yaw(run: Run, channel: str) -> Floats:
    """rad, (n,), of the trunk"""
    return np.asarray(signals.roll_pitch_yaw(run.field(channel, "quat_WB"))[:, 2])


def landed(made: list[Step]) -> list[tuple[Step, Touchdown]]:
    """Those with a touchdown."""
    return [(step, step.touchdown) for step in made if step.touchdown is not None]


def swing_error(run: Run) -> Floats:
    """m, (n, 3) in W: the swing foot's tip less its reference, by the estimate; nan where none swings."""
    swing = run.field("CONTROLLER_TRACE", "swing_foot")
    tip = run.field("CONTROLLER_TRACE", "p_WF")[np.arange(len(swing)), swing]
    swinging = run.field("CONTROLLER_TRACE", "gait_phase") == SINGLE_SUPPORT
    return np.where(swinging[:, None], tip - run.field("CONTROLLER_TRACE", "swing_p"), np.nan)


def slip(run: Run) -> tuple[Floats, Floats] | None:
    """(t [s], (n, feet) m): how far each foot's contact has slid over level ground since it bears load; nan in the air.

    The ball of radius r rolls where the tip moves by dtheta x r z: what is left slides. By the truth; None without it
    or the robot's URDF.
    """
    body = configuration.robot(run)
    if body is None or "TRUTH" not in run:
        return None
    tips = body.feet()
    loaded = run.field("TRUTH", "f_F_W")[:, : len(tips), 2] > signals.MIN_NORMAL_FORCE
    q = run.field("TRUTH", "joint_position")[:, : signals.num_joints(run)]
    frames = body.forward(
        q, transform(rotation_from_quaternion(run.field("TRUTH", "quat_WB")), run.field("TRUTH", "p_WB"))
    )
    moved = np.full(loaded.shape, np.nan)
    whole = np.isfinite(run.field("TRUTH", "p_WF")[:, : len(tips)]).all(axis=(1, 2))
    for foot, (link, _) in enumerate(tips):
        turns = frames[link][:, :3, :3]
        known = np.asarray(whole & np.isfinite(turns).all(axis=(1, 2)))
        R = Rotation.from_matrix(np.where(known[:, None, None], turns, np.eye(3)))
        turned = (R[1:] * R[:-1].inv()).as_rotvec()
        rolled = foot_radius(body, link) * np.column_stack([turned[:, 1], -turned[:, 0]])  # dtheta x z
        slid = np.diff(run.field("TRUTH", "p_WF")[:, foot, :2], axis=0) - rolled
        way = np.concatenate([np.zeros((1, 2)), np.cumsum(slid, axis=0)])
        for first, last in signals.intervals(loaded[:, foot] & known):
            moved[first : last + 1, foot] = np.linalg.norm(way[first : last + 1] - way[first], axis=1)
    return run.time("TRUTH"), moved


def work(run: Run) -> tuple[Floats, Floats] | None:
    """(t [s], J (n,)): the joints' |mechanical work| of the period that ended at each instant; None without the truth.

    Mean torque of the period times the way of the joint in it. Work that is done on a joint counts as much as what it
    does: it has no spring to keep it.
    """
    if "TRUTH" not in run:
        return None
    joints = slice(signals.num_joints(run))
    way = np.diff(run.field("TRUTH", "joint_position")[:, joints], axis=0, prepend=np.nan)
    return run.time("TRUTH"), np.nansum(np.abs(run.field("TRUTH", "joint_torque")[:, joints] * way), axis=1)


def _path(run: Run) -> tuple[Floats, Floats, Floats]:
    """(t [s], p_WC [m] (n, 3), yaw of the trunk [rad] (n,) unwrapped)."""
    channel = "TRUTH" if "TRUTH" in run else "CONTROLLER_TRACE"
    position = run.field(channel, "p_WC") if channel == "TRUTH" else run.field(channel, "x")[:, 3:6]
    yaw = np.unwrap(_yaw(run, channel))
    return run.time(channel), position, yaw


def _cost_of_transport(run: Run, among: tuple[float, float]) -> float | None:
    """Of a time span [s]: work over weight and path. See `Walking`."""
    body, done = configuration.robot(run), work(run)
    if body is None or done is None:
        return None
    (energy_time, energy), (time, position, _) = done, _path(run)
    rows = (time >= among[0]) & (time <= among[1])
    way = signals.path_length(position[rows], time[rows]) if rows.sum() > 1 else 0.0
    spent = float(energy[(energy_time > among[0]) & (energy_time <= among[1])].sum())
    return spent / (body.mass * GRAVITY * way) if way >= MIN_PATH else None


def segments(run: Run) -> list[Segment]:
    """What the operator wanted, one after the other, and what came of it."""
    if "USER_COMMAND" not in run or not ("TRUTH" in run or "CONTROLLER_TRACE" in run):
        return []
    time, position, yaw = _path(run)
    touchdowns = [down.time for _, down in landed(steps(run))]
    found = []
    for start, end, row in _stretches(run):
        rows = np.flatnonzero((time >= start - 1e-9) & (time <= end + 1e-9))
        if len(rows) < 2:
            continue
        first, last = rows[0], rows[-1]
        settled = first + min(int(np.searchsorted(time[rows] - time[first], SETTLING - 1e-9)), (last - first) // 2)
        span = time[last] - time[settled]
        way = np.diff(position[settled : last + 1], axis=0)
        heading = 0.5 * (yaw[settled:last] + yaw[settled + 1 : last + 1])
        velocity = signals.in_heading(way, heading).sum(axis=0) / span
        wanted = run.field("USER_COMMAND", "velocity")[row]
        found.append(
            Segment(
                start=float(time[first]),
                end=float(time[last]),
                behaviour=signals.name_of(BEHAVIOURS, int(run.field("USER_COMMAND", "behaviour")[row])),
                wanted_velocity=(float(wanted[0]), float(wanted[1])),
                wanted_yaw_rate=float(run.field("USER_COMMAND", "yaw_rate")[row]),
                measured_from=float(time[settled]),
                velocity=(float(velocity[0]), float(velocity[1])),
                yaw_rate=float((yaw[last] - yaw[settled]) / span),
                distance=float(np.linalg.norm((position[last] - position[first])[:2])),
                steps=sum(start < at <= end for at in touchdowns),
                cost_of_transport=_cost_of_transport(run, (float(time[first]), float(time[last]))),
            )
        )
    return found


def _stretches(run: Run) -> list[tuple[float, float, int]]:
    """(start, end [s], row of USER_COMMAND that wants it): a silence longer than the controller's patience ends one."""
    names = ("behaviour", "velocity", "yaw_rate", "height_offset")
    wish = np.column_stack([run.field("USER_COMMAND", name) for name in names])
    time = run.time("USER_COMMAND")
    patience = configuration.value(run, "controller.user_command_timeout")
    lasts = np.append(time[1:], np.inf)  # s, until the next command
    if isinstance(patience, float):
        lasts = np.minimum(lasts, time + patience)
    new = np.append(True, (np.diff(wish, axis=0) != 0.0).any(axis=1) | (lasts[:-1] < time[1:]))
    rows = np.flatnonzero(new)
    return list(
        zip(time[rows].tolist(), lasts[np.append(rows[1:], len(time)) - 1].tolist(), rows.tolist(), strict=True)
    )


def walking(run: Run) -> Walking | None:
    """None where the robot never had a gait."""
    made = steps(run)
    if not made:
        return None
    ends = landed(made)
    rows = np.flatnonzero(run.field("CONTROLLER_TRACE", "gait_phase") != STANDING)
    ticks = run.time("CONTROLLER_TRACE")[rows]
    error = np.array([down.error for _, down in ends]).reshape(-1, 2)
    change = np.array([step.foothold - step.first_foothold for step, _ in ends]).reshape(-1, 3)
    times = np.array([down.swing_time for _, down in ends])
    slid = slip(run)
    time, position, _ = _path(run)
    on_the_way = (time >= ticks[0]) & (time <= ticks[-1])
    return Walking(
        steps=len(ends),
        recovering=sum(step.recovering for step, _ in ends),
        crossing=sum(step.crossing for step, _ in ends),
        step_time=Spread.of(_within_a_gait(run, np.array([down.time for _, down in ends]))),
        swing_time=Spread.of(times),
        swing_time_change=Spread.of(times - [step.planned_time for step, _ in ends]),
        foothold_forward=Spread.of(error[:, 0]),
        foothold_left=Spread.of(error[:, 1]),
        foothold_error=Percentiles.of(np.linalg.norm(error, axis=1)),
        foothold_change=Percentiles.of(np.linalg.norm(change[:, :2], axis=1)),
        swing_error=Percentiles.of(np.linalg.norm(swing_error(run), axis=1)),
        slip=None if slid is None else Percentiles.of(_largest_of_each_stance(slid[1])),
        distance=signals.path_length(position[on_the_way], time[on_the_way]) if on_the_way.sum() > 1 else 0.0,
        cost_of_transport=_cost_of_transport(run, (float(ticks[0]), float(ticks[-1]))),
    )


def _within_a_gait(run: Run, touchdowns: Floats) -> Floats:
    """s, from each touchdown to the next; not over a stretch in which the robot stood."""
    phase, time = run.field("CONTROLLER_TRACE", "gait_phase"), run.time("CONTROLLER_TRACE")
    stood = np.append(0, np.cumsum(phase == STANDING))[np.searchsorted(time, touchdowns)]
    return np.asarray(np.diff(touchdowns)[np.diff(stood) == 0])


def _largest_of_each_stance(slid: Floats) -> Floats:
    """m, (stances,)"""
    return np.array(
        [
            slid[first : last + 1, foot].max()
            for foot in range(slid.shape[1])
            for first, last in signals.intervals(~np.isnan(slid[:, foot]))
        ]
    )
