"""Campaigns: what runs, what counts, what is kept, and what a kill leaves. The rollout is a stand-in."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import fake_rollout
import pytest
from stance.campaign import Outcome, Request, Tally, as_text, run_campaign, wilson
from stance.cli import main
from stance.errors import RunError, StanceError
from stance.log import Log
from stance.programs import SOURCE_TREE
from stance.study import load_study
from stance.tick_cpu import TickCpu

STUDY = """\
title: Pushes
robot: biped
scenario: stand
trials: 3
set:
  pushes: [{time: 5.0, duration: 0.1, force_W: [$force, 0, 0], point_B: [0, 0, 0]}]
limits:
  - {name: tilt, metric: max_tilt_rad, unit: rad, max: 0.5}
cells:
  - name: $force N
    for: {force: [10, 30]}
    asked: {success_rate: 1.0}
  - name: 80 N
    set: {pushes: [{time: 5.0, duration: 0.1, force_W: [80, 0, 0], point_B: [0, 0, 0]}]}
    asked: {within: 0.5, of: 10 N}
"""


class Bench:
    """A study, a stand-in for stance-rollout, and where everything goes."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.seen = directory / "seen"
        self.seen.touch()
        self.output = directory / "out"
        (directory / "bin").mkdir()
        fake_rollout.install(directory / "bin")
        self.said: list[str] = []

    @property
    def study(self) -> Path:
        return self.directory / "pushes.yaml"

    def run(self, text: str = STUDY, **request: Any) -> Outcome:
        self.study.write_text(text)
        self.said.clear()
        return run_campaign(
            load_study(str(self.study), "biped"), Request(self.output, **request), None, self.said.append
        )

    def calls(self) -> list[tuple[float, int, bool]]:
        """(force, seed, with a log) of each rollout that came to its end."""
        asked = [json.loads(line) for line in self.seen.read_text().splitlines()]
        return sorted(
            (scenario["pushes"][0]["force_W"][0], int(option["--seed"]), "--log" in option)
            for option, scenario in asked
        )

    def command(self, *words: str) -> list[str]:
        self.study.write_text(STUDY)
        where = ["--study", str(self.study), "--output", str(self.output)]
        return [sys.executable, "-m", "stance", "campaign", *where, *words]

    def done(self) -> list[str]:
        """The lines of trials.jsonl."""
        return [line for path in self.tables() for line in path.read_text().splitlines()]

    def tables(self) -> list[Path]:
        """Each study's trials.jsonl. Not by rglob: it would enter a trial's own directory, which a campaign removes."""
        return list(self.output.glob("*/*/trials.jsonl"))

    def wait(self, process: subprocess.Popen[Any], count: int) -> None:
        """Until a campaign of its own process has begun, and done so many trials."""
        while not self.tables() or len(self.done()) < count:
            assert process.poll() is None
            time.sleep(0.05)


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    bench = Bench(tmp_path)
    monkeypatch.setenv("STANCE_BIN_DIR", str(tmp_path / "bin"))
    monkeypatch.setenv(fake_rollout.SEEN, str(bench.seen))
    return bench


@pytest.mark.parametrize(
    ("succeeded", "trials", "interval"),
    [(0, 10, (0.0, 0.2775)), (5, 10, (0.2366, 0.7634)), (10, 10, (0.7225, 1.0)), (95, 100, (0.8882, 0.9785))],
)
def test_the_interval_is_wilsons(succeeded: int, trials: int, interval: tuple[float, float]) -> None:
    assert wilson(succeeded, trials) == pytest.approx(interval, abs=1e-4)


def test_every_cell_runs_the_same_seeds_with_its_own_scenario(bench: Bench) -> None:
    bench.run(seed=500)
    without_log = [call[:2] for call in bench.calls() if not call[2]]
    assert without_log == [(force, seed) for force in (10, 30, 80) for seed in (500, 501, 502)]


