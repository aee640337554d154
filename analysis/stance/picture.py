"""A drawing of the robot at chosen instants: its links, the ground's forces on its feet, and the push it takes.

By the truth where it is logged, else by the controller's estimate; the body is the URDF that stands in the log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, Polygon
from scipy.spatial import ConvexHull

from . import configuration, metrics, signals, style
from .errors import UnreadableError
from .metrics import Push
from .series import Array, Floats, Integers, Run
from .style import new_figure, styled
from .urdf import Robot, Shape, rotation_from_quaternion, transform

FORCE_SCALE = 0.004  # m of arrow per N
PUSH_SCALE = 0.008  # m of arrow per N, of the push
PUSH_LENGTH = 0.30  # m, the longest arrow of a push
BOTTOM, HEIGHT = -0.20, 1.05  # m, of a drawing
REACH = 0.15  # m, that the trunk may be off the drawing's middle
MIN_STEP = 0.03  # s from a push's end to the largest tilt after it
SIDE, FRONT = "side", "front"

LINK_COLOUR = "#7d8b99"
FAR_LINK_COLOUR = "#b4bec8"
TRUNK_COLOUR = "#dfe6ec"
CONE_HEIGHT = 0.22  # m, of the drawn friction cones
POINTS_PER_METRE = 190.0  # of a drawing, roughly
KEY_FORCE = 50.0  # N, of the arrow that shows the scale


@dataclass(frozen=True)
class Pose:
    """The robot at one instant. Frames as in the messages."""

    time: float
    """s"""
    T_WB: Floats
    """(4, 4)"""
    q: Floats
    """rad, (joints,)"""
    p_WF: Floats
    """m, (contacts, 3), foot tips"""
    f_F_W: Floats
    """N, (contacts, 3), of the ground on each foot"""
    push_W: Floats
    """N, (3,)"""
    tilt: float
    """rad"""
    mu: float | None
    """that the controller plans with; None where the log does not say"""


def whole_rows(run: Run) -> Integers:
    """Rows of TRUTH whose pose and forces are all finite: those that can be drawn."""
    if "TRUTH" not in run:
        return np.empty(0, np.int64)
    names = ("p_WB", "quat_WB", "joint_position", "p_WF", "f_F_W", "push_W")
    finite = [np.isfinite(run.field("TRUTH", name)).reshape(run.count("TRUTH"), -1).all(axis=1) for name in names]
    return np.flatnonzero(np.all(finite, axis=0))


def drawable(run: Run) -> bool:
    """Whether the log has a TRUTH to draw, and the body's URDF."""
    return len(whole_rows(run)) > 0 and configuration.robot(run) is not None


def pose_at(run: Run, time: float) -> Pose:
    """The logged instant nearest to `time` [s] that is finite. Raises UnreadableError where there is none."""
    rows = whole_rows(run)
    if not len(rows):
        raise UnreadableError("no TRUTH in the log: the robot cannot be drawn")
    row = int(rows[np.argmin(np.abs(run.time("TRUTH")[rows] - time))])
    contacts, joints = signals.num_contacts(run), signals.num_joints(run)

    def at(name: str) -> Array:
        return np.asarray(run.field("TRUTH", name)[row])

    quaternion = at("quat_WB")
    return Pose(
        time=float(run.time("TRUTH")[row]),
        T_WB=transform(rotation_from_quaternion(quaternion), at("p_WB")),
        q=at("joint_position")[:joints],
        p_WF=at("p_WF")[:contacts],
        f_F_W=at("f_F_W")[:contacts],
        push_W=at("push_W"),
        tilt=float(signals.tilt(quaternion)),
        mu=configuration.friction(run, _has_a_gait(run, float(run.time("TRUTH")[row]))),
    )


def _has_a_gait(run: Run, time: float) -> bool:
    """At the tick before `time` [s], whose plan the forces of that instant follow."""
    if "CONTROLLER_TRACE" not in run:
        return False
    before = run.time("CONTROLLER_TRACE") < time
    return bool(before.any() and run.field("CONTROLLER_TRACE", "gait_phase")[before][-1] != signals.STANDING)


