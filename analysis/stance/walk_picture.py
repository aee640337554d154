"""A walk seen from the side: stick figures at even intervals, the ways of C and of the feet, and the ground's forces.

By the truth; the body is the URDF that stands in the log. The drawing's plane holds W's z and the way that the robot
went, forward to the right; we stand at its right.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull

from . import configuration, signals, style, walking
from .errors import UnreadableError
from .picture import LINK_COLOUR, TRUNK_COLOUR, box_corners, drawable, whole_rows
from .series import Array, Floats, Integers, Run
from .style import new_figure, styled
from .urdf import Robot, foot_radius, rotation_from_quaternion, transform

WIDTH = 11.0  # inch
WAY = 2.0  # m, of the part that is drawn
INTERVAL = 0.05  # s, between stick figures
WHOLE = 0.5  # m, between those that have their trunk
MARGIN = 0.36  # m, before and after
BELOW, ABOVE = 0.17, 0.05  # m
FORCE_SCALE = 0.002  # m of line per N
BEYOND = np.array([100.0, 0.0])  # m, past either end of what is drawn
KEY_FORCE = 100.0  # N, of the line that shows the scale


@dataclass(frozen=True)
class SideView:
    """n instants of a walk in the drawing's plane: m forward of where it begins, and up."""

    time: Floats
    """s, (n,)"""
    legs: list[Floats]
    """of each, (n, points, 2): from the trunk to the tip"""
    trunk: list[Floats]
    """of each instant, (corners, 2); none of a trunk without a box"""
    p_WC: Floats
    """(n, 2)"""
    tips: Floats
    """(n, feet, 2)"""
    force: Floats
    """N, (n, feet, 2)"""


def walks(run: Run) -> bool:
    """Whether the log holds a walk that can be drawn."""
    return drawable(run) and _has_landed(run) and len(_rows_between(run, *middle_of_the_walk(run))) > 1


def _has_landed(run: Run) -> bool:
    return len(walking.landed(walking.steps(run))) > 0


def _rows_between(run: Run, first: float, last: float) -> Integers:
    """Rows of TRUTH that can be drawn, from `first` to `last` [s]."""
    time, rows = run.time("TRUTH"), whole_rows(run)
    return rows[(time[rows] >= first - 1e-9) & (time[rows] <= last + 1e-9)]


def middle_of_the_walk(run: Run) -> tuple[float, float]:
    """s: whole steps in the middle of the run's, over a way of `WAY`; all steps where they do not go so far."""
    landed = walking.landed(walking.steps(run))
    if not landed:
        raise UnreadableError("no step in the log: there is no walk to draw")
    touchdowns = np.array([landed[0][0].lift_off, *(down.time for _, down in landed)])
    place = run.field("TRUTH", "p_WC")[
        np.searchsorted(run.time("TRUTH"), touchdowns - 1e-9).clip(0, run.count("TRUTH") - 1)
    ]
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(place[:, :2], axis=0), axis=1)))
    first = int(np.searchsorted(way, 0.5 * (way[-1] - WAY), side="right")) - 1 if way[-1] > WAY else 0
    last = min(int(np.searchsorted(way, way[first] + WAY)), len(way) - 1)
    return float(touchdowns[first]), float(touchdowns[last])


def side_view(run: Run, first: float, last: float, body: Robot) -> SideView:
    """From `first` to `last` [s], at every state of the log."""
    rows = _rows_between(run, first, last)

    def of(name: str) -> Array:
        return run.field("TRUTH", name)[rows]

    feet, joints = slice(signals.num_contacts(run)), slice(signals.num_joints(run))
    way = of("p_WC")[-1, :2] - of("p_WC")[0, :2]
    yaw = signals.roll_pitch_yaw(of("quat_WB")[:1])[0, 2]
    heading = np.array([np.cos(yaw), np.sin(yaw)])
    forward = way / np.linalg.norm(way) if np.linalg.norm(way) > 0.2 else heading
    if forward @ heading < 0.0:
        forward = -forward  # it walks backward: to the left
    plane = np.array([[*forward, 0.0], [0.0, 0.0, 1.0]])
    origin = np.array([*of("p_WC")[0, :2], 0.0])

    def drawn(points: Array) -> Floats:
        return np.asarray((points - origin) @ plane.T)

    frames = body.forward(
        of("joint_position")[:, joints], transform(rotation_from_quaternion(of("quat_WB")), of("p_WB"))
    )
    parent = {joint.child: joint.parent for joint in body.joints}
    legs = []
    for foot, (link, _) in enumerate(body.feet()):
        chain = [link]
        while parent[chain[-1]] != body.root:
            chain.append(parent[chain[-1]])
        points = [frames[name][:, :3, 3] for name in reversed(chain)] + [of("p_WF")[:, foot]]
        legs.append(drawn(np.stack(points, axis=1)))
    boxes = [shape for shape in body.links[body.root].visual if shape.kind == "box"]
    trunk = [
        np.concatenate([np.empty((0, 2)), *(drawn(box_corners(T_WB @ box.T_link, box)) for box in boxes)])
        for T_WB in frames[body.root]
    ]
    return SideView(
        time=run.time("TRUTH")[rows],
        legs=legs,
        trunk=trunk,
        p_WC=drawn(of("p_WC")),
        tips=drawn(of("p_WF")[:, feet]),
        force=np.asarray(of("f_F_W")[:, feet] @ plane.T),
    )


