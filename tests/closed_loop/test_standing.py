"""What README and issue claim, over rollouts: ten minutes of standing, the ellipse of pushes, the demo."""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from stance.campaign import Request, run_campaign
from stance.check import judge, limits_file, load_limits
from stance.log import Log
from stance.metrics import measure
from stance.programs import SOURCE_TREE, find_program
from stance.study import load_study

TEN_MINUTES = 600.0  # s
MAX_TILT = math.radians(2.0)  # of the trunk, left alone
DIRECTIONS = 8
PUSH_SEED = 10_000  # of the first push; no tuning has seen it or the next
DEMO_SEEDS = (10_000, 10_001, 10_002)  # that no tuning has seen
DEMO_IMPULSES = [(0.5, 0.0, 0.0), (0.0, 3.0, 0.0), (8 * math.cos(-1.1), 8 * math.sin(-1.1), 0.0)]  # N s


@pytest.fixture(scope="module", autouse=True)
def ten_minutes() -> Iterator[subprocess.Popen[str]]:
    """Ten minutes of standing, which take a core some twenty seconds: meanwhile the other tests go on."""
    words = ["--robot", "biped", "--scenario", "stand", "--duration", str(TEN_MINUTES), "--json"]
    with subprocess.Popen([str(find_program("stance-rollout")), *words], stdout=subprocess.PIPE, text=True) as process:
        yield process
        process.kill()


@pytest.mark.parametrize("steps", ["without a step", "with capture steps"])
def test_forty_pushes_on_the_ellipse_are_survived(steps: str, tmp_path: Path) -> None:
    request = Request(tmp_path, seed=PUSH_SEED, names=(f"0.8 by 4 N s, {steps}",))
    outcome = run_campaign(load_study("push_standing", "biped"), request)
    (cell,) = outcome.cells
    assert (cell.trials, cell.failures) == (40, [])
    trials = [json.loads(line) for line in (Path(outcome.directory) / "trials.jsonl").read_text().splitlines()]
    assert len({trial["rollout"]["drawn"]["pushes[1].force_W"] for trial in trials}) == DIRECTIONS


@pytest.mark.parametrize("seed", DEMO_SEEDS)
def test_the_demo_takes_its_pushes_and_keeps_its_limits(seed: int, tmp_path: Path) -> None:
    path = tmp_path / "run.lcmlog"
    words = ["--robot", "biped", "--scenario", "demo", "--seed", str(seed), "--log", str(path), "--json"]
    done = subprocess.run([str(find_program("stance-rollout")), *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    duration = yaml.safe_load((SOURCE_TREE / "sim/scenarios/biped/demo.yaml").read_text())["duration"]
    assert json.loads(done.stdout)["duration_s"] == pytest.approx(duration)
    log = Log.open(path)
    figures = measure(log.run(), log.report)
    assert [push.impulse_W for push in figures.pushes] == [pytest.approx(impulse) for impulse in DEMO_IMPULSES]
    limits = load_limits(limits_file("biped", "demo"))
    assert {"fell", "trunk.tilt_max_deg", "behaviour_final", "segments.2.velocity.0"} <= {
        limit.metric for limit in limits
    }
    verdict = judge(figures.as_dict(), limits)
    assert verdict.passed, verdict.as_text()


def test_it_stands_for_ten_minutes_upright_and_without_a_failed_qp(ten_minutes: subprocess.Popen[str]) -> None:
    result = json.loads(ten_minutes.communicate()[0])
    assert result["duration_s"] == pytest.approx(TEN_MINUTES)
    assert not result["fallen"]
    assert result["max_tilt_rad"] <= MAX_TILT
    assert result["qp_failures"] == 0