@styled
def picture(run: Run, instants: Sequence[float] | None = None, view: str | None = None) -> Figure:
    """The robot at `instants` [s], seen from the side or the front.

    Without instants: a row for each of the two hardest pushes, from just before it until the robot stands again, each
    seen from where the push is best seen. Raises UnreadableError where the log has no TRUTH or no URDF.
    """
    body = configuration.robot(run)
    if body is None:
        raise UnreadableError("no URDF in the log: the robot cannot be drawn")
    rows: list[tuple[str, Sequence[float], str]] = []
    pale = "pale: the first instant"
    if instants is not None:
        rows.append((view or SIDE, list(instants), ""))
    else:
        hardest = sorted(metrics.pushes(run), key=lambda push: -push.impulse)[:2]
        for push in sorted(hardest, key=lambda push: push.start):
            seen = view or (FRONT if abs(push.impulse_W[1]) > abs(push.impulse_W[0]) else SIDE)
            rows.append((seen, _instants_of(run, push), style.push_text(push)))
        if rows:
            pale = "pale: before the push"
        else:
            rows.append((view or SIDE, np.linspace(*run.span, 5)[1:-1].tolist(), ""))
    poses = [[pose_at(run, time) for time in times] for _, times, _ in rows]
    columns = max(map(len, poses))
    top = max(HEIGHT, *(_top(body, pose) + 0.02 for row in poses for pose in row))
    fig = new_figure(
        0.35 + 2.7 * columns,
        0.85 + (0.65 + 2.0 * (top - BOTTOM)) * len(rows),
        "The robot and the ground's forces",
        configuration.title(run),
    )
    axes = fig.subplots(len(rows), columns, squeeze=False)
    has_ghost = False
    centre = np.mean([row[0].T_WB[:3, 3] for row in poses], axis=0)
    for place, (seen, _, label) in enumerate(rows):
        for column, ax in enumerate(axes[place]):
            if column >= len(poses[place]):
                ax.set_axis_off()
                continue
            pose, first = poses[place][column], poses[place][0]
            middle = centre if _is_near(pose, centre, seen) else pose.T_WB[:3, 3]
            ghost = first if column and _is_near(first, middle, seen) else None
            has_ghost |= ghost is not None
            draw(ax, body, pose, seen, ghost=ghost, centre=middle, top=top)
            words = f"t = {pose.time:.2f} s   tilt {np.degrees(pose.tilt):.1f}°"
            ax.set_title(words, fontsize=9, fontweight="normal", loc="center")
        if label:
            axes[place, 0].set_ylabel(f"{label}, seen from the {seen}", fontsize=9, color=style.PUSH_INK, labelpad=6)
    _key(axes[-1, 0], configuration.friction_text(run), pale if has_ghost else "")
    return fig


def _is_near(pose: Pose, place: Array, view: str) -> bool:
    """Whether both fit into one drawing."""
    return abs(float((pose.T_WB[:3, 3] - place) @ _plane(view)[0])) < REACH


def _key(ax: Axes, mu: str, ghost: str) -> None:
    """What the marks mean, below the first drawing."""
    left, y = ax.get_xlim()[0] + 0.02, -0.155
    _arrow(ax, np.array([left, y]), np.array([left + KEY_FORCE * FORCE_SCALE, y]), style.MUTED, 2.0, 14)
    cone = f"shaded: friction cone, {mu}" if mu else ""
    words = ax.annotate(
        "   ".join(filter(None, (f"{KEY_FORCE:.0f} N of the ground", "○ centre of mass", cone, ghost))),
        (left + KEY_FORCE * FORCE_SCALE + 0.03, y),
        va="center",
        fontsize=8,
        color=style.MUTED,
        annotation_clip=False,
    )
    words.set_in_layout(False)


def _instants_of(run: Run, push: Push) -> list[float]:
    """Before a push, within it, at its end, at the largest tilt after it, and back again [s]; a fall ends them."""
    time = run.time("TRUTH")
    end = push.start + push.duration
    rows = whole_rows(run)
    after = rows[(time[rows] >= end + MIN_STEP) & (time[rows] <= end + 1.0)]
    wanted = [push.start - 0.02, push.start + 0.5 * push.duration, end]
    if len(after):
        tilt = signals.tilt(run.field("TRUTH", "quat_WB")[after])
        peak = float(time[after[np.argmax(tilt)]])
        wanted += [peak, min(peak + 1.0, float(time[rows[-1]]))]
    return [one for before, one in zip([-np.inf, *wanted], wanted, strict=False) if one > before]


