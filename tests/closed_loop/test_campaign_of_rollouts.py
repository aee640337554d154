"""Campaigns of real rollouts: what fails once falls again, from its command and from its log."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path

import lcm
import pytest
from stance.campaign import Outcome, Request, run_campaign
from stance.errors import RunError
from stance.log import Log
from stance.metrics import fall, pushes
from stance.programs import find_program
from stance.study import load_study

STUDY = """\
title: A push that no robot of this size takes
robot: biped
scenario: stand_noisy
trials: 2
set:
  duration: 4.0
  pushes:
    - time: {uniform: [1.0, 2.0]}
      duration: 0.1
      force_W: {choice: [[500, 0, 0], [{uniform: [-500, -490]}, 0, 0], [0, 500, 0], [0, {uniform: [-500, -490]}, 0]]}
      point_B: [0, 0, 0]
cells:
  - {name: struck}
"""


@pytest.fixture(scope="module")
def struck(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    directory = tmp_path_factory.mktemp("campaign")
    study = directory / "struck.yaml"
    study.write_text(STUDY)
    return run_campaign(load_study(str(study), "biped"), Request(directory / "out"))


def messages(log: Path) -> list[tuple[str, bytes]]:
    """All of them but what names the command line, which a campaign gives --json."""
    return [(event.channel, event.data) for event in lcm.EventLog(str(log)) if not event.channel.startswith("RUN_INFO")]


def test_a_kept_log_shows_the_fall_that_was_counted(struck: Outcome) -> None:
    (cell,) = struck.cells
    assert [(cell.fell, failure.seed) for failure in cell.failures] == [(2, 1), (2, 2)]
    for failure in cell.failures:
        fallen = fall(Log.open(failure.log or "").run())
        assert failure.why[0].startswith(f"fell at {fallen:.2f} s by ")
    assert cell.failures[0].drawn != cell.failures[1].drawn


def test_what_a_trial_was_pushed_with_is_what_its_log_shows(struck: Outcome) -> None:
    (cell,) = struck.cells
    for told, failure in zip(cell.pushes, cell.failures, strict=True):
        (push,) = pushes(Log.open(failure.log or "").run())
        x, y, _ = push.impulse_W
        assert (told.seed, told.succeeded) == (failure.seed, False)
        assert told.direction == pytest.approx(math.atan2(y, x), abs=1e-6)
        assert push.duration < 0.1 or told.impulse == pytest.approx(math.hypot(x, y))
    assert cell.pushes[0].direction != cell.pushes[1].direction


def test_the_command_of_a_failure_writes_the_same_log_again(struck: Outcome) -> None:
    failure = struck.cells[0].failures[1]
    log = Path(failure.log or "")
    kept = messages(log)
    log.unlink()
    assert subprocess.run(["sh", "-c", failure.command], capture_output=True, check=False).returncode == 1
    assert messages(log) == kept


def test_the_controller_decides_every_byte_of_a_kept_log_again(struck: Outcome) -> None:
    done = subprocess.run(
        [str(find_program("stance-replay")), struck.cells[0].failures[0].log or ""], capture_output=True, check=False
    )
    assert done.returncode == 0, done.stdout


def test_a_key_that_no_scenario_has_is_told_with_its_cell(tmp_path: Path) -> None:
    study = tmp_path / "struck.yaml"
    study.write_text(STUDY.replace("  duration: 4.0", "  frictoin: 0.5\n  duration: 4.0"))
    with pytest.raises(RunError, match=r"cell 'struck', seed [12]: stance-rollout: struck-\w+\.yaml: .*frictoin"):
        run_campaign(load_study(str(study), "biped"), Request(tmp_path / "out"))
