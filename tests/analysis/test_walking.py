"""Steps, footholds, speeds and costs of walks whose every figure is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from stance import metrics, signals, walking
from stance.log import Log
from stance.series import Run
from synthetic import MASS, PERIOD, START, Synthetic, Walk, records, run_of

WALK = Walk(start=1.0, speed=0.4, recovering=(2, 5))
STEP_TIME = 0.25  # s, of WALK: swing and double support


def changed(walk: Walk = WALK, duration: float = 4.0) -> dict[str, np.ndarray]:
    return Synthetic(duration=duration, pushes=[], walk=walk).messages()


@pytest.fixture(scope="module")
def walk() -> Run:
    return Log.from_bytes(Synthetic(duration=4.0, pushes=[], walk=WALK).log()).run()


def test_every_swing_is_a_step_and_the_last_may_have_no_touchdown(walk: Run) -> None:
    found = walking.steps(walk)
    assert [step.foot for step in found] == [0, 1] * 6
    assert [step.lift_off for step in found] == pytest.approx(1.05 + STEP_TIME * np.arange(12))
    assert [down.time for _, down in walking.landed(found)] == pytest.approx(1.25 + STEP_TIME * np.arange(12))
    assert [down.swing_time for _, down in walking.landed(found)] == pytest.approx([0.2] * 12)
    assert [number for number, step in enumerate(found) if step.recovering] == [2, 5]
    early = walking.steps(walk.between(None, 3.9))[-1]
    assert early.touchdown is None


def test_a_swing_that_ends_in_standing_is_no_touchdown() -> None:
    messages = changed()
    trace = messages["CONTROLLER_TRACE"]
    trace["gait_phase"][215:], trace["steps"][215:] = signals.STANDING, 0
    found = walking.steps(run_of(messages))
    assert [step.touchdown is None for step in found] == [False] * 4 + [True]


def test_swings_with_no_tick_between_them_are_two_steps() -> None:
    messages = changed(Walk(start=1.0, speed=0.4, double_support=0))
    found = walking.steps(run_of(messages))
    assert len(found) == 16
    assert [step.lift_off for step in found] == pytest.approx(1.0 + 0.2 * np.arange(16))


def test_footholds_are_told_as_reached_less_planned_along_the_heading(walk: Run) -> None:
    found = walking.walking(walk)
    assert found is not None
    assert found.foothold_forward is not None and found.foothold_left is not None
    assert found.foothold_forward.mean == pytest.approx(0.012, abs=1e-9)
    assert found.foothold_left.mean == pytest.approx(-0.005, abs=1e-9)
    assert found.foothold_error is not None and found.foothold_error.max == pytest.approx(0.013, abs=1e-9)
    assert found.foothold_change is not None and found.foothold_change.p50 == pytest.approx(0.03)
    assert found.swing_error is not None and found.swing_error.max == pytest.approx(0.004)


def test_the_estimates_drift_and_yaw_are_no_error_of_a_foothold() -> None:
    messages = changed()
    yaw = 0.5 * np.pi
    turned = np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])
    trace = messages["CONTROLLER_TRACE"]
    trace["quat_WB"] = turned
    for name in ("p_WF", "foothold"):
        x, y = trace[name][..., 0].copy(), trace[name][..., 1].copy()
        trace[name][..., 0], trace[name][..., 1] = 7.0 - y, -3.0 + x
    messages["TRUTH"]["quat_WB"] = [1.0, 0.0, 0.0, 0.0]
    for _, down in walking.landed(walking.steps(run_of(messages))):
        assert down.error == pytest.approx((0.012, -0.005), abs=1e-9)


def test_without_the_truth_a_foothold_is_compared_with_the_estimates_feet() -> None:
    messages = changed()
    messages["TRUTH"]["p_WF"] += 99.0 * np.arange(8).reshape(1, 4, 2).sum(axis=2)[..., None]
    del messages["TRUTH"]
    run = run_of(messages)
    assert walking.landed(walking.steps(run))[0][1].error == pytest.approx((0.012, -0.005), abs=1e-3)
    found = walking.walking(run)
    assert found is not None
    assert (found.slip, found.cost_of_transport) == (None, None)
    assert found.distance == pytest.approx(1.2, abs=0.05)


def test_steps_and_their_times_are_counted(walk: Run) -> None:
    found = walking.walking(walk)
    assert found is not None
    assert (found.steps, found.recovering, found.crossing) == (12, 2, 0)
    assert found.step_time is not None and found.swing_time is not None and found.swing_time_change is not None
    assert (found.step_time.min, found.step_time.max) == pytest.approx((STEP_TIME, STEP_TIME))
    assert found.swing_time.mean == pytest.approx(0.2)
    assert found.swing_time_change.mean == pytest.approx(0.0, abs=1e-9)


def test_the_time_between_two_gaits_is_no_step_time() -> None:
    messages = changed()
    messages["CONTROLLER_TRACE"]["gait_phase"][180:301] = signals.STANDING  # from the swing before 2.00 s on
    found = walking.walking(run_of(messages))
    assert found is not None and found.step_time is not None
    assert (found.steps, found.step_time.max) == (7, pytest.approx(STEP_TIME))


def test_a_robot_that_stands_does_not_walk(stand: Run) -> None:
    assert walking.walking(stand) is None
    assert walking.steps(stand) == []
    assert metrics.measure(stand).walking is None


def test_a_ball_that_rolls_does_not_slip_and_one_that_slides_does() -> None:
    messages = Synthetic(duration=1.0, pushes=[]).messages()
    truth = messages["TRUTH"]
    truth["quat_WB"], truth["joint_position"] = [1.0, 0.0, 0.0, 0.0], truth["joint_position"][0]
    truth["p_WB"], truth["f_F_W"][..., 2] = truth["p_WB"][0], 60.0
    pitch = np.linspace(0.0, 0.3, 101)
    truth["joint_position"][:, 3] += pitch
    truth["joint_position"][:, 7] += pitch
    truth["p_WF"][:, 0, 0] += 0.02 * pitch  # rad, about +y: the ball of 2 cm goes forward
    truth["p_WF"][:, 1, 0] -= 0.02 * pitch
    truth["f_F_W"][50, :, 2] = 0.0  # both feet are lifted for a moment
    found = walking.slip(run_of(messages))
    assert found is not None
    moved = found[1]
    assert moved[:50, 0] == pytest.approx(np.zeros(50), abs=1e-9)
    assert np.isnan(moved[50]).all()
    assert moved[49, 1] == pytest.approx(0.04 * pitch[49])
    assert moved[51, 1] == 0.0


def test_what_came_of_each_command_is_told_without_its_start(walk: Run) -> None:
    stood, walked = walking.segments(walk)
    assert (stood.behaviour, walked.behaviour) == ("stand", "walk")
    assert (walked.start, walked.end, walked.measured_from) == pytest.approx((1.0, 4.0, 2.5))
    assert (stood.wanted_velocity, walked.wanted_velocity) == ((0.0, 0.0), (0.4, 0.0))
    assert walked.velocity == pytest.approx((0.4, 0.0), abs=0.01)
    assert (stood.steps, walked.steps) == (0, 12)
    assert walked.distance == pytest.approx(1.2, abs=0.05)


def test_a_segments_velocity_is_along_the_heading_as_the_robot_turns() -> None:
    messages = changed()
    truth = messages["TRUTH"]
    yaw = 0.6 * np.maximum(np.arange(len(truth)) * PERIOD - 1.0, 0.0)
    truth["quat_WB"] = np.stack([np.cos(yaw / 2), 0.0 * yaw, 0.0 * yaw, np.sin(yaw / 2)], axis=1)
    middle = yaw - 0.3 * PERIOD
    way = 0.4 * PERIOD * np.stack([np.cos(middle), np.sin(middle)], axis=1) * (yaw > 0.0)[:, None]
    truth["p_WC"][:, :2] = np.cumsum(way, axis=0)
    messages["USER_COMMAND"] = commanded((0.0, 0, 0.0), (1.0, 1, 0.4))
    walked = walking.segments(run_of(messages))[1]
    assert walked.velocity == pytest.approx((0.4, 0.0), abs=1e-6)
    assert walked.yaw_rate == pytest.approx(0.6)


def test_a_command_that_is_sent_again_is_the_same_and_silence_ends_it() -> None:
    messages = changed()
    messages["USER_COMMAND"] = commanded((0.0, 0, 0.0), (1.0, 1, 0.4), (1.3, 1, 0.4), (1.7, 1, 0.4), (3.0, 1, 0.4))
    patient = run_of(messages)
    assert [(one.start, one.end) for one in walking.segments(patient)] == [
        (0.0, pytest.approx(1.0)),
        (pytest.approx(1.0), pytest.approx(4.0)),
    ]
    assert patient.controller is not None
    text = patient.controller.configuration.replace("controller:\n", "controller:\n  user_command_timeout: 0.5\n")
    impatient = replace(patient, controller=replace(patient.controller, configuration=text))
    assert [(one.start, one.end) for one in walking.segments(impatient)] == [
        (0.0, pytest.approx(0.5)),
        (pytest.approx(1.0), pytest.approx(2.2)),
        (pytest.approx(3.0), pytest.approx(3.5)),
    ]


def test_the_cost_of_transport_is_the_joints_work_over_weight_and_way() -> None:
    messages = changed()
    truth = messages["TRUTH"]
    truth["joint_torque"], truth["joint_position"] = 0.0, 0.0
    truth["joint_position"][:, 2] = 0.1 * np.arange(401)
    truth["joint_torque"][:, 2] = 5.0 * (-1.0) ** np.arange(401)  # N m: half of it is done on the joint
    truth["p_WC"][:, :2] = 0.0
    truth["p_WC"][:, 0] = 0.5 * PERIOD * np.arange(401)
    found = walking.walking(run_of(messages))
    assert found is not None
    assert found.cost_of_transport == pytest.approx(5.0 * 0.1 / (MASS * 9.81 * 0.5 * PERIOD))
    near = run_of(messages).between(None, 2.9)
    assert walking.walking(near).cost_of_transport is None  # type: ignore[union-attr]


def commanded(*wishes: tuple[float, int, float]) -> np.ndarray:
    """(s, behaviour, m/s forward)"""
    command = records("user_command_t", len(wishes))
    for row, (at, behaviour, forward) in zip(command, wishes, strict=True):
        row["utime"], row["behaviour"], row["velocity"][0] = START + round(1e6 * at), behaviour, forward
    command["seq"] = np.arange(1, len(wishes) + 1)
    return command
