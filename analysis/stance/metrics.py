"""What a run amounts to in figures. Pure functions of a `Run`: no files, no plots, no clock.

Every figure has its unit in its name where it is not SI. A figure that the log cannot give is None.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from . import configuration, signals
from .arm3 import Motion, motions
from .catcher import Catching
from .catcher import measure as catching
from .estimation import EstimatorError, estimator_error
from .messages import CHANNELS
from .series import Array, Floats, Integers, Run, missing_after, restarted
from .signals import Percentiles
from .walking import Segment, Walking, segments, walking

if TYPE_CHECKING:
    from .log import LogReport

PUSH_THRESHOLD = 1e-9  # N, of a push that counts as one
SLIP_WINDOW = 0.5  # s at the run's end: the least late of its states shows what real time has lost

STAGES = ("decode", "validate", "estimate", "plan", "model", "force_qp", "torque", "safety", "encode")
SAFETY_MODES = ("run", "hold", "damp", "stop")
FAULTS = (
    "state_stale",
    "state_invalid",
    "command_invalid",
    "qp_failed",
    "robot_fallen",
    "operator_stop",
    "torque_saturated",
    "joint_limit",
)
QP_STATUS = ("not_run", "solved", "max_iterations", "infeasible", "invalid_problem", "inaccurate")
QP_NOT_RUN, QP_SOLVED = 0, 1
REFUSALS = ("refused_stale", "refused_not_finite", "refused_order", "refused_run")


@dataclass(frozen=True)
class Trunk:
    tilt_max_deg: float
    """of the trunk's z axis from W's"""
    tilt_rms_deg: float
    height_min: float
    """m, of B over W's ground"""


@dataclass(frozen=True)
class CenterOfMass:
    """Distance [m] of the centre of mass from its reference."""

    error_max: float
    error_rms: float
    error_final: float


@dataclass(frozen=True)
class Miss:
    """One or more ticks in a row that did not happen on time."""

    at: float
    """s"""
    ticks: int
    wake_latency_us: float
    tick_us: float
    cause: str


@dataclass(frozen=True)
class Ticks:
    count: int
    missed: int
    missed_share: float
    """missed of all that were due"""
    without_new_state: int
    without_new_state_share: float
    """of all ticks"""
    dropped_states: int
    """that a later one replaced before a tick took them"""
    lockstep: bool
    slip: float | None
    """s, by which the states' stamps fell behind the logger's clock; None in lockstep"""
    misses: list[Miss]


@dataclass(frozen=True)
class Timing:
    """Times [us] by the wall clock; what only real time has is None in lockstep."""

    stage_us: dict[str, Percentiles | None]
    rest_us: Percentiles | None
    """of a tick outside its stages: publishing above all"""
    share: dict[str, float]
    """of each stage, and of `rest`, in the time of all ticks together"""
    tick_us: Percentiles | None
    cpu_us: Percentiles | None
    wake_latency_us: Percentiles | None
    period_jitter_us: Percentiles | None
    """|period - nominal|"""
    state_to_command_us: Percentiles | None
    """from the state's stamp to the published command"""
    slack_min_us: float | None
    period_us: float
    """nominal"""


@dataclass(frozen=True)
class ForceQp:
    status: dict[str, int]
    failures: int
    """ticks on which it ran and did not solve"""
    iterations: Percentiles | None
    primal_residual_max: float
    """N"""
    dual_residual_max: float
    """N, of the projected gradient"""
    active_max: int
    effort_mean: float
    """||f||_R"""
    effort_max: float


@dataclass(frozen=True)
class Friction:
    mu: float | None
    """that the controller plans with while it stands"""
    mu_walking: float | None
    """the same while it has a gait"""
    planned_share_max: float | None
    """max(|fx|, |fy|) / (mu fz) of planned forces: 1 is the edge of the cone"""
    true_ratio_max: float | None
    """tangential over normal of the contacts' true forces"""


@dataclass(frozen=True)
class ForceError:
    """Norm [N] of a foot's true force less the planned one."""

    rms: float
    max: float


@dataclass(frozen=True)
class JointUse:
    """Shares of a joint's limits: 1 is the limit. None where the URDF has none."""

    name: str
    torque_share_max: float | None
    speed_share_max: float | None
    position_share_max: float | None
    """of half its range, from the range's middle"""