def test_successes_are_counted_and_judged_by_what_is_asked(bench: Bench) -> None:
    outcome = bench.run(STUDY.replace("success_rate: 1.0", "success_rate: 0.5").replace("max: 0.5", "max: 0.325"))
    _, thirty, eighty = outcome.cells
    assert [(cell.succeeded, cell.trials, cell.fell) for cell in outcome.cells] == [(3, 3, 0), (2, 3, 0), (0, 3, 3)]
    assert [cell.met for cell in outcome.cells] == [True, True, False]
    assert thirty.interval == wilson(2, 3)
    assert thirty.failures[0].seed == 3
    assert thirty.failures[0].why == ["tilt 18.9°, not ≤ 18.6°"]
    assert (thirty.figures[0].failed, thirty.figures[0].median, thirty.figures[0].worst) == pytest.approx(
        (1, 0.32, 0.33)
    )
    assert [failure.why for failure in eighty.failures] == [["fell at 0.50 s by body on ground (shank_l)"]] * 3
    assert eighty.figures[0].median is None
    assert not outcome.met
    assert json.loads((Path(outcome.directory) / "summary.json").read_text()) == json.loads(
        json.dumps(outcome.as_dict())
    )
    assert outcome.qp_iterations_max == 30
    assert outcome.tick_cpu == TickCpu(540, 100.0, 100.0, 100.0, 100.0)
    text = as_text(outcome, shown=1)
    assert "540 ticks: CPU p50 / p99 / p99.9 / max 100 / 100 / 100 / 100 µs; at most 30 QP iterations" in text
    assert "ok   10 N       3/3   0.439 to 1.000   asked ≥ 50 %" in text
    assert "FAIL 80 N       0/3   0.000 to 0.561   asked ≥ that of '10 N' less 50 points" in text
    assert "and 2 more" in text
    assert (
        "seed 1: fell at 0.50 s by body on ground (shank_l); pushes[1].direction = 0.25; again: STANCE_SHARE=" in text
    )
    assert eighty.failures[0].command in text and eighty.failures[1].command not in text


@pytest.mark.parametrize(("share", "met"), [("0.33", False), ("0.34", True)])
def test_a_cell_may_be_so_much_below_another(share: str, met: bool, bench: Bench) -> None:
    text = STUDY.replace("asked: {within: 0.5, of: 10 N}", f"asked: {{within: {share}, of: 10 N}}").replace(
        "80", "30.0"
    )
    text = text.replace("max: 0.5", "max: 0.325")
    assert bench.run(text).cells[2].met is met
    assert bench.run(text, names=("30.0 N",)).cells[0].met is None  # not compared with what did not run


def test_a_failures_log_scenario_and_command_are_kept_and_run_to_the_same_fall(bench: Bench) -> None:
    failure = bench.run().cells[2].failures[1]
    assert failure.log is not None
    log = Path(failure.log)
    kept = log.read_bytes()
    assert Log.open(log).run().field("TRUTH", "fallen").any()
    log.unlink()
    (bench.directory / "bin/stance-rollout").unlink()  # what is kept needs nothing of the present build
    done = subprocess.run(["sh", "-c", failure.command], capture_output=True, text=True, check=False)
    assert (done.returncode, json.loads(done.stdout)["fallen"]) == (1, True)
    assert log.read_bytes() == kept


def test_a_cell_may_run_another_robot(bench: Bench) -> None:
    other = "    set_robot: {controller: {force_qp: {friction: 0.3}}}\n    asked: {within"
    limit = "limits:\n  - {name: mu, metric: friction, max: 0.4}\n"
    text = STUDY.replace("    asked: {within", other).replace("limits:\n", limit).replace("80", "20.0")
    outcome = bench.run(text, trials=1)
    assert [cell.succeeded for cell in outcome.cells] == [0, 0, 1]
    assert [cell.figures[0].worst for cell in outcome.cells] == [0.55, 0.55, 0.3]
    strict = bench.run(text.replace("max: 0.4", "max: 0.1"), trials=1).cells[2].failures[0]
    done = subprocess.run(["sh", "-c", strict.command], capture_output=True, text=True, check=False)
    assert json.loads(done.stdout)["friction"] == 0.3


def test_only_failures_leave_a_log_and_no_more_than_are_wanted(bench: Bench) -> None:
    logs = bench.output / "pushes"
    kept = bench.run(keep=1).cells
    assert [len([one for one in cell.failures if one.log]) for cell in kept] == [0, 0, 1]
    before = bench.calls()
    kept = bench.run(keep=2).cells
    assert [len([one for one in cell.failures if one.log]) for cell in kept] == [0, 0, 2]
    assert len(bench.calls()) == len(before) + 1  # only the log that is wanted more
    assert len(list(logs.rglob("*.lcmlog"))) == 2


def test_a_trial_that_is_done_is_not_done_again_and_more_may_follow(bench: Bench) -> None:
    first = bench.run(trials=2)
    calls = bench.calls()
    again = bench.run(trials=2)
    assert again == first
    assert bench.calls() == calls
    assert bench.said == []
    assert [cell.trials for cell in bench.run(trials=3).cells] == [3, 3, 3]
    assert len(bench.calls()) == len(calls) + 3 + 1  # one with its log
    assert [cell.trials for cell in bench.run(trials=1).cells] == [1, 1, 1]


