"""Kept studies: what the file holds, the table that is drawn from it, and that the README's is that table."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from stance.campaign import Figure, Outcome, Tally
from stance.cli import main
from stance.errors import StanceError
from stance.programs import SOURCE_TREE
from stance.scoreboard import around, insert, keep, load, table
from stance.study import load_study
from stance.tick_cpu import TickCpu

KEPT = SOURCE_TREE / "docs/studies.json"
STUDIES = sorted((path.parents[1].name, path.stem) for path in (SOURCE_TREE / "sim/scenarios").glob("*/studies/*.yaml"))
OUTCOME = Outcome(
    study="pushes",
    title="Pushed while standing",
    robot="biped",
    seed=10_000,
    program="0123456789abcdef",
    directory="/somewhere/here",
    cells=[
        Tally("6 N s", 40, 39, 1, (0.8711834, 0.9955771), "≥ 95 %", True, [], []),
        Tally(
            "6 N s, noisy",
            40,
            30,
            8,
            (0.5980721, 0.8582183),
            "≥ that of '6 N s' less 5 points",
            False,
            [
                Figure("largest tilt", "rad", "≤ 53.1°", 2, 0.2123456, 0.9312345),
                Figure("standing at the end", "", "= stand", 1, None, None),
            ],
            [],
        ),
        Tally("60 N s", 40, 0, 40, (0.0, 0.0876222), "", True, [], []),
    ],
    tick_cpu=TickCpu(120_000, 79.43282, 398.1072, 794.3282, 1234.567),
    qp_iterations_max=25,
)
TABLE = """\
|  | succeeded | 95% interval | asked | median, worst (asked) | `stance campaign` with |
| --- | --- | --- | --- | --- | --- |
| **Pushed while standing** |  |  |  | ticks: 79 / 398 / 794 / 1,235 µs, at most 25 QP iterations |  |
| 6 N s | 39/40 | 0.87 to 1.00 | ≥ 95 %, met |  | `--study pushes --trials 40 --seed 10000` |
| 6 N s, noisy | 30/40 | 0.60 to 0.86 | ≥ that of '6 N s' less 5 points, not met | largest tilt 12.2°, 53.4° (≤ 53.1°: 2 not); standing at the end = stand: 1 not | `--study pushes --trials 40 --seed 10000` |
| 60 N s | 0/40 | 0.00 to 0.09 | stated |  | `--study pushes --trials 40 --seed 10000` |"""  # noqa: E501


def test_the_table_has_a_row_for_each_cell_with_its_command(tmp_path: Path) -> None:
    assert table(keep(tmp_path / "kept.json", [OUTCOME])) == TABLE


def test_what_was_kept_before_ticks_were_counted_has_none(tmp_path: Path) -> None:
    document = keep(tmp_path / "kept.json", [OUTCOME])
    del document["studies"][0]["tick_cpu"], document["studies"][0]["qp_iterations_max"]
    assert table(document).splitlines()[2] == "| **Pushed while standing** |  |  |  | - |  |"


def test_a_study_takes_the_place_of_its_earlier_self(tmp_path: Path) -> None:
    path = tmp_path / "kept.json"
    keep(path, [OUTCOME, replace(OUTCOME, study="other")])
    keep(path, [replace(OUTCOME, title="again")])
    assert [(study["study"], study["title"]) for study in load(path)["studies"]] == [
        ("pushes", "again"),
        ("other", "Pushed while standing"),
    ]


def test_what_is_kept_is_small_and_names_no_place(tmp_path: Path) -> None:
    path = tmp_path / "kept.json"
    keep(path, [OUTCOME])
    assert "somewhere" not in path.read_text()
    (study,) = json.loads(path.read_text())["studies"]
    assert study["cells"][1]["figures"][0]["median"] == 0.2123
    assert study["tick_cpu"] == {"ticks": 120_000, "p50_us": 79.43, "p99_us": 398.1, "p99_9_us": 794.3, "max_us": 1235}


@pytest.mark.parametrize(
    "text", ["", "[]", '{"schema": "stance.studies"}', '{"schema": "stance.studies", "version": 0}']
)
def test_a_file_that_is_no_kept_study_is_an_error(text: str, tmp_path: Path) -> None:
    path = tmp_path / "kept.json"
    path.write_text(text)
    with pytest.raises(StanceError, match=r"kept\.json"):
        load(path)


def test_the_table_stands_between_the_marks(tmp_path: Path) -> None:
    path = tmp_path / "README.md"
    path.write_text("before\n<!-- studies -->\nold\n<!-- /studies -->\nafter\n")
    for text in ("| a |", "| b |"):
        insert(path, text)
    assert path.read_text() == "before\n<!-- studies -->\n| b |\n<!-- /studies -->\nafter\n"
    path.write_text("no marks")
    with pytest.raises(StanceError, match="put <!-- studies --> and <!-- /studies --> on lines of their own"):
        insert(path, "| a |")


def test_what_cannot_be_kept_is_told_before_the_campaign(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = tmp_path / "wrong.json"
    wrong.write_text("{")
    words = ["campaign", "--study", "stand", "--output", str(tmp_path / "out")]
    for more, message in (
        (["--summary", str(wrong)], "cannot be read as kept studies"),
        (["--summary", str(tmp_path / "new.json"), "--table", str(wrong)], "put <!-- studies -->"),
        (["--table", str(wrong)], "--table is drawn from --summary: give both"),
        (["--summary", str(wrong), "--name", "x"], "--summary keeps whole studies: leave out --name"),
    ):
        assert main([*words, *more]) == 2
        assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_readmes_table_is_that_of_the_kept_studies() -> None:
    readme = SOURCE_TREE / "README.md"
    before, after = around(readme)
    assert readme.read_text() == f"{before}<!-- studies -->\n{table(load(KEPT))}\n<!-- /studies -->{after}"


@pytest.mark.parametrize(("robot", "study"), STUDIES)
def test_every_study_is_kept_as_it_is_now(robot: str, study: str) -> None:
    (kept,) = [one for one in load(KEPT)["studies"] if one["study"] == study]
    now = load_study(study, robot)
    assert kept["title"] == now.title
    assert [cell["name"] for cell in kept["cells"]] == [cell.name for cell in now.cells]
    assert kept["seed"] >= 10_000, "seeds below 10000 are for tuning"


def test_nothing_is_kept_of_a_study_that_is_gone() -> None:
    assert sorted((study["robot"], study["study"]) for study in load(KEPT)["studies"]) == STUDIES
