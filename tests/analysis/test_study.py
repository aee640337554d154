"""Study files: the cells that they stand for, and what is wrong with them in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from stance.errors import StanceError
from stance.programs import SOURCE_TREE
from stance.study import Asked, Study, load_study

STUDY = """\
title: Pushes
robot: biped
scenario: stand
trials: 20
set:
  pushes: [{time: 5.0, duration: $duration, force_W: [$push.force, 0, 0], point_B: [0, 0, 0]}]
limits:
  - {name: tilt, metric: max_tilt_rad, unit: rad, max: $push.tilt}
cells:
  - name: $push.force N, ${duration}s, noise-free
    for: &grid {push: [{force: 5, tilt: 0.1}, {force: 7.5, tilt: 0.2}], duration: [0.1, 0.3]}
    trials: 4
    asked: {success_rate: 0.9}
  - name: $push.force N, ${duration}s, noisy
    for: *grid
    scenario: stand_noisy
    set: {sensors: {noise: {gyro_white: 0.1}}, friction: {uniform: [0.5, 0.8]}}
    limits: [{name: time, metric: duration_s, min: 1}]
    log_limits: [{name: drift, metric: estimator.position_drift, max: 0.01}]
    asked: {within: 0.05, of: "$push.force N, ${duration}s, noise-free"}
"""


def study_of(text: str, directory: Path) -> Study:
    path = directory / "pushes.yaml"
    path.write_text(text)
    return load_study(str(path), "biped")


def scenario(study: Study, name: str) -> Any:
    return yaml.safe_load(next(cell for cell in study.cells if cell.name == name).scenario)


def base(name: str) -> Any:
    return yaml.safe_load((SOURCE_TREE / f"sim/scenarios/biped/{name}.yaml").read_text())


def test_a_cell_stands_for_each_combination_of_values(tmp_path: Path) -> None:
    study = study_of(STUDY, tmp_path)
    assert (study.name, study.title, study.robot) == ("pushes", "Pushes", "biped")
    kinds = ("5 N, 0.1s", "5 N, 0.3s", "7.5 N, 0.1s", "7.5 N, 0.3s")
    assert [cell.name for cell in study.cells] == [
        f"{kind}, {sensors}" for sensors in ("noise-free", "noisy") for kind in kinds
    ]
    push = {"time": 5.0, "duration": 0.3, "force_W": [7.5, 0, 0], "point_B": [0, 0, 0]}
    assert scenario(study, "7.5 N, 0.3s, noise-free") == {**base("stand"), "pushes": [push]}
    assert study.cells[0].asked == Asked(success_rate=0.9)
    assert study.cells[4].asked == Asked(within=0.05, of="5 N, 0.1s, noise-free")


def test_what_is_set_merges_into_mappings_and_replaces_all_else(tmp_path: Path) -> None:
    expected = base("stand_noisy")
    expected["sensors"]["noise"]["gyro_white"] = 0.1
    expected["friction"] = {"uniform": [0.5, 0.8]}
    found = scenario(study_of(STUDY, tmp_path), "5 N, 0.1s, noisy")
    del found["pushes"]
    assert found == expected


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("{uniform: [0.5, 0.8], step: 0.1}", "{choice: [0.5, 0.8]}"),
        ("{choice: [{legs: 1.0, trunk: 1.1}]}", "{legs: 0.9, trunk: 1.0}"),
        ("{legs: 0.9, trunk: 1.0}", "{choice: [{legs: 1.0, trunk: 1.1}]}"),
    ],
)
def test_a_random_value_is_replaced_as_a_whole(before: str, after: str, tmp_path: Path) -> None:
    text = STUDY.replace("set:\n", f"set:\n  mass_factor: {before}\n", 1).replace(
        "friction: {uniform", f"mass_factor: {after}, friction: {{uniform"
    )
    assert scenario(study_of(text, tmp_path), "5 N, 0.1s, noisy")["mass_factor"] == yaml.safe_load(after)


def test_a_cells_limits_are_added_to_the_studys_with_their_values(tmp_path: Path) -> None:
    study = study_of(STUDY, tmp_path)
    assert [(limit.metric, limit.value) for limit in study.cells[2].limits] == [("max_tilt_rad", 0.2)]
    assert [(limit.metric, limit.value) for limit in study.cells[4].limits] == [
        ("max_tilt_rad", 0.1),
        ("duration_s", 1),
    ]
    assert [[limit.name for limit in cell.log_limits] for cell in study.cells[3:5]] == [[], ["drift"]]


def test_a_twin_follows_each_cell_and_is_compared_with_it(tmp_path: Path) -> None:
    study = study_of(
        """\
