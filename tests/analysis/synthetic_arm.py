"""Logs with known content of the 3-joint arm: motions at constant joint rates, by document 004's formulas in numpy."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation
from stance.messages import message_type
from synthetic import GRAVITY, PERIOD, Synthetic, ticked

ROBOT = Path(__file__).parents[2] / "robots/arm3"
LENGTHS = (1.0, 0.5, 0.5)  # m, the document's
PLOTS = {"arm", "joint_rates", "tracking", "catches", "ball"}
"""those that only an arm's logs can give, this one's or the catcher's"""
REST = 50  # ticks before, between and after motions

Floats = npt.NDArray[np.float64]


def place(theta: Floats) -> Floats:
    """o_3 [m] of angles [rad] (3,)."""
    l1, l2, l3 = LENGTHS
    m = l2 * np.sin(theta[1]) + l3 * np.sin(theta[1] + theta[2])
    n = l2 * np.cos(theta[1]) + l3 * np.cos(theta[1] + theta[2])
    return np.array([np.sin(theta[0]) * m, -np.cos(theta[0]) * m, l1 + n])


def jacobian(theta: Floats) -> Floats:
    """(6, 3), of (v, omega): v by central differences of `place`."""
    h = 1e-6
    v = np.stack([(place(theta + h * e) - place(theta - h * e)) / (2 * h) for e in np.eye(3)], axis=1)
    s, c = np.sin(theta[0]), np.cos(theta[0])
    return np.vstack([v, [[0, c, c], [0, s, s], [1, 0, 0]]])


@dataclass
class SyntheticArm(Synthetic):
    """What to write of an arm that stands, moves and stands again."""

    pushes: list[tuple[float, float, tuple[float, float, float]]] = field(default_factory=list)
    motions: tuple[tuple[int, tuple[float, float, float]], ...] = ((620, (0.2, 0.1, -0.3)), (100, (-0.5, 0.2, 0.4)))
    """(steps, rates rad/s) of each"""
    lag: float = 1e-3
    """rad, by which every joint is behind its reference while it moves"""

    def messages(self) -> dict[str, npt.NDArray[np.void]]:
        steps = np.zeros(REST, np.int64)
        rates = np.zeros((REST, 3))
        for count, rate in self.motions:
            steps = np.concatenate([steps, np.arange(1, count + 1), np.zeros(REST, np.int64)])
            rates = np.concatenate([rates, np.tile(rate, (count, 1)), np.zeros((REST, 3))])
        n = len(steps)
        self.duration = (n - 1) * PERIOD

        motion = ticked("arm3_motion_t", n)
        theta = np.zeros(3)
        for k in range(n):
            if steps[k] == 1 or k == 0:
                R, p = _pose(theta)
            J = jacobian(theta)
            v, omega = np.split(J @ rates[k], 2)
            R, p = Rotation.from_rotvec(omega * PERIOD).as_matrix() @ R, p + v * PERIOD
            motion["theta"][k], motion["v"][k], motion["omega"][k], motion["jacobian"][k] = theta, v, omega, J
            motion["map_A3"][k, :3, :3], motion["map_A3"][k, :3, 3], motion["map_A3"][k, 3, 3] = R, p, 1.0
            theta = theta + rates[k] * PERIOD
        motion["given_rate"] = motion["calculated_rate"] = rates
        motion["dp"], motion["dphi"] = motion["v"] * PERIOD, motion["omega"] * PERIOD
        motion["step"], motion["time"] = steps, np.maximum(steps - 1, 0) * PERIOD

        state, truth, command, trace = (
            ticked(name, n) for name in ("robot_state_t", "truth_t", "joint_command_t", "controller_trace_t")
        )
        moves = (steps > 0)[:, None]
        truth["joint_position"][:, :3] = motion["theta"] - self.lag * moves
        truth["joint_velocity"][:, :3] = rates
        truth["joint_torque"][:, :3] = 5.0 * np.sin(motion["theta"])
        truth["quat_WB"][:, 0] = truth["p_WC"][:, 2] = 1.0
        state["joint_position"] = truth["joint_position"][:, None, :]
        state["sample_period"], state["accelerometer"][..., 2] = PERIOD / 2, GRAVITY
        command["position"][:, :3], command["velocity"][:, :3] = motion["theta"], rates
        trace["behaviour"] = np.where(steps > 0, 3, 0)
        trace["periods"] = trace["state_is_new"] = 1
        state["num_joints"] = truth["num_joints"] = command["num_joints"] = 3
        for messages in (motion, command, trace):
            messages["state_seq"] = messages["seq"]
        for messages in (motion, state, truth, command, trace):
            messages["run_id"] = self.run_id
        return {
            "ROBOT_STATE": state,
            "TRUTH": truth,
            "JOINT_COMMAND": command,
            "ARM3_MOTION": motion,
            "CONTROLLER_TRACE": trace,
            "CONTROLLER_TIMING": super().messages()["CONTROLLER_TIMING"],
        }

    def run_info(self, program: str, utime: int, seq: int) -> bytes:
        message = message_type("run_info_t").python_class.decode(super().run_info(program, utime, seq))
        message.robot = "arm3"
        message.options = message.options.replace("biped", "arm3")
        message.urdf = (ROBOT / "arm3.urdf").read_text()
        message.configuration = (ROBOT / "arm3.yaml").read_text()
        return bytes(message.encode())


def _pose(theta: Floats) -> tuple[Floats, Floats]:
    """(R, p) of frame 3: A(0) turned about z by theta_1 and about the joints' axis by theta_2 + theta_3."""
    upright = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
    about_z = Rotation.from_rotvec([0.0, 0.0, theta[0]]).as_matrix()
    about_x = Rotation.from_rotvec([theta[1] + theta[2], 0.0, 0.0]).as_matrix()
    return about_z @ about_x @ upright, place(theta)
