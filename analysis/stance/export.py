"""Logs in the formats of other tools: Parquet and CSV, a file per channel, and MATLAB's .mat; and their force QPs."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np

from .errors import StanceError
from .programs import find_program
from .series import Array, Run

FORMATS = ("parquet", "csv", "mat")


def export(run: Run, kind: str, out: Path) -> list[Path]:
    """Writes a run; returns the files. Parquet and CSV make a directory `out` with a file per channel, mat one file.

    Times `t` [s] count from the run's start. Raises StanceError for another format.
    """
    if kind == "mat":
        return [_mat(run, out)]
    if kind not in FORMATS:
        raise StanceError(f"no format {kind!r}: {', '.join(FORMATS)}")
    out.mkdir(parents=True, exist_ok=True)
    written = []
    for channel in run:
        path = out / f"{channel}.{kind}"
        frame = run.frame(channel)
        if kind == "parquet":
            frame.to_parquet(path, index=False)
        else:
            frame.to_csv(path, index=False)
        written.append(path)
    return written


def export_force_qps(log: Path, out: Path, ticks: int) -> str:
    """Writes the force QPs of the first `ticks` ticks of `log` that step, as `bench_force_qp --sequence` reads them.

    They are the controller's own, computed again from the log by `stance-replay`, which compares every byte on the way;
    returns what it says. Raises StanceError where a byte differs, or the log holds no such tick.
    """
    command = [str(find_program("stance-replay")), str(log), "--qp", str(out), "--qp-ticks", str(ticks)]
    said = subprocess.run(command, capture_output=True, text=True, check=False)
    if said.returncode != 0:
        raise StanceError((said.stderr or said.stdout).strip().removeprefix("stance-replay: "))
    return said.stdout.strip()


def _mat(run: Run, out: Path) -> Path:
    from scipy.io import savemat

    content: dict[str, dict[str, Array]] = {}
    for channel in run:
        names = [name for name in run.channels[channel].names if name != "tag"]
        content[channel] = {"t": run.time(channel)}
        for name in names:
            values = run.field(channel, name)
            content[channel][name] = values.astype(object) if values.dtype.kind == "U" else np.ascontiguousarray(values)
    out.parent.mkdir(parents=True, exist_ok=True)
    savemat(out, content, do_compression=True, long_field_names=True)
    return out
