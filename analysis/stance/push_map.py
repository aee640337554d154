"""Which pushes a robot survives: success by direction and impulse, over the trials of a campaign.

A trial belongs on the map where its scenario has exactly one push. Directions are horizontal, from W's +x (the robot's
front at the start) about W's z: left is positive.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from . import style
from .errors import StanceError
from .pushes import PushTrial
from .series import Floats, Integers
from .style import new_figure, styled

MANY = 96  # trials of a ring, from which on it has more sectors
SECTORS = (8, 16)  # of a ring with few trials, with many
RINGS = 8  # at most; more impulses than that are counted in so many ranges
PANEL = 3.6  # inch
COLUMNS = 4
HOLE = 1.0  # of a ring's thickness, in the middle of a panel
RATES = LinearSegmentedColormap.from_list("rates", [style.BAD, style.PUSH, style.GOOD])


@dataclass(frozen=True)
class Panel:
    """Trials that differ in their pushes alone."""

    title: str
    """what their cells are named besides the impulse; may be empty"""
    trials: list[PushTrial]


@dataclass(frozen=True)
class Rings:
    """Successes and trials counted by impulse and direction."""

    edges: list[float]
    """N s, of the rings, from inside out, one more than these"""
    labels: list[str]
    """of each ring"""
    succeeded: Integers
    """(rings, sectors); sector i is about the direction i 2 pi / sectors"""
    count: Integers
    """(rings, sectors)"""


def panels(cells: Sequence[tuple[str, list[PushTrial]]]) -> list[Panel]:
    """One for each kind of cell: names (with their trials) that differ in the impulse alone are of one kind."""
    found: dict[str, list[PushTrial]] = {}
    for name, trials in cells:
        impulses = {trial.impulse for trial in trials}
        rest = name
        if len(impulses) == 1:
            rest = re.sub(rf"^{re.escape(f'{impulses.pop():g}')} N s\b[\s,]*", "", name)
        if trials:
            found.setdefault(rest, []).extend(trials)
    return [Panel(name, trials) for name, trials in found.items()]


def count(trials: Sequence[PushTrial]) -> Rings:
    """Of at least one trial. A ring for each impulse, or for ranges of it where there are many."""
    impulse = np.array([trial.impulse for trial in trials])
    direction = np.array([trial.direction for trial in trials])
    good = np.array([trial.succeeded for trial in trials])
    impulses = np.unique(impulse.round(6))
    if len(impulses) <= RINGS:
        inner = 0.5 * (impulses[1:] + impulses[:-1])
        edges, labels = [0.0, *inner, float("inf")], [f"{one:g}" for one in impulses]
    else:
        edges = np.linspace(0.0, impulses[-1] * (1.0 + 1e-9), RINGS + 1).tolist()
        labels = [f"{low:.2g} to {high:.2g}" for low, high in pairwise(edges)]
    ring = np.clip(np.searchsorted(edges, impulse, side="right") - 1, 0, len(labels) - 1)
    sectors = _sectors(direction, float(np.median(np.bincount(ring)[np.unique(ring)])))
    sector = np.floor(direction * sectors / (2.0 * np.pi) + 0.5 + 1e-6).astype(int) % sectors
    counted = np.zeros((2, len(labels), sectors), np.int64)
    np.add.at(counted[0], (ring[good], sector[good]), 1)
    np.add.at(counted[1], (ring, sector), 1)
    return Rings([float(edge) for edge in edges], labels, counted[0], counted[1])


def _sectors(direction: Floats, trials: float) -> int:
    """Where there are few directions [rad], a sector for each; else as many as a ring's trials fill."""
    few, many = SECTORS
    directions = len(np.unique((direction % (2.0 * np.pi)).round(3)))
    return few if directions <= few or (directions > many and trials < MANY) else many


@styled
def push_map(found: Sequence[Panel], title: str, subtitle: str = "") -> Figure:
    """A polar map for each panel of where pushes go: the front is up, the impulse grows outward, successes / trials.

    Raises StanceError where there is no trial with one push.
    """
    if not found:
        raise StanceError(f"{title}: no trial has exactly one push, so that there is nothing to map")
    columns = min(COLUMNS, len(found))
    rows = -(-len(found) // columns)
    fig = new_figure(max(PANEL * columns + 0.4, 7.6), (PANEL + 0.65) * rows + 0.7, title, subtitle)
    axes = fig.subplots(rows, columns, squeeze=False, subplot_kw={"projection": "polar"}).flat
    for ax, panel in zip(axes, found, strict=False):
        _draw(ax, panel)
    for ax in list(axes)[len(found) :]:
        ax.set_axis_off()
    return fig


def _draw(ax: PolarAxes, panel: Panel) -> None:
    rings = count(panel.trials)
    sectors = rings.count.shape[1]
    width = 2.0 * np.pi / sectors
    ax.set_theta_zero_location("N")
    for ring in range(len(rings.labels)):
        for sector in range(sectors):
            trials, good = int(rings.count[ring, sector]), int(rings.succeeded[ring, sector])
            colour = RATES(good / trials) if trials else style.GRID
            ax.bar(sector * width, 1.0, width, HOLE + ring, color=colour, ec="white", lw=1.0)
            if trials:
                ax.text(
                    sector * width,
                    HOLE + ring + 0.5,
                    f"{good}/{trials}",
                    ha="center",
                    va="center",
                    fontsize=6.0 if sectors > 8 else 7.0,
                    color="white",
                    fontweight="bold",
                )
    ax.set_ylim(0.0, HOLE + len(rings.labels))
    ax.set_yticks([])
    ax.set_xticks(np.arange(0.0, 2.0 * np.pi, 0.5 * np.pi), ["to the front", "left", "back", "right"], fontsize=8)
    ax.tick_params(axis="x", pad=-2)
    ax.grid(False)
    ax.spines["polar"].set_visible(False)
    ax.set_title(panel.title, loc="center", fontsize=9)
    totals = [
        f"{label} N s: {int(good)}/{int(trials)}"
        for label, good, trials in zip(rings.labels, rings.succeeded.sum(axis=1), rings.count.sum(axis=1), strict=True)
    ]
    lines = [", ".join(totals[place : place + 3]) for place in range(0, len(totals), 3)]
    ax.set_xlabel("from inside out: " + "\n".join(lines), fontsize=8, labelpad=2)
