"""Logs in the formats of other tools: Parquet and CSV, a file per channel, and MATLAB's .mat."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .errors import StanceError
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
