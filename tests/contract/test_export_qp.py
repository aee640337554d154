"""`stance export qp`: the controller's own force QPs, out of a log."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from stance.cli import main
from stance.log import Log
from stance.programs import find_program

WALK = 1  # user_command_t's
HEADER = np.dtype(
    [
        ("magic", "S8"),
        ("contacts", "<i4"),
        ("ticks", "<i4"),
        ("stages", "<i4"),
        ("terminal", "<i4"),
        ("friction", "<f8"),
        ("typical_force", "<f8"),
    ]
)


def roll_out(log: Path, scenario: str, seconds: float) -> None:
    words = ["--robot", "biped", "--scenario", scenario, "--duration", str(seconds), "--log", str(log)]
    subprocess.run([str(find_program("stance-rollout")), *words], check=True, capture_output=True)


def test_the_force_qps_of_a_walk_are_those_that_its_trace_tells(tmp_path: Path) -> None:
    log, file = tmp_path / "walk.lcmlog", tmp_path / "walk.qp"
    roll_out(log, "walk", 4.0)
    assert main(["export", "qp", str(log), "--out", str(file), "--ticks", "50"]) == 0
    header = np.frombuffer(file.read_bytes(), HEADER, count=1)[0]
    assert (header["magic"], header["contacts"], header["ticks"], header["terminal"]) == (b"STANCEQ2", 2, 50, 0)
    stage = 12 * 12 + 12 * 6 + 3 * 12 + 2 * 6 + 2 * 2  # A, B, g, xref, Q, fref, R, bounds
    ticks = np.frombuffer(file.read_bytes(), "<f8", offset=HEADER.itemsize).reshape(50, 12 + header["stages"] * stage)
    run = Log.open(log).run()
    stepping = run.field("CONTROLLER_TRACE", "behaviour") == WALK
    assert np.array_equal(ticks[:, :12], run.field("CONTROLLER_TRACE", "x")[stepping][:50])
    first_reference = ticks[:, 12 + 12 * 12 + 12 * 6 + 12 :][:, :12]
    assert np.array_equal(first_reference, run.field("CONTROLLER_TRACE", "x_ref")[stepping][:50])


def test_a_log_without_a_step_has_none_to_export(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, file = tmp_path / "stand.lcmlog", tmp_path / "stand.qp"
    roll_out(log, "stand", 0.5)
    assert main(["export", "qp", str(log), "--out", str(file)]) != 0
    assert "no tick of the log steps" in capsys.readouterr().err
    assert not file.exists()
