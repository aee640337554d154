"""The plots of how a robot walks: contacts and steps, velocities, footholds from above, and how its feet follow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from . import configuration, signals, style, walking
from .series import Array, Floats, Run
from .style import new_figure, shade, stance_bars, styled, time_axis
from .walking import Step, Touchdown

WIDTH = 11.0  # inch
MAP_MARGIN = 0.12  # m, around what the map from above shows
MAP_LENGTH = 3.0  # m, of way on one strip of the map, roughly
MAP_STRIPS = 4  # at most
NUMBER_ROOM = 13.0  # points, that a step's number takes along the way


@styled
def gait(run: Run) -> Figure:
    """5: which foot stands when: planned, believed, felt by the switch, and true; how the load is shared; the steps."""
    used = signals.num_contacts(run)
    names = configuration.foot_names(run, used)
    kinds = [kind for kind in _contact_kinds(run, used) if kind is not None]
    made = walking.steps(run)
    bars = 0.30 * max(used, 1) * max(len(kinds), 1)
    fig = new_figure(WIDTH, 2.6 + bars + (1.5 if made else 0.0), "Gait", configuration.title(run))
    axes = list(fig.subplots(3 if made else 2, 1, sharex=True, height_ratios=[bars, 1.1, 1.3][: 3 if made else 2]))
    top, load = axes[:2]
    ticks, labels = [], []
    y = 0.0
    for foot in range(used):
        for name, time, contact, alpha in kinds:
            spans = [
                (float(time[first]), float(time[min(last + 1, len(time) - 1)] - time[first]))
                for first, last in signals.intervals(contact[:, foot])
            ]
            top.broken_barh(spans, (y - 0.38, 0.76), facecolor=style.FEET[foot], alpha=alpha, lw=0)
            ticks.append(y)
            labels.append(f"{names[foot]}: {name}")
            y += 1.0
        y += 0.4
    top.set_yticks(ticks, labels)
    top.set_ylim(y - 0.6, -0.8)
    top.grid(axis="y", visible=False)
    top.set_title("Contacts, planned and measured")
    if "TRUTH" in run:
        normal = np.maximum(run.field("TRUTH", "f_F_W")[:, :used, 2], 0.0)
        total = np.maximum(normal.sum(axis=1), 1e-9)
        for foot in range(used):
            load.plot(run.time("TRUTH"), normal[:, foot] / total, color=style.FEET[foot], label=names[foot])
        load.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=used)
    load.set_ylim(-0.02, 1.02)
    load.set_title("Share of the load, true")
    load.set_ylabel("share")
    if made:
        _step_times(axes[2], made, names)
    shade(axes, run, label=True)
    time_axis(axes, run)
    return fig


def _contact_kinds(run: Run, used: int) -> list[tuple[str, Floats, Array, float] | None]:
    """(name, t, (n, contacts) bool, opacity) of every way in which the log knows contacts."""

    def of(channel: str, name: str, find: Callable[[], Array], alpha: float) -> tuple[str, Floats, Array, float] | None:
        return (name, run.time(channel), find(), alpha) if channel in run else None

    return [
        of("FORCE_PLAN", "planned", lambda: run.field("FORCE_PLAN", "contact")[:, 0, :used] != 0, 0.35),
        of("CONTROLLER_TRACE", "believed", lambda: run.field("CONTROLLER_TRACE", "contact")[:, :used] != 0, 0.55),
        of("ROBOT_STATE", "switch", lambda: run.field("ROBOT_STATE", "contact_switch")[:, -1, :used] != 0, 0.75),
        of("TRUTH", "true", lambda: run.field("TRUTH", "f_F_W")[:, :used, 2] > signals.MIN_NORMAL_FORCE, 1.0),
    ]


def _step_times(ax: Axes, made: list[Step], names: list[str]) -> None:
    """Of each swing: how long it took, and how long it was to take at lift-off."""
    landed = walking.landed(made)
    ax.plot(
        [step.lift_off for step in made],
        [1000 * step.planned_time for step in made],
        "_",
        color=style.REFERENCE,
        ms=9,
        label="planned at lift-off",
    )
    for foot, name in enumerate(names):
        own = [(step.lift_off, 1000 * down.swing_time) for step, down in landed if step.foot == foot]
        ax.plot(*np.reshape(own, (-1, 2)).T, "o", color=style.FEET[foot], ms=3.5, label=name)
    recovering = [(step.lift_off, 1000 * down.swing_time) for step, down in landed if step.recovering]
    crossing = [(step.lift_off, 1000 * down.swing_time) for step, down in landed if step.crossing]
    if recovering:
        ax.plot(*np.transpose(recovering), "o", mfc="none", mec=style.PUSH, ms=7, label="gets over a push")
    if crossing:
        ax.plot(*np.transpose(crossing), "x", color=style.INK, ms=6, label="crosses over")
    ax.set_title("Swing times")
    ax.set_ylabel("time [ms]")
    ax.set_ylim(0.0, 1.15 * max(ax.get_ylim()[1], 1.0))
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=5)


@styled
def velocity(run: Run) -> Figure:
    """The centre of mass's velocity along the heading, and the yaw rate: wanted, estimated, true; strides' means."""
    fig = new_figure(WIDTH, 6.6, "Velocity in the heading frame", configuration.title(run))
    axes = list(fig.subplots(3, 1, sharex=True))
    time = run.time("CONTROLLER_TRACE")
    wanted = run.field("CONTROLLER_TRACE", "velocity_wanted")
    if "TRUTH" in run:
        true_time, true = run.time("TRUTH"), velocities(run, "TRUTH")
        for ax, values in zip(axes, true.T, strict=True):
            ax.plot(true_time, values, color=style.TRUTH, lw=1.6, alpha=0.55, label="true")
    estimated = velocities(run, "CONTROLLER_TRACE")
    for ax, values in zip(axes, estimated.T, strict=True):
        ax.plot(time, values, color=style.ESTIMATE, lw=0.8, label="estimated")
    shown = (true_time, true, "true") if "TRUTH" in run else (time, estimated, "estimated")
    ends = np.array([down.time for _, down in walking.landed(walking.steps(run))][::2])
    rows = np.searchsorted(shown[0], ends)
    if len(rows) > 1 and (np.diff(rows) > 0).all():
        means = np.add.reduceat(shown[1], rows)[:-1] / np.diff(rows)[:, None]
        for ax, values in zip(axes, means.T, strict=True):
            ax.stairs(values, ends, color=style.SERIES[2], lw=1.6, baseline=None, label=f"{shown[2]}, mean of a stride")
    for ax, values in zip(axes, wanted.T, strict=True):
        ax.plot(time, values, color=style.REFERENCE, lw=1.2, ls=(0, (5, 2)), label="wanted, ramped")
    for ax, label in zip(axes, ("forward [m/s]", "left [m/s]", "yaw rate [rad/s]"), strict=True):
        ax.set_ylabel(label)
        style.at_least(ax, 0.1)
    axes[0].set_title("Centre of mass $v_{WC}$; bars: feet on the ground")
    axes[2].set_title("Trunk's turn about W's z")
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4)
    shade(axes, run, label=True)
    stance_bars(axes, run)
    time_axis(axes, run)
    return fig


def velocities(run: Run, channel: str) -> Floats:
    """(n, 3): of the centre of mass forward and left [m/s], and the yaw rate [rad/s], of TRUTH or CONTROLLER_TRACE."""
    v_WC = run.field(channel, "v_WC") if channel == "TRUTH" else run.field(channel, "x")[:, 9:12]
    yaw = signals.roll_pitch_yaw(run.field(channel, "quat_WB"))[:, 2]
    return np.column_stack([signals.in_heading(v_WC, yaw)[:, :2], run.field(channel, "w_WB_W")[:, 2]])


@dataclass(frozen=True)
class GroundWays:
    """What moves over the ground, by the truth, seen from above: n instants, m in W."""

    time: Floats
    """s, (n,)"""
    p_WC: Floats
    """(n, 2), centre of mass"""
    dcm: Floats
    """(n, 2), divergent component of motion p + v sqrt(h / g), h the height of C over the lower foot's ground"""
    zmp: Floats
    """(n, 2), zero-moment point of the feet's forces; nan where they bear no load"""

    def between(self, first: float, last: float) -> GroundWays:
        """The part of a time span [s]."""
        rows = (self.time >= first) & (self.time <= last)
        return GroundWays(self.time[rows], self.p_WC[rows], self.dcm[rows], self.zmp[rows])

    @property
    def whole(self) -> Floats:
        """Everything, (3 n, 2)."""
        return np.concatenate([self.p_WC, self.dcm, self.zmp])


