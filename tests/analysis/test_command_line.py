"""Every command on a small log: what it prints, what it writes, and how it ends."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import fake_programs
import lcm
import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat
from stance import network, plots
from stance.cli import main
from stance.log import Log
from stance.programs import find_lcm_tool
from synthetic import WALL, Synthetic, encode_log


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(
        Synthetic(duration=0.6, pushes=[(0.2, 0.1, (5.0, 0.0, 0.0))]).write(tmp_path_factory.mktemp("l") / "a.log")
    )


@pytest.fixture(scope="module")
def fallen(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(Synthetic(duration=1.0, fall_at=0.2).write(tmp_path_factory.mktemp("l") / "b.log"))


def test_info_tells_channels_and_runs(small: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", small]) == 0
    text = capsys.readouterr().out
    assert "CONTROLLER_TRACE" in text and "nothing was skipped" in text and "stance-sim 0.1.0" in text
    assert main(["info", small, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["schema"], found["complete"], found["runs"][0]["states"]) == ("stance.info", True, 61)


def test_info_tells_what_was_skipped(small: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    torn = tmp_path / "torn.log"
    torn.write_bytes(Path(small).read_bytes()[:-40])
    assert main(["info", str(torn)]) == 0
    assert "torn tail" in capsys.readouterr().out


def test_info_starts_without_pandas_and_matplotlib(small: str) -> None:
    code = (
        "import sys; from stance.cli import main; main(['info', sys.argv[1], '--silent']); "
        "print([m for m in ('pandas', 'matplotlib', 'scipy', 'jinja2', 'lcm') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code, small], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_check_passes_and_fails_by_exit_code(small: str, fallen: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", small]) == 0
    assert "PASS" in capsys.readouterr().out
    assert main(["check", fallen, "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["passed"] is False


def test_check_takes_other_limits(small: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    limits = tmp_path / "strict.yaml"
    limits.write_text("limits: [{name: no tilt at all, metric: trunk.tilt_max_deg, max: 0.0}]")
    assert main(["check", small, "--limits", str(limits)]) == 1
    assert "no tilt at all" in capsys.readouterr().out
    assert main(["check", small, "--limits", str(tmp_path / "absent.yaml")]) == 2


def test_json_has_null_for_what_is_not_finite_and_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    messages = Synthetic(duration=0.5).messages()
    messages["CONTROLLER_TRACE"]["qp_primal_residual"][20] = np.nan
    log = tmp_path / "run.lcmlog"
    log.write_bytes(encode_log([(WALL, channel, row.tobytes()) for channel, rows in messages.items() for row in rows]))
    limits = tmp_path / "limits.yaml"
    limits.write_text("limits: [{name: violation, metric: qp.primal_residual_max, max: 0.5}]")
    assert main(["check", str(log), "--limits", str(limits), "--json"]) == 1
    verdict = json.loads(capsys.readouterr().out, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert verdict["findings"][0]["value"] is None
    assert verdict["not_finite"] == {"findings.0.value": "inf"}


def test_report_writes_its_files(
    small: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(plots, "PLOTS", {"gait": plots.PLOTS["gait"]})  # one is enough here
    assert main(["report", small, "--out", str(tmp_path), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert all(Path(result[name]).exists() for name in ("report", "summary", "plots"))


def test_plot_draws_what_is_asked_for(small: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plot", small, "--list"]) == 0
    assert "timing" in capsys.readouterr().out
    out = ["--out", str(tmp_path)]
    assert main(["plot", small, *out, "--only", "gait", "--from", "0.1", "--to", "0.4", "--format", "svg"]) == 0
    assert (tmp_path / "gait.svg").read_bytes().startswith(b"<?xml")
    assert main(["plot", small, *out, "--at", "0.1", "0.3", "--view", "front", "--silent"]) == 0
    assert (tmp_path / "picture.png").exists()
    assert main(["plot", small, *out, "--only", "nonsense"]) == 2


@pytest.mark.parametrize("kind", ["parquet", "csv"])
def test_export_writes_every_channel(small: str, tmp_path: Path, kind: str) -> None:
    assert main(["export", kind, small, "--out", str(tmp_path)]) == 0
    path = tmp_path / f"TRUTH.{kind}"
    frame = pd.read_parquet(path) if kind == "parquet" else pd.read_csv(path)
    expected = Log.open(small).run().frame("TRUTH")
    assert list(frame.columns) == list(expected.columns)
    assert frame["p_WC_2"].to_numpy() == pytest.approx(expected["p_WC_2"].to_numpy())


def test_export_for_matlab_keeps_shapes(small: str, tmp_path: Path) -> None:
    assert main(["export", "mat", small, "--out", str(tmp_path / "run.mat")]) == 0
    truth = loadmat(tmp_path / "run.mat", simplify_cells=True)["TRUTH"]
    assert truth["f_F_W"].shape == (61, 4, 3)
    assert truth["t"][-1] == pytest.approx(0.6)


def test_verify_passes_the_exit_code_on(
    small: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    program = tmp_path / "stance-replay"
    program.write_text("#!/bin/sh\necho 60 equal, 1 different\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("STANCE_BIN_DIR", str(tmp_path))
    assert main(["replay", small, "--verify", "--json"]) == 1
    assert json.loads(capsys.readouterr().out) == {"equal": False, "exit_code": 1, "text": "60 equal, 1 different"}
    monkeypatch.setenv("STANCE_BIN_DIR", str(tmp_path / "absent"))
    assert main(["replay", small, "--verify"]) == 2
    assert "stance-replay is not in $STANCE_BIN_DIR" in capsys.readouterr().err


def test_doctor_has_a_line_for_each_thing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--json"]) in (0, 2)
    found = {one["name"]: one for one in json.loads(capsys.readouterr().out)}
    assert {"stance-sim", "lcm-logger", "network", "real-time priority", "locked memory"} <= set(found)
    assert all("\n" not in one["text"] for one in found.values())


def test_doctor_notes_that_lcm_spy_needs_java(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    main(["doctor"])
    line = next(line for line in capsys.readouterr().out.splitlines() if " java " in line)
    assert line.startswith("note") and "lcm-spy needs it" in line


@pytest.mark.parametrize("command", ["info", "check", "report", "plot", "replay"])
def test_unreadable_input_is_exit_3_and_one_line(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    junk = tmp_path / "junk"
    junk.write_bytes(b"not a log" * 100)
    for path in (junk, tmp_path / "absent"):
        assert main([command, str(path)]) == 3
        assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("command", [["report"], ["plot"], ["export", "csv"], ["export", "mat"]])
def test_a_place_that_cannot_be_written_is_exit_2_and_one_line(
    command: list[str], small: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*command, small, "--out", "/dev/null/there", "--silent"]) == 2
    err = capsys.readouterr().err
    assert err.startswith("stance: /dev/null")
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["plot", "--from", "0.5", "--to", "0.3"], "the run goes from 0.00 to 0.60 s"),
        (["plot", "--from", "100"], "the run goes from 0.00 to 0.60 s"),
        (["plot", "--at", "100"], "from 0.00 to 0.60 s"),
        (["plot", "--at", "0.1", "--only", "gait"], "leave out --only"),
        (["plot", "--view", "front", "--list"], "leave out --only and --list"),
        (["replay", "--from", "100"], "it lasts 0."),
        (["replay", "--from", "0.5", "--to", "0.3"], "nothing to play"),
        (["replay", "--verify", "--channels", "TRUTH"], "takes the whole log"),
        (["replay", "--verify", "--speed", "2"], "takes the whole log"),
    ],
)
def test_options_that_would_do_nothing_are_exit_2(
    arguments: list[str], message: str, small: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command, *options = arguments
    out = ["--out", str(tmp_path)] if command == "plot" else []
    assert main([command, small, *out, *options]) == 2
    assert message in capsys.readouterr().err
    assert not any(tmp_path.iterdir())


def test_limits_that_cannot_be_used_are_told_before_the_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(network, "ensure", lambda *_: pytest.fail("began to run"))
    assert main(["run", "--out", str(tmp_path), "--limits", str(tmp_path / "absent.yaml")]) == 2
    assert "absent.yaml: No such file" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["fly"],
        ["info"],
        ["run", "--duration", "-1"],
        ["run", "--duration", "inf"],
        ["run", "--no-report", "--limits", "x"],
        ["replay", "x", "--speed", "-1"],
        ["plot", "x", "--list", "--only", "gait"],
        ["campaign"],
        ["campaign", "--study", "x", "--trials", "0"],
        ["campaign", "--study", "x", "--workers", "-1"],
        ["campaign", "--study", "x", "--keep", "-1"],
        ["command", "--vx", "inf"],
        ["command", "--behaviour", "fly"],
        ["command", "--lcm-url", "x", "--pid", "1"],
    ],
)
def test_usage_errors_are_exit_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2


def test_silent_says_nothing(small: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", small, "--silent"]) == 0
    assert capsys.readouterr() == ("", "")


# ---- over LCM, with stand-ins for the C++ programs -------------------------------------------------------------------


class Stance:
    """The command as a process of its own, with stand-ins for the simulator and the controller."""

    def __init__(self, directory: Path) -> None:
        programs = directory / "bin"
        programs.mkdir()
        fake_programs.install(programs)
        self.out = directory / "run"
        self.environment = {
            **os.environ,
            "STANCE_BIN_DIR": str(programs),
            network.RUNTIME_DIRECTORY: str(directory / "runtime"),
        }

    def start(self, *arguments: str, **environment: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-m", "stance", *arguments],
            env={**self.environment, **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, *arguments: str, **environment: str) -> tuple[int, str, str]:
        process = self.start(*arguments, **environment)
        out, err = process.communicate(timeout=60)
        return process.returncode, out, err


def children_of(pid: int) -> list[str]:
    """Process ids, without needing a program that may not be installed."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # others come and go
            name, _, fields = path.read_text().rpartition(")")
            if int(fields.split()[1]) == pid:
                found.append(name.split()[0])
    return found


