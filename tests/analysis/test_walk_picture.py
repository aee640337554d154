"""The walk from the side, on a walk whose every figure is known."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.patches import Polygon
from stance import configuration, plots, walk_picture, walking
from stance.errors import UnreadableError
from stance.log import Log
from stance.series import Run
from synthetic import Synthetic, Walk, run_of

WALK = Walk(start=0.5, speed=0.5)


@pytest.fixture(scope="module")
def walk() -> Run:
    return Log.from_bytes(Synthetic(duration=8.0, pushes=[], walk=WALK).log()).run()


def view(run: Run, first: float, last: float) -> walk_picture.SideView:
    body = configuration.robot(run)
    assert body is not None
    return walk_picture.side_view(run, first, last, body)


def turned(yaw: float) -> Run:
    """The same walk, in another direction."""
    messages = Synthetic(duration=3.0, pushes=[], walk=WALK).messages()
    cos, sin = np.cos(yaw), np.sin(yaw)
    truth = messages["TRUTH"]
    for name in ("p_WB", "p_WC", "p_WF", "f_F_W"):
        x, y = truth[name][..., 0].copy(), truth[name][..., 1].copy()
        truth[name][..., 0], truth[name][..., 1] = cos * x - sin * y, sin * x + cos * y
    w, x, y, z = truth["quat_WB"].T.copy()
    c, s = np.cos(yaw / 2), np.sin(yaw / 2)
    truth["quat_WB"] = np.stack([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w], axis=1)
    return run_of(messages)


def test_the_middle_of_a_long_walk_is_drawn_and_all_of_a_short_one(walk: Run) -> None:
    first, last = walk_picture.middle_of_the_walk(walk)
    ends = [down.time for _, down in walking.landed(walking.steps(walk))]
    assert any(first == pytest.approx(end) for end in ends) and any(last == pytest.approx(end) for end in ends)
    assert 0.5 * (last - first) == pytest.approx(walk_picture.WAY, abs=0.15)
    assert 0.5 * (first + last) == pytest.approx(0.5 * (0.55 + ends[-1]), abs=0.25)
    short = walk.between(None, 2.0)
    landed = walking.landed(walking.steps(short))
    assert walk_picture.middle_of_the_walk(short) == pytest.approx((0.55, landed[-1][1].time))


def test_legs_hang_from_the_trunk_to_the_tips_and_the_way_begins_at_zero(walk: Run) -> None:
    found = view(walk, 3.0, 5.0)
    assert found.time == pytest.approx(np.arange(3.0, 5.005, 0.01))
    assert found.p_WC[0, 0] == pytest.approx(0.0)
    assert found.p_WC[-1, 0] == pytest.approx(1.0, abs=0.02)
    for foot, leg in enumerate(found.legs):
        assert leg[:, -1] == pytest.approx(found.tips[:, foot])
        lengths = np.linalg.norm(np.diff(leg[100], axis=0), axis=1)
        assert lengths[-3:] == pytest.approx([0.26, 0.26, 0.24], abs=0.01)  # thigh, shank, tarsus, hardly rolled
    low, high = (np.min(found.trunk[0], axis=0), np.max(found.trunk[0], axis=0))
    assert high - low == pytest.approx([0.6, 0.2], abs=0.02)


@pytest.mark.parametrize("yaw", [0.7, 2.0, -3.0])
def test_the_view_is_from_the_robots_right_wherever_it_goes(yaw: float) -> None:
    ahead, there = view(turned(0.0), 1.0, 2.5), view(turned(yaw), 1.0, 2.5)
    for name in ("p_WC", "tips", "force"):
        assert getattr(there, name) == pytest.approx(getattr(ahead, name), abs=0.02 if name != "force" else 2.0)


def test_a_robot_that_walks_backward_goes_to_the_left() -> None:
    run = run_of(Synthetic(duration=3.0, pushes=[], walk=Walk(start=0.5, speed=-0.5)).messages())
    assert view(run, 1.0, 2.5).p_WC[-1, 0] == pytest.approx(-0.75, abs=0.02)


def test_the_picture_has_a_stick_for_each_interval_each_loaded_foots_force_and_numbered_steps(walk: Run) -> None:
    (ax,) = plots.PLOTS["walk"].draw(walk).axes
    first, last = walk_picture.middle_of_the_walk(walk)
    legs, forces, other_legs, other_forces = (one for one in ax.collections if isinstance(one, LineCollection))
    sticks = 1 + int((last - first + 1e-6) / walk_picture.INTERVAL)
    assert len(legs.get_segments()) == len(other_legs.get_segments()) == sticks
    found = view(walk, first, last)
    rows = np.arange(sticks) * 5
    for foot, lines in enumerate((forces, other_forces)):
        loaded = rows[found.force[rows, foot, 1] > 5.0]
        drawn = np.array(lines.get_segments())
        assert drawn[:, 0] == pytest.approx(found.tips[loaded, foot])
        assert drawn[:, 1] - drawn[:, 0] == pytest.approx(0.002 * found.force[loaded, foot])
    numbers = {int(text.get_text()) for text in ax.texts if text.get_text().isdigit()}
    ends = [down.time for _, down in walking.landed(walking.steps(walk))]
    assert numbers == {number for number, end in enumerate(ends, 1) if first <= end <= last}
    trunks = [patch for patch in ax.patches if isinstance(patch, Polygon)]
    assert len(trunks) == 5  # of 2 m
    bottom = min(patch.get_path().vertices[:, 0].min() for patch in trunks)
    assert ax.get_xlim()[0] < bottom


def test_the_ground_is_where_the_feet_stand() -> None:
    messages = Synthetic(duration=3.0, pushes=[], walk=WALK).messages()
    rise = 0.1
    for name in ("p_WB", "p_WC", "p_WF"):
        messages["TRUTH"][name][..., 2] += rise * messages["TRUTH"][name][..., 0]
    (ax,) = plots.PLOTS["walk"].draw(run_of(messages)).axes
    (ground,) = [line for line in ax.lines if len(line.get_xdata()) and max(line.get_xdata()) > 50.0]
    way, height = ground.get_data()
    assert np.polyfit(way[1:-1], height[1:-1], 1)[0] == pytest.approx(rise, abs=0.02)


def test_without_a_step_there_is_no_walk_to_draw(stand: Run) -> None:
    assert not walk_picture.walks(stand)
    for draw in (walk_picture.walk, walk_picture.middle_of_the_walk):
        with pytest.raises(UnreadableError, match="no walk to draw"):
            draw(stand)
