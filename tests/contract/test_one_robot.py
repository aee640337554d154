"""Controller, simulator and Python read the same robot: mass, joints' order and limits, and where the feet are."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from stance.log import Log
from stance.programs import SOURCE_TREE, find_program
from stance.series import Run
from stance.urdf import Robot, parse_urdf, rotation_from_quaternion, transform

EXACT = 1e-12
GRAVITY = 9.81  # m/s^2
SETTLED = 1500  # ticks after which the robot stands still
NUMBER = re.compile(r"(?<![\w.])\d+\.?\d*(?:e[-+]?\d+)?(?![\w.])", re.IGNORECASE)
COMMENT = re.compile(r"(?s:<!--.*?-->|\"\"\".*?\"\"\")|//.*|#.*")
SIGNIFICANT = 3  # digits that make a number the robot's own, not a half, a tolerance or a count


def described(robot: str) -> dict[str, Any]:
    """As the controller reads it."""
    words = [str(find_program("stance-controller")), "--robot", robot, "--describe"]
    found: dict[str, Any] = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    return found


def read(robot: str) -> Robot:
    """As Python does."""
    directory = SOURCE_TREE / "robots" / robot
    joints = yaml.safe_load((directory / f"{robot}.yaml").read_text())["joints"]
    return parse_urdf((directory / f"{robot}.urdf").read_text(), tuple(joints))


@pytest.fixture(scope="module")
def controller() -> dict[str, Any]:
    return described("biped")


@pytest.fixture(scope="module")
def python() -> Robot:
    return read("biped")


@pytest.fixture(scope="module")
def standing(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """20 s of standing on noise-free sensors."""
    log = tmp_path_factory.mktemp("contract") / "run.lcmlog"
    words = ["--robot", "biped", "--scenario", "stand", "--log", str(log)]
    subprocess.run([str(find_program("stance-rollout")), *words], check=True, capture_output=True)
    return Log.open(log).run()


def test_mass_is_the_same(controller: dict[str, Any], python: Robot, standing: Run) -> None:
    assert controller["total_mass"] == pytest.approx(python.mass, abs=EXACT)
    # The simulator's, weighed by its ground; the controller's, by the force that it plans to stand on.
    carried = standing.field("TRUTH", "f_F_W")[SETTLED:, :, 2].sum(axis=1).mean() / GRAVITY
    planned = standing.field("FORCE_PLAN", "force")[SETTLED:, 0, :, 2].sum(axis=1).mean() / GRAVITY
    assert carried == pytest.approx(python.mass, rel=1e-4)
    assert planned == pytest.approx(python.mass, rel=1e-3)


def test_joints_have_the_same_order_and_limits(controller: dict[str, Any], python: Robot, standing: Run) -> None:
    assert [joint["name"] for joint in controller["joints"]] == [joint.name for joint in python.moving]
    for told, read in zip(controller["joints"], python.moving, strict=True):
        assert (told["lower"], told["upper"]) == (read.lower, read.upper)
        assert (told["max_velocity"], told["max_torque"]) == (read.velocity, read.effort)
    nominal = [joint["nominal"] for joint in controller["joints"]]
    assert standing.field("TRUTH", "joint_position")[0, : len(nominal)] == pytest.approx(nominal, abs=0.02)


def test_the_arms_mass_and_joints_are_the_same_and_it_has_no_feet() -> None:
    told, arm = described("arm3"), read("arm3")
    assert told["total_mass"] == pytest.approx(arm.mass, abs=EXACT)
    assert told["feet"] == []
    assert [joint["name"] for joint in told["joints"]] == [joint.name for joint in arm.moving]
    for one, other in zip(told["joints"], arm.moving, strict=True):
        assert (one["lower"], one["upper"]) == (other.lower, other.upper)
        assert (one["max_velocity"], one["max_torque"]) == (other.velocity, other.effort)


def test_feet_are_at_the_same_place(controller: dict[str, Any], python: Robot, standing: Run) -> None:
    nominal = np.array([joint["nominal"] for joint in controller["joints"]])
    for told, (link, tip) in zip(controller["feet"], python.feet(), strict=True):
        assert told["link"] == link
        pose = python.forward(nominal)[link]
        assert told["nominal_p_BF"] == pytest.approx(list(pose[:3, :3] @ tip + pose[:3, 3]), abs=EXACT)


@pytest.fixture(scope="module")
def stepping(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A push to the side and the steps after it: left and right are told apart."""
    directory = tmp_path_factory.mktemp("stepping")
    scenario = yaml.safe_load((SOURCE_TREE / "sim/scenarios/biped/stand.yaml").read_text())
    push = {"time": 1.0, "duration": 0.1, "force_W": [0.0, 60.0, 0.0], "point_B": [0.0, 0.0, 0.0]}
    (directory / "pushed.yaml").write_text(yaml.safe_dump({**scenario, "pushes": [push]}))
    words = ["--robot", "biped", "--scenario", str(directory / "pushed.yaml"), "--duration", "2.5"]
    log = directory / "run.lcmlog"
    subprocess.run([str(find_program("stance-rollout")), *words, "--log", str(log)], check=True, capture_output=True)
    run = Log.open(log).run()
    q = run.field("TRUTH", "joint_position")
    assert np.abs(q[:, :4] - q[:, 4:8]).max() > 0.3
    return run