def _top(body: Robot, pose: Pose) -> float:
    """m, the highest point of the trunk over the ground."""
    boxes = [shape for shape in body.links[body.root].visual if shape.kind == "box"]
    return max((float(box_corners(pose.T_WB @ shape.T_link, shape)[:, 2].max()) for shape in boxes), default=0.0)


def box_corners(T: Array, box: Shape) -> Array:
    """m, (8, 3), of a box whose frame is T."""
    corners = np.array(np.meshgrid(*[[-0.5 * size, 0.5 * size] for size in box.size])).reshape(3, -1)
    return np.asarray((T[:3, :3] @ corners + T[:3, 3:]).T)


def draw(
    ax: Axes,
    body: Robot,
    pose: Pose,
    view: str,
    ghost: Pose | None = None,
    centre: Array | None = None,
    top: float = HEIGHT,
) -> None:
    """Draws one pose on an axis in metres of W, up to the height `top`.

    `ghost` is another pose, faint behind it.
    """
    plane = _plane(view)
    middle = (pose.T_WB[:3, 3] if centre is None else np.asarray(centre)) @ plane[0]
    ax.axhspan(-0.08, 0.0, color="#eceff2", lw=0, zorder=0)
    ax.axhline(0.0, color=style.MUTED, lw=0.9, zorder=1)
    if ghost is not None:
        _body(ax, body, ghost, view, alpha=0.16, order=2)
    _body(ax, body, pose, view, alpha=1.0, order=4)
    com = body.center_of_mass(pose.q, pose.T_WB) @ plane.T
    ax.plot(*com, "o", ms=6.5, mfc="white", mec=style.INK, mew=1.4, zorder=12)
    ax.plot([com[0], com[0]], [0.0, com[1]], color=style.INK, lw=0.7, ls=(0, (1, 2)), zorder=3)
    for foot, (tip, force) in enumerate(zip(pose.p_WF, pose.f_F_W, strict=True)):
        ground = np.array([tip @ plane[0], 0.0])
        arrow = force @ plane.T * FORCE_SCALE
        if pose.mu and force[2] > signals.MIN_NORMAL_FORCE:
            edge = np.array([pose.mu * CONE_HEIGHT, CONE_HEIGHT])
            cone = [ground, ground + edge * [-1.0, 1.0], ground + edge]
            ax.add_patch(Polygon(cone, closed=True, fc=style.FEET[foot % len(style.FEET)], alpha=0.10, lw=0, zorder=3))
        if np.linalg.norm(arrow) > 0.01:
            _arrow(ax, ground, ground + arrow, style.FEET[foot % len(style.FEET)], 2.4, 14)
    _force_labels(ax, pose, plane)
    push = pose.push_W @ plane.T
    size = float(np.linalg.norm(push))
    if size > 0.5:
        tip = pose.T_WB[:3, 3] @ plane.T
        length = min(max(PUSH_SCALE * size, 0.12), PUSH_LENGTH)
        edge = tip - push / size * 0.5 * _trunk_extent(body, pose, view)
        start = edge - push / size * length
        _arrow(ax, start, edge, style.PUSH, 4.0, 20)
        ax.text(
            0.5 * (start[0] + edge[0]),
            start[1] + 0.045,
            f"{size:.0f} N",
            color=style.PUSH_INK,
            fontsize=8.5,
            ha="center",
            zorder=20,
        )
    ax.set_xlim(middle - 0.50, middle + 0.50)
    ax.set_ylim(BOTTOM, top)
    ax.set_aspect("equal")
    ax.set_xticks([])
    ax.set_yticks([])
    ax.grid(False)
    ax.patch.set_visible(False)  # or it hides what stands below its neighbour
    for spine in ax.spines.values():
        spine.set_visible(False)


