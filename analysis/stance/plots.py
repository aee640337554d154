"""The plots of a run: each function takes a `Run` and returns a matplotlib Figure; nothing is shown or saved here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator
from scipy.stats import chi2

from . import arm3, catcher, configuration, estimation, metrics, signals, style, walking
from .arm_plots import joint_rates, tracking, way
from .catcher_plots import ball, catches
from .check import Verdict
from .gait_plots import footholds, gait, maps, swing, velocity
from .metrics import Metrics
from .picture import drawable, picture
from .plain import counted
from .series import Array, Floats, Run
from .signals import Percentiles
from .style import new_figure, shade, stance_bars, styled, time_axis
from .walk_picture import walk, walks

WIDTH = 11.0  # inch
FAR = 1.0  # m, a way that is not drawn in mm any more
PARTS = (*metrics.STAGES, "publish, rest")  # of a tick: its stages, and what they leave of it
TAIL = ((0.5, "p50"), (0.01, "p99"), (0.001, "p99.9"))  # share of ticks above → name


@styled
def summary_card(run: Run, measured: Metrics, verdict: Verdict | None = None) -> Figure:
    """1: what came out, at a glance: the verdict, what ran, and how much of each limit was used."""
    findings = verdict.findings if verdict is not None else []
    rows = max(len(findings), 9)
    height = 1.9 + 0.26 * rows
    fig = Figure(figsize=(WIDTH, height))
    ax = fig.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_axis_off()
    ax.set_xlim(0.0, WIDTH)
    ax.set_ylim(height, 0.0)

    passed = verdict.passed if verdict is not None else not measured.fell
    colour = style.GOOD if passed else style.BAD
    ax.add_patch(Rectangle((0.0, 0.0), WIDTH, 1.15, color=colour, lw=0))
    word = "PASS" if passed else "FAIL"
    ax.text(0.35, 0.58, word, fontsize=30, fontweight="bold", color="white", va="center")
    outcome = f"{'ran' if signals.on_fixed_base(run) else 'stood'} {run.duration:.1f} s"
    if measured.motions:
        outcome = f"{counted(len(measured.motions), 'motion')} in {run.duration:.1f} s"
    elif measured.catching is not None:
        caught = sum(one.verdict == "caught" for one in measured.catching.throws)
        outcome = f"{caught} of {counted(len(measured.catching.throws), 'ball')} caught in {run.duration:.1f} s"
    elif measured.fell_at is not None:
        outcome = f"fell after {measured.fell_at:.2f} s"
    elif measured.walking is not None:
        outcome = (
            f"{counted(measured.walking.steps, 'step')}, {measured.walking.distance:.1f} m in {run.duration:.1f} s"
        )
    ax.text(2.25, 0.40, f"{configuration.title(run)}: {outcome}", fontsize=15, color="white", va="center")
    kept = (
        f"{len(findings) - len(verdict.violated) - len(verdict.slow)} of {len(findings)} limits kept"
        if verdict is not None
        else ""
    )
    pushes = ", ".join(style.push_text(push) for push in measured.pushes[:4]) or "no push"
    if signals.on_fixed_base(run):
        pushes = ""
    ax.text(2.25, 0.80, "   ".join(filter(None, (pushes, kept))), fontsize=9.5, color="white", va="center", alpha=0.95)

    y = 1.5
    for name, text in _run_facts(run, measured):
        ax.text(0.35, y, name, fontsize=8.5, color=style.MUTED, va="center")
        ax.text(1.55, y, text, fontsize=8.5, va="center", family="DejaVu Sans")
        y += 0.26
    left, bar, right = 5.1, 8.15, 10.65
    ax.text(left, 1.36, "limit", fontsize=8, color=style.MUTED, va="bottom")
    ax.text(bar - 0.15, 1.36, "measured", fontsize=8, color=style.MUTED, va="bottom", ha="right")
    ax.text(bar, 1.36, "share of the limit used", fontsize=8, color=style.MUTED, va="bottom")
    for place, finding in enumerate(findings):
        y = 1.5 + 0.26 * place
        ink = style.INK if finding.passed else style.BAD
        mark = "·" if finding.value is None else "✓" if finding.passed else "✗"
        ax.text(left - 0.22, y, mark, fontsize=10, color=style.GOOD if finding.passed else style.BAD, va="center")
        ax.text(left, y, finding.limit.name, fontsize=8.5, va="center", color=ink)
        ax.text(bar - 0.15, y, finding.measured, fontsize=8.5, va="center", ha="right", color=ink)
        _limit_bar(ax, finding.limit.bound, finding.limit.value, finding.value, (bar, right - 1.05), y, finding.passed)
        ax.text(right, y, finding.limit.rule, fontsize=8, va="center", ha="right", color=style.MUTED)
    return fig


def _limit_bar(
    ax: Axes, bound: str, limit: float | bool | str, value: object, span: tuple[float, float], y: float, passed: bool
) -> None:
    """A bar for how much of a limit was used; none where the limit is 0 or no number."""
    numbers = [part for part in (limit, value) if isinstance(part, int | float) and not isinstance(part, bool)]
    if len(numbers) < 2 or not limit:
        return
    used = numbers[1] / numbers[0] if bound == "max" else numbers[0] / numbers[1] if numbers[1] else 1.0
    width = span[1] - span[0]
    ax.add_patch(Rectangle((span[0], y - 0.055), width, 0.11, color=style.GRID, lw=0))
    colour = style.BAD if not passed else style.PUSH if used > 0.8 else style.GOOD
    ax.add_patch(Rectangle((span[0], y - 0.055), width * float(np.clip(used, 0.0, 1.0)), 0.11, color=colour, lw=0))


def _run_facts(run: Run, measured: Metrics) -> list[tuple[str, str]]:
    facts = [("run", f"{measured.run_id}")]
    for name, info in (("simulator", run.simulator), ("controller", run.controller)):
        if info is not None:
            facts.append((name, f"{info.program} {info.version}"))
            facts.append(("", f"{info.source}, {info.build}"))
    seed = run.simulator.seed if run.simulator is not None else configuration.run_option(run, "--seed")
    if seed is not None:
        facts.append(("seed", str(seed)))
    info = run.controller or run.simulator
    if info is not None:
        facts.append(("input hash", info.input_hash))
    found = measured.ticks
    if found is not None:
        facts.append(("clock", "lockstep" if found.slip is None else f"real time, {found.slip:.2f} s lost to stalls"))
        facts.append(("ticks", f"{found.count}, missed {found.missed}, without a new state {found.without_new_state}"))
        for miss in found.misses[:4]:
            facts.append(("", f"{miss.ticks} at {miss.at:.2f} s: {miss.cause.partition(':')[0]}"))
        if len(found.misses) > 4:
            facts.append(("", f"and {len(found.misses) - 4} more times"))
    if measured.timing is not None and measured.timing.tick_us is not None:
        tick = measured.timing.tick_us
        facts.append(("tick time", f"p50 {tick.p50:.0f}, p99 {tick.p99:.0f}, max {tick.max:.0f} µs"))
    if measured.log is not None:
        whole = "complete" if measured.log.complete else counted(len(measured.log.problems), "remark")
        facts.append(("log", whole))
    return facts


@styled
def timing(run: Run) -> Figure:
    """2: the tick's period and the time of each stage: series, histogram, and tail against the deadline."""
    fig = new_figure(WIDTH, 8.2, "Tick period and time per stage", configuration.title(run))
    lockstep = metrics.is_lockstep(run)
    time = run.time("CONTROLLER_TIMING")
    stage = metrics.tick_parts(run)
    tick = run.field("CONTROLLER_TIMING", "tick_us")
    deadline = 1e6 * signals.period(run)
    axes = fig.subplot_mosaic(
        [["period", "period"], ["stages", "stages"], ["histogram", "tail"], ["bars", "tail"]],
        height_ratios=[1.0, 1.25, 1.1, 1.5],
        width_ratios=[1.0, 1.1],
    )

    ax = axes["period"]
    period = run.field("CONTROLLER_TIMING", "period_us")
    if lockstep:
        ax.plot(time, period / 1000, color=style.TRUTH, lw=0.6)
        ax.set_title("Wall time between ticks (lockstep: the simulator sets the pace)")
        ax.set_ylabel("period [ms]")
    else:
        ax.plot(time[1:], (period[1:] - deadline) / 1000, color=style.TRUTH, lw=0.6)
        ax.set_ylabel("deviation [ms]")
        missed = metrics.risen(run, "missed_ticks")
        rows = np.flatnonzero(missed)
        ax.plot(time[rows], (period[rows] - deadline) / 1000, "v", color=style.BAD, ms=5)
        told = f"{missed.sum()} missed, marked" if len(rows) else "none missed"
        ax.set_title(f"Tick period less its nominal {deadline / 1000:g} ms: {told}")
    shade(ax, run, label=True)

    ax = axes["stages"]
    ax.stackplot(time, stage.T, colors=style.STAGES, labels=PARTS, lw=0)
    ax.set_title("Where each tick's time goes")
    ax.set_ylabel("wall time [µs]")
    top = float(np.percentile(tick, 99.5)) * 1.35
    ax.set_ylim(0.0, max(top, 1.0))
    above = int((tick > top).sum())
    note = f"deadline at {deadline:,.0f} µs" + (f"; beyond this axis: {counted(above, 'tick')}" if above else "")
    ax.text(0.995, 0.97, note, transform=ax.transAxes, ha="right", va="top", fontsize=7.5, color=style.MUTED)
    handles, labels = ax.get_legend_handles_labels()
    ax.legend(handles[::-1], labels[::-1], loc="center left", bbox_to_anchor=(1.0, 0.5), labelspacing=0.25)
    shade(ax, run)
    time_axis([axes["period"], ax], run)

    quantities: list[tuple[str, Array, str]] = [("tick, wake-up to published", tick, style.TRUTH)]
    if not lockstep:
        late = run.field("CONTROLLER_TIMING", "wake_latency_us")
        quantities.append(("wake-up after the deadline", late, style.ESTIMATE))
        jitter = np.abs(period[1:] - deadline)
        quantities.append(("|period less nominal|", jitter, style.SERIES[2]))
        age = run.field("CONTROLLER_TIMING", "state_age_us") + tick
        quantities.append(("state's stamp to command", age, style.SERIES[3]))

    ax = axes["histogram"]
    positive = np.concatenate([values[values > 0] for _, values, _ in quantities])
    edges = np.geomspace(max(positive.min(), 1.0), positive.max() * 1.1, 70) if len(positive) else np.ones(2)
    bins = edges.tolist()
    for name, values, colour in quantities:
        ax.hist(values, bins, histtype="stepfilled", fc=(colour, 0.25), ec=colour, lw=1.0, label=name)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_ylim(0.7, None)
    ax.axvline(deadline, color=style.BAD, lw=1.0, ls=(0, (4, 2)))
    ax.set_title("Histogram")
    ax.legend(loc="lower left", bbox_to_anchor=(0.24, 1.0), ncols=2, fontsize=7.0, columnspacing=1.0)
    ax.set_xlabel("time [µs]")
    ax.set_ylabel("ticks")

    _tail(axes["tail"], quantities, deadline)
    _stage_bars(axes["bars"], stage)
    return fig


