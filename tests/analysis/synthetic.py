"""Logs with known content: a biped that stands and takes pushes, written without any of the C++ programs.

Not a simulation: a base that sways and swings back after a push, and walks where it is told to, with joints, forces and
messages that agree with it.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
from stance.events import SYNC
from stance.log import Log
from stance.messages import message_type
from stance.series import Run
from stance.urdf import Robot, parse_urdf, rotation_from_rpy, transform

URDF = (Path(__file__).parents[2] / "robots/biped/biped.urdf").read_text()
CONFIGURATION = """\
robot: biped
urdf: biped.urdf
joints: [q0_l, q1_l, q2_l, q3_l, q0_r, q1_r, q2_r, q3_r]
feet: [tarsus_l, tarsus_r]
controller:
  force_qp:
    friction: 0.55
"""
FRICTION = 0.55
RUN_ID = 4242
PERIOD = 0.01  # s
GRAVITY = 9.81
MASS = 13.2
START = 1_000_000  # us, the simulated clock at the first state
WALL = 1_700_000_000_000_000  # us, the logger's clock at the first state


def encode_event(number: int, time: int, channel: str, data: bytes) -> bytes:
    """One event as lcm-logger writes it."""
    name = channel.encode()
    return struct.pack(">Iqqii", SYNC, number, time, len(name), len(data)) + name + data


def encode_log(events: list[tuple[int, str, bytes]]) -> bytes:
    """A log's bytes from (receive time us, channel, payload)."""
    return b"".join(encode_event(number, *event) for number, event in enumerate(events))


def records(type_name: str, count: int) -> npt.NDArray[np.void]:
    """Zeroed encoded messages of a fixed-size type, with its fingerprint."""
    found = message_type(type_name)
    assert found.dtype is not None
    result = np.zeros(count, found.dtype)
    result["fingerprint"] = np.frombuffer(found.fingerprint, "V8")
    return result


def leg_ik(robot: Robot, side: str, p_BF: npt.NDArray[np.float64], pitch_sum: float = -0.25) -> npt.NDArray[np.float64]:
    """Joints (4,) of the leg with its foot at p_BF; the last link's angle is `pitch_sum`."""
    hip = next(joint for joint in robot.joints if joint.name == f"q0_{side}")
    x, y, z = hip.T_parent[:3, :3].T @ (p_BF - hip.T_parent[:3, 3])
    q0 = np.arctan2(z, y)
    down = np.hypot(y, z) - 0.08
    # In the leg's plane: angle a from down towards +x is minus the pitch.
    ankle = np.array([x, down]) - 0.24 * np.array([-np.sin(pitch_sum), np.cos(pitch_sum)])
    distance = np.linalg.norm(ankle)
    knee = np.arccos(np.clip((distance**2 - 2 * 0.26**2) / (2 * 0.26**2), -1, 1))
    q1 = np.arctan2(-ankle[0], ankle[1]) - knee / 2
    return np.array([q0, q1, knee, pitch_sum - q1 - knee])


def run_of(channels: dict[str, npt.NDArray[np.void]], run_id: int = RUN_ID) -> Run:
    """A run that holds just these messages, as it reads back from a log."""
    events = []
    for channel, messages in channels.items():
        messages["run_id"] = run_id
        events += [(WALL + int(message["utime"]), channel, message.tobytes()) for message in messages]
    for channel, program in (("RUN_INFO_SIMULATOR", "stance-sim"), ("RUN_INFO_CONTROLLER", "stance-controller")):
        events.append((WALL, channel, Synthetic(run_id=run_id).run_info(program, 0, 1)))
    return Log.from_bytes(encode_log(sorted(events))).run()


def ticked(type_name: str, count: int) -> npt.NDArray[np.void]:
    """Zeroed messages at the control period, seq from 1."""
    result = records(type_name, count)
    result["seq"] = np.arange(1, count + 1)
    result["utime"] = START + np.arange(count) * round(PERIOD * 1e6)
    return result