def ground_ways(run: Run) -> GroundWays:
    """Raises KeyError without the truth."""
    feet = slice(signals.num_contacts(run))
    position, tips = run.field("TRUTH", "p_WC"), run.field("TRUTH", "p_WF")[:, feet]
    load = np.maximum(run.field("TRUTH", "f_F_W")[:, feet, 2], 0.0)
    total = load.sum(axis=1)
    shares = load / np.where(total > signals.MIN_NORMAL_FORCE, total, np.nan)[:, None]
    height = np.maximum(position[:, 2] - tips[:, :, 2].min(axis=1), 0.0)
    dcm = position[:, :2] + run.field("TRUTH", "v_WC")[:, :2] * np.sqrt(height / walking.GRAVITY)[:, None]
    return GroundWays(run.time("TRUTH"), position[:, :2], dcm, np.einsum("nf,nfk->nk", shares, tips[:, :, :2]))


def foothold_places(run: Run) -> tuple[list[tuple[Step, Touchdown]], Floats]:
    """The steps that came down, and where by the truth and as planned last: m, (steps, 2, 2). Those that are finite."""
    landed = walking.landed(walking.steps(run))
    yaw = signals.roll_pitch_yaw(run.field("TRUTH", "quat_WB"))[:, 2]
    found = np.empty((len(landed), 2, 2))
    for place, (step, down) in zip(found, landed, strict=True):
        row = int(np.argmin(np.abs(run.time("TRUTH") - down.time)))
        place[0] = run.field("TRUTH", "p_WF")[row, step.foot, :2]
        error = np.array([[*down.error, 0.0]])
        place[1] = place[0] - signals.in_heading(error, -yaw[row : row + 1])[0, :2]
    finite = np.asarray(np.isfinite(found).all(axis=(1, 2)))
    return [one for one, whole in zip(landed, finite, strict=True) if whole], found[finite]