def _tail(ax: Axes, quantities: list[tuple[str, Array, str]], deadline: float) -> None:
    """Complementary CDF: what share of ticks took longer, with p50, p99, p99.9 and max marked."""
    lowest = 1.0
    for name, values, colour in quantities:
        ordered = np.sort(values)
        count = len(ordered)
        above = 1.0 - np.arange(count) / count
        lowest = min(lowest, above[-1])
        found = Percentiles.of(values)
        assert found is not None
        ax.step(ordered, above, where="post", color=colour, lw=1.3)
        marks = [(found.p50, 0.5), (found.p99, 0.01), (found.p99_9, 0.001), (found.max, above[-1])]
        shown = [(x, y) for x, y in marks if y >= above[-1]]
        ax.plot(*zip(*shown, strict=True), "o", color=colour, ms=4.5, mec="white", mew=0.7)
        numbers = " / ".join(f"{value:,.0f}" for value in (found.p50, found.p99, found.p99_9, found.max))
        ax.plot([], [], "o-", color=colour, ms=4.5, mec="white", mew=0.7, label=f"{name}\n{numbers}")
    ax.axvline(deadline, color=style.BAD, lw=1.0, ls=(0, (4, 2)))
    ax.annotate(
        "deadline",
        (deadline, 0.0),
        xycoords=("data", "axes fraction"),
        xytext=(-3, 4),
        textcoords="offset points",
        ha="right",
        fontsize=7.5,
        color=style.BAD,
    )
    for share, name in TAIL:
        if share >= lowest:
            ax.axhline(share, color=style.FAINT, lw=0.7, zorder=0)
            ax.annotate(
                name,
                (0.0, share),
                xycoords=("axes fraction", "data"),
                xytext=(3, 2),
                textcoords="offset points",
                fontsize=7.5,
                color=style.MUTED,
            )
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_ylim(lowest * 0.6, 1.3)
    ax.set_xlim(max(1.0, ax.get_xlim()[0]), None)
    ax.set_xlabel("time [µs]")
    ax.set_ylabel("share of ticks that took longer")
    ax.set_title("Tail: p50 / p99 / p99.9 / max [µs]")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2, labelspacing=0.6)