@dataclass(frozen=True)
class Walk:
    """Walking straight ahead from `start` on, left foot first; every figure of it is known."""

    start: float
    """s"""
    speed: float
    """m/s"""
    swing: int = 20
    """ticks"""
    double_support: int = 5
    """ticks"""
    foothold_error: tuple[float, float] = (0.012, -0.005)
    """m, forward and left, of each touchdown from the foothold that is planned last"""
    foothold_change: float = 0.03
    """m, left, from the foothold planned at lift-off to the one planned last"""
    swing_error: float = 0.004
    """m, of a swing foot above its reference"""
    recovering: tuple[int, ...] = ()
    """steps"""

    def feet(self, n: int, p_WF: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], list[tuple[int, int, int]]]:
        """Tips [m] (n, 2, 3) of feet that start at p_WF, and (foot, first tick, touchdown's tick) of each step."""
        way = np.tile(p_WF, (n, 1, 1))
        first = round(self.start / PERIOD) + self.double_support
        swings = []
        while first < n:
            foot, down = len(swings) % 2, first + self.swing
            middle = (down + 0.5 * (self.swing + self.double_support)) * PERIOD - self.start
            s = np.linspace(0.0, 1.0, self.swing + 1)[: n - first]
            start, length = way[first, foot, 0], self.speed * middle + p_WF[foot, 0] - way[first, foot, 0]
            way[first : down + 1, foot, 0] = start + length * s * s * (3.0 - 2.0 * s)
            way[first : down + 1, foot, 2] += 0.06 * np.sin(np.pi * s)
            way[down:, foot, 0] = start + length
            swings.append((foot, first, down))
            first = down + self.double_support
        return way, swings

    def write(self, trace: npt.NDArray[np.void], swings: list[tuple[int, int, int]]) -> None:
        """The gait's fields."""
        n = len(trace)
        first = round(self.start / PERIOD)
        trace["gait_phase"][first:], trace["behaviour"][first:] = 1, 1
        trace["velocity_wanted"][first:, 0] = self.speed
        for number, (foot, begin, down) in enumerate(swings):
            rows = slice(begin, down)
            reached = self.feet(down + 1, trace["p_WF"][0, :2])[0][down, foot]
            trace["swing_foot"][down - self.swing - self.double_support : down] = foot
            trace["gait_phase"][rows] = 2
            trace["swing_time"][rows] = self.swing * PERIOD
            trace["foothold"][rows] = reached - [*self.foothold_error, 0.0]
            trace["foothold"][begin : begin + 1, 1] -= self.foothold_change
            trace["swing_p"][rows] = trace["p_WF"][rows, foot] - [0.0, 0.0, self.swing_error]
            trace["contact"][rows, foot] = 0
            trace["recovering"][rows] = number in self.recovering
            trace["steps"][min(down, n) :] = number + 1


