"""Controller, simulator and Python read the same robot: mass, joints' order and limits, and where the feet are."""

from __future__ import annotations

import json
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


@pytest.fixture(scope="module")
def controller() -> dict[str, Any]:
    words = [str(find_program("stance-controller")), "--robot", "biped", "--describe"]
    described: dict[str, Any] = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    return described


@pytest.fixture(scope="module")
def python() -> Robot:
    directory = SOURCE_TREE / "robots/biped"
    joints = yaml.safe_load((directory / "biped.yaml").read_text())["joints"]
    return parse_urdf((directory / "biped.urdf").read_text(), tuple(joints))


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


def test_feet_are_at_the_same_place(controller: dict[str, Any], python: Robot, standing: Run) -> None:
    nominal = np.array([joint["nominal"] for joint in controller["joints"]])
    for told, (link, tip) in zip(controller["feet"], python.feet(), strict=True):
        assert told["link"] == link
        pose = python.forward(nominal)[link]
        assert told["nominal_p_BF"] == pytest.approx(list(pose[:3, :3] @ tip + pose[:3, 3]), abs=EXACT)


@pytest.mark.parametrize("row", [0, 700, 1900])
def test_the_simulators_feet_are_where_python_puts_them(python: Robot, standing: Run, row: int) -> None:
    q = standing.field("TRUTH", "joint_position")[row, : len(python.moving)]
    rotation = rotation_from_quaternion(standing.field("TRUTH", "quat_WB")[row])
    poses = python.forward(q, transform(rotation, standing.field("TRUTH", "p_WB")[row]))
    for contact, (link, tip) in enumerate(python.feet()):
        expected = poses[link][:3, :3] @ tip + poses[link][:3, 3]
        assert standing.field("TRUTH", "p_WF")[row, contact] == pytest.approx(list(expected), abs=1e-9)


def test_no_mass_length_or_limit_is_repeated_outside_robots() -> None:
    """The robot's own numbers stand in robots/ alone: not in the sources of controller, simulator or analysis."""
    numbers = ("13.2", "0.081", "0.333", "0.348", "1.441123", "0.590795", "1.100328")
    for folder in ("controller", "sim", "rollout", "analysis/stance"):
        for path in sorted(Path(SOURCE_TREE, folder).rglob("*")):
            if path.suffix in (".cpp", ".hpp", ".py"):
                text = path.read_text()
                assert not [number for number in numbers if number in text], path
