"""The 3-joint arm: what its motions amount to, its printout as document 004's terminal, its plots and its report."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from golden import load
from stance import arm3, plots
from stance.cli import main
from stance.errors import StanceError
from stance.log import Log
from stance.metrics import measure
from stance.report import analyse, figures, render, tables
from stance.series import Run
from synthetic import PERIOD, Synthetic
from synthetic_arm import REST, SyntheticArm, place

DOCUMENT = """\
Printing linear velocity:
0.00472567 0.158093 -0.145229
Printing angular velocity:
0.00815092 0.309893 0.3
Orientation change:
8.15092e-05 0.00309893 0.003
Position change:
4.72567e-05 0.00158093 -0.00145229
Printing final(updated) kinematic map
0.928318 -0.0794238 0.17029 1.89399
-0.0244199 0.00208632 0.998128 0.471623
-0.160193 -1.07144 0.41007 -0.998296
0 0 0 1
Printing Jacobian:
0.012281 0.48329 -0.0158199
0.527068 -0.0112609 0.000368612
0 0.471009 -0.49975
0 0.0232942 0.998491
0 0.0549224 0.999729
1 0 0"""


@pytest.fixture(scope="module")
def log() -> Log:
    return Log.from_bytes(SyntheticArm().log())


@pytest.fixture(scope="module")
def run(log: Log) -> Run:
    return log.run()


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(SyntheticArm().write(tmp_path_factory.mktemp("arm") / "arm.log"))


def test_every_motion_is_found_with_its_errors(run: Run) -> None:
    first, second = arm3.motions(run)
    assert (first.steps, second.steps) == (620, 100)
    assert (first.start, second.start) == pytest.approx((REST * PERIOD, (2 * REST + 620) * PERIOD))
    assert first.behaviour == "track"
    for motion in (first, second):
        assert motion.error_max == pytest.approx(1e-3)
        assert motion.error_rms == pytest.approx(1e-3)
        assert motion.rate_error_max == 0.0
        assert motion.orthonormality_max < 1e-12
    assert second.map_error_at_600 is None


def test_the_maps_error_is_its_distance_from_forward_kinematics(run: Run) -> None:
    first, second = arm3.motions(run)
    rows = arm3.spans(run)
    for motion, last in ((first, rows[0][-1]), (second, rows[1][-1])):
        theta = run.field("ARM3_MOTION", "theta")[last] + run.field("ARM3_MOTION", "given_rate")[last] * PERIOD
        distance = np.linalg.norm(run.field("ARM3_MOTION", "map_A3")[last, :3, 3] - place(theta))
        assert motion.map_error_final == pytest.approx(distance, abs=1e-9)
        assert 1e-5 < motion.map_error_final < 1e-2
    assert first.map_error_at_600 == pytest.approx(arm3.map_error(run)[rows[0][599]])


def test_the_tools_error_is_the_joints_error_at_the_end_of_the_arm(run: Run) -> None:
    row = arm3.spans(run)[0][300]
    theta = run.field("ARM3_MOTION", "theta")[row]
    assert arm3.tool_error(run)[row] == pytest.approx(np.linalg.norm(place(theta - 1e-3) - place(theta)), abs=1e-9)


def test_an_arm_neither_stands_nor_falls(run: Run) -> None:
    found = measure(run)
    assert not found.fell
    assert (found.trunk, found.center_of_mass, found.qp, found.walking, found.estimator) == (None,) * 5
    assert found.segments == [] and len(found.motions) == 2
    assert found.joints is not None and len(found.joints.each) == 3
    assert measure(Log.from_bytes(Synthetic(duration=0.5).log()).run()).motions == []


def test_a_step_is_printed_as_the_document_prints_it() -> None:
    golden = load("map_update004.json")["terminal_output_reproduction"]
    step = arm3.Step(600, 6.0, golden["v"], golden["omega"], golden["dphi"], golden["dp"], golden["map"], golden["J"])
    assert step.as_text() == f"step 600, 6.00 s\n{DOCUMENT}"


def test_steps_are_those_that_are_asked_for(run: Run) -> None:
    assert [step.step for step in arm3.steps(run)] == list(range(1, 621))
    assert [step.step for step in arm3.steps(run, 2, 99)] == [99, 100]
    (one,) = arm3.steps(run, 1, 7, 7)
    assert one.time == pytest.approx(6 * PERIOD)
    assert one.dp == pytest.approx([PERIOD * v for v in one.v])
    with pytest.raises(StanceError, match=r"no motion 3 in this log: it holds 2"):
        arm3.steps(run, 3)
    with pytest.raises(StanceError, match=r"it goes from step 1 to 100"):
        arm3.steps(run, 2, 101)
    with pytest.raises(StanceError, match="ARM3_MOTION"):
        arm3.steps(Log.from_bytes(Synthetic(duration=0.5).log()).run())


def test_the_command_prints_steps_and_tells_what_is_not_there(path: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["steps", path, "--from", "3", "--to", "4"]) == 0
    text = capsys.readouterr().out
    assert re.findall(r"^step (\d+), ", text, re.MULTILINE) == ["3", "4"]
    assert text.count("Printing Jacobian:") == 2
    assert main(["steps", path, "--motion", "2", "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)) == 100
    assert main(["steps", path, "--from", "9999"]) == 2


def test_the_documents_three_figures_show_calculated_over_given_rates(run: Run) -> None:
    figure = plots.PLOTS["joint_rates"].draw(run)
    assert len(figure.axes) == 3
    for joint, ax in enumerate(figure.axes):
        lines = {str(line.get_label()): line for line in ax.lines}
        assert {"given", "calculated"} <= set(lines)
        assert lines["calculated"].get_zorder() >= lines["given"].get_zorder()
        given = run.field("ARM3_MOTION", "given_rate")[:, joint]
        assert np.array_equal(np.asarray(lines["given"].get_ydata()), given)


def test_an_arms_report_has_its_own_plots_and_tables_alone(log: Log) -> None:
    analysis = analyse(log)
    assert analysis.verdict.source == "arm3_demo.yaml"
    drawn = figures(analysis)
    assert {"arm", "joint_rates", "tracking", "joints"} <= set(drawn)
    assert not {"picture", "forces", "gait", "velocity", "estimator", "force_qp", "center_of_mass"} & set(drawn)
    for name in ("arm", "tracking", "summary_card"):
        assert drawn[name]().axes
    titles = [table.title for table in tables(analysis.metrics)]
    assert "Motion 1: track" in titles and "Force QP" not in titles
    page = render(analysis, {})
    assert "without a fall" not in page


def test_an_arm_without_the_truth_is_measured_too(path: str, tmp_path: Path) -> None:
    messages = {name: values for name, values in SyntheticArm().messages().items() if name != "TRUTH"}

    class Blind(SyntheticArm):
        def messages(self) -> dict[str, np.ndarray]:  # type: ignore[type-arg]
            super().messages()
            return messages

    blind = Log.from_bytes(Blind().log()).run()
    assert [motion.steps for motion in arm3.motions(blind)] == [620, 100]
    assert arm3.motions(blind)[0].error_max == 0.0
    assert plots.PLOTS["arm"].draw(blind).axes and plots.PLOTS["tracking"].draw(blind).axes