def _stage_bars(ax: Axes, stage: Array) -> None:
    for place in range(len(PARTS)):
        found = Percentiles.of(stage[:, place])
        if found is None or found.max <= 0.0:
            continue
        y = len(PARTS) - 1 - place
        colour = style.STAGES[place]
        low = max(found.p50, 0.1)
        ax.plot([low, max(found.max, low)], [y, y], color=colour, lw=5, alpha=0.35, solid_capstyle="butt")
        ax.plot(low, y, "o", color=colour, ms=6, mec=style.INK, mew=0.6)
        ax.plot([max(found.p99, 0.1)], [y], "|", color=style.INK, ms=9, mew=1.2)
        ax.plot([max(found.p99_9, 0.1)], [y], "|", color=style.MUTED, ms=9, mew=1.2)
        ax.annotate(
            f"{found.p50:,.1f} / {found.p99:,.1f} / {found.p99_9:,.0f} / {found.max:,.0f}",
            (max(found.max, 0.1), y),
            xytext=(5, 0),
            textcoords="offset points",
            va="center",
            fontsize=7.5,
            color=style.MUTED,
        )
    ax.set_yticks(range(len(PARTS)), PARTS[::-1])
    ax.set_xscale("log")
    low, high = ax.get_xlim()
    ax.set_xlim(max(low, 0.05), high * 25)
    ax.set_ylim(-0.7, len(PARTS) - 0.3)
    ax.set_xlabel("time [µs]")
    ax.set_title("Each stage: p50 / p99 / p99.9 / max [µs]")
    ax.grid(axis="y", visible=False)