@dataclass(frozen=True)
class Joints:
    torque_share_max: float | None
    speed_share_max: float | None
    position_share_max: float | None
    each: list[JointUse]


@dataclass(frozen=True)
class Push:
    start: float
    """s"""
    duration: float
    """s"""
    impulse_W: tuple[float, float, float]
    """N s"""
    force_max: float
    """N"""

    @property
    def impulse(self) -> float:
        """N s"""
        return float(np.linalg.norm(self.impulse_W))


@dataclass(frozen=True)
class SafetyChange:
    at: float
    """s"""
    mode: str


@dataclass(frozen=True)
class ChannelUse:
    name: str
    count: int
    rate_hz: float
    missing: int
    """messages that seq says were sent and the log lacks"""
    restarts: int


@dataclass(frozen=True)
class LogQuality:
    complete: bool
    """nothing skipped, nothing missing"""
    missing: int
    skipped_bytes: int
    problems: list[str]


@dataclass(frozen=True)
class Metrics:
    """The whole run. Sections are None where the log lacks their channel, or the robot has no such thing."""

    run_id: int
    duration: float
    """s"""
    fell: bool
    fell_at: float | None
    """s"""
    behaviour_final: str | None
    """what the robot does at the end, one of signals.BEHAVIOURS"""
    trunk: Trunk | None
    center_of_mass: CenterOfMass | None
    ticks: Ticks | None
    timing: Timing | None
    qp: ForceQp | None
    friction: Friction
    force_error: ForceError | None
    joints: Joints | None
    estimator: EstimatorError | None
    walking: Walking | None
    """None where the robot never had a gait"""
    segments: list[Segment]
    """between two user commands that want different things"""
    motions: list[Motion]
    """of the 3-joint arm"""
    catching: Catching | None
    """of the catcher"""
    pushes: list[Push]
    refused: dict[str, int]
    refused_total: int
    drives_damped: float | None
    """s"""
    drives_damped_share: float | None
    """of the run"""
    faults: dict[str, int]
    safety: list[SafetyChange]
    channels: list[ChannelUse]
    log: LogQuality | None = field(default=None)

    def as_dict(self) -> dict[str, Any]:
        """Plain data, for JSON and for limits."""
        return asdict(self)


def measure(run: Run, report: LogReport | None = None) -> Metrics:
    """All of it. `report` is the log's, for what could not be read."""
    fell_at = fall(run)
    refused = refusals(run)
    damped = run.field("TRUTH", "drives_damped") if "TRUTH" in run else None
    on_feet = not signals.on_fixed_base(run)
    return Metrics(
        run_id=run.run_id,
        duration=run.duration,
        fell=fell_at is not None,
        fell_at=fell_at,
        behaviour_final=behaviour_final(run),
        trunk=trunk(run) if on_feet else None,
        center_of_mass=center_of_mass(run) if on_feet else None,
        ticks=ticks(run),
        timing=timing(run),
        qp=force_qp(run) if on_feet else None,
        friction=friction(run),
        force_error=force_error(run),
        joints=joints(run),
        estimator=estimator_error(run) if on_feet else None,
        walking=walking(run) if on_feet else None,
        segments=segments(run) if on_feet else [],
        motions=motions(run),
        catching=catching(run),
        pushes=pushes(run),
        refused=refused,
        refused_total=sum(refused.values()),
        drives_damped=None if damped is None else float((damped != 0).sum() * signals.period(run)),
        drives_damped_share=None if damped is None else float((damped != 0).mean()),
        faults=faults(run),
        safety=safety(run),
        channels=channels(run),
        log=None if report is None else log_quality(run, report),
    )


def fall(run: Run) -> float | None:
    """s, when it fell: by the truth where it is logged, else by the controller's fault; None where it did not."""
    if "TRUTH" in run:
        down = run.field("TRUTH", "fallen") != 0
        time = run.time("TRUTH")
    elif "CONTROLLER_TRACE" in run:
        down = run.field("CONTROLLER_TRACE", "faults") & (1 << FAULTS.index("robot_fallen")) != 0
        time = run.time("CONTROLLER_TRACE")
    else:
        return None
    return float(time[np.argmax(down)]) if down.any() else None


