"""What the plots of walking show, on a walk whose every figure is known."""

from __future__ import annotations

import numpy as np
import pytest
import synthetic_arm
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import StepPatch
from stance import estimation, gait_plots, plots, style, walking
from stance.log import Log
from stance.series import Run
from synthetic import PERIOD, Synthetic, Walk, run_of

WALK = Walk(start=1.0, speed=0.4, recovering=(2, 5))
STEPS = 12
STEP_TIME = 0.25  # s


@pytest.fixture(scope="module")
def walk() -> Run:
    return Log.from_bytes(Synthetic(duration=4.0, pushes=[], walk=WALK).log()).run()


def line(ax: Axes, label: str) -> Line2D:
    (found,) = [one for one in ax.lines if one.get_label() == label]
    return found


def titled(figure: object, words: str) -> Axes:
    (found,) = [ax for ax in figure.axes if words in ax.get_title(loc="left")]  # type: ignore[attr-defined]
    return found


def spans(ax: Axes) -> list[list[tuple[float, float]]]:
    """(start, end) of each bar of each row of bars."""
    return [
        [(float(path.vertices[:, 0].min()), float(path.vertices[:, 0].max())) for path in row.get_paths()]
        for row in ax.collections
        if isinstance(row, PolyCollection)
    ]


def test_a_walk_has_every_plot_and_a_stand_has_none_of_its_steps(walk: Run, stand: Run) -> None:
    of_the_biped = set(plots.PLOTS) - synthetic_arm.PLOTS
    assert set(plots.available(walk)) == of_the_biped
    assert of_the_biped - set(plots.available(stand)) == {"walk", "footholds", "swing"}


def test_the_gait_shows_when_each_foot_was_planned_to_stand_and_how_long_it_swung(walk: Run) -> None:
    figure = plots.PLOTS["gait"].draw(walk)
    top = titled(figure, "Contacts")
    labels = [text.get_text() for text in top.get_yticklabels()]
    planned = spans(top)[labels.index("right: planned")]
    assert planned[:2] == [pytest.approx((0.0, 1.30)), pytest.approx((1.5, 1.80))]
    swings = titled(figure, "Swing times")
    assert line(swings, "left").get_xdata() == pytest.approx(1.05 + 2 * STEP_TIME * np.arange(6))
    assert line(swings, "right").get_ydata() == pytest.approx([200.0] * 6)
    assert line(swings, "gets over a push").get_xdata() == pytest.approx([1.05 + STEP_TIME * i for i in (2, 5)])
    assert line(swings, "planned at lift-off").get_ydata() == pytest.approx([200.0] * STEPS)


def test_a_robot_that_stands_has_no_swing_times(stand: Run) -> None:
    assert len(plots.PLOTS["gait"].draw(stand).axes) == 2


def test_velocity_is_told_as_wanted_estimated_true_and_by_the_stride(walk: Run) -> None:
    forward, left, _ = plots.PLOTS["velocity"].draw(walk).axes
    wanted = line(forward, "wanted, ramped")
    assert np.interp([0.5, 2.0], wanted.get_xdata(), wanted.get_ydata()) == pytest.approx([0.0, 0.4])
    true = line(forward, "true")
    assert true.get_ydata() == pytest.approx(gait_plots.velocities(walk, "TRUTH")[:, 0])
    (strides,) = [patch for patch in forward.patches if isinstance(patch, StepPatch)]
    values, edges, _ = strides.get_data()
    assert edges == pytest.approx(1.25 + 2 * STEP_TIME * np.arange(6))
    row = slice(125, 175)
    assert values[0] == pytest.approx(gait_plots.velocities(walk, "TRUTH")[row, 0].mean())
    assert line(left, "estimated").get_xdata()[-1] == pytest.approx(4.0)


def test_velocities_are_along_the_heading() -> None:
    messages = Synthetic(duration=0.5, pushes=[]).messages()
    yaw = 0.5 * np.pi
    messages["TRUTH"]["quat_WB"] = np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)
    messages["TRUTH"]["v_WC"], messages["TRUTH"]["w_WB_W"] = (-0.1, 0.5, 0.0), (0.0, 0.0, 0.3)
    found = gait_plots.velocities(run_of(messages), "TRUTH")
    assert found[7] == pytest.approx([0.5, 0.1, 0.3])


def test_bars_under_a_curve_are_the_gaits_stances_and_below_all_of_it(walk: Run, stand: Run) -> None:
    figure = style.new_figure(6.0, 2.0, "")
    ax = figure.subplots()
    ax.plot([0.0, 4.0], [-3.0, 5.0])
    low = ax.get_ylim()[0]
    style.stance_bars(ax, walk)
    left, right = spans(ax)
    assert left[:2] == [pytest.approx((0.0, 1.05)), pytest.approx((1.25, 1.55))]
    assert right[0] == pytest.approx((0.0, 1.30))
    tops = [row.get_paths()[0].vertices[:, 1].max() for row in ax.collections]
    assert max(tops) < low and ax.get_ylim()[0] < min(tops)
    before = len(ax.collections)
    style.stance_bars(ax, stand)
    assert len(ax.collections) == before