def _plane(view: str) -> Floats:
    """Rows: W's directions that are right and up in the drawing. From the front, the robot's left is at our right."""
    return np.array([[1.0, 0.0, 0.0] if view == SIDE else [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def _depth(view: str) -> int:
    """The axis of W that points at us, with y towards the left leg behind, or x towards us."""
    return 1 if view == SIDE else 0


def _body(ax: Axes, body: Robot, pose: Pose, view: str, alpha: float, order: int) -> None:
    plane = _plane(view)
    frames = body.forward(pose.q, pose.T_WB)
    feet = {name for name, _ in body.feet()}
    far = {name: frame[_depth(view), 3] for name, frame in frames.items()}
    # From the side we stand at the robot's right: what has more y is further away.
    away = 1.0 if view == SIDE else -1.0
    for name in sorted(frames, key=lambda link: -away * far[link]):
        link = body.links[name]
        side = 0 if name.endswith("_l") else 1 if name.endswith("_r") else None
        behind = view == SIDE and side == 0
        for shape in link.visual:
            _shape(ax, frames[name] @ shape.T_link, shape, plane, _link_colour(side, behind), alpha, order)
        for shape in link.collision:
            if shape.kind == "sphere" and name in feet:
                centre = (frames[name] @ shape.T_link)[:3, 3] @ plane.T
                colour = style.FEET[side or 0]
                ax.add_patch(
                    Circle((centre[0], centre[1]), shape.size[0], fc=colour, ec="none", alpha=alpha, zorder=order + 2)
                )


def _link_colour(side: int | None, behind: bool) -> str:
    if side is None:
        return TRUNK_COLOUR
    return FAR_LINK_COLOUR if behind else LINK_COLOUR


def _shape(ax: Axes, T: Array, shape: Shape, plane: Array, colour: str, alpha: float, order: int) -> None:
    if shape.kind == "box":
        points = box_corners(T, shape) @ plane.T
        outline = points[ConvexHull(points).vertices]
        ax.add_patch(Polygon(outline, closed=True, fc=colour, ec=LINK_COLOUR, lw=1.2, alpha=alpha, zorder=order + 1))
    elif shape.kind == "cylinder":
        radius, length = shape.size
        ends = np.array([T[:3, 3] - 0.5 * length * T[:3, 2], T[:3, 3] + 0.5 * length * T[:3, 2]]) @ plane.T
        _capsule(ax, ends, radius, colour, alpha, order)
    elif shape.kind == "sphere":
        centre = T[:3, 3] @ plane.T
        ax.add_patch(Circle((centre[0], centre[1]), shape.size[0], fc=colour, ec="none", alpha=alpha, zorder=order))


def _capsule(ax: Axes, ends: Array, radius: float, colour: str, alpha: float, order: int) -> None:
    """A link with round ends, (2, 2) m."""
    along = ends[1] - ends[0]
    turn = np.arctan2(along[1], along[0])
    half = np.linspace(-np.pi / 2, np.pi / 2, 14)
    outline = [ends[1] + radius * np.array([np.cos(turn + a), np.sin(turn + a)]) for a in half]
    outline += [ends[0] + radius * np.array([np.cos(turn + np.pi + a), np.sin(turn + np.pi + a)]) for a in half]
    ax.add_patch(Polygon(outline, closed=True, fc=colour, ec="white", lw=0.6, alpha=alpha, zorder=order))


def _trunk_extent(body: Robot, pose: Pose, view: str) -> float:
    """m, how wide the trunk's box is in the drawing's horizontal direction."""
    boxes = [shape for shape in body.links[body.root].visual if shape.kind == "box"]
    if not boxes:
        return 0.0
    size = np.array(boxes[0].size)
    return float(np.abs(pose.T_WB[:3, :3].T @ _plane(view)[0]) @ size)


def _arrow(ax: Axes, start: Array, end: Array, colour: str, width: float, order: int) -> None:
    """An arrow [m], `width` [points] wide; short ones have a small head."""
    head = min(6.0 * width, 0.7 * POINTS_PER_METRE * float(np.linalg.norm(np.asarray(end) - start)))
    ax.add_patch(
        FancyArrowPatch(
            (float(start[0]), float(start[1])),
            (float(end[0]), float(end[1])),
            arrowstyle="-|>",
            mutation_scale=head,
            lw=width,
            color=colour,
            shrinkA=0,
            shrinkB=0,
            zorder=order,
        )
    )


def _force_labels(ax: Axes, pose: Pose, plane: Array) -> None:
    """How large each foot's force is, under the ground."""
    places = pose.p_WF @ plane[0]
    together = len(places) == 2 and abs(places[0] - places[1]) < 0.12
    for foot, (place, force) in enumerate(zip(places, pose.f_F_W, strict=True)):
        side = 0.0 if not together else (0.09 if foot == 0 else -0.09)
        ax.text(
            float(place) + side,
            -0.022,
            f"{np.linalg.norm(force):.0f} N",
            color=style.FEET[foot % len(style.FEET)],
            fontsize=8,
            ha="center",
            va="top",
            zorder=20,
        )
