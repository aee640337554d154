"""The catcher's figures, tables and plots, on logs of known content."""

from __future__ import annotations

import numpy as np
import pytest
from stance import catcher, plots
from stance.log import Log
from stance.report import analyse, figures, tables
from stance.series import Run
from synthetic_catcher import PLACE, SyntheticCatcher


@pytest.fixture(scope="module")
def log() -> Log:
    return Log.from_bytes(SyntheticCatcher().log())


@pytest.fixture(scope="module")
def run(log: Log) -> Run:
    return log.run()


def test_every_throw_is_told_with_its_verdict(run: Run) -> None:
    throws = catcher.throws(run)
    assert [one.verdict for one in throws] == ["caught", "bounce", "caught"]
    assert [one.crossed for one in throws] == [True, True, True]
    assert [one.retained for one in throws] == [True, False, True]
    assert [one.time for one in throws] == pytest.approx([0.5, 3.0, 5.5])
    assert all(one.crossing_offset == pytest.approx(0.01) for one in throws)


def test_the_figures_are_the_errors_that_the_log_was_written_with(run: Run) -> None:
    found = catcher.measure(run)
    assert found is not None
    assert found.crossed == 1.0
    assert found.retained == pytest.approx(2 / 3)
    assert found.ball_error_rms == pytest.approx(0.004)
    assert found.nis == pytest.approx(1 / 3)
    assert found.joint_error_max == pytest.approx(1e-3)
    moved = catcher.cup_places(run, PLACE[None] - 1e-3) - catcher.cup_places(run, PLACE[None])
    assert found.cup_error_max == pytest.approx(float(np.linalg.norm(moved)))


def test_manipulability_is_nothing_where_the_arm_is_stretched_and_something_elsewhere(run: Run) -> None:
    stretched = np.array([[0.0, 0.5, 0.0, np.pi / 2, 0.0]])  # upper arm, forearm and tool on one line
    assert catcher.manipulability(run, stretched)[0] < 1e-6
    assert catcher.manipulability(run, PLACE[None])[0] > 1e-3


def test_another_robot_catches_nothing(run: Run) -> None:
    from synthetic import Synthetic

    other = Log.from_bytes(Synthetic(duration=0.5).log()).run()
    assert catcher.measure(other) is None and catcher.throws(other) == []


def test_the_plots_show_the_error_within_its_stated_sigma_and_a_catch_each(run: Run) -> None:
    figure = plots.PLOTS["ball"].draw(run)
    line = next(line for line in figure.axes[0].lines if line.get_label() == "estimated less true")
    shown = np.asarray(line.get_ydata(), float)
    assert shown[np.isfinite(shown)] == pytest.approx(4.0)  # mm
    titles = [ax.get_title(loc="left") for ax in plots.PLOTS["catches"].draw(run).axes]
    assert titles[:3] == ["1: caught, 10 mm", "2: bounce, 10 mm", "3: caught, 10 mm"]


def test_a_catchers_report_has_its_own_plots_and_tables_alone(log: Log) -> None:
    analysis = analyse(log)
    assert analysis.verdict.source == "catcher_demo.yaml"
    drawn = figures(analysis)
    assert {"catches", "ball", "joints"} <= set(drawn)
    assert not {"picture", "forces", "gait", "arm", "joint_rates", "force_qp"} & set(drawn)
    named = {table.title: table for table in tables(analysis.metrics)}
    assert [row[2] for row in named["Throws"].rows] == ["caught", "bounce", "caught"]
    card = drawn["summary_card"]()
    assert any("2 of 3 balls caught" in text.get_text() for text in card.axes[0].texts)