def maps(run: Run) -> bool:
    """Whether the log holds footholds to draw."""
    return "TRUTH" in run and len(foothold_places(run)[0]) > 0


def _strips(ways: GroundWays, landed: list[tuple[Step, Touchdown]]) -> list[tuple[float, float]]:
    """Time spans [s] that the map shows, one below the other: more than one for a long way that is straight."""
    first, last = landed[0][0].lift_off - 0.3, landed[-1][1].time + 0.3
    shown = ways.between(first, last)
    size = np.ptp(shown.p_WC, axis=0)
    strips = int(np.clip(np.ceil(size[0] / MAP_LENGTH), 1, MAP_STRIPS)) if size[0] > 4.0 * size[1] else 1
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(shown.p_WC, axis=0), axis=1)))
    inner = shown.time[np.searchsorted(way, way[-1] * np.arange(1, strips) / strips)].tolist()
    return list(pairwise([first, *inner, last]))


@styled
def footholds(run: Run) -> Figure:
    """8: from above: where the feet came down and were to come down, the ways of C, of the ZMP and of the DCM."""
    ways, (landed, places) = ground_ways(run), foothold_places(run)
    times = np.array([down.time for _, down in landed])
    at = np.clip(np.searchsorted(run.time("TRUTH"), times), 0, run.count("TRUTH") - 1)
    yaw = signals.roll_pitch_yaw(run.field("TRUTH", "quat_WB")[at])[:, 2]
    strips = _strips(ways, landed)
    shown = [ways.between(*strip) for strip in strips]
    here = [(times >= first) & (times <= last) for first, last in strips]
    points = [np.concatenate([way.whole, places[rows].reshape(-1, 2)]) for way, rows in zip(shown, here, strict=True)]
    low = np.array([np.nanmin(all_of_it, axis=0) for all_of_it in points]) - MAP_MARGIN
    high = np.array([np.nanmax(all_of_it, axis=0) for all_of_it in points]) + MAP_MARGIN
    size = (high - low).max(axis=0)
    scale = (WIDTH - 0.9) / size[0]  # inch/m
    height = float(np.clip(scale * size[1], 1.0, 8.0))
    fig = new_figure(WIDTH, 1.3 + (height + 0.3) * len(strips), "Footholds from above", configuration.title(run))
    axes = fig.subplots(len(strips), 1, squeeze=False)[:, 0]
    stride = np.linalg.norm(places[2:, 0] - places[:-2, 0], axis=1)
    every = 1 + int(NUMBER_ROOM / (72.0 * scale * max(float(np.median(stride)) if len(stride) else 1.0, 1e-3)))
    for ax, way, rows, centre, (first, last) in zip(axes, shown, here, 0.5 * (low + high), strips, strict=True):
        ax.plot(*way.dcm.T, color=style.SERIES[3], lw=0.8, label="DCM, true", zorder=2)
        ax.plot(*way.zmp.T, color=style.SERIES[2], lw=0.8, label="ZMP, true", zorder=2)
        ax.plot(*way.p_WC.T, color=style.INK, lw=1.4, label="centre of mass, true", zorder=3)
        ax.plot(*places[rows, 1].T, "o", mfc="none", mec=style.INK, mew=0.8, ms=7, label="planned last", zorder=4)
        for foot, name in enumerate(configuration.foot_names(run, 2)):
            own = rows & [step.foot == foot for step, _ in landed]
            ax.plot(*places[own, 0].T, "o", color=style.FEET[foot], ms=4.5, label=f"{name} foot, with step", zorder=5)
            for number in np.flatnonzero(own)[::every]:
                aside = 10.0 * (1 - 2 * foot) * np.array([-np.sin(yaw[number]), np.cos(yaw[number])])
                ax.annotate(
                    f"{number + 1}",
                    places[number, 0],
                    xytext=(float(aside[0]), float(aside[1])),
                    textcoords="offset points",
                    ha="center",
                    va="center",
                    fontsize=7.0,
                    color=style.FEET[foot],
                )
        ax.set_xlim(centre[0] - 0.5 * size[0], centre[0] + 0.5 * size[0])
        ax.set_ylim(centre[1] - 0.5 * size[1], centre[1] + 0.5 * size[1])
        ax.set_aspect("equal")
        ax.set_ylabel("y of W [m]")
        ax.set_title(f"{first:.2f} to {last:.2f} s", fontsize=8.5, fontweight="normal")
    axes[-1].set_xlabel("x of W [m]")
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=7, columnspacing=1.0)
    return fig


