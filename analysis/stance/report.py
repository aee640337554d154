"""One file that says what a run was and how it went: report.html, with summary.json and the plots beside it."""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import jinja2
from matplotlib.figure import Figure

from . import __version__, configuration, plots, signals, style
from .arm3 import Motion
from .catcher import Catching, Throw
from .check import DIRECTORY, SHARE, Verdict, judge, limits_file, load_limits, quantity
from .errors import StanceError
from .log import Log
from .messages import CONTROLLER_CHANNELS
from .metrics import Metrics, Ticks, measure
from .plain import to_json
from .series import Run
from .signals import Percentiles, Spread
from .timeline import Event, timeline
from .walking import Segment, Walking

TAIL = ("p50", "p99", "p99.9", "max")
SCHEMA = {"schema": "stance.summary", "version": 1}
CARD = "summary_card"  # beside the report, not in it: its head and its verdict say the same
MAX_EVENTS = 400  # rows of the report's table of events
ESTIMATOR = DIRECTORY / "estimator.yaml"  # what is asked of it


@dataclass(frozen=True)
class Analysis:
    """A run, measured and judged."""

    run: Run
    metrics: Metrics
    verdict: Verdict
    events: list[Event]
    estimator: Verdict | None = None
    """its figures against what is asked of them on noisy sensors; None where the sensors had no noise"""

    def summary(self) -> dict[str, Any]:
        """What summary.json holds."""
        infos = {"simulator": self.run.simulator, "controller": self.run.controller}
        texts = ("urdf", "configuration", "scenario")
        return {
            **SCHEMA,
            "stance": __version__,
            "log": self.run.name,
            "programs": {
                name: {key: value for key, value in asdict(info).items() if key not in texts}
                for name, info in infos.items()
                if info is not None
            },
            "verdict": self.verdict.as_dict(),
            "metrics": self.metrics.as_dict(),
            "estimator_asked": None if self.estimator is None else self.estimator.as_dict(),
            "events": [asdict(event) for event in self.events],
        }


@dataclass(frozen=True)
class Written:
    """Where everything went."""

    report: Path
    summary: Path
    plots: Path


def analyse(log: Log, run_id: int | None = None, limits: Path | None = None) -> Analysis:
    """Measures and judges a run of a log; without `limits`, by the list of its robot and scenario.

    Raises UnreadableError where the log has no such run, and StanceError where the limits cannot be used.
    """
    run = log.run(run_id)
    # What the controller does once the robot has fallen silent for good is no part of the run; the truth ends later.
    run = run.between(None, run.span[1] + 0.5 * signals.period(run), CONTROLLER_CHANNELS)
    measured = measure(run, log.report)
    info = run.controller or run.simulator
    chosen = limits or limits_file(info.robot if info else "", configuration.scenario_name(run))
    figures = measured.as_dict()
    verdict = judge(figures, load_limits(chosen), chosen.name)
    asked = None
    if measured.estimator is not None and configuration.has_noisy_sensors(run):
        asked = judge(figures, load_limits(ESTIMATOR), ESTIMATOR.name)
    return Analysis(run, measured, verdict, timeline(run), asked)


def figures(analysis: Analysis) -> dict[str, Callable[[], Figure]]:
    """name → how to draw it: the summary card, and every plot that the log can give."""
    run = analysis.run
    found = {name: partial(plot.draw, run) for name, plot in plots.available(run).items()}
    return {CARD: partial(plots.summary_card, run, analysis.metrics, analysis.verdict), **found}


def write_plots(analysis: Analysis, directory: Path, only: list[str] | None = None, kind: str = "png") -> list[Path]:
    """Draws into `directory`: every plot, or those named. Raises StanceError where one is unknown."""
    available = figures(analysis)
    for name in only or []:
        if name not in available:
            raise StanceError(f"no plot {name!r} for this log: {', '.join(available)}")
    directory.mkdir(parents=True, exist_ok=True)
    written = []
    for name in only or available:
        path = directory / f"{name}.{kind}"
        path.write_bytes(style.render(available[name](), kind))
        written.append(path)
    return written


