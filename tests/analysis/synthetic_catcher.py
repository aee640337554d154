"""Logs with known content of the catcher: throws with given verdicts, a filter with a given error, joints that lag."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
from stance.catcher import PHASES, VERDICTS
from stance.messages import message_type
from stance.urdf import parse_urdf
from synthetic import GRAVITY, PERIOD, Synthetic, ticked

ROBOT = Path(__file__).parents[2] / "robots/catcher"
PLACE = np.array([0.0, 1.745329, -1.919862, 2.530727, 0.0])  # rad
TOOL = 0.251  # m
FLIGHT, STAY = 80, 120  # ticks of a flight, and of what follows it


@dataclass
class SyntheticCatcher(Synthetic):
    """What to write of an arm that waits, and is thrown balls every 2.5 s."""

    pushes: list[tuple[float, float, tuple[float, float, float]]] = field(default_factory=list)
    verdicts: tuple[str, ...] = ("caught", "bounce", "caught")
    ball_error: float = 0.004
    """m, of the estimate, along x"""
    sigma: float = 0.004
    """m, as the filter states it"""
    lag: float = 1e-3
    """rad, by which every joint is behind its reference"""

    def messages(self) -> dict[str, npt.NDArray[np.void]]:
        n = 100 + 250 * len(self.verdicts)
        self.duration = (n - 1) * PERIOD
        names = ("robot_state_t", "truth_t", "joint_command_t", "controller_trace_t", "ball_truth_t")
        state, truth, command, trace, ball = (ticked(name, n) for name in names)
        estimate, plan = ticked("ball_estimate_t", n), ticked("catch_plan_t", n)

        robot = parse_urdf((ROBOT / "catcher.urdf").read_text())
        tool = robot.forward(PLACE[None])["l5"][0]
        cup, axis = tool[:3, :3] @ [0.0, 0.0, TOOL] + tool[:3, 3], tool[:3, 2]
        ball["p_WCup"], ball["axis_WCup"] = cup, axis
        ball["crossing_offset"] = ball["nearest"] = np.inf
        ball["plan_ball_error"] = ball["plan_cup_error"] = np.nan
        estimate["nis"] = np.nan
        plan["phase"], plan["calibration"] = PHASES.index("waiting"), 1
        for index, verdict in enumerate(self.verdicts):
            first = 50 + 250 * index
            flight = slice(first, first + FLIGHT)
            there = slice(first, first + FLIGHT + STAY)
            ball["throw_number"][first:] = index + 1
            ball["present"][there] = 1
            left = np.maximum(FLIGHT - np.arange(FLIGHT + STAY), 0) * PERIOD
            ball["p_WBall"][there] = cup + np.outer(left, [4.0, 0.0, 3.0])
            over = slice(first + FLIGHT + STAY, None)
            for rows in (slice(first, first + FLIGHT), over):
                ball["verdict"][rows] = 0 if rows is not over else VERDICTS.index(verdict)
                ball["crossed"][rows] = rows is over and verdict in ("caught", "bounce")
                ball["retained"][rows] = rows is over and verdict == "caught"
                ball["crossing_offset"][rows] = 0.01 if rows is over else np.inf
            plan["phase"][flight], plan["status"][flight] = PHASES.index("catching"), 1
            estimate["observation_seq"][flight] = np.arange(first, first + FLIGHT)
            estimate["nis"][flight] = (self.ball_error / self.sigma) ** 2 / 3.0
        estimate["observation_seq"] = np.maximum.accumulate(estimate["observation_seq"])
        estimate["p_ABall"] = ball["p_WBall"] + [self.ball_error, 0.0, 0.0]
        estimate["covariance"][:, :3, :3] = self.sigma**2 * np.eye(3)

        plan["q_ref"][:, :5] = PLACE
        truth["joint_position"][:, :5] = PLACE - self.lag
        truth["joint_torque"][:, :5] = [0.0, 12.0, 3.0, 1.0, 0.0]
        truth["quat_WB"][:, 0] = truth["p_WC"][:, 2] = 1.0
        state["joint_position"] = truth["joint_position"][:, None, :]
        state["sample_period"], state["accelerometer"][..., 2] = PERIOD / 2, GRAVITY
        command["position"][:, :5] = PLACE
        trace["behaviour"], trace["periods"], trace["state_is_new"] = 4, 1, 1
        state["num_joints"] = truth["num_joints"] = command["num_joints"] = 5
        for messages in (plan, command, trace):
            messages["state_seq"] = messages["seq"]
        for messages in (state, truth, command, trace, ball, estimate, plan):
            messages["run_id"] = self.run_id
        return {
            "ROBOT_STATE": state,
            "TRUTH": truth,
            "BALL_TRUTH": ball,
            "JOINT_COMMAND": command,
            "BALL_ESTIMATE": estimate,
            "CATCH_PLAN": plan,
            "CONTROLLER_TRACE": trace,
            "CONTROLLER_TIMING": super().messages()["CONTROLLER_TIMING"],
        }

    def run_info(self, program: str, utime: int, seq: int) -> bytes:
        message = message_type("run_info_t").python_class.decode(super().run_info(program, utime, seq))
        message.robot = "catcher"
        message.options = message.options.replace("biped", "catcher")
        message.urdf = (ROBOT / "catcher.urdf").read_text()
        message.configuration = (ROBOT / "catcher.yaml").read_text()
        return bytes(message.encode())