def behaviour_final(run: Run) -> str | None:
    """What the robot does at the end."""
    if "CONTROLLER_TRACE" not in run:
        return None
    return signals.name_of(signals.BEHAVIOURS, int(run.field("CONTROLLER_TRACE", "behaviour")[-1]))


def trunk(run: Run) -> Trunk | None:
    """By the truth where it is logged, else by the controller's estimate."""
    channel = "TRUTH" if "TRUTH" in run else "CONTROLLER_TRACE"
    if channel not in run:
        return None
    angle = np.degrees(signals.tilt(run.field(channel, "quat_WB")))
    height = run.field(channel, "p_WB")[:, 2]
    return Trunk(float(angle.max()), signals.rms(angle), float(height.min()))


def center_of_mass_error(run: Run) -> tuple[Floats, Floats] | None:
    """(t [s], error [m] (n, 3)): the true centre of mass less its reference, else the estimated one less it."""
    if "CONTROLLER_TRACE" not in run:
        return None
    reference = run.field("CONTROLLER_TRACE", "x_ref")[:, 3:6]
    time = run.time("CONTROLLER_TRACE")
    if "TRUTH" not in run:
        return time, run.field("CONTROLLER_TRACE", "x")[:, 3:6] - reference
    rows, truth_rows = signals.truth_of_ticks(run)
    return time[rows], run.field("TRUTH", "p_WC")[truth_rows] - reference[rows]


def center_of_mass(run: Run) -> CenterOfMass | None:
    found = center_of_mass_error(run)
    if found is None or not len(found[1]):
        return None
    distance = np.linalg.norm(found[1], axis=1)
    return CenterOfMass(float(distance.max()), signals.rms(distance), float(distance[-1]))


def risen(run: Run, counter: str) -> Integers:
    """By how much a counter of CONTROLLER_TIMING rose before each message, (n,); not what it had before the run."""
    total = run.field("CONTROLLER_TIMING", counter)
    before = np.append(total[:1], total[:-1])
    before[(run.field("CONTROLLER_TIMING", "seq") == 1) | restarted(run.channels["CONTROLLER_TIMING"])] = 0
    return np.asarray(np.maximum(total - before, 0), np.int64)


def is_lockstep(run: Run) -> bool:
    """True where the simulator set the pace, so that no deadline is in the log."""
    return not any(
        run.field("CONTROLLER_TIMING", name).any() for name in ("wake_latency_us", "slack_us", "state_age_us")
    )


def slip(run: Run) -> float:
    """s, by which simulated time fell behind the logger's: where the machine stalls, the simulator slips whole periods.

    A state may be heard late but never early, so that the least late ones tell the two clocks' distance.
    """
    distance = run.channels["ROBOT_STATE"].received - run.field("ROBOT_STATE", "utime")
    at_the_end = run.time("ROBOT_STATE") >= run.span[1] - SLIP_WINDOW
    return float(distance[at_the_end].min() - distance.min()) * 1e-6


def ticks(run: Run) -> Ticks | None:
    if "CONTROLLER_TIMING" not in run:
        return None
    missed = risen(run, "missed_ticks")
    time = run.time("CONTROLLER_TIMING")
    late = run.field("CONTROLLER_TIMING", "wake_latency_us")
    took = run.field("CONTROLLER_TIMING", "tick_us")
    budget = 1e6 * signals.period(run)
    misses = []
    for row in np.flatnonzero(missed).tolist():
        before = float(took[row - 1]) if row else 0.0
        if late[row] + took[row] >= budget and took[row] > late[row]:
            cause = f"the tick took {took[row] / 1000:.1f} ms"
        elif before >= budget - late[row] and before > late[row]:
            cause = f"the tick before took {before / 1000:.1f} ms"
        else:
            cause = f"woke {late[row] / 1000:.1f} ms late: the machine ran something else"
        misses.append(Miss(float(time[row]), int(missed[row]), float(late[row]), float(took[row]), cause))
    lockstep = is_lockstep(run)
    count = run.count("CONTROLLER_TIMING")
    total = int(missed.sum())
    waiting = run.field("CONTROLLER_TRACE", "state_is_new") == 0 if "CONTROLLER_TRACE" in run else np.zeros(1, bool)
    return Ticks(
        count=count,
        missed=total,
        missed_share=total / (count + total),
        without_new_state=int(waiting.sum()),
        without_new_state_share=float(waiting.mean()),
        dropped_states=int(risen(run, "dropped_states").sum()),
        lockstep=lockstep,
        slip=None if lockstep else slip(run),
        misses=misses,
    )