@styled
def center_of_mass(run: Run) -> Figure:
    """3: centre of mass and trunk against their reference: planned, estimated and true."""
    fig = new_figure(WIDTH, 6.6, "Centre of mass and base against reference", configuration.title(run))
    axes = fig.subplots(3, 2, sharex=True)
    time = run.time("CONTROLLER_TRACE")
    x, reference = run.field("CONTROLLER_TRACE", "x"), run.field("CONTROLLER_TRACE", "x_ref")
    truth_time = run.time("TRUTH") if "TRUTH" in run else None
    for row, name in enumerate("xyz"):
        ax = axes[row, 0]
        place = x[:, 3 + row]
        scale, unit = (1.0, "m") if float(np.ptp(place)) > FAR else (1000.0, "mm")  # nan is not far
        if truth_time is not None:
            ax.plot(truth_time, scale * run.field("TRUTH", "p_WC")[:, row], color=style.TRUTH, lw=1.8, label="true")
        ax.plot(time, scale * place, color=style.ESTIMATE, lw=0.9, label="estimated")
        ax.plot(time, scale * reference[:, 3 + row], color=style.REFERENCE, lw=1.0, ls=(0, (5, 2)), label="reference")
        ax.set_ylabel(f"{name} [{unit}]")
        style.at_least(ax, 0.004 * scale)
    axes[0, 0].set_title("Centre of mass $p_{WC}$")
    for row, angle in enumerate(("roll", "pitch", "yaw")):
        ax = axes[row, 1]
        if truth_time is not None:
            true = np.unwrap(signals.roll_pitch_yaw(run.field("TRUTH", "quat_WB"))[:, row])
            ax.plot(truth_time, np.degrees(true), color=style.TRUTH, lw=1.8)
        ax.plot(time, np.degrees(x[:, row]), color=style.ESTIMATE, lw=0.9)
        ax.plot(time, np.degrees(reference[:, row]), color=style.REFERENCE, lw=1.0, ls=(0, (5, 2)))
        ax.set_ylabel(f"{angle} [°]")
        style.at_least(ax, 0.5)
    axes[0, 1].set_title("Trunk's orientation")
    for column in range(2):
        shade(list(axes[:, column]), run, label=column == 0)
        stance_bars(axes[2, column], run)
        time_axis(list(axes[:, column]), run)
    axes[0, 1].legend(*axes[0, 0].get_legend_handles_labels(), loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)
    return fig


