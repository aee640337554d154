"""Messages as columns: what the metrics and the plots read. Nothing here opens a file."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from .messages import OPERATOR_CHANNELS

if TYPE_CHECKING:
    import pandas as pd

Array = npt.NDArray[Any]
Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class Messages(Protocol):
    """The messages of one channel, sorted by (session, seq); what is sent by hand as it came. n is their number.

    Not by utime: a tick without a new state is stamped ahead of it, so that the next one's stamp may be earlier.
    """

    @property
    def channel(self) -> str: ...

    @property
    def received(self) -> Integers:
        """us, wall clock of the logger, shape (n,)"""
        ...

    @property
    def session(self) -> Integers:
        """how often the sender had been started again in its run before each message, shape (n,)"""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """the fields, as in lcmtypes/"""
        ...

    def __len__(self) -> int: ...

    def field(self, name: str) -> Array:
        """One field, native byte order, shape (n, *dimensions of the field)."""
        ...

    def take(self, rows: Array) -> Messages:
        """The rows where the mask (n,) is true."""
        ...

    def frame(self) -> pd.DataFrame:
        """A column per scalar; array fields as name_0, name_0_2, ... in row-major order; `tag` is left out."""
        ...


@dataclass(frozen=True)
class RunInfo:
    """What a program said of itself: run_info_t."""

    program: str
    version: str
    source: str
    build: str
    robot: str
    options: str
    seed: int
    urdf: str
    configuration: str
    scenario: str
    input_hash: str


@dataclass
class Run:
    """One run of a robot: the messages of one ROBOT_STATE.run_id. Times are seconds from its first ROBOT_STATE."""

    run_id: int
    start: int
    """us, utime of the first ROBOT_STATE"""
    channels: Mapping[str, Messages]
    simulator: RunInfo | None = None
    controller: RunInfo | None = None
    name: str = ""
    """where it came from, for titles"""
    _time: dict[str, Floats] = field(default_factory=dict, repr=False)

    def __contains__(self, channel: str) -> bool:
        return channel in self.channels and len(self.channels[channel]) > 0

    def __iter__(self) -> Iterator[str]:
        return iter(self.channels)

    def count(self, channel: str) -> int:
        return len(self.channels[channel]) if channel in self.channels else 0

    def field(self, channel: str, name: str) -> Array:
        """Shape (n, *dimensions). Raises KeyError where the run has no such channel or field."""
        return self.channels[channel].field(name)

    def frame(self, channel: str) -> pd.DataFrame:
        """The channel's columns with `t` [s] first. Raises KeyError where the run has no such channel."""
        import pandas as pd

        return pd.concat([pd.Series(self.time(channel), name="t"), self.channels[channel].frame()], axis=1)

    @property
    def span(self) -> tuple[float, float]:
        """s, times of the first and the last ROBOT_STATE; (0, duration) unless `between` cut the run"""
        state = self.field("ROBOT_STATE", "utime")
        return (float(state[0] - self.start) * 1e-6, float(state[-1] - self.start) * 1e-6) if len(state) else (0.0, 0.0)

    @property
    def duration(self) -> float:
        """s, from the first to the last ROBOT_STATE"""
        first, last = self.span
        return last - first

    def between(self, first: float | None, last: float | None, of: Collection[str] | None = None) -> Run:
        """The part from `first` to `last` [s]; times still count from the run's start. `of`: only these are cut."""
        low, high = -np.inf if first is None else first, np.inf if last is None else last
        parts, times = {}, {}
        for name, messages in self.channels.items():
            rows = (self.time(name) >= low) & (self.time(name) <= high) | (of is not None and name not in of)
            if rows.any() or name == "ROBOT_STATE":
                parts[name], times[name] = messages.take(rows), self.time(name)[rows]
        return replace(self, channels=parts, _time=times)

    def time(self, channel: str) -> Floats:
        """s since the run's start, shape (n,).

        By utime where the sender shares the robot's clock. CONTROLLER_TIMING is stamped by the wall clock, so it takes
        the time of the trace of the same tick; what knows no run or was sent by hand is placed by when it was received.
        """
        if channel not in self._time:
            self._time[channel] = self._time_of(channel)
        return self._time[channel]

    def _time_of(self, channel: str) -> Floats:
        utime = self.field(channel, "utime")
        own = (utime - self.start) * 1e-6
        if channel == "CONTROLLER_TIMING" and "CONTROLLER_TRACE" in self:
            rows = match(self._ticks("CONTROLLER_TIMING"), self._ticks("CONTROLLER_TRACE"))
            trace = self.time("CONTROLLER_TRACE")
            known = rows >= 0
            if known.any():
                position = np.arange(len(own), dtype=float)
                return np.asarray(np.interp(position, position[known], trace[rows[known]]))
        foreign = channel in OPERATOR_CHANNELS or (self.field(channel, "run_id") != self.run_id).any()
        if foreign or (len(own) and (own.min() < -1.0 or own.max() > self.span[1] + 1.0)):
            received, at = self.channels["ROBOT_STATE"].received, self.time("ROBOT_STATE")
            order = np.argsort(received, kind="stable")
            return np.asarray(np.interp(self.channels[channel].received, received[order], at[order]))
        return np.asarray(own)

    def _ticks(self, channel: str) -> Integers:
        """A number for each tick that stays unique when the controller is started again within the run."""
        return self.channels[channel].session * (1 << 40) + self.field(channel, "seq")


def missing_after(messages: Messages) -> Integers:
    """How many messages that its sender numbered the log lacks after each, (n,). None of what is sent by hand."""
    if messages.channel in OPERATOR_CHANNELS or not len(messages):
        return np.zeros(len(messages), np.int64)
    step = np.where(_same_sender(messages), np.diff(messages.field("seq")), 1)
    return np.append(np.maximum(step - 1, 0), 0)


def restarted(messages: Messages) -> npt.NDArray[np.bool_]:
    """Whether the sender was started again just before each message, (n,); a run's first sender is not."""
    return np.append(np.zeros(min(len(messages), 1), bool), np.diff(messages.session) > 0)


def _same_sender(messages: Messages) -> npt.NDArray[np.bool_]:
    """Whether a message and the next one are of one session of one run, (n - 1,)."""
    return np.asarray((np.diff(messages.session) == 0) & (np.diff(messages.field("run_id")) == 0))


def match(wanted: Array, keys: Array) -> Integers:
    """For each of `wanted`, the first index into `keys` that holds it, or -1. Shape of `wanted`."""
    if not len(keys):
        return np.full(len(wanted), -1, np.int64)
    order = np.argsort(keys, kind="stable")
    at = np.searchsorted(keys[order], wanted)
    found = order[np.minimum(at, len(keys) - 1)]
    return np.where(keys[found] == wanted, found, -1).astype(np.int64)
