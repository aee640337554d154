"""Studies: what each rollout is asked, and what is counted. The rollout is a stand-in that falls by the push's size."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import pytest
import yaml
from stance.cli import main
from stance.errors import RunError, StanceError
from stance.programs import SOURCE_TREE
from stance.study import as_text, standing_pushes, summarise

ROLLOUT = f"""#!{sys.executable}
import json, math, os, sys, yaml
option = dict(zip(sys.argv[1::2], sys.argv[2::2]))
with open(option["--scenario"]) as file:
    scenario = yaml.safe_load(file)
with open(os.environ["STANCE_SHARE"] + "/robots/biped/biped.yaml") as file:
    robot = yaml.safe_load(file)
with open({{seen!r}}, "a") as file:
    print(json.dumps([option, scenario, robot]), file=file)
(push,) = scenario["pushes"]
x, y, z = (component * push["duration"] for component in push["force_W"])
size = math.hypot(x / 0.8, y / 4.0)
print(json.dumps({{{{"fallen": size > 1.5, "max_tilt_rad": 0.3 * size}}}}))
sys.exit(size > 1.5)
"""


@pytest.fixture
def seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What the stand-in was asked, a line each."""
    seen = tmp_path / "seen"
    program = tmp_path / "stance-rollout"
    program.write_text(ROLLOUT.format(seen=str(seen)))
    program.chmod(0o755)
    monkeypatch.setenv("STANCE_BIN_DIR", str(tmp_path))
    return seen


def test_each_direction_is_pushed_at_its_own_moments_with_its_own_seed(seen: Path) -> None:
    told: list[tuple[int, int]] = []
    trials = standing_pushes("stand_noisy", [1.0], 2, 500, progress=lambda done, of: told.append((done, of)))
    asked = [json.loads(line) for line in seen.read_text().splitlines()]
    assert len(trials) == len(asked) == 16
    assert told[-1] == (16, 16)
    assert {int(option["--seed"]) for option, _, _ in asked} == set(range(500, 516))
    for option, scenario, _ in asked:
        trial = trials[int(option["--seed"]) - 500]
        (push,) = scenario["pushes"]
        assert push["time"] == trial.moment
        assert [0.1 * force for force in push["force_W"][:2]] == pytest.approx(trial.impulse)
        assert float(option["--duration"]) == pytest.approx(trial.moment + 6.0)
        assert scenario["sensors"]["noise"]["gyro_white"] > 0.0  # the scenario's own, pushes apart
    angles = {round(math.degrees(math.atan2(trial.impulse[1] / 4.0, trial.impulse[0] / 0.8))) % 360 for trial in trials}
    assert angles == set(range(0, 360, 45))
    assert standing_pushes("stand_noisy", [1.0], 2, 500) == trials


def test_a_robot_without_steps_is_the_shipped_one_but_for_its_thresholds(seen: Path) -> None:
    for with_steps in (True, False):
        standing_pushes("stand", [1.0], 1, with_steps=with_steps)
    robots = [json.loads(line)[2] for line in seen.read_text().splitlines()]
    shipped = yaml.safe_load((SOURCE_TREE / "robots/biped/biped.yaml").read_text())
    assert robots[0] == shipped
    changed = robots[-1]
    assert min(changed["controller"]["stepping"]["capture"]) > 0.5  # m, out of its reach
    changed["controller"]["stepping"] = shipped["controller"]["stepping"]
    assert changed == shipped


def test_what_survived_is_counted_with_its_interval(seen: Path) -> None:
    stood, fell = summarise(standing_pushes("stand", [1.0, 2.0], 1))
    assert (stood.trials, stood.survived, fell.survived) == (8, 8, 0)
    assert stood.interval == pytest.approx((0.6756, 1.0), abs=1e-4)  # Wilson's: 8 / (8 + 1.96^2)
    assert stood.max_tilt == pytest.approx(0.3)
    assert "| 1.60, 8.0 | 0/8 | 0.00 to 0.32 | 0° |" in as_text([stood, fell])


def test_the_command_ends_by_whether_all_stood(seen: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "--moments", "1", "--silent"]) == 0
    assert main(["study", "--moments", "1", "--scales", "1", "2", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert [cell["survived"] for cell in found["cells"]] == [8, 0]
    assert len(found["trials"]) == 16


def test_an_unknown_scenario_and_a_rollout_that_fails_are_one_line_each(seen: Path) -> None:
    with pytest.raises(StanceError, match="no scenario"):
        standing_pushes("sitting", [1.0])
    wrong = seen.parent / "wrong.yaml"
    for text in ("{", "- a list"):
        wrong.write_text(text)
        with pytest.raises(StanceError, match=r"wrong\.yaml is no scenario"):
            standing_pushes(str(wrong), [1.0])
    (seen.parent / "stance-rollout").write_text("#!/bin/sh\necho stance-rollout: no robot >&2\nexit 2\n")
    with pytest.raises(RunError, match="stance-rollout failed: stance-rollout: no robot"):
        standing_pushes("stand", [1.0], 1)
