"""Pushes of trials as they were drawn, and the map that counts them."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Rectangle
from stance import push_map
from stance.errors import StanceError
from stance.push_map import Panel, count, panels
from stance.pushes import PushTrial, drawn_scenario, has_one_push, push_of


def trial(impulse: float, degrees: float, succeeded: bool = True) -> PushTrial:
    return PushTrial(1, impulse, float(np.radians(degrees)), succeeded)


def test_what_was_drawn_stands_in_the_place_of_what_it_was_drawn_from() -> None:
    scenario = yaml.safe_load(
        """
        friction: {uniform: [0.5, 0.8]}
        terrain: {choice: [flat, {slope: [{uniform: [-0.2, 0.2]}, 0], tiles: none}]}
        plant: {choice: [multibody, single-body]}
        pushes:
          - {time: {uniform: [5, 7]}, duration: 0.1, force_W: {choice: [[8, 0, 0], [0, {uniform: [-40, 40]}, 0]]}}
        """
    )
    drawn = {
        "friction": 0.6,
        "terrain": "choice[2]",
        "terrain.choice[2].slope[1]": 0.1,
        "plant": "single-body",
        "pushes[1].time": 5.5,
        "pushes[1].force_W": "choice[2]",
        "pushes[1].force_W.choice[2][2]": -30.0,
    }
    assert drawn_scenario(scenario, drawn) == {
        "friction": 0.6,
        "terrain": {"slope": [0.1, 0], "tiles": "none"},
        "plant": "single-body",
        "pushes": [{"time": 5.5, "duration": 0.1, "force_W": [0, -30.0, 0]}],
    }


def test_a_push_is_told_by_its_impulse_and_direction_however_it_is_written() -> None:
    by_force = {"pushes": [{"duration": 0.1, "force_W": [0, -30.0, 5.0]}]}
    assert push_of(by_force) == pytest.approx((3.0, -np.pi / 2))
    by_impulse = {"pushes": [{"duration": 0.3, "impulse": 6, "direction": 4.71238898}]}
    assert push_of(by_impulse) == pytest.approx((6.0, -np.pi / 2))


@pytest.mark.parametrize("pushes", [None, [], [{}, {}], {"choice": [[], [{}]]}])
def test_a_scenario_with_another_number_of_pushes_is_not_for_the_map(pushes: object) -> None:
    assert not has_one_push({"pushes": pushes})
    assert not has_one_push({})


def test_cells_that_differ_in_the_impulse_alone_share_a_panel() -> None:
    cells = [
        ("6 N s", [trial(6.0, 0.0)]),
        ("6 N s, noisy", [trial(6.0, 10.0)]),
        ("12 N s", [trial(12.0, 20.0)]),
        ("12.5 N s in 0.1 s, in place", [trial(12.5, 30.0)]),
        ("an ellipse", [trial(1.0, 0.0), trial(4.0, 90.0)]),
        ("not pushed", []),
    ]
    assert [(panel.title, len(panel.trials)) for panel in panels(cells)] == [
        ("", 2),
        ("noisy", 1),
        ("in 0.1 s, in place", 1),
        ("an ellipse", 2),
    ]


def test_trials_are_counted_by_impulse_and_by_the_sector_about_their_direction() -> None:
    found = count([trial(6.0, 20.0), trial(6.0, -22.0, False), trial(6.0, 180.0), trial(8.0, -179.0), trial(8.0, 47.0)])
    assert found.labels == ["6", "8"]
    assert found.count.tolist() == [[2, 0, 0, 0, 1, 0, 0, 0], [0, 1, 0, 0, 1, 0, 0, 0]]
    assert found.succeeded.tolist() == [[1, 0, 0, 0, 1, 0, 0, 0], [0, 1, 0, 0, 1, 0, 0, 0]]


@pytest.mark.parametrize(("directions", "sectors"), [(4, 8), (8, 8), (16, 16)])
def test_each_of_a_few_directions_has_a_sector_of_its_own(directions: int, sectors: int) -> None:
    degrees = 360.0 / directions * np.arange(3 * directions)
    found = count([trial(6.0, one) for one in degrees])
    assert found.count.shape == (1, sectors)
    assert sorted(found.count[0]) == [0] * (sectors - directions) + [3] * directions


def test_many_trials_have_more_sectors_and_many_impulses_are_ranges() -> None:
    random = np.random.default_rng(5)
    for trials, sectors in ((40, 8), (200, 16)):
        spread = count([trial(6.0, degrees) for degrees in random.uniform(-180.0, 180.0, trials)])
        assert spread.count.shape == (1, sectors) and spread.count.sum() == trials
    impulses = random.uniform(0.0, 16.0, 300)
    ranges = count([trial(float(impulse), 0.0, impulse < 8.0) for impulse in impulses])
    assert len(ranges.labels) == push_map.RINGS
    assert ranges.count.sum() == 300
    assert ranges.succeeded.sum() == (impulses < 8.0).sum()
    assert ranges.edges[-1] >= impulses.max()


def labels(ax: Axes) -> list[tuple[float, float, str]]:
    return [(*text.get_position(), text.get_text()) for text in ax.texts]


def test_the_map_has_the_front_up_the_left_at_the_left_and_says_the_counts() -> None:
    trials = [trial(6.0, 90.0), trial(6.0, 90.0), trial(6.0, 0.0, False), trial(8.0, 90.0, False), trial(8.0, 90.0)]
    figure = push_map.push_map([Panel("in place", trials)], "Pushed", "seeds from 1")
    (ax,) = figure.axes
    assert (ax.get_theta_offset(), ax.get_theta_direction()) == (pytest.approx(np.pi / 2), 1)  # type: ignore[attr-defined]
    left = np.pi / 2
    told = {(round(angle, 6), round(r - push_map.HOLE, 6)): words for angle, r, words in labels(ax)}
    assert told == {(round(left, 6), 0.5): "2/2", (0.0, 0.5): "0/1", (round(left, 6), 1.5): "1/2"}
    fields = [patch for patch in ax.patches if isinstance(patch, Rectangle)]
    at = {(round(one.get_x() + one.get_width() / 2, 6), round(one.get_y(), 6)): one.get_facecolor() for one in fields}
    colours = [at[round(angle, 6), round(push_map.HOLE + ring, 6)][:3] for angle, ring in ((left, 0), (0.0, 0))]
    assert colours == [pytest.approx(push_map.RATES(1.0)[:3]), pytest.approx(push_map.RATES(0.0)[:3])]
    assert at[round(np.pi, 6), round(push_map.HOLE, 6)][:3] == pytest.approx(to_rgb(push_map.style.GRID))
    assert ax.get_xlabel() == "from inside out: 6 N s: 2/3, 8 N s: 1/2"


def test_without_a_push_there_is_no_map() -> None:
    with pytest.raises(StanceError, match="nothing to map"):
        push_map.push_map(panels([("stand", [])]), "Standing")