title: Pushes
robot: biped
scenario: $gait
trials: 5
twin: {name: noisy, scenario: "${scenario}_noisy", within: 0.05}
cells:
  - {name: "$gait, asked", for: {gait: [stand, walk]}, set: {duration: 3.0}, asked: {success_rate: 0.9}, trials: 2}
  - {name: stated, scenario: stand, set: {duration: 4.0}}
  - {name: alone, scenario: stand, twin: false}
""",
        tmp_path,
    )
    assert [(cell.name, cell.asked) for cell in study.cells] == [
        ("stand, asked", Asked(success_rate=0.9)),
        ("stand, asked, noisy", Asked(within=0.05, of="stand, asked")),
        ("walk, asked", Asked(success_rate=0.9)),
        ("walk, asked, noisy", Asked(within=0.05, of="walk, asked")),
        ("stated", Asked()),
        ("stated, noisy", Asked()),
        ("alone", Asked()),
    ]
    assert scenario(study, "walk, asked, noisy") == {**base("walk_noisy"), "duration": 3.0}
    assert scenario(study, "stated, noisy") == {**base("stand_noisy"), "duration": 4.0}
    assert study.cells[3].count(None) == 2


def test_the_command_sets_the_number_of_trials_but_only_lowers_a_cells_own(tmp_path: Path) -> None:
    study = study_of(STUDY, tmp_path)
    own, common = study.cells[0], study.cells[4]
    assert [own.count(wanted) for wanted in (None, 2, 100)] == [4, 2, 4]
    assert [common.count(wanted) for wanted in (None, 2, 100)] == [20, 2, 100]


def test_a_robot_may_be_other_than_it_ships(tmp_path: Path) -> None:
    text = STUDY.replace("    trials: 4\n", "    set_robot: {controller: {stepping: {capture: [$duration, 0.9]}}}\n")
    study = study_of(text, tmp_path)
    shipped = yaml.safe_load((SOURCE_TREE / "robots/biped/biped.yaml").read_text())
    changed = yaml.safe_load(study.cells[1].configuration or "")
    assert changed["controller"]["stepping"].pop("capture") == [0.3, 0.9]
    del shipped["controller"]["stepping"]["capture"]
    assert changed == shipped
    assert study.cells[4].configuration is None


def test_what_an_anchor_repeats_is_written_out_so_that_each_is_drawn_by_itself(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("a: &a {uniform: [0, 1]}\nb: *a\n")
    change = "set: {c: &c {choice: [1, 2]}, d: *c}"
    study = study_of(
        f"title: a\nrobot: biped\nscenario: mine.yaml\ntrials: 1\n{change}\ncells: [{{name: b}}]", tmp_path
    )
    assert "&" not in study.cells[0].scenario and "*" not in study.cells[0].scenario
    one, other = {"uniform": [0, 1]}, {"choice": [1, 2]}
    assert scenario(study, "b") == {"a": one, "b": one, "c": other, "d": other}


def test_a_scenario_may_lie_beside_the_study(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("robot: biped\nduration: 3.0\n")
    study = study_of("title: a\nrobot: biped\nscenario: mine.yaml\ntrials: 1\ncells: [{name: b}]", tmp_path)
    assert scenario(study, "b") == {"robot": "biped", "duration": 3.0}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("title: Pushes\n", "", "pushes.yaml: title is missing"),
        ("title: Pushes", "title: [a]", "title is ['a'], but must be text"),
        ("title:", "titel:", "pushes.yaml: unknown key titel; known are cells, limits"),
        ("robot: biped", "robot: arm", "robot is 'arm', but the campaign is of 'biped'"),
        ("trials: 20", "trials: 0", "trials is 0, but must be a whole number above 0"),
        ("trials: 4", "trials: few", "cells[0]: trials is 'few', but must be"),
        ("scenario: stand\n", "scenario: sitting\n", "no scenario 'sitting': give a name below sim/scenarios/biped/"),
        ("scenario: stand\n", "scenario: mine.yaml\n", "mine.yaml: No such file"),
        ("set: {", "sets: {", "cells[1]: unknown key sets"),
        (
            "set: {sensors: {noise: {gyro_white: 0.1}}, friction: {uniform: [0.5, 0.8]}}",
            "set: a",
            "cells[1]: set is no mapping",
        ),
        ("trials: 4", "set_robot: a", "cells[0]: set_robot is no mapping"),
        ("force_W: [$push.force", "force_W: [$push.farce", "unknown $push.farce; known are $push, $duration"),
        ("- {name: tilt", "- {nome: tilt", "limits[0]: unknown key nome"),
        ("for: *grid", "for: [a]", "for is ['a'], but must be a mapping"),
        ("duration: [0.1, 0.3]", "duration: 0.1", "for: duration is 0.1, but must be a list"),
        ("name: $push.force N", "name: $push N", "$push is a dict, which does not fit into '$push N"),
        ("name: $push.force N, ${duration}s, noisy", "name: noisy", "two cells are named 'noisy'"),
        ("{success_rate: 0.9}", "{success_rate: 90}", "success_rate is 90, but must be in [0, 1]"),
        ("{success_rate: 0.9}", "{survival: 0.9}", "asked: unknown key survival; known are of, success_rate, within"),
        ("{within: 0.05, of", "{of", "asked: within and of go together"),
        ('of: "$push.force N', 'of: "$push.force newton', "'5 newton, 0.1s, noise-free', which is no other cell"),
        ("cells:", "twin: {name: a, within: 1}\ncells:", "pushes.yaml: twin: scenario is missing"),
        ("cells:", "twin: {name: a, scenario: stand, within: 5}\ncells:", "twin: within is 5, but must be in [0, 1]"),
        ("cells:", "twin: {name: a, scenario: $base, within: 1}\ncells:", "unknown $base; known are $scenario"),
        ("trials: 4", "twin: true", "cells[0]: twin must be false, in a study with a twin, or be left out"),
        ("trials: 4", "twin: false", "cells[0]: twin must be false, in a study with a twin, or be left out"),
        ("cells:", "cells: []\nrest:", "pushes.yaml: unknown key rest"),
        ("title: Pushes", "title: Pushes\ntitle: Pulls", "title stands twice"),
        ("title: Pushes", "title: {", "pushes.yaml is no YAML"),
    ],
)
def test_what_is_wrong_is_told_in_one_line_with_its_place(old: str, new: str, message: str, tmp_path: Path) -> None:
    assert old in STUDY
    with pytest.raises(StanceError) as caught:
        study_of(STUDY.replace(old, new, 1), tmp_path)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_readmes_example_is_a_study(tmp_path: Path) -> None:
    example = (SOURCE_TREE / "README.md").read_text().split("```yaml\ntitle:")[1].split("```")[0]
    cells = study_of(f"title:{example}", tmp_path).cells
    assert [cell.name for cell in cells] == ["6 N s", "6 N s, noisy", "10 N s", "10 N s, noisy"]
    assert cells[3].asked == Asked(within=0.05, of="10 N s")


def test_an_unknown_study_is_told_with_those_that_are_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    directory = tmp_path / "sim/scenarios/biped/studies"
    directory.mkdir(parents=True)
    (directory / "walking.yaml").touch()
    monkeypatch.setenv("STANCE_SHARE", str(tmp_path))
    with pytest.raises(StanceError, match="no study 'running' of robot biped; there are walking"):
        load_study("running", "biped")
