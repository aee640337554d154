"""One file that says what a run was and how it went: report.html, with summary.json and the plots beside it."""

from __future__ import annotations

import base64
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import jinja2
from matplotlib.figure import Figure

from . import __version__, configuration, plots, signals, style
from .check import SHARE, Verdict, judge, limits_file, load_limits, quantity
from .errors import StanceError
from .log import Log
from .messages import CONTROLLER_CHANNELS
from .metrics import Metrics, Ticks, measure
from .plain import to_json
from .series import Run
from .signals import Percentiles
from .timeline import Event, timeline

SCHEMA = {"schema": "stance.summary", "version": 1}
CARD = "summary_card"  # beside the report, not in it: its head and its verdict say the same
MAX_EVENTS = 400  # rows of the report's table of events


@dataclass(frozen=True)
class Analysis:
    """A run, measured and judged."""

    run: Run
    metrics: Metrics
    verdict: Verdict
    events: list[Event]

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
    verdict = judge(measured.as_dict(), load_limits(chosen), chosen.name)
    return Analysis(run, measured, verdict, timeline(run))


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
        tables=tables(analysis.metrics),
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


def tables(metrics: Metrics) -> list[Table]:
    """The metrics for people, in the order of the report."""
    found = [Table("Motion", ["figure", "value"], _motion(metrics))]
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
        rows += [_percentile_row(f"stage {name}", found) for name, found in timing.stage_us.items()]
        found.append(Table("Time [µs]", ["quantity", "p50", "p99", "p99.9", "max"], [row for row in rows if row]))
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
    return [[name, quantity(value, unit)] for name, value, unit in rows if value is not None]


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
        rows.append(["iterations, p50 / p99 / max", " / ".join(f"{value:.0f}" for value in _three(qp.iterations))])
    rows.append(["primal residual, largest", f"{qp.primal_residual_max:.2e} N"])
    rows.append(["dual residual, largest", f"{qp.dual_residual_max:.2e} N"])
    rows.append(["active constraints, most", f"{qp.active_max}"])
    rows.append(["effort ‖f‖_R, mean / largest", f"{qp.effort_mean:.2f} / {qp.effort_max:.2f}"])
    return rows


def _three(found: Percentiles) -> tuple[float, float, float]:
    return found.p50, found.p99, found.max


def _percentile_row(name: str, found: Percentiles | None) -> list[str]:
    if found is None:
        return []
    return [name, *(f"{value:,.1f}" for value in (found.p50, found.p99, found.p99_9, found.max))]


def _percent(value: float | None) -> str:
    return "no limit" if value is None else quantity(value, SHARE)