def test_a_new_limit_judges_what_is_done_already(bench: Bench) -> None:
    bench.run()
    calls = bench.calls()
    outcome = bench.run(STUDY.replace("max: 0.5", "max: 0.2"))
    assert [cell.succeeded for cell in outcome.cells] == [3, 0, 0]
    assert [call for call in bench.calls() if call not in calls] == [(30, seed, True) for seed in (1, 2, 3)]
    assert all(failure.log for failure in outcome.cells[1].failures)


def test_a_campaign_that_is_killed_goes_on_where_it_was(bench: Bench) -> None:
    environment = {**os.environ, fake_rollout.HANG: "3"}
    process = subprocess.Popen(bench.command("--trials", "4"), env=environment, stderr=subprocess.DEVNULL)
    bench.wait(process, 6)
    process.kill()
    process.wait()
    with bench.tables()[0].open("a") as file:
        file.write('{"key": "torn')
    (bench.tables()[0].parent / "logs/half.lcmlog").write_bytes(b"of a trial that was running")
    before = bench.calls()
    assert {seed for _, seed, _ in before} == {1, 2}
    outcome = bench.run(trials=4)
    assert [cell.trials for cell in outcome.cells] == [4, 4, 4]
    after = bench.calls()
    assert len(after) == len(set(after)) == 12 + 4  # each trial once, and once more with the log of each that fell
    assert bench.run(trials=4) == outcome
    assert not list(bench.output.rglob("logs"))


def test_ctrl_c_ends_every_rollout_and_keeps_what_is_done(bench: Bench) -> None:
    environment = {**os.environ, fake_rollout.HANG: "2"}
    process = subprocess.Popen(bench.command(), env=environment, stderr=subprocess.PIPE, text=True)
    bench.wait(process, 3)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "the same command goes on from there" in err
    assert len(bench.done()) == 3
    running = [path for path in Path("/proc").glob("[0-9]*/cmdline") if str(bench.output) in cmdline(path)]
    assert running == []