@styled
def forces(run: Run) -> Figure:
    """4: forces of the ground on each foot, planned and true, their share of the friction cone, and the effort."""
    fig = new_figure(WIDTH, 8.6, "Ground reaction forces", configuration.title(run))
    used = signals.num_contacts(run)
    halves = [slice(0, (used + 1) // 2), slice((used + 1) // 2, used)] if used > 1 else [slice(0, 1)] * 2
    rows = 5 if used > 1 else 6
    grid = fig.add_gridspec(rows, used)
    axes = np.array([[fig.add_subplot(grid[row, foot]) for foot in range(used)] for row in range(4)])
    for row in range(4):
        for foot in range(1, used):
            axes[row, foot].sharey(axes[row, 0])
            axes[row, foot].tick_params(labelleft=False)
    below = [fig.add_subplot(grid[4, halves[0]]), fig.add_subplot(grid[rows - 1, halves[1]])]
    # A plan is for the period that begins with its tick, the truth is the mean of the period that ended: steps, both.
    if "FORCE_PLAN" in run:
        time, (planned, contact) = run.time("FORCE_PLAN"), metrics.planned_forces(run)
        share = metrics.cone_share(run, "FORCE_PLAN", planned)
        values = np.concatenate([planned, np.where(contact, share, np.nan)[..., None]], axis=-1)
        for (row, foot), ax in np.ndenumerate(axes):
            ax.step(time, values[:, foot, row], where="post", color=style.PLANNED, lw=2.6, label="planned")
    if "TRUTH" in run:
        time, true = run.time("TRUTH"), run.field("TRUTH", "f_F_W")[:, :used]
        share = metrics.cone_share(run, "TRUTH", true)
        values = np.concatenate([true, share[..., None]], axis=-1)
        for (row, foot), ax in np.ndenumerate(axes):
            ax.step(time, values[:, foot, row], where="pre", color=style.FEET[foot], lw=0.9, label="true")
    for row, least in enumerate((2.0, 2.0, 10.0)):
        style.at_least(axes[row, 0], least)
    axes[3, 0].set_ylim(0.0, max(1.12, min(axes[3, 0].get_ylim()[1], 3.0)))
    for foot, name in enumerate(configuration.foot_names(run, used)):
        column = list(axes[:, foot])
        column[0].set_title(f"{name.capitalize()} foot")
        column[3].axhline(1.0, color=style.BAD, lw=0.9)
        shade(column, run, label=foot == 0)
        time_axis(column, run)
        column[3].set_xlabel("")
        column[3].tick_params(labelbottom=False)
    for row, label in enumerate(
        ("$f_x$ [N]", "$f_y$ [N]", "$f_z$ [N]", f"share of the pyramid,\n{configuration.friction_text(run)}")
    ):
        axes[row, 0].set_ylabel(label)
    axes[0, -1].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    _effort_and_error(below, run, used)
    return fig


def _effort_and_error(axes: list[Axes], run: Run, used: int) -> None:
    if "FORCE_PLAN" in run:
        axes[0].plot(run.time("FORCE_PLAN"), run.field("FORCE_PLAN", "effort"), color=style.SERIES[3])
        axes[0].set_ylim(0.0, None)
    weights = [(way, configuration.value(run, f"controller.{way}.force_weight")) for way in ("stand", "walk")]
    told = ", ".join(f"{weight:g} I ({way})" for way, weight in weights if isinstance(weight, float))
    axes[0].set_title(r"Effort $\|f\|_R$" + (f", R = {told}, f in N" if told else ""))
    axes[0].set_ylabel(r"$(f^T R f)^{1/2}$")
    if "TRUTH" in run:
        error = np.linalg.norm(run.field("TRUTH", "force_error")[:, :used], axis=-1)
        error[run.field("TRUTH", "plan_seq") <= 0] = np.nan
        for foot, name in enumerate(configuration.foot_names(run, used)):
            axes[1].plot(run.time("TRUTH"), error[:, foot], color=style.FEET[foot], lw=0.9, label=name)
        axes[1].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=used)
        axes[1].set_ylim(0.0, max(1.0, axes[1].get_ylim()[1]))
    axes[1].set_title("True less planned force, norm")
    axes[1].set_ylabel("[N]")
    for ax in axes:
        shade(ax, run)
        time_axis([ax], run)


@styled
def joints(run: Run) -> Figure:
    """6: torque, speed and position of each joint as a share of its limit."""
    found = metrics.joint_shares(run)
    assert found is not None
    time, shares, names = found
    fig = new_figure(WIDTH, 7.0, "Joints: share of their limits", configuration.title(run))
    groups = _joint_groups(names)
    axes = fig.subplots(3, len(groups), sharex=True, sharey="row", squeeze=False)
    for column, (title, members) in enumerate(groups):
        for row, quantity in enumerate(("torque", "speed", "position")):
            ax = axes[row, column]
            for place, joint in enumerate(members):
                values = shares[quantity][:, joint]
                ax.plot(time, values, color=style.JOINTS[place % 8], lw=1.0, label=names[joint])
            ax.axhline(1.0, color=style.BAD, lw=0.9)
            largest = signals.largest(shares[quantity])
            ax.set_ylim(0.0, max(1.18, 1.05 * min(largest or 0.0, 3.0)))
            if largest is not None and largest < 0.3:
                ax.set_ylim(0.0, max(1.25 * largest, 0.02))
        axes[0, column].set_title(title)
        axes[0, column].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4)
        shade(list(axes[:, column]), run, label=column == 0)
        time_axis(list(axes[:, column]), run)
    axes[0, 0].set_ylabel(r"|torque| / limit")
    axes[1, 0].set_ylabel("|speed| / limit")
    axes[2, 0].set_ylabel("|position less middle| /\nhalf the range")
    return fig