def timing(run: Run) -> Timing | None:
    if "CONTROLLER_TIMING" not in run:
        return None
    nominal = 1e6 * signals.period(run)
    stages = run.field("CONTROLLER_TIMING", "stage_us")
    tick = run.field("CONTROLLER_TIMING", "tick_us")
    lockstep = is_lockstep(run)

    def real_time(values: Array) -> Percentiles | None:
        return None if lockstep else Percentiles.of(values)

    parts = tick_parts(run)
    total = parts.sum()
    return Timing(
        stage_us={name: Percentiles.of(stages[:, i]) for i, name in enumerate(STAGES)},
        rest_us=Percentiles.of(parts[:, -1]),
        share={
            name: float(spent / total) if total > 0.0 else 0.0
            for name, spent in zip((*STAGES, "rest"), parts.sum(axis=0), strict=True)
        },
        tick_us=Percentiles.of(tick),
        cpu_us=Percentiles.of(run.field("CONTROLLER_TIMING", "cpu_us")),
        wake_latency_us=real_time(run.field("CONTROLLER_TIMING", "wake_latency_us")),
        period_jitter_us=real_time(np.abs(run.field("CONTROLLER_TIMING", "period_us")[1:] - nominal)),
        state_to_command_us=real_time(run.field("CONTROLLER_TIMING", "state_age_us") + tick),
        slack_min_us=None if lockstep else float(run.field("CONTROLLER_TIMING", "slack_us").min()),
        period_us=nominal,
    )


def tick_parts(run: Run) -> Floats:
    """us, (n, stages + 1): of each tick its stages, and what they leave of it."""
    stages, tick = (run.field("CONTROLLER_TIMING", name) for name in ("stage_us", "tick_us"))
    return np.column_stack([stages, np.maximum(tick - stages.sum(axis=1), 0.0)])


def force_qp(run: Run) -> ForceQp | None:
    if "CONTROLLER_TRACE" not in run:
        return None
    status = run.field("CONTROLLER_TRACE", "qp_status")
    ran = status != QP_NOT_RUN
    effort = run.field("CONTROLLER_TRACE", "effort")[ran]

    def residual(name: str) -> float:
        values = run.field("CONTROLLER_TRACE", name)[ran]
        return float(values.max(initial=0.0)) if np.isfinite(values).all() else float("inf")

    return ForceQp(
        status={
            signals.name_of(QP_STATUS, value): int((status == value).sum()) for value in np.unique(status).tolist()
        },
        failures=int((ran & (status != QP_SOLVED)).sum()),
        iterations=Percentiles.of(run.field("CONTROLLER_TRACE", "qp_iterations")[ran]),
        primal_residual_max=residual("qp_primal_residual"),
        dual_residual_max=residual("qp_dual_residual"),
        active_max=int(run.field("CONTROLLER_TRACE", "qp_active").max(initial=0)),
        effort_mean=float(effort.mean()) if len(effort) else 0.0,
        effort_max=float(effort.max(initial=0.0)),
    )


def planned_forces(run: Run) -> tuple[Floats, Array]:
    """Stage 0 of every plan: (force [N] (n, contacts, 3) in W, contact (n, contacts) bool). nan without a plan."""
    used = signals.num_contacts(run)
    planned = (run.field("FORCE_PLAN", "num_stages") > 0)[:, None]
    force = np.where(planned[..., None], run.field("FORCE_PLAN", "force")[:, 0, :used], np.nan)
    return force, planned & (run.field("FORCE_PLAN", "contact")[:, 0, :used] != 0)