@pytest.fixture
def stance(tmp_path: Path) -> Stance:
    return Stance(tmp_path)


def test_run_records_a_log_and_writes_its_report(stance: Stance) -> None:
    code, out, err = stance.run("run", "--lockstep", "--duration", "0.8", "--out", str(stance.out), "--json")
    assert code == 0, err
    result = json.loads(out)
    assert result["verdict"]["passed"]
    assert all(Path(result[name]).exists() for name in ("log", "report", "summary", "plots"))
    report = Log.open(result["log"]).report
    assert report.problems() == []
    assert {channel.name for channel in report.channels} >= {"ROBOT_STATE", "TRUTH", "RUN_INFO_CONTROLLER"}


def test_a_fall_is_recorded_and_is_exit_1(stance: Stance) -> None:
    code, out, _ = stance.run("run", "--duration", "1", "--out", str(stance.out), "--no-report", FAKE_SIM="fall")
    assert (code, "FELL" in out) == (1, True)
    assert Log.open(stance.out / "run.lcmlog").run().field("TRUTH", "fallen").any()


@pytest.mark.parametrize(
    ("environment", "message"),
    [
        ({"FAKE_SIM": "fail"}, "stance-sim failed (exit 2): stance-sim: no scenario of that name"),
        ({"FAKE_CONTROLLER": "fail"}, "stance-controller failed at its start (exit 2): stance-controller: biped.yaml"),
        (
            {"FAKE_CONTROLLER": "die"},
            "stance-controller ended during the run (exit 3): stance-controller: out of memory",
        ),
    ],
)
def test_a_failing_program_is_one_line_with_its_own_words(
    stance: Stance, environment: dict[str, str], message: str
) -> None:
    code, _, err = stance.run("run", "--duration", "20", "--out", str(stance.out), **environment)
    assert code == 2
    assert message in err
    assert err.count("\n") == 1
    assert stance.out.exists() == (
        environment == {"FAKE_CONTROLLER": "die"}
    )  # the others failed before the first state