def _joint_groups(names: tuple[str, ...]) -> list[tuple[str, list[int]]]:
    """Joints by leg where their names end in _l and _r, else all together."""
    sides = [("Left leg", "_l"), ("Right leg", "_r")]
    groups = [(title, [i for i, name in enumerate(names) if name.endswith(end)]) for title, end in sides]
    if sum(len(members) for _, members in groups) == len(names):
        return groups
    return [("All joints", list(range(len(names))))]


@styled
def force_qp(run: Run) -> Figure:
    """7: the force QP: status, iterations, residuals and active constraints of every tick."""
    fig = new_figure(WIDTH, 6.4, "Force QP", configuration.title(run))
    time = run.time("CONTROLLER_TRACE")
    status = run.field("CONTROLLER_TRACE", "qp_status")
    ran = status != metrics.QP_NOT_RUN
    axes = list(fig.subplots(4, 1, sharex=True, height_ratios=[0.75, 1.0, 1.3, 0.8]))
    ax = axes[0]
    seen = np.unique(status).tolist()
    for place, value in enumerate(seen):
        rows = status == value
        name = metrics.QP_STATUS[value] if 0 <= value < len(metrics.QP_STATUS) else f"unknown {value}"
        colour = style.GOOD if value == metrics.QP_SOLVED else style.MUTED if value == 0 else style.BAD
        ax.plot(time[rows], np.full(rows.sum(), place), "|", color=colour, ms=11, mew=0.8)
        ax.annotate(
            f"{name.replace('_', ' ')}: {rows.sum()}",
            (1.0, place),
            xycoords=("axes fraction", "data"),
            xytext=(6, 0),
            textcoords="offset points",
            va="center",
            color=colour,
            fontsize=8.5,
            annotation_clip=False,
        )
    ax.set_yticks([])
    ax.set_ylim(-0.7, len(seen) - 0.3)
    ax.grid(axis="y", visible=False)
    ax.set_title("Status")

    def where_ran(name: str) -> Floats:
        return np.where(ran, run.field("CONTROLLER_TRACE", name).astype(float), np.nan)

    axes[1].plot(time, where_ran("qp_iterations"), ".", color=style.TRUTH, ms=2.5)
    axes[1].set_title("Iterations")
    axes[1].set_ylabel("iterations")
    axes[1].set_ylim(0.0, max(4.0, axes[1].get_ylim()[1]))
    axes[1].yaxis.set_major_locator(MaxNLocator(integer=True, nbins=5))
    floor = 1e-16
    for name, label, colour in (
        ("qp_primal_residual", "primal [N]", style.TRUTH),
        ("qp_dual_residual", "dual [N]", style.ESTIMATE),
    ):
        axes[2].plot(time, np.maximum(where_ran(name), floor), ".", color=colour, ms=2.5, label=label)
    axes[2].set_yscale("log")
    axes[2].set_title(f"Residuals (0 is drawn at {floor:g})")
    axes[2].set_ylabel("residual")
    axes[2].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, markerscale=3.0)
    axes[3].step(time, where_ran("qp_active"), where="post", color=style.SERIES[2], lw=1.0)
    axes[3].set_title("Active constraints of stage 0")
    axes[3].set_ylabel("count")
    axes[3].set_ylim(0.0, max(4.0, axes[3].get_ylim()[1]))
    axes[3].yaxis.set_major_locator(MaxNLocator(integer=True, nbins=4))
    shade(axes, run, label=True)
    time_axis(axes, run)
    return fig