def has_a_gait(run: Run, channel: str) -> Array:
    """Whether the controller had a gait at each instant of a channel, (n,) bool.

    What TRUTH says is of the period that ended: of the tick before.
    """
    if "CONTROLLER_TRACE" not in run:
        return np.zeros(run.count(channel), bool)
    time = run.time("CONTROLLER_TRACE")
    order = np.argsort(time, kind="stable")
    tick = np.searchsorted(time[order], run.time(channel), side="left" if channel == "TRUTH" else "right") - 1
    return np.asarray(run.field("CONTROLLER_TRACE", "gait_phase")[order][np.maximum(tick, 0)] != signals.STANDING)


def friction_at(run: Run, channel: str) -> Floats:
    """mu that the controller plans with at each instant of a channel, (n,); nan where the log does not say."""
    mu = [configuration.friction(run, walking) for walking in (True, False)]
    walking, standing = (np.nan if one is None else one for one in mu)
    return np.where(has_a_gait(run, channel), walking, standing)


def cone_share(run: Run, channel: str, force: Array) -> Floats:
    """max(|fx|, |fy|) / (mu fz) of forces [N] (n, contacts, 3) in W of a channel's instants → (n, contacts).

    Of the force QP's friction pyramid, 1 is its edge: its sides are along the reference's heading while the robot
    stands, and along W's axes while it has a gait. nan where there is no load, or mu is not known.
    """
    yaw = np.zeros(1)
    if "CONTROLLER_TRACE" in run:
        time = run.time("CONTROLLER_TRACE")
        order = np.argsort(time, kind="stable")
        heading = np.unwrap(run.field("CONTROLLER_TRACE", "x_ref")[order, 2])
        yaw = np.where(has_a_gait(run, channel), 0.0, np.interp(run.time(channel), time[order], heading))
    cos, sin = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    along = np.abs(cos * force[..., 0] + sin * force[..., 1])
    across = np.abs(cos * force[..., 1] - sin * force[..., 0])
    return np.asarray(np.maximum(along, across) / (friction_at(run, channel)[:, None] * _loaded(force)))


def _loaded(force: Array) -> Floats:
    """N, normal components of forces (..., 3) → (...); nan where they are too small to divide by."""
    return np.asarray(np.where(force[..., 2] > signals.MIN_NORMAL_FORCE, force[..., 2], np.nan))


def friction_ratio(force: Array) -> Floats:
    """Tangential over normal of forces [N] (..., 3) → (...); nan where there is no load."""
    return np.asarray(np.hypot(force[..., 0], force[..., 1]) / _loaded(force))


def friction(run: Run) -> Friction:
    share = ratio = None
    if "FORCE_PLAN" in run:
        force, contact = planned_forces(run)
        share = signals.largest(np.where(contact, cone_share(run, "FORCE_PLAN", force), np.nan))
    if "TRUTH" in run:
        ratio = signals.largest(friction_ratio(run.field("TRUTH", "f_F_W")[:, : signals.num_contacts(run)]))
    return Friction(configuration.friction(run), configuration.friction(run, walking=True), share, ratio)


def force_error(run: Run) -> ForceError | None:
    if "TRUTH" not in run:
        return None
    compared = run.field("TRUTH", "plan_seq") > 0
    error = np.linalg.norm(run.field("TRUTH", "force_error")[compared, : signals.num_contacts(run)], axis=-1)
    return ForceError(signals.rms(error), float(error.max())) if error.size else None


def joint_shares(run: Run) -> tuple[Floats, dict[str, Floats], tuple[str, ...]] | None:
    """(t [s], {torque, speed, position: share of the limit (n, joints), nan without one}, joint names).

    By the truth where it is logged, else by the robot's own sensors. None where the log has no URDF.
    """
    body = configuration.robot(run)
    used = signals.num_joints(run)
    if body is None or not used:
        return None
    limits = body.moving[:used]
    if "TRUTH" in run:
        channel = "TRUTH"
        position, speed = run.field(channel, "joint_position"), run.field(channel, "joint_velocity")
    else:
        channel = "ROBOT_STATE"
        position, speed = run.field(channel, "joint_position")[:, -1], run.field(channel, "joint_velocity")[:, -1]
    torque = run.field(channel, "joint_torque")
    lower, upper = (np.array([getattr(joint, name) for joint in limits]) for name in ("lower", "upper"))
    bounded = np.isfinite(lower) & np.isfinite(upper) & (upper > lower)
    middle = np.where(bounded, lower + upper, 0.0) / 2
    half = np.where(bounded, upper - lower, np.nan) / 2

    def share(values: Array, limit: Array) -> Floats:
        return np.asarray(np.abs(values[:, :used]) / np.where(np.isfinite(limit) & (limit > 0.0), limit, np.nan))

    shares = {
        "torque": share(torque, np.array([joint.effort for joint in limits])),
        "speed": share(speed, np.array([joint.velocity for joint in limits])),
        "position": share(position[:, :used] - middle, half),
    }
    return run.time(channel), shares, tuple(joint.name for joint in limits)