def cmdline(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:
        return ""  # others come and go


@pytest.mark.parametrize("changed", ["program", "robot"])
def test_results_of_another_program_or_robot_do_not_count_and_are_told(
    changed: str, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    share = bench.directory / "share"
    for folder in ("robots", "sim/scenarios"):
        (share / folder).parent.mkdir(parents=True, exist_ok=True)
        subprocess.run(["cp", "-r", str(SOURCE_TREE / folder), str(share / folder)], check=True)
    monkeypatch.setenv("STANCE_SHARE", str(share))
    first = bench.run(trials=1)
    path = {"program": bench.directory / "bin/stance-rollout", "robot": share / "robots/biped/biped.yaml"}[changed]
    path.write_text(path.read_text() + "# another\n")
    second = bench.run(trials=1)
    assert second.program != first.program
    assert len(bench.calls()) == 2 * (3 + 1)
    assert bench.said == [f"pushes: 3 results of another program or robot in {first.directory}: not used"]


def test_results_of_a_cell_that_is_no_longer_so_do_not_count_and_are_told(bench: Bench) -> None:
    bench.run(trials=1)
    outcome = bench.run(STUDY.replace("scenario: stand\n", "scenario: stand_noisy\n"), trials=1)
    assert bench.said == ["pushes: 3 results of cells or scenarios that are no longer so: not used"]
    assert len(bench.calls()) == 2 * (3 + 1)
    assert [cell.trials for cell in outcome.cells] == [1, 1, 1]


def test_cells_are_chosen_by_name(bench: Bench) -> None:
    assert [cell.name for cell in bench.run(names=("1*", "3? N")).cells] == ["10 N", "30 N"]
    with pytest.raises(StanceError, match=r"pushes: no cell is named 4\*; there are '10 N', '30 N', '80 N'"):
        bench.run(names=("4*",))


def test_figures_of_the_log_are_judged_where_they_are_asked_for(bench: Bench) -> None:
    limit = "log_limits: [{name: height, metric: trunk.height_min, unit: m, min: 0.8}]"
    outcome = bench.run(
        STUDY.replace("    for: {force: [10, 30]}", f"    for: {{force: [10, 30]}}\n    {limit}"), trials=1
    )
    height = outcome.cells[0].figures[1]
    assert (height.failed, height.rule) == (0, "≥ 0.8 m")
    assert 0.81 < (height.median or 0.0) < 0.83
    assert bench.calls() == [(10, 1, True), (30, 1, True), (80, 1, False), (80, 1, True)]
    assert [len(cell.failures) for cell in outcome.cells] == [0, 0, 1]
    assert len(list(bench.output.rglob("*.lcmlog"))) == 1  # those of trials that succeeded are gone


def test_a_limit_on_a_mean_is_the_cells_and_fails_no_trial(bench: Bench) -> None:
    def cell(bound: str) -> Tally:
        limit = f"mean_limits: [{{name: height, metric: trunk.height_min, unit: m, {bound}}}]"
        text = STUDY.replace("    for: {force: [10, 30]}", f"    for: {{force: [10, 30]}}\n    {limit}")
        return bench.run(text, trials=2).cells[0]

    mean = cell("max: 10").figures[1].median or 0.0
    assert 0.81 < mean < 0.83
    above, below = cell(f"min: {mean + 1e-6}"), cell(f"min: {mean - 1e-6}")
    assert (above.succeeded, above.met, above.figures[1].failed) == (2, False, 1)
    assert (below.succeeded, below.met, below.figures[1].failed) == (2, True, 0)
    assert below.figures[1].name == "mean height"
    assert (below.figures[1].worst or 0.0) <= mean


def test_a_rollout_that_fails_is_one_line_with_the_cell_and_its_command(bench: Bench) -> None:
    text = STUDY.replace("    asked: {within", "    limits: []\n    asked: {within").replace(
        "set: {pushes", "set: {robot: broken, pushes"
    )
    with pytest.raises(
        RunError,
        match=r"^cell '80 N', seed 1: stance-rollout: scenario\.yaml: unknown key frictoin; again: STANCE_SHARE=",
    ) as caught:
        bench.run(text, workers=1)
    assert "\n" not in str(caught.value)
    assert len(bench.done()) == 2  # of the cells before it, seed 1


def test_a_limit_on_a_figure_that_no_rollout_tells_is_an_error(bench: Bench) -> None:
    with pytest.raises(StanceError, match="limit 'tilt': no figure 'max_tilt'"):
        bench.run(STUDY.replace("max_tilt_rad", "max_tilt"))


def test_a_rollout_that_comes_out_otherwise_is_an_error(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(fake_rollout.FICKLE, "1")
    with pytest.raises(RunError, match="it must give the same bits"):
        bench.run()


def test_two_campaigns_do_not_write_to_one_place(bench: Bench) -> None:
    bench.study.write_text(STUDY)
    environment = {**os.environ, fake_rollout.HANG: "1"}
    process = subprocess.Popen(bench.command(), env=environment, stderr=subprocess.DEVNULL)
    bench.wait(process, 0)
    try:
        with pytest.raises(StanceError, match="another campaign is writing to"):
            bench.run()
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()


def test_each_trial_tells_its_push_and_whether_it_succeeded(bench: Bench) -> None:
    drawn = STUDY.replace("force_W: [$force, 0, 0]", "impulse: 2, direction: {uniform: [-3, 3]}")
    ten, _, eighty = bench.run(drawn, trials=2).cells
    assert [(one.seed, one.impulse, one.direction, one.succeeded) for one in ten.pushes] == [
        (1, 2.0, 0.25, True),
        (2, 2.0, 0.25, True),
    ]
    assert [(one.impulse, one.succeeded) for one in eighty.pushes] == [(pytest.approx(8.0), False)] * 2
    twice = drawn.replace(
        "pushes: [{", "pushes: [{time: 4.0, duration: 0.1, impulse: 1, direction: 0, point_B: [0, 0, 0]}, {", 1
    )
    assert bench.run(twice, trials=1).cells[0].pushes == []


def test_the_command_draws_a_map_of_one_study(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    words = bench.command("--trials", "1")[3:]
    place = bench.directory / "map.svg"
    assert main([*words, "--map", str(place)]) == 1
    assert "<svg" in place.read_text()
    assert f"map: {place}" in capsys.readouterr().err
    calls = bench.calls()
    for more, message in (
        (["--study", str(bench.study), "stand", "--map", str(place)], "--map draws one study: leave out all of"),
        (["--map", str(bench.directory / "map.txt")], "must end in .png, .svg or .pdf"),
        (["--study", "stand", "--map", str(place)], "--map: no scenario of stand has exactly one push"),
    ):
        assert main([*words, *more]) == 2
        assert message in capsys.readouterr().err
    assert bench.calls() == calls


def test_the_command_prints_and_ends_by_whether_what_is_asked_is_met(
    bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    words = bench.command("--trials", "1")[3:]
    assert main([*words, "--name", "10 N", "--silent"]) == 0
    assert capsys.readouterr() == ("", "")
    assert main([*words, "--json"]) == 1
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert found["met"] is False
    assert [cell["succeeded"] for cell in found["studies"][0]["cells"]] == [1, 1, 0]
    assert "study 1 of 1: pushes, 3 cells" in err
    assert main([*words]) == 1
    assert "FAIL 80 N" in capsys.readouterr().out
    assert main([*words, "--robot", "arm"]) == 2
    assert "robot is 'biped', but the campaign is of 'arm'" in capsys.readouterr().err