@styled
def estimator(run: Run) -> Figure:
    """10: the base's estimate less the truth within 2 sigma as it states them; whether it is honest: NEES and NIS."""
    found = estimation.errors(run)
    assert found is not None
    fig = new_figure(WIDTH, 8.6, "Estimate less truth, within ±2 sigma as stated", configuration.title(run))
    axes = fig.subplots(4, 3, sharex=True)
    columns = (
        ("Trunk's orientation", ("roll", "pitch", "yaw"), "mrad", found.angles, found.angles_sigma),
        (
            "Velocity $v_{WB}$ along the heading",
            ("forward", "left", "up"),
            "mm/s",
            found.velocity,
            found.velocity_sigma,
        ),
        ("Position $p_{WB}$", ("x", "y", "z"), "mm", found.position, found.position_sigma),
    )
    for column, (title, names, unit, error, sigma) in enumerate(columns):
        for row, name in enumerate(names):
            ax = axes[row, column]
            band = 2000 * sigma[:, row]
            ax.fill_between(found.time, -band, band, color=style.PLANNED, alpha=0.55, lw=0)
            ax.plot(found.time, 1000 * error[:, row], color=style.TRUTH, lw=0.8)
            ax.set_ylabel(f"{name} [{unit}]")
            inside = 100 * float(np.mean(np.abs(error[:, row]) <= 2.0 * sigma[:, row]))
            ax.text(0.99, 0.97, f"{inside:.0f}% within", transform=ax.transAxes, ha="right", va="top", fontsize=7.5)
            _about_zero(ax, 1000 * error[:, row], band)
        axes[0, column].set_title(title)
    nees, nis, height = axes[3]
    _honesty(nees, found.time, found.nees, estimation.NEES_FREEDOM, "NEES per degree of freedom")
    _honesty(nis, found.time, found.nis, None, "NIS per degree of freedom")
    for foot, name in enumerate(configuration.foot_names(run, found.height.shape[1])):
        height.plot(found.time, 1000 * found.height[:, foot], color=style.FEET[foot], lw=0.8, label=name)
    height.legend(loc="upper left", ncols=2, fontsize=7.0)
    height.set_title("Height over a loaded foot")
    height.set_ylabel("[mm]")
    _about_zero(height, 1000 * found.height)
    for column in range(3):
        shade(list(axes[:, column]), run)
        time_axis(list(axes[:, column]), run)
    stance_bars(height, run)
    return fig