def test_a_controller_that_says_nothing_is_given_up_after_its_time(stance: Stance) -> None:
    code = "from stance import run; run.READY_TIMEOUT = 1.0; from stance.cli import main; raise SystemExit(main())"
    prefix = [] if network.host_is_loopback() else network.namespace_command() or []
    done = subprocess.run(
        [*prefix, sys.executable, "-c", code, "run", "--out", str(stance.out)],
        env={**stance.environment, network.INSIDE: "1", "FAKE_CONTROLLER": "mute"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "stance-controller is not ready after 1 s: it sent no RUN_INFO_CONTROLLER" in done.stderr


def test_a_run_that_never_began_leaves_what_was_there_before(stance: Stance) -> None:
    stance.out.mkdir()
    note = stance.out / "note.txt"
    note.write_text("mine")
    assert stance.run("run", "--out", str(stance.out), FAKE_SIM="fail")[0] == 2
    assert list(stance.out.iterdir()) == [note]


def test_a_log_that_is_there_is_not_overwritten(stance: Stance) -> None:
    stance.out.mkdir()
    log = stance.out / "run.lcmlog"
    log.write_bytes(b"of yesterday")
    code, _, err = stance.run("run", "--duration", "0.5", "--out", str(stance.out))
    assert (code, log.read_bytes()) == (2, b"of yesterday")
    assert err == f"stance: {log} is there already: choose another --out, or remove it\n"


def test_ctrl_c_ends_every_process_and_leaves_a_readable_log_and_others_can_join(stance: Stance) -> None:
    process = stance.start("run", "--out", str(stance.out), FAKE_SIM="forever")
    log = stance.out / "run.lcmlog"
    deadline = time.monotonic() + 30
    while not (log.exists() and log.stat().st_size > 100_000) and time.monotonic() < deadline:
        time.sleep(0.05)
    code, out, _ = stance.run("shell", "--", "sh", "-c", "echo url $LCM_DEFAULT_URL; readlink /proc/self/ns/net")
    assert code == 0
    assert "url udpm://239.255.76.67:7667?ttl=0" in out
    assert os.readlink(f"/proc/{process.pid}/ns/net") in out
    children = children_of(process.pid)
    assert len(children) == 3
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "interrupted after" in err
    assert not any(Path(f"/proc/{child}").exists() for child in children)
    assert Log.open(log).report.skipped == []
    assert stance.run("shell", "--", "true")[0] == 2


def test_commands_reach_a_run_in_its_network_and_ctrl_c_ends_them_with_standing(stance: Stance) -> None:
    process = stance.start("run", "--out", str(stance.out), "--no-report", FAKE_SIM="forever")
    log = stance.out / "run.lcmlog"
    while not (log.exists() and log.stat().st_size > 100_000):
        assert process.poll() is None
        time.sleep(0.05)
    words = ["command", "--vx", "0.5", "--yaw-rate", "-0.2"]
    code, out, err = stance.run(*words, "--duration", "0.5", "--json")
    assert (code, json.loads(out)) == (0, {"sent": 6}), err
    operator = stance.start(*words)
    while log.read_bytes().count(b"USER_COMMAND") < 1 + 6 + 3:  # the simulator sends one, too
        assert operator.poll() is None
        time.sleep(0.05)
    operator.send_signal(signal.SIGINT)
    out, err = operator.communicate(timeout=30)
    assert operator.returncode == 0, err
    assert "the last one to stand" in out
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=30)
    commands = Log.open(log).run().channels["USER_COMMAND"]
    commands = commands.take(np.flatnonzero(commands.field("seq") > 1_000_000))  # the operator's count microseconds
    behaviour = commands.field("behaviour").tolist()
    assert behaviour[:6] == [1, 1, 1, 1, 1, 0]
    assert behaviour[6:] == [1] * (len(behaviour) - 7) + [0]
    walking = commands.field("behaviour") == 1
    assert (commands.field("velocity")[walking] == [0.5, 0.0]).all()
    assert (commands.field("yaw_rate")[walking] == -0.2).all()
    assert (np.diff(commands.field("seq")) > 0).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--vx", "1"], "no running stance process to join: start `stance run` first"),
        (["--script", "absent.yaml"], "absent.yaml: No such file"),
        (["--script", "absent.yaml", "--vx", "1"], "--script says it all"),
        (["--behaviour", "stand", "--yaw-rate", "1"], "--behaviour stand has no velocity: leave out --vx"),
    ],
)
def test_a_command_that_cannot_be_given_is_exit_2_and_one_line(
    arguments: list[str], message: str, stance: Stance
) -> None:
    code, _, err = stance.run("command", *arguments)
    assert code == 2
    assert message in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("player", ["stance replay", "lcm-logplayer"])
