"""Publishes a log again over LCM, and verifies that the controller would decide the same again."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from .errors import StanceError, UnreadableError
from .events import Offsets
from .log import Log
from .messages import SELF_TEST_CHANNEL
from .network import LCM_URL, connect
from .programs import find_program

VERIFIER = "stance-replay"
PROGRESS_EVERY = 0.1  # s

Progress = Callable[[float, float], None]
"""called with the log's time and its end, both in s from the first event that is played"""


@dataclass(frozen=True)
class Replayed:
    """What was published."""

    messages: int
    channels: dict[str, int]
    duration: float
    """s, of the log's time"""
    wall: float
    """s"""


def select(
    log: Log, channels: Sequence[str] | None = None, first: float | None = None, last: float | None = None
) -> Offsets:
    """Rows of `log.index` to play, in order of the time of their reception.

    `channels` are names or patterns such as CONTROLLER_*; `first` and `last` [s] count from the log's first event.
    Raises StanceError where a name matches no channel, or where there is nothing between these times.
    """
    held = [name for name in log.events_of if name != SELF_TEST_CHANNEL]
    chosen = held
    if channels is not None:
        for pattern in channels:
            if not any(fnmatchcase(name, pattern) for name in held):
                raise StanceError(f"no channel {pattern} in {log.path}; it holds {', '.join(held)}")
        chosen = [name for name in held if any(fnmatchcase(name, pattern) for pattern in channels)]
    rows = np.sort(np.concatenate([log.events_of[name] for name in chosen] or [np.empty(0, np.int64)]))
    everything = np.concatenate([log.events_of[name] for name in held] or [np.empty(0, np.int64)])
    if not len(everything):
        raise UnreadableError(f"{log.path}: nothing to play in it")
    begin, end = log.index.time[everything].min(), log.index.time[everything].max()
    at = (log.index.time[rows] - begin) * 1e-6
    kept = (at >= (-np.inf if first is None else first)) & (at <= (np.inf if last is None else last))
    if not kept.any():
        raise StanceError(f"{log.path}: nothing to play between these times; it lasts {(end - begin) * 1e-6:.2f} s")
    return np.asarray(rows[kept][np.argsort(log.index.time[rows[kept]], kind="stable")])


def replay(
    log: Log,
    rows: Offsets,
    speed: float = 1.0,
    url: str = LCM_URL,
    progress: Progress | None = None,
    connection: Any = None,
) -> Replayed:
    """Publishes the events `rows` (of `select`) at `speed` times their own pace, or as fast as possible where it is 0.

    Each message leaves at an absolute deadline, so that delays do not add up. `connection` takes the place of an LCM on
    `url`. Raises MissingError where LCM cannot start.
    """
    if connection is None:
        connection = connect(url)
    offset, length = log.index.data_offset[rows], log.index.data_length[rows]
    at = (log.index.time[rows] - log.index.time[rows[0]]) * 1e-6 if len(rows) else np.empty(0)
    names = np.empty(len(log.index), object)
    for name, events in log.events_of.items():
        names[events] = name
    counts: dict[str, int] = {}
    end = float(at[-1]) if len(at) else 0.0
    begun = time.monotonic()
    shown = begun
    for row, start, size, due in zip(rows.tolist(), offset.tolist(), length.tolist(), at.tolist(), strict=True):
        now = time.monotonic()
        if speed > 0.0 and begun + due / speed > now:
            time.sleep(begun + due / speed - now)
        name = names[row]
        connection.publish(name, log.payload_bytes(start, size))
        counts[name] = counts.get(name, 0) + 1
        if progress is not None and now - shown > PROGRESS_EVERY:
            shown = now
            progress(due, end)
    if progress is not None:
        progress(end, end)
    return Replayed(len(rows), counts, end, time.monotonic() - begun)


def verify(path: Path, capture: bool = False) -> subprocess.CompletedProcess[str]:
    """Feeds the logged states and commands through the controller and compares every published byte.

    Runs `stance-replay LOG`: its exit code is 0 where all are equal, 1 where not. Raises MissingError without it, and
    UnreadableError where there is no such log.
    """
    if not path.is_file():
        raise UnreadableError(f"{path}: No such file or directory")
    return subprocess.run([str(find_program(VERIFIER)), str(path)], check=False, text=True, capture_output=capture)