def test_the_map_shows_where_each_foot_came_down_and_was_to(walk: Run) -> None:
    figure = plots.PLOTS["footholds"].draw(walk)
    (ax,) = figure.axes
    left, planned = line(ax, "left foot, with step"), line(ax, "planned last")
    truth = walk.field("TRUTH", "p_WF")
    rows = [125 + 25 * i for i in range(STEPS)]
    assert np.transpose(left.get_data()) == pytest.approx(truth[rows[::2], 0, :2])
    reached = np.array([truth[row, i % 2, :2] for i, row in enumerate(rows)])
    assert np.transpose(planned.get_data()) == pytest.approx(reached - [0.012, -0.005])
    assert sorted(int(text.get_text()) for text in ax.texts) == list(range(1, STEPS + 1))
    above = {int(text.get_text()): text.xyann[1] > 0.0 for text in ax.texts}  # type: ignore[attr-defined]
    assert above == {number: number % 2 == 1 for number in range(1, STEPS + 1)}
    assert ax.get_aspect() == 1.0


def test_a_long_way_straight_ahead_is_shown_in_strips_of_one_scale() -> None:
    run = Log.from_bytes(Synthetic(duration=8.0, pushes=[], walk=Walk(start=0.5, speed=1.0)).log()).run()
    axes = plots.PLOTS["footholds"].draw(run).axes
    assert len(axes) == 3
    widths = [np.diff(ax.get_xlim())[0] for ax in axes]
    assert widths == pytest.approx([widths[0]] * 3)
    shown = sum(len(line(ax, "planned last").get_xdata()) for ax in axes)
    assert shown == len(walking.landed(walking.steps(run)))


def test_the_zmp_is_the_forces_middle_and_the_dcm_leads_the_centre_of_mass(walk: Run) -> None:
    ways = gait_plots.ground_ways(walk)
    swinging = 110  # the left foot is in the air
    assert ways.zmp[swinging] == pytest.approx(walk.field("TRUTH", "p_WF")[swinging, 1, :2], abs=2e-3)
    force, tips = walk.field("TRUTH", "f_F_W")[50, :2, 2], walk.field("TRUTH", "p_WF")[50, :2, :2]
    assert ways.zmp[50] == pytest.approx(force @ tips / force.sum())
    height = walk.field("TRUTH", "p_WC")[300, 2] - walk.field("TRUTH", "p_WF")[300, :2, 2].min()
    lead = ways.dcm[300] - ways.p_WC[300]
    assert lead == pytest.approx(walk.field("TRUTH", "v_WC")[300, :2] * np.sqrt(height / 9.81))


def test_a_robot_in_the_air_has_no_zmp() -> None:
    messages = Synthetic(duration=0.5, pushes=[]).messages()
    messages["TRUTH"]["f_F_W"][20] = 0.0
    assert np.isnan(gait_plots.ground_ways(run_of(messages)).zmp).any(axis=1).nonzero()[0].tolist() == [20]


def test_the_swings_show_their_error_and_the_footholds_theirs(walk: Run) -> None:
    figure = plots.PLOTS["swing"].draw(walk)
    left = titled(figure, "Left foot less its reference")
    _, _, up = (bundle.get_segments() for bundle in left.collections if isinstance(bundle, LineCollection))
    assert len(up) == STEPS / 2
    for swing in up:
        assert swing == pytest.approx(np.column_stack([10.0 * np.arange(20), np.full(20, 4.0)]))
    side = titled(figure, "Left foot's swings")
    feet, _ = (bundle.get_segments() for bundle in side.collections if isinstance(bundle, LineCollection))
    tips = walk.field("CONTROLLER_TRACE", "p_WF")[105:125]
    assert feet[0] == pytest.approx(1000 * (tips[:, 0] - tips[:, 1])[:, [0, 2]], abs=1.0)
    footholds = titled(figure, "Foothold reached")
    assert line(footholds, "right foot, forward").get_ydata() == pytest.approx([12.0] * 6)
    assert line(footholds, "left foot, left").get_ydata() == pytest.approx([-5.0] * 6)
    slid = titled(figure, "How far each standing foot has slid")
    found = walking.slip(walk)
    assert found is not None
    assert line(slid, "left").get_ydata() == pytest.approx(1000 * found[1][:, 0], nan_ok=True)


def test_the_estimators_errors_lie_in_bands_of_two_sigma(walk: Run) -> None:
    figure = plots.PLOTS["estimator"].draw(walk)
    found = estimation.errors(walk)
    assert found is not None
    forward = figure.axes[1]
    (curve,) = [one for one in forward.lines if len(one.get_xdata()) == len(found.time)]
    assert curve.get_ydata() == pytest.approx(1000 * found.velocity[:, 0])
    band = forward.collections[0].get_paths()[0].vertices[:, 1]
    assert (band.min(), band.max()) == pytest.approx((-4.0, 4.0))  # 2 mm/s is one
    share = 100 * np.mean(np.abs(found.velocity[:, 0]) <= 0.004)
    assert [text.get_text() for text in forward.texts] == [f"{share:.0f}% within"]
    nees = titled(figure, "NEES")
    means = next(patch for patch in nees.patches if isinstance(patch, StepPatch)).get_data().values
    assert means[2] == pytest.approx(found.nees[200:300].mean())
    assert PERIOD * len(found.nees) == pytest.approx(4.01)
