"""Every figure on data whose answer is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from stance import configuration, metrics, signals
from stance.estimation import errors, estimator_error
from stance.log import Log
from stance.messages import message_type
from stance.metrics import measure
from stance.signals import Percentiles
from synthetic import PERIOD, WALL, Synthetic, encode_log, run_of, ticked

N = 101


def base(**more: object) -> dict:
    state = ticked("robot_state_t", N)
    state["num_joints"], state["num_contacts"], state["sample_period"] = 8, 2, PERIOD / 2
    return {"ROBOT_STATE": state, **more}


def truth() -> np.ndarray:
    result = ticked("truth_t", N)
    result["quat_WB"][:, 0] = 1.0
    result["num_contacts"], result["num_joints"] = 2, 8
    return result


def trace() -> np.ndarray:
    result = ticked("controller_trace_t", N)
    result["quat_WB"][:, 0] = 1.0
    result["state_seq"], result["state_is_new"], result["qp_status"] = result["seq"], 1, 1
    return result


def test_the_names_of_values_are_those_of_the_messages() -> None:
    trace_type = message_type("controller_trace_t").python_class
    assert [getattr(message_type("controller_timing_t").python_class, name.upper()) for name in metrics.STAGES] == list(
        range(9)
    )
    assert [getattr(trace_type, name.upper()) for name in metrics.FAULTS] == list(range(trace_type.NUM_FAULTS))
    assert [getattr(trace_type, name.upper()) for name in metrics.SAFETY_MODES] == [0, 1, 2, 3]
    assert [getattr(trace_type, "QP_" + name.upper()) for name in metrics.QP_STATUS] == list(range(6))
    assert [trace_type.STANDING, trace_type.DOUBLE_SUPPORT, trace_type.SINGLE_SUPPORT] == [
        signals.STANDING,
        signals.DOUBLE_SUPPORT,
        signals.SINGLE_SUPPORT,
    ]
    behaviours = message_type("user_command_t").python_class
    assert [getattr(behaviours, name.upper()) for name in signals.BEHAVIOURS] == list(range(6))


def test_percentiles_are_values_that_occurred() -> None:
    found = Percentiles.of(np.arange(1.0, 1001.0))
    assert found == Percentiles(501.0, 991.0, 1000.0, 1000.0)
    assert Percentiles.of(np.array([])) is None
    assert Percentiles.of(np.array([np.nan, 2.0])) == Percentiles(2.0, 2.0, 2.0, 2.0)


@pytest.mark.parametrize("axis", [0, 1])
def test_tilt_is_the_angle_from_upright_about_any_horizontal_axis(axis: int) -> None:
    messages = truth()
    angle = np.radians(np.linspace(0.0, 12.0, N))
    messages["quat_WB"][:, 0], messages["quat_WB"][:, 1 + axis] = np.cos(angle / 2), np.sin(angle / 2)
    found = metrics.trunk(run_of(base(TRUTH=messages)))
    assert found is not None
    assert found.tilt_max_deg == pytest.approx(12.0)
    assert found.tilt_rms_deg == pytest.approx(np.sqrt(np.mean(np.linspace(0.0, 12.0, N) ** 2)))


def test_tilt_does_not_see_yaw() -> None:
    messages = truth()
    messages["quat_WB"][:, 0], messages["quat_WB"][:, 3] = np.cos(0.7), np.sin(0.7)
    run = run_of(base(TRUTH=messages))
    found = metrics.trunk(run)
    assert found is not None and found.tilt_max_deg == pytest.approx(0.0, abs=1e-9)
    assert signals.roll_pitch_yaw(run.field("TRUTH", "quat_WB"))[0] == pytest.approx([0.0, 0.0, 1.4])


def test_an_orientation_that_is_none_is_told_and_breaks_nothing() -> None:
    messages = truth()
    messages["quat_WB"][30], messages["quat_WB"][40] = np.nan, 0.0
    found = metrics.trunk(run_of(base(TRUTH=messages)))
    assert found is not None and np.isnan(found.tilt_max_deg)
    assert np.isnan(signals.tilt(messages["quat_WB"])).nonzero()[0].tolist() == [30, 40]


def test_a_fall_is_when_the_truth_says_so() -> None:
    messages = truth()
    messages["fallen"][60:] = 1
    assert metrics.fall(run_of(base(TRUTH=messages))) == pytest.approx(0.6)
    assert metrics.fall(run_of(base(TRUTH=truth()))) is None


def test_without_truth_a_fall_is_the_controllers_fault() -> None:
    messages = trace()
    messages["faults"][70:] = 1 << metrics.FAULTS.index("robot_fallen")
    assert metrics.fall(run_of(base(CONTROLLER_TRACE=messages))) == pytest.approx(0.7)


def test_the_centre_of_mass_is_compared_at_the_instant_of_the_state() -> None:
    messages, plan = truth(), trace()
    messages["p_WC"][:, 0] = np.linspace(0.0, 0.1, N)
    plan["x_ref"][:, 3] = np.linspace(0.0, 0.1, N)
    plan["x_ref"][50, 4] = 0.03
    plan["state_seq"][1:] -= 1  # a period late
    plan["state_seq"][0], plan["state_is_new"][0] = 0, 0
    found = metrics.center_of_mass(run_of(base(TRUTH=messages, CONTROLLER_TRACE=plan)))
    assert found is not None
    assert found.error_max == pytest.approx(np.hypot(0.03, 0.001))
    assert found.error_final == pytest.approx(0.001)


def test_missed_ticks_are_counted_and_explained() -> None:
    timing = ticked("controller_timing_t", N)
    timing["wake_latency_us"], timing["tick_us"], timing["slack_us"] = 50.0, 300.0, 9000.0
    timing["missed_ticks"][40:] = 2
    timing["wake_latency_us"][40] = 21_000.0
    timing["missed_ticks"][80:] = 3
    timing["tick_us"][79] = 12_000.0
    timing["wake_latency_us"][80] = 2_300.0
    found = metrics.ticks(run_of(base(CONTROLLER_TIMING=timing)))
    assert found is not None
    assert (found.count, found.missed, found.lockstep) == (N, 3, False)
    assert found.missed_share == pytest.approx(3 / (N + 3))
    assert [(miss.at, miss.ticks) for miss in found.misses] == [(pytest.approx(0.4), 2), (pytest.approx(0.8), 1)]
    assert found.misses[0].cause == "woke 21.0 ms late: the machine ran something else"
    assert found.misses[1].cause == "the tick before took 12.0 ms"


def test_slip_is_what_the_states_lost_against_the_loggers_clock_and_no_jitter() -> None:
    synthetic = Synthetic(duration=4.0, pushes=[])
    late = np.random.default_rng(3).exponential(2_000.0, 401)  # us
    found = []
    for lost in (0, 30_000):  # us, from 1.2 s on
        events = [
            (received + (lost if received > WALL + 1_200_000 else 0) + int(late[i % 401]), channel, payload)
            for i, (received, channel, payload) in enumerate(synthetic.events())
        ]
        ticks = metrics.ticks(Log.from_bytes(encode_log(events)).run())
        assert ticks is not None and ticks.slip is not None
        found.append(ticks.slip)
    assert found == [pytest.approx(0.0, abs=1e-3), pytest.approx(0.03, abs=1e-3)]
    in_lockstep = metrics.ticks(Log.from_bytes(Synthetic(duration=1.0, realtime=False).log()).run())
    assert in_lockstep is not None and in_lockstep.slip is None


def test_missed_ticks_add_up_over_a_controller_that_was_started_again() -> None:
    timing = ticked("controller_timing_t", N)
    timing["slack_us"] = 9000.0
    timing["missed_ticks"][10:50] = 4
    timing["seq"][50:] = np.arange(1, N - 49)
    timing["missed_ticks"][50:] = 1
    found = metrics.ticks(run_of(base(CONTROLLER_TIMING=timing)))
    assert found is not None and found.missed == 5


def test_misses_from_before_the_run_are_not_its_own() -> None:
    timing = ticked("controller_timing_t", N)
    timing["seq"] += 500
    timing["slack_us"], timing["missed_ticks"], timing["dropped_states"] = 9000.0, 7, 60
    timing["dropped_states"][50:] = 62
    found = metrics.ticks(run_of(base(CONTROLLER_TIMING=timing)))
    assert found is not None
    assert (found.missed, found.dropped_states) == (0, 2)


def test_ticks_without_a_new_state_are_a_share_of_all() -> None:
    timing, decided = ticked("controller_timing_t", N), trace()
    decided["state_is_new"][20:25] = 0
    found = metrics.ticks(run_of(base(CONTROLLER_TIMING=timing, CONTROLLER_TRACE=decided)))
    assert found is not None
    assert (found.without_new_state, found.without_new_state_share) == (5, pytest.approx(5 / N))


def test_lockstep_has_stage_times_but_no_latency() -> None:
    timing = ticked("controller_timing_t", N)
    timing["tick_us"] = np.arange(N)
    timing["stage_us"][:, 5] = 7.0
    run = run_of(base(CONTROLLER_TIMING=timing))
    found = metrics.timing(run)
    assert metrics.is_lockstep(run)
    assert found is not None
    assert found.tick_us is not None and found.tick_us.max == N - 1
    assert found.stage_us["force_qp"] == Percentiles(7.0, 7.0, 7.0, 7.0)
    assert found.rest_us is not None and found.rest_us.max == N - 1 - 7.0
    assert sum(found.share.values()) == pytest.approx(1.0)
    parts = 7.0 * N + sum(max(k - 7.0, 0.0) for k in range(N))
    assert (found.share["force_qp"], found.share["plan"]) == pytest.approx((7.0 * N / parts, 0.0))
    assert found.wake_latency_us is None and found.period_jitter_us is None and found.state_to_command_us is None


def test_jitter_and_latency_in_real_time() -> None:
    timing = ticked("controller_timing_t", N)
    timing["slack_us"], timing["tick_us"], timing["state_age_us"] = 9000.0, 250.0, 650.0
    timing["period_us"] = 10_000.0
    timing["period_us"][30] = 10_400.0
    found = metrics.timing(run_of(base(CONTROLLER_TIMING=timing)))
    assert found is not None and found.period_jitter_us is not None and found.state_to_command_us is not None
    assert (found.period_jitter_us.p50, found.period_jitter_us.max) == (0.0, 400.0)
    assert found.state_to_command_us.p99 == 900.0
    assert found.slack_min_us == 9000.0


def test_the_qp_counts_what_ran_and_what_failed() -> None:
    messages = trace()
    messages["qp_status"][:10], messages["qp_status"][50] = 0, 2
    messages["qp_iterations"], messages["qp_primal_residual"] = 25, 1e-9
    messages["qp_primal_residual"][3], messages["qp_primal_residual"][70] = 9.0, 0.25  # the first did not run
    messages["effort"] = 2.0
    found = metrics.force_qp(run_of(base(CONTROLLER_TRACE=messages)))
    assert found is not None
    assert found.status == {"not_run": 10, "solved": N - 11, "max_iterations": 1}
    assert found.failures == 1
    assert found.primal_residual_max == 0.25
    assert found.iterations == Percentiles(25, 25, 25, 25)
    assert found.effort_mean == 2.0


def test_a_residual_that_is_not_finite_is_infinite() -> None:
    messages = trace()
    messages["qp_dual_residual"][20] = np.nan
    found = metrics.force_qp(run_of(base(CONTROLLER_TRACE=messages)))
    assert found is not None and found.dual_residual_max == np.inf


def test_friction_uses_the_controllers_mu_and_only_loaded_contacts() -> None:
    plan, messages = ticked("force_plan_t", N), truth()
    plan["num_contacts"], plan["num_stages"], plan["contact"][:, 0, :2] = 2, 1, 1
    plan["force"][:, 0, :2, 2] = 60.0
    plan["force"][30, 0, 0, :2] = 3.0, -16.5
    plan["force"][40, 0, 1] = 100.0, 0.0, 1.0  # hardly loaded
    plan["contact"][50, 0, 0], plan["force"][50, 0, 0] = 0, (90.0, 0.0, 100.0)  # not in contact
    messages["f_F_W"][:, :2, 2] = 50.0
    messages["f_F_W"][20, 1] = 3.0, 4.0, 50.0
    found = metrics.friction(run_of(base(FORCE_PLAN=plan, TRUTH=messages)))
    assert found.mu == 0.55
    assert found.planned_share_max == pytest.approx(16.5 / (0.55 * 60.0))
    assert found.true_ratio_max == pytest.approx(0.1)


def test_planned_and_true_forces_are_measured_by_one_pyramid_along_the_heading() -> None:
    plan, messages, decided = ticked("force_plan_t", N), truth(), trace()
    plan["num_contacts"], plan["num_stages"], plan["contact"][:, 0, :2] = 2, 1, 1
    decided["x_ref"][:, 2] = np.radians(179.0 + 0.04 * np.arange(N))
    decided["x_ref"][decided["x_ref"][:, 2] > np.pi, 2] -= 2.0 * np.pi
    force = 50.0 * np.array([0.2, -0.1, 1.0])
    plan["force"][:, 0, :2], messages["f_F_W"][:, :2] = force, force
    run = run_of(base(FORCE_PLAN=plan, TRUTH=messages, CONTROLLER_TRACE=decided))
    planned, _ = metrics.planned_forces(run)
    shares = metrics.cone_share(run, "FORCE_PLAN", planned)
    assert metrics.cone_share(run, "TRUTH", run.field("TRUTH", "f_F_W")[:, :2]) == pytest.approx(shares)
    assert shares[25] == pytest.approx(0.2 / 0.55, abs=1e-6)  # at 180 degrees


def test_the_pyramid_of_a_robot_that_walks_is_along_the_worlds_axes() -> None:
    plan, decided = ticked("force_plan_t", N), trace()
    plan["num_contacts"], plan["num_stages"], plan["contact"][:, 0, :2] = 2, 1, 1
    plan["force"][:, 0, :2] = 11.0, 11.0, 40.0
    decided["x_ref"][:, 2] = np.radians(45.0)
    decided["gait_phase"][50:] = signals.SINGLE_SUPPORT
    run = run_of(base(FORCE_PLAN=plan, CONTROLLER_TRACE=decided))
    shares = metrics.cone_share(run, "FORCE_PLAN", metrics.planned_forces(run)[0])
    assert shares[[10, 60], 0] == pytest.approx([np.sqrt(2.0) * 0.5, 0.5])


def test_a_robot_that_walks_is_measured_by_the_friction_that_it_walks_with() -> None:
    plan, messages, decided = ticked("force_plan_t", N), truth(), trace()
    decided["gait_phase"][40:60], decided["gait_phase"][60:80] = signals.DOUBLE_SUPPORT, signals.SINGLE_SUPPORT
    run = run_of(base(FORCE_PLAN=plan, TRUTH=messages, CONTROLLER_TRACE=decided))
    assert metrics.friction_at(run, "FORCE_PLAN") == pytest.approx(np.full(N, 0.55))  # nothing else is in this log
    assert run.controller is not None
    text = run.controller.configuration + "  walk: {friction: 0.4}\n"
    run = replace(run, controller=replace(run.controller, configuration=text))
    planned = np.where((np.arange(N) >= 40) & (np.arange(N) < 80), 0.4, 0.55)
    assert metrics.friction_at(run, "FORCE_PLAN") == pytest.approx(planned)
    assert metrics.friction_at(run, "TRUTH") == pytest.approx(np.append(planned[:1], planned[:-1]))
    assert configuration.friction_text(run) == "µ = 0.55, walking 0.4"


def test_without_stages_there_is_no_plan() -> None:
    plan = ticked("force_plan_t", N)
    plan["num_contacts"], plan["num_stages"] = 2, 1
    plan["num_stages"][40:] = 0  # damped
    force, contact = metrics.planned_forces(run_of(base(FORCE_PLAN=plan)))
    assert np.isnan(force[40:]).all() and not np.isnan(force[:40]).any() and not contact[40:].any()


def test_the_force_error_is_per_foot_and_only_where_there_is_a_plan() -> None:
    messages = truth()
    messages["plan_seq"][1:] = 1
    messages["force_error"][0, 0, 0] = 1000.0
    messages["force_error"][1:, 0] = 3.0, 4.0, 0.0
    found = metrics.force_error(run_of(base(TRUTH=messages)))
    assert found is not None
    assert (found.rms, found.max) == (pytest.approx(5.0 / np.sqrt(2)), pytest.approx(5.0))


def test_joint_shares_are_of_the_limits_in_the_urdf() -> None:
    messages = truth()
    messages["joint_torque"][10, 2] = -45.0  # of 60
    messages["joint_velocity"][20, 5] = 6.0  # of 30
    messages["joint_position"][:, 0] = 0.4  # of +-0.8
    found = metrics.joints(run_of(base(TRUTH=messages)))
    assert found is not None
    by_name = {use.name: use for use in found.each}
    assert by_name["q2_l"].torque_share_max == pytest.approx(0.75)
    assert by_name["q1_r"].speed_share_max == pytest.approx(0.2)
    assert by_name["q0_l"].position_share_max == pytest.approx(0.5)
    assert by_name["q2_r"].position_share_max == pytest.approx(1.325 / 1.275)  # 0 rad is outside 0.05..2.6
    assert found.torque_share_max == pytest.approx(0.75)


def test_the_estimators_error_is_taken_at_the_same_instant() -> None:
    messages, estimate = truth(), trace()
    messages["p_WB"][:, 0] = np.linspace(0.0, 1.0, N)
    estimate["p_WB"][:, 0] = np.linspace(0.0, 1.0, N) + np.linspace(0.001, 0.005, N)
    angle = np.radians(2.0)
    estimate["quat_WB"][30] = np.cos(angle / 2), np.sin(angle / 2), 0.0, 0.0
    estimate["quat_WB"][31] = np.cos(angle), 0.0, 0.0, np.sin(angle)
    estimate["state_is_new"][90], estimate["p_WB"][90] = 0, 99.0  # no new state: says nothing of the estimate
    found = estimator_error(run_of(base(TRUTH=messages, CONTROLLER_TRACE=estimate)))
    assert found is not None
    assert found.position_max == pytest.approx(0.005)
    assert found.position_drift == pytest.approx(0.004)
    assert found.tilt_max_deg == pytest.approx(2.0)
    assert found.yaw_max_deg == pytest.approx(4.0)


def test_the_estimators_errors_are_those_of_a_robot_that_does_not_know_its_yaw() -> None:
    messages, estimate = truth(), trace()
    half = np.radians(90.0) / 2
    estimate["quat_WB"][:] = np.cos(half), 0.0, 0.0, np.sin(half)  # a quarter turn off, and all else right
    messages["v_WB"][:] = 0.5, 0.1, 0.0
    estimate["v_WB"][:] = -0.1, 0.5, 0.02
    messages["p_WB"][:, 0] = estimate["p_WB"][:, 1] = 5.0 * np.linspace(0.0, 1.0, N)
    messages["f_F_W"][:50, 0, 2], messages["f_F_W"][50:, 1, 2] = 130.0, 130.0
    messages["p_WB"][:, 2], estimate["p_WB"][:, 2] = 0.82, 0.824
    messages["p_WF"][:, :, 2], estimate["p_WF"][:, :, 2] = 0.02, 0.021
    estimate["p_WF"][50:, 0, 2] = 9.0  # in swing
    estimate["sigma_v"], estimate["sigma_theta"] = 0.01, 0.001
    found = estimator_error(run_of(base(TRUTH=messages, CONTROLLER_TRACE=estimate)))
    assert found is not None
    assert found.yaw_max_deg == pytest.approx(90.0)
    assert (found.roll_rms, found.pitch_rms) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert found.heading_velocity_rms == pytest.approx(0.02)
    assert found.height_rms == pytest.approx(0.003)
    assert found.odometry_share == pytest.approx(np.sqrt(2.0))
    assert found.nees == pytest.approx(2.0**2 / 5.0)


def test_the_stated_sigma_turn_with_the_heading() -> None:
    messages, estimate = truth(), trace()
    half = np.radians(90.0) / 2
    messages["quat_WB"][:] = estimate["quat_WB"][:] = np.cos(half), 0.0, 0.0, np.sin(half)
    estimate["v_WB"][:, 1] = 0.03  # forward
    estimate["sigma_v"], estimate["sigma_theta"] = (0.001, 0.03, 0.002), (0.004, 0.005, 0.0)
    found = errors(run_of(base(TRUTH=messages, CONTROLLER_TRACE=estimate)))
    assert found is not None
    assert found.velocity[7] == pytest.approx([0.03, 0.0, 0.0])
    assert found.velocity_sigma[7] == pytest.approx([0.03, 0.001, 0.002])
    assert found.angles_sigma[7] == pytest.approx([0.005, 0.004, 0.0])
    assert found.nees == pytest.approx(np.full(N, 0.2))


def test_what_yaw_adds_to_the_velocitys_sigma_is_no_uncertainty_along_the_heading() -> None:
    estimate = trace()
    estimate["v_WB"][:, 0] = 0.5
    estimate["sigma_theta"][:, 2] = 0.03
    estimate["sigma_v"][:] = 0.004, np.hypot(0.003, 0.015), 0.005
    found = errors(run_of(base(TRUTH=truth(), CONTROLLER_TRACE=estimate)))
    assert found is not None
    assert found.velocity_sigma[7] == pytest.approx([0.004, 0.003, 0.005])


def test_the_velocitys_error_is_told_apart_by_whether_the_robot_has_a_gait() -> None:
    messages, estimate = truth(), trace()
    estimate["gait_phase"][40:80:2], estimate["gait_phase"][41:80:2] = signals.DOUBLE_SUPPORT, signals.SINGLE_SUPPORT
    estimate["v_WB"][:, 1] = np.where(estimate["gait_phase"] == signals.STANDING, 0.002, 0.005)
    run = run_of(base(TRUTH=messages, CONTROLLER_TRACE=estimate))
    found = estimator_error(run)
    assert found is not None
    assert found.heading_velocity_rms_standing == pytest.approx(0.002)
    assert found.heading_velocity_rms_walking == pytest.approx(0.005)
    alone = estimator_error(run.between(0.4, 0.79))
    assert alone is not None and alone.heading_velocity_rms_standing is None


@pytest.mark.parametrize("axis", [0, 1])
def test_roll_and_pitch_are_told_apart(axis: int) -> None:
    messages, estimate = truth(), trace()
    estimate["quat_WB"][:, 0], estimate["quat_WB"][:, 1 + axis] = np.cos(0.005), np.sin(0.005)
    found = estimator_error(run_of(base(TRUTH=messages, CONTROLLER_TRACE=estimate)))
    assert found is not None
    assert (found.roll_rms, found.pitch_rms) == pytest.approx((0.01, 0.0) if axis == 0 else (0.0, 0.01), abs=1e-12)
    assert (found.height_rms, found.odometry_share, found.nees) == (None, None, None)


def test_what_the_robot_does_at_the_end_is_told() -> None:
    decided = trace()
    decided["behaviour"][:-1] = 1
    assert metrics.behaviour_final(run_of(base(CONTROLLER_TRACE=decided))) == "stand"
    assert metrics.behaviour_final(run_of(base())) is None


def test_a_push_has_its_start_length_and_impulse() -> None:
    messages = truth()
    messages["push_W"][31:41] = 0.0, 30.0, 0.0  # means over the periods that end at 0.31 ... 0.40 s
    messages["push_W"][60] = 5.0, 0.0, 0.0
    first, second = metrics.pushes(run_of(base(TRUTH=messages)))
    assert (first.start, first.duration) == (pytest.approx(0.3), pytest.approx(0.1))
    assert first.impulse_W == pytest.approx((0.0, 3.0, 0.0))
    assert second.impulse == pytest.approx(0.05)


def test_refusals_faults_and_safety_modes() -> None:
    messages, decided = truth(), trace()
    messages["refused_stale"][50:], messages["refused_order"][90:] = 2, 1
    messages["drives_damped"][10:20] = 1
    decided["safety"][40:50], decided["safety"][50:] = 1, 2
    decided["fault_count"][40:, 0] = 5
    run = run_of(base(TRUTH=messages, CONTROLLER_TRACE=decided))
    found = measure(run)
    assert found.refused == {"stale": 2, "not_finite": 0, "order": 1, "run": 0}
    assert found.refused_total == 3
    assert (found.drives_damped, found.drives_damped_share) == (pytest.approx(0.1), pytest.approx(10 / N))
    assert found.faults["state_stale"] == 5
    assert [(change.at, change.mode) for change in found.safety] == [
        (0.0, "run"),
        (pytest.approx(0.4), "hold"),
        (pytest.approx(0.5), "damp"),
    ]


def test_channels_tell_what_is_missing() -> None:
    messages = base()["ROBOT_STATE"]
    run = run_of({"ROBOT_STATE": np.delete(messages, [20, 21, 60])})
    state = next(use for use in metrics.channels(run) if use.name == "ROBOT_STATE")
    assert (state.count, state.missing) == (N - 3, 3)


def test_a_log_of_states_alone_is_measured_as_far_as_it_goes() -> None:
    found = measure(run_of(base()))
    assert found.trunk is None and found.ticks is None and found.qp is None and found.estimator is None
    assert not found.fell
    assert found.duration == pytest.approx(1.0)


def test_the_log_report_is_part_of_the_metrics() -> None:
    events = Synthetic(duration=1.0, pushes=[]).events()
    log = Log.from_bytes(encode_log([event for i, event in enumerate(events) if i != 100])[:-20])
    found = measure(log.run(), log.report)
    assert found.log is not None
    assert not found.log.complete
    assert found.log.missing == 1 and found.log.skipped_bytes > 0


def test_what_another_run_lacks_is_not_missing_from_this_one() -> None:
    first = Synthetic(duration=1.0, pushes=[], run_id=7).events()
    truths = [i for i, event in enumerate(first) if event[1] == "TRUTH"]
    kept = [event for i, event in enumerate(first) if i not in truths[20:25]]
    second = [(at + 10_000_000, *rest) for at, *rest in Synthetic(duration=1.0, pushes=[], run_id=8).events()]
    log = Log.from_bytes(encode_log([*kept, *second]))  # type: ignore[list-item]
    for run_id, missing in ((7, 5), (8, 0)):
        found = measure(log.run(run_id), log.report).log
        assert found is not None and found.missing == missing
        assert not found.complete


def test_a_part_of_a_run_keeps_its_times(stand: metrics.Run) -> None:
    part = stand.between(1.0, 2.0)
    assert part.span == (pytest.approx(1.0), pytest.approx(2.0))
    assert part.count("TRUTH") == 101
    assert [push.start for push in metrics.pushes(part)] == [pytest.approx(1.5)]
    assert part.time("CONTROLLER_TIMING")[0] == pytest.approx(1.0)