@styled
def walk(run: Run) -> Figure:
    """The middle of the run's walk, seen from the side. Raises UnreadableError where there is none to draw."""
    body = configuration.robot(run)
    if body is None or not walks(run):
        raise UnreadableError("no TRUTH, no URDF or no step in the log: there is no walk to draw")
    first, last = middle_of_the_walk(run)
    view = side_view(run, first, last, body)
    low, high = view.p_WC[:, 0].min() - MARGIN, view.p_WC[:, 0].max() + MARGIN
    ground = _ground(view, [foot_radius(body, link) for link, _ in body.feet()])
    bottom, top = float(ground[:, 1].min()) - BELOW, np.concatenate([view.p_WC, *view.trunk])[:, 1].max() + ABOVE
    height = (WIDTH - 0.7) * (top - bottom) / (high - low)
    fig = new_figure(
        WIDTH, float(np.clip(height, 3.0, 7.0)) + 1.1, "Walking, seen from the side", configuration.title(run)
    )
    ax = fig.subplots()
    sticks = _every(view.time, INTERVAL)
    for box in _whole_figures(view, sticks):
        outline = box[ConvexHull(box).vertices] if len(box) else box
        ax.add_patch(Polygon(outline, closed=True, fc=(TRUNK_COLOUR, 0.7), ec=LINK_COLOUR, lw=1.0, zorder=2))
    names = configuration.foot_names(run, len(view.legs))
    for foot, (leg, name) in enumerate(zip(view.legs, names, strict=True)):
        colour = style.FEET[foot % len(style.FEET)]
        ax.add_collection(LineCollection(list(leg[sticks]), colors=colour, lw=0.8, alpha=0.45, zorder=3))
        tips, force = view.tips[sticks, foot], view.force[sticks, foot]
        loaded = force[:, 1] > signals.MIN_NORMAL_FORCE
        lines = np.stack([tips, tips + FORCE_SCALE * force], axis=1)[loaded]
        ax.add_collection(LineCollection(list(lines), colors=style.PUSH, lw=0.9, alpha=0.9, zorder=4))
        ax.plot(*view.tips[:, foot].T, color=colour, lw=1.6, label=f"{name} leg, and its foot's way", zorder=6)
    ax.plot(*view.p_WC.T, color=style.INK, lw=1.8, label="centre of mass", zorder=7)
    at = (low + 0.05, bottom + 0.035)
    ax.plot([at[0], at[0] + FORCE_SCALE * KEY_FORCE], [at[1]] * 2, color=style.PUSH, lw=1.6, zorder=8)
    words = f"{KEY_FORCE:.0f} N of the ground on a foot"
    ax.text(
        at[0] + FORCE_SCALE * KEY_FORCE + 0.03, at[1], words, va="center", fontsize=8, color=style.PUSH_INK, zorder=8
    )
    _footprints(ax, run, view, first, last)
    ax.fill_between(ground[:, 0], ground[:, 1], bottom, color="#eceff2", lw=0, zorder=0)
    ax.plot(*ground.T, color=style.MUTED, lw=0.9, zorder=1)
    ax.set_xlim(low, high)
    ax.set_ylim(bottom, top)
    ax.set_aspect("equal")
    ax.grid(False)
    ax.set_xlabel("way [m]")
    ax.set_ylabel("z of W [m]")
    span = f"{view.time[0]:.2f} to {view.time[-1]:.2f} s, a stick figure every {1000 * INTERVAL:.0f} ms"
    ax.set_title(span, fontsize=9, fontweight="normal")
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)
    return fig


def _every(time: Floats, interval: float) -> Array:
    """Rows that are so far apart [s]."""
    return np.unique(np.searchsorted(time, np.arange(time[0], time[-1] + 1e-9, interval) - 1e-9))


def _whole_figures(view: SideView, sticks: Array) -> list[Floats]:
    """The trunks, one in each `WHOLE` m of way, first and last included."""
    place = view.p_WC[sticks, 0]
    count = max(1, round(float(np.ptp(place)) / WHOLE))
    wanted = place[0] + (place[-1] - place[0]) * np.arange(count + 1) / count
    return [view.trunk[sticks[int(np.argmin(np.abs(place - one)))]] for one in wanted]


def _ground(view: SideView, radii: list[float]) -> Floats:
    """m, (points, 2): where feet stand, and on as level as there beyond."""
    loaded = view.force[:, :, 1] > signals.MIN_NORMAL_FORCE
    points = [
        (np.median(view.tips[begin : end + 1, foot] - [0.0, radius], axis=0)).tolist()
        for foot, radius in enumerate(radii)
        for begin, end in signals.intervals(loaded[:, foot])
    ]
    found = np.array(sorted(points) if points else [[0.0, 0.0]])
    return np.concatenate([found[:1] - BEYOND, found, found[-1:] + BEYOND])


def _footprints(ax: Axes, run: Run, view: SideView, first: float, last: float) -> None:
    """The number of each step below where its foot came down."""
    for number, (step, down) in enumerate(walking.landed(walking.steps(run)), 1):
        if first <= down.time <= last:
            row = min(int(np.searchsorted(view.time, down.time - 1e-9)), len(view.time) - 1)
            place = view.tips[row, step.foot]
            ax.annotate(
                f"{number}",
                place,
                xytext=(0, -9),
                textcoords="offset points",
                ha="center",
                va="top",
                fontsize=7.5,
                color=style.FEET[step.foot],
            )