def test_a_subscriber_hears_the_whole_log_byte_for_byte(player: str, stance: Stance, small: str) -> None:
    command = [sys.executable, "-m", "stance", "replay", "--silent"]
    if player == "lcm-logplayer":
        command = [str(find_lcm_tool(player)), f"--lcm-url={network.LCM_URL}"]
    prefix = [] if network.host_is_loopback() else network.namespace_command() or []
    done = subprocess.run(
        [*prefix, sys.executable, str(Path(__file__).with_name("heard.py")), *command, small],
        env={**stance.environment, network.INSIDE: "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    heard = [(channel, bytes.fromhex(payload)) for channel, payload in json.loads(done.stdout)]
    written = [(event.channel, event.data) for event in lcm.EventLog(small)]
    assert [one for one in heard if one[0] != "LCM_SELF_TEST"] == [one for one in written if one[0] != "LCM_SELF_TEST"]


def test_replay_publishes_over_lcm_in_its_own_network(stance: Stance, small: str) -> None:
    code, out, err = stance.run("replay", small, "--speed", "0", "--channels", "TRUTH", "ROBOT_*", "--json")
    assert code == 0, err
    assert json.loads(out)["channels"] == {"ROBOT_STATE": 61, "TRUTH": 61}


def test_run_without_its_programs_says_what_to_do(stance: Stance, tmp_path: Path) -> None:
    code, _, err = stance.run("run", "--out", str(stance.out), STANCE_BIN_DIR=str(tmp_path / "absent"))
    assert code == 2
    assert "build the project" in err
