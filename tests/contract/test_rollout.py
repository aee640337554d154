"""What stance-rollout says of a run, against the run's own log."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from stance import walking
from stance.log import Log
from stance.programs import SOURCE_TREE, find_program
from stance.series import Run
from stance.urdf import rotation_from_quaternion

COMMAND = {"velocity": [0, 0], "yaw_rate": 0, "height_offset": 0}
COMMANDS = [
    {**COMMAND, "time": 0.5, "behaviour": "walk", "velocity": [{"uniform": [0.2, 0.5]}, 0], "yaw_rate": 0.3},
    {**COMMAND, "time": 8.0, "behaviour": "stand"},
]


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Run]:
    directory = tmp_path_factory.mktemp("rollout")
    scenario = yaml.safe_load((SOURCE_TREE / "sim/scenarios/biped/stand.yaml").read_text())
    scenario |= {"commands": COMMANDS, "duration": 10.0, "friction": {"choice": [0.6, 0.9]}}
    file = directory / "wild.yaml"
    file.write_text(yaml.safe_dump(scenario))
    words = ["--robot", "biped", "--scenario", str(file), "--seed", "4", "--log", str(directory / "log"), "--json"]
    done = subprocess.run([str(find_program("stance-rollout")), *words], check=True, capture_output=True, text=True)
    return json.loads(done.stdout), Log.open(directory / "log").run()


def test_the_segments_are_what_the_truth_says(walked: tuple[dict[str, Any], Run]) -> None:
    told, run = walked
    walk, stand = told["segments"]
    assert (walk["start_s"], walk["end_s"], walk["measured_from_s"]) == (0.5, 8.0, 3.5)
    assert (stand["start_s"], stand["end_s"], stand["measured_from_s"]) == (8.0, 10.0, 9.0)
    time, position = run.time("TRUTH"), run.field("TRUTH", "p_WC")
    rotation = rotation_from_quaternion(run.field("TRUTH", "quat_WB"))
    yaw = np.unwrap(np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]))
    at = {name: int(np.argmin(np.abs(time - walk[f"{name}_s"]))) for name in ("start", "measured_from", "end")}
    rows = slice(at["measured_from"], at["end"] + 1)
    velocity = run.field("TRUTH", "v_WC")[rows]
    forward = velocity[:, 0] * np.cos(yaw[rows]) + velocity[:, 1] * np.sin(yaw[rows])
    left = velocity[:, 1] * np.cos(yaw[rows]) - velocity[:, 0] * np.sin(yaw[rows])
    assert walk["mean_velocity_m_s"] == pytest.approx([forward.mean(), left.mean()], abs=2e-3)
    turned = yaw[at["end"]] - yaw[at["measured_from"]]
    assert walk["mean_yaw_rate_rad_s"] == pytest.approx(turned / 4.5, abs=1e-9)
    moved = position[at["end"], :2] - position[at["start"], :2]
    assert walk["distance_m"] == pytest.approx(np.hypot(*moved), abs=1e-9)


def test_a_log_is_measured_as_its_rollout_tells(walked: tuple[dict[str, Any], Run]) -> None:
    told, run = walked
    for one, of_log in zip(told["segments"], walking.segments(run), strict=True):
        assert (of_log.start, of_log.end) == pytest.approx((one["start_s"], one["end_s"]))
        assert of_log.behaviour == one["behaviour"]
        assert of_log.velocity == pytest.approx(one["mean_velocity_m_s"], abs=1e-9)
        assert of_log.yaw_rate == pytest.approx(one["mean_yaw_rate_rad_s"], abs=1e-9)
        assert of_log.distance == pytest.approx(one["distance_m"], abs=1e-9)
    found = walking.walking(run)
    assert found is not None and found.steps == told["steps"]


def test_the_steps_are_swings_that_the_plan_ends(walked: tuple[dict[str, Any], Run]) -> None:
    told, run = walked
    contact = run.field("FORCE_PLAN", "contact")[:, 0, :2].astype(bool)
    assert told["steps"] == int((~contact[:-1] & contact[1:]).sum()) > 20
    assert told["qp_iterations_max"] == run.field("CONTROLLER_TRACE", "qp_iterations").max()


def test_every_tick_is_counted(walked: tuple[dict[str, Any], Run]) -> None:
    told, run = walked
    cpu = told["tick_cpu"]
    assert sum(cpu["counts"]) == run.count("CONTROLLER_TRACE") == 1000
    assert 0.0 < cpu["p50_us"] <= cpu["p99_us"] <= cpu["p99_9_us"] <= cpu["max_us"]


def test_the_log_holds_the_scenario_as_it_was_drawn(walked: tuple[dict[str, Any], Run]) -> None:
    told, run = walked
    assert run.simulator is not None
    scenario = yaml.safe_load(run.simulator.scenario)
    speed = told["drawn"]["commands[1].velocity[1]"]
    assert scenario["commands"][0]["velocity"] == [speed, 0]
    assert run.field("USER_COMMAND", "velocity")[0, 0] == told["segments"][0]["velocity_m_s"][0] == speed
    assert scenario["friction"] == told["drawn"]["friction"] in (0.6, 0.9)
    assert "# Drawn by the seed 4 from:" in run.simulator.scenario


@pytest.mark.parametrize("seed", [1, 2])
def test_the_readmes_random_scenario_runs(tmp_path: Path, seed: int) -> None:
    """Seed 1 draws a slope, 2 flat ground: both of the README's choices."""
    (example,) = re.findall(r"```\n(friction: .*?)```", (SOURCE_TREE / "README.md").read_text(), re.DOTALL)
    scenario = yaml.safe_load((SOURCE_TREE / "sim/scenarios/biped/stand.yaml").read_text()) | yaml.safe_load(example)
    file = tmp_path / "wild.yaml"
    file.write_text(yaml.safe_dump(scenario))
    words = ["--robot", "biped", "--scenario", str(file), "--seed", str(seed), "--duration", "1", "--json"]
    done = subprocess.run([str(find_program("stance-rollout")), *words], check=True, capture_output=True, text=True)
    drawn = json.loads(done.stdout)["drawn"]
    assert 0.5 <= drawn["friction"] <= 0.8
    assert round(1000 * drawn["command_latency"], 9) in range(6)
    assert 5.0 <= drawn["pushes[1].time"] <= 7.0
    assert drawn["terrain"] == ("choice[2]" if seed == 1 else "flat")