@pytest.mark.parametrize("row", [0, 110, 130, 150, 170, 190])
def test_the_simulators_feet_are_where_python_puts_them(python: Robot, stepping: Run, row: int) -> None:
    q = stepping.field("TRUTH", "joint_position")[row, : len(python.moving)]
    rotation = rotation_from_quaternion(stepping.field("TRUTH", "quat_WB")[row])
    poses = python.forward(q, transform(rotation, stepping.field("TRUTH", "p_WB")[row]))
    for contact, (link, tip) in enumerate(python.feet()):
        expected = poses[link][:3, :3] @ tip + poses[link][:3, 3]
        assert stepping.field("TRUTH", "p_WF")[row, contact] == pytest.approx(list(expected), abs=1e-9)


def test_the_simulator_drives_the_joint_that_the_controller_means(stepping: Run) -> None:
    """Torques of the mirrored joint would be others: the drives' own gains change little of the feed-forward."""
    commands = stepping.field("JOINT_COMMAND", "feedforward_torque")[110:230, :8]
    torques = stepping.field("TRUTH", "joint_torque")[111:231, :8]
    mirrored = np.roll(torques, 4, axis=1)
    assert np.abs(commands - torques).mean() < 0.5 * np.abs(commands - mirrored).mean()


def numbers(text: str) -> set[float]:
    """Those of at least so many significant digits, comments left out."""
    found = NUMBER.findall(COMMENT.sub("", text))
    return {
        float(one) for one in found if len(re.sub(r"e.*|\.", "", one, flags=re.IGNORECASE).strip("0")) >= SIGNIFICANT
    }


def test_no_mass_length_limit_or_gain_is_repeated_outside_robots() -> None:
    """The robot's own numbers stand in robots/ alone: not in the sources of controller, simulator or analysis."""
    files = [file for file in (SOURCE_TREE / "robots").rglob("*") if file.suffix in (".urdf", ".yaml")]
    robot = {number for file in files for number in numbers(file.read_text())}
    assert {0.0813333333, 1.441123, 0.505} <= robot  # an inertia, a joint's position, a reach
    assert {0.50375, 0.031484375} <= robot  # the 3-joint arm's inertias
    for folder in ("controller", "sim", "rollout", "analysis/stance"):
        for path in sorted(Path(SOURCE_TREE, folder).rglob("*")):
            if path.suffix in (".cpp", ".hpp", ".py"):
                assert not numbers(path.read_text()) & robot, path