def joints(run: Run) -> Joints | None:
    found = joint_shares(run)
    if found is None:
        return None
    _, shares, names = found
    each = [
        JointUse(name, *(signals.largest(shares[quantity][:, i]) for quantity in ("torque", "speed", "position")))
        for i, name in enumerate(names)
    ]
    worst = [signals.largest(shares[quantity]) for quantity in ("torque", "speed", "position")]
    return Joints(worst[0], worst[1], worst[2], each)


def pushes(run: Run) -> list[Push]:
    """The external forces on the base that the truth shows, one after the other."""
    if "TRUTH" not in run:
        return []
    force = run.field("TRUTH", "push_W")
    time = run.time("TRUTH")
    step = signals.period(run)
    found = []
    for first, last in signals.intervals(np.linalg.norm(force, axis=1) > PUSH_THRESHOLD):
        part = force[first : last + 1]
        impulse = part.sum(axis=0) * step
        found.append(
            Push(
                start=float(time[first] - step),  # the mean of a row is over the period that ends at its time
                duration=float((last + 1 - first) * step),
                impulse_W=(float(impulse[0]), float(impulse[1]), float(impulse[2])),
                force_max=float(np.linalg.norm(part, axis=1).max()),
            )
        )
    return found


def refusals(run: Run) -> dict[str, int]:
    """How many joint commands the simulator refused in all, by reason."""
    if "TRUTH" not in run:
        return {}
    return {name.removeprefix("refused_"): int(run.field("TRUTH", name)[-1]) for name in REFUSALS}


def faults(run: Run) -> dict[str, int]:
    """fault → ticks on which it stood, over the whole run, a controller that was started again included."""
    if "CONTROLLER_TRACE" not in run:
        return {}
    count = run.field("CONTROLLER_TRACE", "fault_count")
    last = np.append(np.flatnonzero(restarted(run.channels["CONTROLLER_TRACE"])) - 1, len(count) - 1)
    total = count[last].sum(axis=0)
    return {signals.name_of(FAULTS, i): int(value) for i, value in enumerate(total.tolist())}


def safety(run: Run) -> list[SafetyChange]:
    """The safety mode at the start and at each change."""
    if "CONTROLLER_TRACE" not in run:
        return []
    mode = run.field("CONTROLLER_TRACE", "safety")
    time = run.time("CONTROLLER_TRACE")
    rows = np.append(0, np.flatnonzero(np.diff(mode)) + 1)
    return [SafetyChange(float(time[row]), signals.name_of(SAFETY_MODES, int(mode[row]))) for row in rows]


def channels(run: Run) -> list[ChannelUse]:
    """Counts, rates and what is missing by seq, per channel of the run."""
    found = []
    for name in sorted(
        run, key=lambda channel: list(CHANNELS).index(channel) if channel in CHANNELS else len(CHANNELS)
    ):
        messages, utime = run.channels[name], run.field(name, "utime")
        span = float(utime[-1] - utime[0]) * 1e-6
        rate = (len(utime) - 1) / span if span > 0.0 else 0.0
        missing, restarts = int(missing_after(messages).sum()), int(restarted(messages).sum())
        found.append(ChannelUse(name, len(utime), rate, missing, restarts))
    return found


def log_quality(run: Run, report: LogReport) -> LogQuality:
    """What of the log file itself is amiss; what is missing, of this run alone."""
    problems = report.problems()
    missing = sum(use.missing for use in channels(run))
    return LogQuality(not problems, missing, report.skipped_bytes, problems)