def write(analysis: Analysis, directory: Path) -> Written:
    """Writes report.html, summary.json and plots/ into `directory`."""
    images = write_plots(analysis, directory / "plots")
    summary = directory / "summary.json"
    summary.write_text(to_json(analysis.summary()) + "\n")
    report = directory / "report.html"
    report.write_text(render(analysis, {path.stem: path.read_bytes() for path in images if path.stem != CARD}))
    return Written(report, summary, directory / "plots")


def render(analysis: Analysis, images: dict[str, bytes]) -> str:
    """The report as one HTML page; `images` are PNG by plot name."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("stance"), autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True
    )
    embedded = {
        plots.PLOTS[name].title: "data:image/png;base64," + base64.b64encode(data).decode("ascii")
        for name, data in images.items()
    }
    return environment.get_template("report.html.j2").render(
        analysis=analysis,
        run=analysis.run,
        metrics=analysis.metrics,
        verdict=analysis.verdict,
        title=configuration.title(analysis.run),
        tables=tables(analysis.metrics, analysis.estimator),
        events=analysis.events[:MAX_EVENTS],
        hidden_events=max(len(analysis.events) - MAX_EVENTS, 0),
        images=embedded,
        version=__version__,
    )


@dataclass(frozen=True)
class Table:
    title: str
    head: list[str]
    rows: list[list[str]]
    shares: list[float] | None = None
    """of 1, a bar in each row"""


def tables(metrics: Metrics, estimator: Verdict | None = None) -> list[Table]:
    """The metrics for people, in the order of the report; `estimator`: its figures against what is asked of them."""
    found = [Table("Motion", ["figure", "value"], _motion(metrics))]
    if metrics.walking is not None:
        found.append(Table("Walking", ["figure", "value"], _walking(metrics.walking)))
        head = ["command", "wanted", "walked", "straight way", "steps", "cost of transport"]
        found.append(Table("Walking by command", head, [_segment(one) for one in metrics.segments]))
    for number, motion in enumerate(metrics.motions, 1):
        found.append(Table(f"Motion {number}: {motion.behaviour}", ["figure", "value"], _arm_motion(motion)))
    if metrics.catching is not None:
        found.append(Table("Catching", ["figure", "value"], _catching(metrics.catching)))
        head = ["throw", "at", "verdict", "crossed the cup's plane", "in the cup for 0.5 s"]
        rows = [
            [f"{one.number}", quantity(one.time, "s"), one.verdict, _crossing(one), "yes" if one.retained else "no"]
            for one in metrics.catching.throws
        ]
        found.append(Table("Throws", head, rows))
    if estimator is not None:
        marks = {True: "✓", False: "✗"}
        rows = [
            [f"{marks[one.passed] if one.value is not None else '·'} {one.limit.name}", one.measured, one.limit.rule]
            for one in estimator.findings
        ]
        found.append(Table("Estimator on noisy sensors, rms", ["figure", "measured", "asked"], rows))
    if metrics.ticks is not None:
        found.append(Table("Ticks", ["figure", "value"], _ticks(metrics.ticks)))
    if metrics.timing is not None:
        timing = metrics.timing
        rows = [
            _percentile_row("tick, wake-up to published", timing.tick_us),
            _percentile_row("CPU time of the tick", timing.cpu_us),
            _percentile_row("wake-up after the deadline", timing.wake_latency_us),
            _percentile_row("|period less nominal|", timing.period_jitter_us),
            _percentile_row("state's stamp to command", timing.state_to_command_us),
        ]
        found.append(Table("Time [µs]", ["quantity", *TAIL], [row for row in rows if row]))
        parts = {**timing.stage_us, "rest": timing.rest_us}
        rows = [[*_percentile_row(name, parts[name]), quantity(share, SHARE)] for name, share in timing.share.items()]
        head = ["stage", *TAIL, "of all ticks"]
        found.append(Table("Where a tick's time goes [µs]", head, rows, list(timing.share.values())))
    if metrics.qp is not None:
        found.append(Table("Force QP", ["figure", "value"], _force_qp(metrics)))
    if metrics.joints is not None:
        rows = [
            [use.name, *map(_percent, (use.torque_share_max, use.speed_share_max, use.position_share_max))]
            for use in metrics.joints.each
        ]
        found.append(Table("Joints: largest share of the limit", ["joint", "torque", "speed", "position"], rows))
    channels = [
        [use.name, f"{use.count}", f"{use.rate_hz:.1f}", f"{use.missing}", f"{use.restarts}"]
        for use in metrics.channels
    ]
    found.append(Table("Channels", ["channel", "messages", "rate [Hz]", "missing", "restarts"], channels))
    counts = [[f"fault: {name.replace('_', ' ')}", f"{count}"] for name, count in metrics.faults.items()]
    counts += [[f"command refused: {name.replace('_', ' ')}", f"{n}"] for name, n in metrics.refused.items()]
    found.append(Table("Counts", ["what", "ticks or messages"], counts))
    return [table for table in found if table.rows]


def _motion(metrics: Metrics) -> list[list[str]]:
    rows: list[tuple[str, float | None, str]] = [("duration", metrics.duration, "s")]
    if metrics.trunk is not None:
        rows.append(("trunk tilt, largest", metrics.trunk.tilt_max_deg, "deg"))
        rows.append(("trunk tilt, rms", metrics.trunk.tilt_rms_deg, "deg"))
        rows.append(("trunk height, least", metrics.trunk.height_min, "m"))
    if metrics.center_of_mass is not None:
        rows.append(("centre of mass from its reference, largest", metrics.center_of_mass.error_max, "m"))
        rows.append(("centre of mass from its reference, rms", metrics.center_of_mass.error_rms, "m"))
    if metrics.force_error is not None:
        rows.append(("true less planned force, rms", metrics.force_error.rms, "N"))
        rows.append(("true less planned force, largest", metrics.force_error.max, "N"))
    friction = metrics.friction
    rows.append(("friction cone used by the plan", friction.planned_share_max, SHARE))
    rows.append(("tangential over normal force, true, largest", friction.true_ratio_max, ""))
    if metrics.estimator is not None:
        rows.append(("estimated position, error rms", metrics.estimator.position_rms, "m"))
        rows.append(("estimated position, drift", metrics.estimator.position_drift, "m"))
        rows.append(("estimated velocity, error rms", metrics.estimator.velocity_rms, "m/s"))
        rows.append(("estimated tilt, largest error", metrics.estimator.tilt_max_deg, "deg"))
    rows.append(("drives damped", metrics.drives_damped, "s"))
    return _told(rows)


def _walking(found: Walking) -> list[list[str]]:
    def spread(of: Spread | None, unit: str) -> str | None:
        if of is None:
            return None
        least, most = quantity(of.min, unit), quantity(of.max, unit)
        return f"{quantity(of.mean, unit)} ± {quantity(of.std, unit)} ({least} to {most})"

    def tail(of: Percentiles | None) -> str | None:
        return None if of is None else " / ".join(quantity(value, "m") for value in (of.p50, of.p99, of.max))

    got_over = ", ".join(
        f"{count} of them {what}"
        for count, what in ((found.recovering, "getting over a push"), (found.crossing, "crossing over"))
        if count
    )
    cost = found.cost_of_transport
    rows: list[tuple[str, str | None]] = [
        ("steps", f"{found.steps}{', ' if got_over else ''}{got_over}"),
        ("way", quantity(found.distance, "m")),
        ("cost of transport, joints' |work| over weight and way", None if cost is None else quantity(cost, "")),
        ("step time, mean ± std (range)", spread(found.step_time, "s")),
        ("swing time", spread(found.swing_time, "s")),
        ("swing time less planned at lift-off", spread(found.swing_time_change, "s")),
        ("foothold reached less planned, forward", spread(found.foothold_forward, "m")),
        ("the same, left", spread(found.foothold_left, "m")),
        ("the same, length, p50 / p99 / max", tail(found.foothold_error)),
        ("foothold's plan from lift-off to touchdown, p50 / p99 / max", tail(found.foothold_change)),
        ("swing foot from its reference, p50 / p99 / max", tail(found.swing_error)),
        ("slip of a stance, true, p50 / p99 / max", tail(found.slip)),
    ]
    return [[name, value] for name, value in rows if value is not None]


def _told(rows: Sequence[tuple[str, float | None, str]]) -> list[list[str]]:
    """Name, figure and unit for people; figures that there are not are left out."""
    return [[name, quantity(value, unit)] for name, value, unit in rows if value is not None]


def _arm_motion(of: Motion) -> list[list[str]]:
    rows: list[tuple[str, float | None, str]] = [
        ("begins at", of.start, "s"),
        ("steps", of.steps, ""),
        ("joint from its reference, largest", of.error_max, "rad"),
        ("joint from its reference, rms", of.error_rms, "rad"),
        ("end effector from its reference, largest", of.tool_error_max, "m"),
        ("calculated less given joint rate, largest", of.rate_error_max, "rad/s"),
        ("map less forward kinematics after 600 steps", of.map_error_at_600, "m"),
        ("map less forward kinematics after the last step", of.map_error_final, "m"),
        ("orthonormality of the map, largest defect", of.orthonormality_max, ""),
    ]
    return _told(rows)


def _catching(of: Catching) -> list[list[str]]:
    rows: list[tuple[str, float | None, str]] = [
        ("throws that crossed the cup's plane as asked", of.crossed, "share"),
        ("throws that stayed in the cup", of.retained, "share"),
        ("estimated ball from the true one, rms", of.ball_error_rms, "m"),
        ("NIS of its observations per degree of freedom, mean", of.nis, ""),
        ("joint from its reference, largest", of.joint_error_max, "rad"),
        ("cup from its reference, largest", of.cup_error_max, "m"),
    ]
    return _told(rows)


def _crossing(one: Throw) -> str:
    if one.crossing_offset is None or one.crossing_angle_deg is None:
        return "no"
    return f"{quantity(one.crossing_offset, 'm')} from the axis, at {quantity(one.crossing_angle_deg, 'deg')}"


def _segment(one: Segment) -> list[str]:
    def motion(velocity: tuple[float, float], yaw_rate: float) -> str:
        return f"({velocity[0]:+.2f}, {velocity[1]:+.2f}) m/s, {yaw_rate:+.2f} rad/s".replace("-", style.MINUS)

    return [
        f"{one.start:.2f} to {one.end:.2f} s, {one.behaviour.replace('_', ' ')}",
        motion(one.wanted_velocity, one.wanted_yaw_rate),
        motion(one.velocity, one.yaw_rate),
        quantity(one.distance, "m"),
        f"{one.steps}",
        "-" if one.cost_of_transport is None else quantity(one.cost_of_transport, ""),
    ]


def _ticks(ticks: Ticks) -> list[list[str]]:
    return [
        ["ticks", f"{ticks.count}"],
        ["deadlines missed", f"{ticks.missed}"],
        ["ticks without a new state", f"{ticks.without_new_state}"],
        ["states that a later one replaced before a tick", f"{ticks.dropped_states}"],
        ["simulated time lost to stalls", "lockstep" if ticks.slip is None else f"{ticks.slip:.2f} s"],
    ]


def _force_qp(metrics: Metrics) -> list[list[str]]:
    assert metrics.qp is not None
    qp = metrics.qp
    rows = [[f"ticks {name.replace('_', ' ')}", f"{count}"] for name, count in qp.status.items()]
    if qp.iterations is not None:
        iterations = asdict(qp.iterations).values()
        rows.append(["iterations, p50 / p99 / p99.9 / max", " / ".join(f"{value:.0f}" for value in iterations)])
    rows.append(["primal residual, largest", f"{qp.primal_residual_max:.2e} N"])
    rows.append(["dual residual, largest", f"{qp.dual_residual_max:.2e} N"])
    rows.append(["active constraints, most", f"{qp.active_max}"])
    rows.append(["effort ‖f‖_R, mean / largest", f"{qp.effort_mean:.2f} / {qp.effort_max:.2f}"])
    return rows


def _percentile_row(name: str, found: Percentiles | None) -> list[str]:
    if found is None:
        return []
    return [name, *(f"{value:,.1f}" for value in (found.p50, found.p99, found.p99_9, found.max))]


def _percent(value: float | None) -> str:
    return "no limit" if value is None else quantity(value, SHARE)