def _about_zero(ax: Axes, *series: Array) -> None:
    """Limits that hold all but what series [mm or mrad] begin with or end in, and do not magnify below 0.5."""
    half = 0.5
    for values in series:
        finite = np.abs(values[np.isfinite(values)])
        if len(finite):
            half = max(half, min(float(finite.max()), 3.0 * float(np.percentile(finite, 98.0))))
    ax.set_ylim(-1.3 * half, 1.3 * half)


def _honesty(ax: Axes, time: Floats, values: Floats, freedom: int | None, title: str) -> None:
    """A normalised squared error: of each instant, its mean over 1 s, and the chi-squared band of its `freedom`."""
    if freedom is not None:
        low, high = chi2.ppf([0.025, 0.975], freedom) / freedom
        ax.axhspan(low, high, color=style.PLANNED, alpha=0.35, lw=0, label="95% of χ²")
    ax.plot(time, values, ".", color=style.TRUTH, ms=1.5, alpha=0.5)
    known = np.isfinite(values)
    seconds = np.arange(np.floor(time[0]), time[-1] + 1.0)
    counts, _ = np.histogram(time[known], seconds)
    sums, _ = np.histogram(time[known], seconds, weights=values[known])
    means = np.divide(sums, counts, out=np.full(len(counts), np.nan), where=counts > 0)
    ax.stairs(means, seconds, baseline=None, color=style.ESTIMATE, lw=1.6, label="mean of 1 s", zorder=4)
    ax.axhline(1.0, color=style.REFERENCE, lw=0.8)
    ax.set_yscale("log")
    ax.set_ylim(0.03, 30.0)
    ax.set_title(title)
    ax.legend(loc="lower left", ncols=2, fontsize=7.0)


@dataclass(frozen=True)
class Plot:
    """One plot of the report."""

    title: str
    draw: Callable[[Run], Figure]
    possible: Callable[[Run], bool]
    """whether the log holds what it draws: only then may it be drawn"""


def _on_feet(possible: Callable[[Run], bool]) -> Callable[[Run], bool]:
    """Of a plot that is of a robot with feet alone."""
    return lambda run: not signals.on_fixed_base(run) and possible(run)


PLOTS = {
    "picture": Plot("The robot", picture, _on_feet(drawable)),
    "arm": Plot("The arm", way, arm3.plays),
    "joint_rates": Plot("Joint rates: calculated over given", joint_rates, arm3.plays),
    "tracking": Plot("Tracking, and the map kept by velocities", tracking, arm3.plays),
    "catches": Plot("Catches", catches, catcher.catches),
    "ball": Plot("The ball's filter", ball, catcher.catches),
    "walk": Plot("The walk from the side", walk, walks),
    "timing": Plot("Tick period and stage times", timing, lambda run: "CONTROLLER_TIMING" in run),
    "center_of_mass": Plot("Centre of mass and base", center_of_mass, _on_feet(lambda run: "CONTROLLER_TRACE" in run)),
    "forces": Plot(
        "Ground reaction forces",
        forces,
        lambda run: signals.num_contacts(run) > 0 and ("FORCE_PLAN" in run or "TRUTH" in run),
    ),
    "gait": Plot("Gait", gait, lambda run: signals.num_contacts(run) > 0),
    "velocity": Plot("Velocity", velocity, _on_feet(lambda run: "CONTROLLER_TRACE" in run)),
    "footholds": Plot("Footholds from above", footholds, maps),
    "swing": Plot("Swing tracking and stance slip", swing, lambda run: len(walking.steps(run)) > 0),
    "estimator": Plot("Estimator", estimator, _on_feet(lambda run: estimation.errors(run) is not None)),
    "joints": Plot("Joints", joints, lambda run: metrics.joint_shares(run) is not None),
    "force_qp": Plot("Force QP", force_qp, _on_feet(lambda run: "CONTROLLER_TRACE" in run)),
}
"""name → plot, in the report's order; the summary card also takes the metrics and the verdict"""


def available(run: Run) -> dict[str, Plot]:
    """The plots that the log can give."""
    return {name: plot for name, plot in PLOTS.items() if plot.possible(run)}