@dataclass
class Synthetic:
    """What to write. Every list of times is in seconds from the run's start."""

    duration: float = 4.0
    pushes: list[tuple[float, float, tuple[float, float, float]]] = field(
        default_factory=lambda: [(1.5, 0.1, (5.0, 0.0, 0.0)), (2.5, 0.1, (0.0, 30.0, 0.0))]
    )
    """(start, duration s, force N in W)"""
    run_id: int = RUN_ID
    seed: int = 1
    realtime: bool = True
    late_ticks: dict[int, float] = field(default_factory=dict)
    """tick → how late it woke, us; above a period it counts as missed"""
    qp_failures: tuple[int, ...] = ()
    fall_at: float | None = None
    refused: int = 0
    estimator_drift: float = 0.0
    """m/s, along x"""
    walk: Walk | None = None
    scenario: str = "scenario: demo\n"
    """the simulator's, as it was drawn"""

    def messages(self) -> dict[str, npt.NDArray[np.void]]:
        """channel → encoded messages, in order."""
        n = round(self.duration / PERIOD) + 1
        t = np.arange(n) * PERIOD
        rng = np.random.default_rng(self.seed)
        robot = parse_urdf(URDF)
        force = np.zeros((n, 3))
        sway = np.sin(2 * np.pi * np.outer(t, [0.4, 0.3, 0.2])) * np.array([0.002, 0.003, 0.001])
        acceleration = np.zeros((n, 3))
        for start, length, push in self.pushes:
            force[(t > start + 1e-9) & (t <= start + length + 1e-9)] = push
            since = np.maximum(t - start, 0.0)
            amplitude = np.array(push) * length / MASS * 0.25
            sway += amplitude * (np.exp(-4.0 * since) * np.sin(6.0 * since))[:, None]
        acceleration = np.gradient(np.gradient(sway, PERIOD, axis=0), PERIOD, axis=0)
        roll, pitch = -1.2 * sway[:, 1], 1.2 * sway[:, 0]
        p_WB = sway + np.array([0.0, 0.0, 0.8176])
        fallen = np.zeros(n, np.int8)
        if self.fall_at is not None:
            since = np.maximum(t - self.fall_at, 0.0)
            pitch = pitch + np.minimum(4.0 * since**2, 1.5)
            p_WB[:, 2] -= np.minimum(2.0 * since**2, 0.4)
            fallen = (t > self.fall_at + 0.4).astype(np.int8)
        half = np.stack([roll, pitch], axis=1) / 2
        (cos_roll, cos_pitch), (sin_roll, sin_pitch) = np.cos(half).T, np.sin(half).T
        quat_WB = np.stack(
            [cos_roll * cos_pitch, sin_roll * cos_pitch, cos_roll * sin_pitch, -sin_roll * sin_pitch], axis=1
        )
        p_WF, swings = np.tile([[0.03, 0.10, 0.02], [0.03, -0.10, 0.02]], (n, 1, 1)), []
        if self.walk is not None:
            p_WB[:, 0] += self.walk.speed * np.maximum(t - self.walk.start, 0.0)
            p_WF, swings = self.walk.feet(n, p_WF[0])
        q, p_WC = np.zeros((n, 8)), np.zeros((n, 3))
        for i in range(n):
            R_WB = rotation_from_rpy(roll[i], pitch[i], 0.0)
            for leg, side in enumerate("lr"):
                q[i, 4 * leg : 4 * leg + 4] = leg_ik(robot, side, R_WB.T @ (p_WF[i, leg] - p_WB[i]))
            p_WC[i] = robot.center_of_mass(q[i], transform(R_WB, p_WB[i]))
        v_WB, v_WC, qd = (np.gradient(values, PERIOD, axis=0) for values in (p_WB, p_WC, q))
        ground = MASS * (acceleration + np.array([0.0, 0.0, GRAVITY])) - force
        share = np.clip(0.5 + (p_WC[:, 1] - 0.05 * ground[:, 1] / 10) / 0.2, 0.1, 0.9)
        for foot, begin, down in swings:
            share[begin:down] = foot
        planned = np.stack([share[:, None] * ground, (1 - share)[:, None] * ground], axis=1)
        planned[..., :2] = np.clip(planned[..., :2], -0.5 * planned[..., 2:], 0.5 * planned[..., 2:])
        contact_force = planned + rng.normal(0.0, 0.4, planned.shape)
        torque = 8.0 * np.sin(q) + 0.3 * rng.normal(size=q.shape)

        seq = np.arange(1, n + 1)
        utime = START + np.round(t * 1e6).astype(np.int64)

        def stamped(type_name: str, count: int = n) -> npt.NDArray[np.void]:
            result = records(type_name, count)
            result["utime"], result["seq"], result["run_id"] = utime[:count], seq[:count], self.run_id
            return result

        state = stamped("robot_state_t")
        state["num_joints"], state["num_contacts"], state["sample_period"] = 8, 2, PERIOD / 2
        state["joint_position"] = q[:, None, :] + rng.normal(0, 1e-4, (n, 2, 8))
        state["joint_velocity"] = qd[:, None, :] + rng.normal(0, 1e-2, (n, 2, 8))
        state["accelerometer"][..., 2] = GRAVITY
        state["contact_switch"][..., :2] = 1
        state["joint_torque"] = torque

        truth = stamped("truth_t")
        truth["num_joints"], truth["num_contacts"] = 8, 2
        truth["p_WB"], truth["quat_WB"], truth["v_WB"] = p_WB, quat_WB, v_WB
        truth["p_WC"], truth["v_WC"], truth["push_W"] = p_WC, v_WC, force
        truth["joint_position"], truth["joint_velocity"], truth["joint_torque"] = q, qd, torque
        truth["p_WF"][:, :2], truth["f_F_W"][:, :2] = p_WF, contact_force
        truth["plan_seq"] = np.maximum(seq - 1, 0)
        truth["force_error"][1:, :2] = contact_force[1:] - planned[:-1]
        truth["fallen"] = fallen
        truth["refused_stale"] = np.minimum(np.arange(n), self.refused)

        command = stamped("joint_command_t")
        command["state_seq"], command["num_joints"] = seq, 8
        command["position"], command["velocity"], command["feedforward_torque"] = q, qd, torque
        command["kp"], command["kd"] = 40.0, 2.0

        plan = stamped("force_plan_t")
        plan["state_seq"], plan["num_contacts"], plan["num_stages"] = seq, 2, 10
        plan["stage_duration"][:, :10] = PERIOD
        plan["contact"][:, :10, :2] = 1
        for foot, begin, down in swings:
            plan["contact"][begin:down, :10, foot] = 0
        plan["p_WF"][:, :2], plan["force"][:, :10, :2] = p_WF, planned[:, None]
        plan["p_WC"][:, :10] = p_WC[:, None]
        plan["effort"] = np.sqrt(0.1 * (planned**2).sum(axis=(1, 2)))

        trace = stamped("controller_trace_t")
        trace["state_seq"], trace["state_is_new"], trace["periods"] = seq, 1, 1
        drift = np.zeros((n, 3))
        drift[:, 0] = self.estimator_drift * t
        trace["p_WB"] = p_WB + drift + rng.normal(0, 2e-4, (n, 3))
        trace["quat_WB"], trace["v_WB"] = quat_WB, v_WB + rng.normal(0, 2e-3, (n, 3))
        trace["p_WF"][:, :2], trace["contact"][:, :2] = p_WF, 1
        trace["x"][:, 0], trace["x"][:, 1] = roll, pitch
        trace["x"][:, 3:6], trace["x"][:, 9:12] = p_WC + drift, v_WC
        trace["x_ref"][:, 3:6] = p_WC[0]
        trace["sigma_theta"], trace["sigma_v"], trace["sigma_p"] = 1e-3, 2e-3, 2e-4
        trace["nis"] = rng.chisquare(12, n) / 12.0
        if self.walk is not None:
            self.walk.write(trace, swings)
        trace["qp_status"] = 1
        trace["qp_iterations"] = 25 * rng.integers(1, 4, n)
        trace["qp_primal_residual"] = 10 ** rng.uniform(-9, -6, n)
        trace["qp_dual_residual"] = 10 ** rng.uniform(-8, -6, n)
        trace["effort"] = plan["effort"]
        if self.fall_at is not None:
            down = t > self.fall_at + 0.4
            trace["faults"], trace["safety"] = down << 4, np.where(down, 2, 0)
            trace["fault_count"][:, 4] = np.cumsum(down)
        for tick in self.qp_failures:
            trace["qp_status"][tick] = 2
            trace["faults"][tick] |= 1 << 3
            trace["fault_count"][tick:, 3] += 1
            trace["safety"][tick] = 1

        timing = stamped("controller_timing_t")
        timing["utime"] = 77_000_000 + np.round(t * 1e6).astype(np.int64)  # the wall's clock, not the simulator's
        timing["state_seq"] = seq
        stage = np.array([4.0, 2.0, 12.0, 6.0, 9.0, 160.0, 14.0, 3.0, 5.0]) * rng.lognormal(0.0, 0.25, (n, 9))
        timing["stage_us"], timing["tick_us"] = stage, stage.sum(axis=1) + 3.0
        timing["cpu_us"] = stage.sum(axis=1)
        if self.realtime:
            latency = rng.lognormal(np.log(45.0), 0.5, n)
            for tick, late in self.late_ticks.items():
                latency[tick] = late
            timing["wake_latency_us"] = latency
            timing["period_us"] = 1e6 * PERIOD + np.diff(latency, prepend=latency[0])
            timing["slack_us"] = 1e6 * PERIOD - latency - timing["tick_us"]
            timing["state_age_us"] = 600.0 + latency
            timing["missed_ticks"] = np.cumsum(np.floor(latency / (1e6 * PERIOD)))
        else:
            timing["period_us"] = 300.0
        return {
            "ROBOT_STATE": state,
            "TRUTH": truth,
            "JOINT_COMMAND": command,
            "FORCE_PLAN": plan,
            "CONTROLLER_TRACE": trace,
            "CONTROLLER_TIMING": timing,
        }

    def run_info(self, program: str, utime: int, seq: int) -> bytes:
        message = message_type("run_info_t").python_class()
        if program != "stance-controller":  # which serves any run
            message.utime, message.seq, message.run_id, message.seed = utime, seq, self.run_id, self.seed
        message.program, message.version, message.source, message.build = program, "0.1.0", "0123abc", "g++ 12 Release"
        message.robot, message.scenario = "biped", self.scenario
        message.options = f"--robot biped --scenario demo {'--realtime' if self.realtime else '--lockstep'}"
        message.urdf, message.configuration, message.input_hash = URDF, CONFIGURATION, "00c0ffee"
        message.tag = bytes(16)
        return bytes(message.encode())

    def events(self) -> list[tuple[int, str, bytes]]:
        """(receive time us, channel, payload), in order of time."""
        result: list[tuple[int, str, bytes]] = [(WALL - 5000, "LCM_SELF_TEST", b"lcm self test")]
        for second in range(int(self.duration) + 1):
            utime = START + second * 1_000_000
            received = WALL + second * 1_000_000 - 100
            result.append((received, "RUN_INFO_SIMULATOR", self.run_info("stance-sim", utime, second + 1)))
            result.append((received, "RUN_INFO_CONTROLLER", self.run_info("stance-controller", utime, second + 1)))
        for place, (channel, messages) in enumerate(self.messages().items()):
            for i, record in enumerate(messages):
                result.append((WALL + round(i * PERIOD * 1e6) + 100 * place, channel, record.tobytes()))
        command = records("user_command_t", 2)
        command["utime"], command["seq"] = [5, 6], [1, 2]
        result.append((WALL + 500_000, "USER_COMMAND", command[0].tobytes()))
        if self.walk is not None:
            command["behaviour"][1], command["velocity"][1, 0] = 1, self.walk.speed
            result.append((WALL + round(1e6 * self.walk.start), "USER_COMMAND", command[1].tobytes()))
        return sorted(result, key=lambda event: event[0])

    def log(self) -> bytes:
        return encode_log(self.events())

    def write(self, path: Path) -> Path:
        path.write_bytes(self.log())
        return path