def _bundle(ax: Axes, lines: list[Floats], colour: str, dashes: Any, order: int) -> None:
    """Many lines (points, 2) of one look, pale enough that what they share stands out."""
    ax.add_collection(LineCollection(lines, colors=colour, lw=0.8, ls=dashes, alpha=0.4, zorder=order))
    ax.autoscale_view()


@styled
def swing(run: Run) -> Figure:
    """9: how the swing feet follow their references, where they come down, and whether standing feet slide."""
    fig = new_figure(WIDTH, 9.4, "Swing tracking and stance slip", configuration.title(run))
    axes = fig.subplot_mosaic(
        [["path0", "path1"], ["error0", "error1"], ["footholds", "footholds"], ["slip", "slip"]],
        height_ratios=[1.1, 1.1, 1.0, 0.9],
    )
    names = configuration.foot_names(run, 2)
    made = walking.steps(run)
    yaw = signals.roll_pitch_yaw(run.field("CONTROLLER_TRACE", "quat_WB"))[:, 2]
    error = 1000 * signals.in_heading(walking.swing_error(run), yaw)
    tips, reference = run.field("CONTROLLER_TRACE", "p_WF"), run.field("CONTROLLER_TRACE", "swing_p")
    time = run.time("CONTROLLER_TRACE")
    for foot in (0, 1):
        swings = [slice(step.rows[0], step.rows[1] + 1) for step in made if step.foot == foot]
        for place, colour, dashes, order in (
            (tips[:, foot], style.FEET[foot], "-", 2),
            (reference, style.REFERENCE, (0, (5, 2)), 3),
        ):
            way = 1000 * signals.in_heading(place - tips[:, 1 - foot], yaw)[:, [0, 2]]
            _bundle(axes[f"path{foot}"], [way[rows] for rows in swings], colour, dashes, order)
        for axis, colour in enumerate(style.SERIES[:3]):
            lines = [np.column_stack([1000 * (time[rows] - time[rows][0]), error[rows, axis]]) for rows in swings]
            _bundle(axes[f"error{foot}"], lines, colour, "-", 2)
    for foot, name in enumerate(names):
        ax = axes[f"path{foot}"]
        ax.set_title(f"{name.capitalize()} foot's swings from the side")
        ax.set_xlabel("forward of the standing foot [mm]")
        ax.set_ylabel("above it [mm]")
        ax.plot([], [], color=style.FEET[foot], label="estimated")
        ax.plot([], [], color=style.REFERENCE, ls=(0, (5, 2)), label="reference")
        ax = axes[f"error{foot}"]
        ax.set_title(f"{name.capitalize()} foot less its reference")
        ax.set_xlabel("time since lift-off [ms]")
        ax.set_ylabel("[mm]")
        for label, colour in zip(("forward", "left", "up"), style.SERIES, strict=False):
            ax.plot([], [], color=colour, label=label)
    for part, columns in (("path", 2), ("error", 3)):
        axes[f"{part}0"].sharey(axes[f"{part}1"])
        axes[f"{part}1"].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns)

    ax = axes["footholds"]
    landed = walking.landed(made)
    for axis, (name, marker) in enumerate((("forward", "o"), ("left", "^"))):
        for foot in (0, 1):
            own = [(down.time, 1000 * down.error[axis]) for step, down in landed if step.foot == foot]
            ax.plot(
                *np.reshape(own, (-1, 2)).T,
                marker,
                color=style.FEET[foot],
                mfc=style.FEET[foot] if axis == 0 else "none",
                ms=4,
                label=f"{names[foot]} foot, {name}",
            )
    ax.axhline(0.0, color=style.MUTED, lw=0.8, zorder=1)
    ax.set_title("Foothold reached less planned")
    ax.set_ylabel("[mm]")
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4)
    style.at_least(ax, 10.0)

    ax = axes["slip"]
    slid = walking.slip(run)
    if slid is not None:
        for foot, name in enumerate(names):
            ax.plot(slid[0], 1000 * slid[1][:, foot], color=style.FEET[foot], lw=0.9, label=name)
        ax.set_ylim(0.0, max(0.1, ax.get_ylim()[1]))
    ax.set_title("How far each standing foot has slid, true, its rolling left out; bars: feet on the ground")
    ax.set_ylabel("[mm]")
    shade([axes["footholds"], ax], run, label=True)
    stance_bars(ax, run)
    time_axis([axes["footholds"], ax], run)
    return fig
