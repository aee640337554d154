"""LCM logs → columns: every message of a channel at once, by numpy, with a report of all that could not be read.

log = Log.open("run.lcmlog")
run = log.run()                               # the longest run in it
run.field("TRUTH", "p_WC")                    # (n, 3) m
run.frame("CONTROLLER_TRACE")                 # DataFrame
log.report.problems()                         # what was skipped, and why
"""

from __future__ import annotations

import mmap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .errors import UnreadableError
from .events import Buffer, EventIndex, Offsets, Skipped, gather, index_events
from .messages import CHANNELS, OPERATOR_CHANNELS, SELF_TEST_CHANNEL, MessageType, message_types
from .plain import counted
from .series import Array, Integers, Run, RunInfo, missing_after, restarted

if TYPE_CHECKING:
    import pandas as pd

CHUNK_BYTES = 256 << 10  # of payloads decoded at a time: what fits a core's cache
MOST_LATE = 100  # messages that one may arrive behind its successors; what is further back is of another session
RUN_INFO_TYPE = "run_info_t"  # repeated every second, byte for byte, so that any part of a log explains itself
NOT_COLUMNS = ("tag",)  # fields that a DataFrame leaves out


@dataclass(frozen=True)
class Gap:
    """Messages that a sender numbered and the log does not hold."""

    after_utime: int
    """us, of the last message before the gap"""
    missing: int
    """how many seq are absent"""


@dataclass
class ChannelReport:
    """One channel of a log, or of one run in it."""

    name: str
    type_name: str
    """empty where the type is unknown"""
    count: int
    """messages that were read, duplicates left out"""
    bytes: int
    """of all payloads on the channel, read or not"""
    rate: float = 0.0
    """Hz, mean by the messages' own stamps"""
    duplicates: int = 0
    """messages sent again, byte for byte"""
    conflicting: int = 0
    """messages whose utime and seq another one has with other content: kept"""
    out_of_order: int = 0
    """messages that arrived after a later one"""
    restarts: int = 0
    """how often seq started again"""
    gaps: list[Gap] = field(default_factory=list)
    wrong_type: int = 0
    """messages whose fingerprint is not the channel's type: another or an older type, not read"""
    wrong_size: int = 0
    """messages of the right fingerprint that are too short or too long, not read"""

    @property
    def missing(self) -> int:
        """messages that the gaps lack"""
        return sum(gap.missing for gap in self.gaps)


@dataclass
class LogReport:
    """What a log holds, and what of it could not be read. Nothing is dropped without standing here."""

    path: str
    size: int
    """bytes"""
    events: int
    """whole events, LCM's self tests included"""
    self_tests: int
    skipped: list[Skipped]
    suspect: list[int]
    """byte offsets of events that damaged bytes follow; they were read"""
    lost_numbers: int
    """event numbers that the writer gave and the file lacks"""
    channels: list[ChannelReport]
    run_ids: list[int]

    @property
    def skipped_bytes(self) -> int:
        return sum(part.length for part in self.skipped)

    def problems(self) -> list[str]:
        """One sentence for each thing that is not as it should be; empty for a clean log."""
        found = [
            f"{counted(part.length, 'byte')} skipped at offset {part.offset}: {part.reason}" for part in self.skipped
        ]
        found += [f"the event at offset {at} precedes damaged bytes: its payload may be damaged" for at in self.suspect]
        if self.lost_numbers:
            found.append(f"{counted(self.lost_numbers, 'event number')} absent from the file")
        for channel in self.channels:
            if not channel.type_name:
                found.append(f"{channel.name}: unknown type, {counted(channel.bytes, 'byte')} not read")
            told = (
                (channel.wrong_type, "of another or older type not read"),
                (channel.wrong_size, "of the wrong size not read"),
                (channel.missing, f"missing in {counted(len(channel.gaps), 'gap')}"),
                (channel.conflicting, "not like another of the same utime and seq"),
                (channel.duplicates if channel.type_name != RUN_INFO_TYPE else 0, "sent again, byte for byte"),
                (channel.out_of_order, "late, now sorted"),
            )
            found += [f"{channel.name}: {counted(count, 'message')} {what}" for count, what in told if count]
            if channel.restarts:
                found.append(f"{channel.name}: its sender was started again {counted(channel.restarts, 'time')}")
        return found


class LogMessages:
    """The messages of one channel in a log (`stance.series.Messages`): columns are decoded when first asked for."""

    def __init__(
        self,
        channel: str,
        message_type: MessageType,
        buffer: Buffer,
        offsets: Offsets,
        sizes: Integers,
        received: Integers,
        session: Integers | None = None,
    ) -> None:
        self.channel = channel
        self.type = message_type
        self.received = received
        self.session = np.zeros(len(offsets), np.int64) if session is None else session
        self.offsets = offsets
        self.sizes = sizes
        self._buffer = buffer
        self._columns: dict[str, Array] = {}

    def __len__(self) -> int:
        return len(self.offsets)

    @property
    def names(self) -> tuple[str, ...]:
        return self.type.fields

    def field(self, name: str) -> Array:
        if name not in self.names:
            raise KeyError(f"{self.channel} has no field {name!r}: {', '.join(self.names)}")
        return np.moveaxis(self._decode([name])[name], -1, 0)

    def frame(self) -> pd.DataFrame:
        import pandas as pd

        names = [name for name in self.names if name not in NOT_COLUMNS]
        columns: dict[str, Array] = {}
        for name, values in self._decode(names).items():
            if values.ndim == 1:
                columns[name] = values
                continue
            flat = values.reshape(-1, values.shape[-1])
            for index, column in zip(np.ndindex(values.shape[:-1]), flat, strict=True):
                columns["_".join((name, *map(str, index)))] = column
        return pd.DataFrame(columns, copy=False)

    def take(self, rows: slice | npt.NDArray[Any]) -> LogMessages:
        """The chosen rows of it, as messages."""
        taken = LogMessages(
            self.channel,
            self.type,
            self._buffer,
            self.offsets[rows],
            self.sizes[rows],
            self.received[rows],
            self.session[rows],
        )
        taken._columns = {name: values[..., rows] for name, values in self._columns.items()}
        return taken

    def payload(self, row: int) -> bytes:
        """The encoded message, fingerprint included."""
        start = int(self.offsets[row])
        return bytes(self._buffer[start : start + int(self.sizes[row])])

    def decoded(self, row: int) -> Any:
        """The generated class's own object."""
        return self.type.python_class.decode(self.payload(row))

    def _decode(self, names: Sequence[str]) -> dict[str, Array]:
        """Fields as arrays of shape (*dimensions, n): each scalar's column is contiguous."""
        missing = [name for name in names if name not in self._columns]
        if missing and self.type.dtype is not None:
            self._columns.update(decode_columns(self._buffer, self.offsets, self.type.dtype, missing))
        elif missing:
            decoded = [self.decoded(row) for row in range(len(self))]
            self._columns.update({name: np.array([getattr(message, name) for message in decoded]) for name in missing})
        return {name: self._columns[name] for name in names}


def decode_columns(
    buffer: Buffer, offsets: Offsets, dtype: np.dtype[np.void], names: Iterable[str]
) -> dict[str, Array]:
    """Decodes fields of the fixed-size messages that start at `offsets`: name → (*dimensions, n), native byte order.

    Goes through the messages in pieces that fit the cache, and takes neighbouring fields of one base type together.
    """
    count = len(offsets)
    assert dtype.fields is not None
    wanted = sorted(names, key=lambda name: int(dtype.fields[name][1]))  # type: ignore[index]
    runs: list[tuple[int, int, np.dtype[Any], Array]] = []  # (start byte, stop byte, base type, (scalars, n) output)
    columns: dict[str, Array] = {}
    group: list[tuple[str, np.dtype[Any], int]] = []

    def close_group() -> None:
        if not group:
            return
        base = group[0][1].base
        start, stop = group[0][2], group[-1][2] + group[-1][1].itemsize
        block = np.empty(((stop - start) // base.itemsize, count), base.newbyteorder("="))
        runs.append((start, stop, base, block))
        for name, field_type, offset in group:
            first = (offset - start) // base.itemsize
            size = field_type.itemsize // base.itemsize
            columns[name] = block[first : first + size].reshape((*field_type.shape, count))
        group.clear()

    for name in wanted:
        field_type, offset = dtype.fields[name][0], int(dtype.fields[name][1])
        if group and (group[-1][1].base != field_type.base or group[-1][2] + group[-1][1].itemsize != offset):
            close_group()
        group.append((name, field_type, offset))
    close_group()
    if not count:
        return columns

    low, high = min(run[0] for run in runs), max(run[1] for run in runs)
    rows = max(CHUNK_BYTES // (high - low), 16)
    for first in range(0, count, rows):
        piece = gather(buffer, offsets[first : first + rows] + low, (np.void, high - low))
        raw = piece.view(np.uint8).reshape(len(piece), high - low)
        for start, stop, base, block in runs:
            block[:, first : first + rows] = raw[:, start - low : stop - low].view(base).T
    return columns


class Log:
    """A log file, indexed; its columns are read when they are asked for. `Log.open` makes one."""

    def __init__(self, path: Path, buffer: Buffer, index: EventIndex) -> None:
        self.path = path
        self.index = index
        self._buffer = buffer
        self.channels: dict[str, LogMessages] = {}
        """every channel of a known type, duplicates left out, sorted by (run, session, seq)"""
        self.report = self._read()

    @classmethod
    def open(cls, path: str | Path) -> Log:
        """Indexes a log. Raises UnreadableError where there is no file or no LCM event in it."""
        path = Path(path)
        try:
            with path.open("rb") as file:
                size = file.seek(0, 2)
                buffer: Buffer = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if size else b""
        except OSError as error:
            raise UnreadableError(f"{path}: {error.strerror or error}") from error
        return cls.from_bytes(buffer, path)

    @classmethod
    def from_bytes(cls, buffer: Buffer, path: str | Path = "") -> Log:
        """The same from what a file holds. Raises UnreadableError where there is no LCM event in it."""
        index = index_events(buffer)
        if not len(index):
            raise UnreadableError(f"{path}: no LCM event in its {len(buffer)} bytes: no log, or one never written to")
        return cls(Path(path), buffer, index)

    # ---- runs ------------------------------------------------------------------------------------------------------

    @property
    def run_ids(self) -> list[int]:
        """the runs in it, in order of their first ROBOT_STATE"""
        return self.report.run_ids

    def run(self, run_id: int | None = None) -> Run:
        """The run of that id, else the one with the most states. Raises UnreadableError where there is none such."""
        if "ROBOT_STATE" not in self.channels:
            held = ", ".join(self.channels) or "no known channel"
            raise UnreadableError(f"{self.path}: no ROBOT_STATE in it, so no run; it holds {held}")
        states = self.channels["ROBOT_STATE"]
        ids = states.field("run_id")
        if run_id is None:
            run_id = max(self.run_ids, key=lambda candidate: int((ids == candidate).sum()))
        elif run_id not in self.run_ids:
            raise UnreadableError(f"{self.path}: no run {run_id}; it holds {', '.join(map(str, self.run_ids))}")
        own = states.take(ids == run_id)
        first, last = int(own.received.min()), int(own.received.max())
        chosen: dict[str, LogMessages] = {}
        for name, messages in self.channels.items():
            rows = messages.field("run_id") == run_id
            if name in OPERATOR_CHANNELS:
                foreign = ~np.isin(messages.field("run_id"), self.run_ids)
                rows |= foreign & (messages.received >= first) & (messages.received <= last)
            part = messages.take(rows)
            if not len(part) and messages.type.name == RUN_INFO_TYPE:
                part = self._heard_before(messages, last)
            if len(part):
                chosen[name] = part
        return Run(
            run_id=run_id,
            start=int(own.field("utime")[0]),
            channels=chosen,
            simulator=_run_info(chosen.get("RUN_INFO_SIMULATOR")),
            controller=_run_info(chosen.get("RUN_INFO_CONTROLLER")),
            name=self.path.name,
        )

    def _heard_before(self, messages: LogMessages, received: int) -> LogMessages:
        """The newest message of a sender that knows no run ids, as of a wall time [us]; none where there is none."""
        rows = np.flatnonzero(~np.isin(messages.field("run_id"), self.run_ids) & (messages.received <= received))
        return messages.take(rows[np.argsort(messages.received[rows], kind="stable")][-1:])

    def payload_bytes(self, offset: int, length: int) -> bytes:
        """What stands in the file at `offset`: an event's payload by `index.data_offset` and `index.data_length`."""
        return bytes(self._buffer[offset : offset + length])

    # ---- reading ---------------------------------------------------------------------------------------------------

    def _read(self) -> LogReport:
        index = self.index
        types = message_types()
        data_offset = index.data_offset
        reports: list[ChannelReport] = []
        self_tests = 0
        self.events_of: dict[str, npt.NDArray[np.int64]] = _events_by_channel(self._buffer, index)
        """channel → rows of `index`, in file order"""
        found: dict[str, LogMessages] = {}
        for name, rows in self.events_of.items():
            if name == SELF_TEST_CHANNEL:
                self_tests = len(rows)
                continue
            lengths = index.data_length[rows]
            report = ChannelReport(name, "", 0, int(lengths.sum()))
            reports.append(report)
            message_type = _type_of(name, self._buffer, data_offset[rows], lengths, types)
            if message_type is None:
                continue
            report.type_name = message_type.name
            right_type = _has_fingerprint(self._buffer, data_offset[rows], lengths, message_type.fingerprint)
            report.wrong_type = int((~right_type).sum())
            rows = rows[right_type]
            if message_type.dtype is not None:
                right_size = index.data_length[rows] == message_type.dtype.itemsize
                report.wrong_size = int((~right_size).sum())
                rows = rows[right_size]
            found[name] = LogMessages(
                name, message_type, self._buffer, data_offset[rows], index.data_length[rows], index.time[rows]
            )
        run_order = self._run_order(found.get("ROBOT_STATE"))
        for report in reports:
            if report.name in found:
                self._add_channel(report, found[report.name], run_order)
        numbers = np.diff(index.number)
        return LogReport(
            path=str(self.path),
            size=len(self._buffer),
            events=len(index),
            self_tests=self_tests,
            skipped=index.skipped,
            suspect=index.suspect,
            lost_numbers=int(np.maximum(numbers - 1, 0).sum()),
            channels=sorted(reports, key=_channel_order),
            run_ids=list(run_order),
        )

    def _run_order(self, states: LogMessages | None) -> list[int]:
        if states is None:
            return []
        values, first = np.unique(states.field("run_id"), return_index=True)
        return [int(run_id) for run_id in values[np.argsort(first)]]

    def _add_channel(self, report: ChannelReport, messages: LogMessages, run_order: list[int]) -> None:
        if messages.type.dtype is None:
            messages = messages.take(self._decodable(messages, report))
        keys = messages._decode(("run_id", "utime", "seq"))
        rank = np.full(len(messages), len(run_order), np.int64)
        for place, run_id in enumerate(run_order):
            rank[keys["run_id"] == run_id] = place
        if (np.diff(rank) < 0).any():
            order = np.argsort(rank, kind="stable")
            messages, rank = messages.take(order), rank[order]
        if report.name not in OPERATOR_CHANNELS:  # whose numbers are those of many hands: in the order of arrival
            seq = messages.field("seq")
            messages.session = _sessions(rank, seq)
            late = (np.diff(rank) == 0) & (np.diff(messages.session) == 0) & (np.diff(seq) < 0)
            report.out_of_order = int(late.sum())
            if report.out_of_order:
                messages = messages.take(np.lexsort((seq, messages.session, rank)))
        keys = messages._decode(("run_id", "utime", "seq"))
        again = np.flatnonzero(np.all([np.diff(values) == 0 for values in keys.values()], axis=0)) + 1
        if len(again):
            identical = np.array([messages.payload(row) == messages.payload(row - 1) for row in again.tolist()])
            report.duplicates = int(identical.sum())
            report.conflicting = int((~identical).sum())
            messages = messages.take(np.setdiff1d(np.arange(len(messages)), again[identical]))
        report.count = len(messages)
        if len(messages) > 1:
            utime, missing = messages.field("utime"), missing_after(messages)
            report.restarts = int(restarted(messages).sum())
            report.gaps = [Gap(int(utime[i]), int(missing[i])) for i in np.flatnonzero(missing).tolist()]
            same_run = np.diff(messages.field("run_id")) == 0
            span = float(np.diff(utime)[same_run].sum()) * 1e-6
            report.rate = float(same_run.sum()) / span if span > 0.0 else 0.0
        self.channels[report.name] = messages

    def _decodable(self, messages: LogMessages, report: ChannelReport) -> npt.NDArray[np.bool_]:
        """Which messages of a type with strings the generated decode can read."""
        good = np.ones(len(messages), bool)
        for row in range(len(messages)):
            try:
                messages.decoded(row)
            except Exception:  # the generated code raises whatever struct, bytes and str do on damaged bytes
                good[row] = False
        report.wrong_size = int((~good).sum())
        return good


def _events_by_channel(buffer: Buffer, index: EventIndex) -> dict[str, npt.NDArray[np.int64]]:
    """channel → which events are on it, in file order."""
    name_offset = index.data_offset - index.channel_length
    found: dict[bytes, list[npt.NDArray[np.int64]]] = {}
    for length in np.flatnonzero(np.bincount(index.channel_length)).tolist():
        rows = np.flatnonzero(index.channel_length == length)
        values = gather(buffer, name_offset[rows], (np.bytes_, length))
        while len(rows):
            name = bytes(values[0])
            same = values == values[0]
            found.setdefault(name, []).append(rows[same])
            rows, values = rows[~same], values[~same]
    merged = {
        name.decode("ascii", "replace"): np.sort(np.concatenate(parts), kind="stable") for name, parts in found.items()
    }
    return dict(sorted(merged.items(), key=lambda item: int(item[1][0])))


def _type_of(
    name: str, buffer: Buffer, offsets: Offsets, lengths: Integers, types: Mapping[bytes, MessageType]
) -> MessageType | None:
    """The channel's type of lcmtypes/, else the type of its first message where that is a known one."""
    expected = CHANNELS.get(name)
    if expected is not None:
        return next((found for found in types.values() if found.name == expected), None)
    for offset, length in zip(offsets[:1].tolist(), lengths[:1].tolist(), strict=True):
        return types.get(bytes(buffer[offset : offset + min(length, 8)]))
    return None


def _sessions(rank: Integers, seq: Integers) -> Integers:
    """How often the sender had been started again in its run before each message, in order of arrival; (n,).

    A sender counts from 1. What falls back by less, or not to 1, arrived late.
    """
    if not len(seq):
        return np.zeros(0, np.int64)
    step, new_run = np.diff(seq), np.diff(rank) != 0
    count = np.append(0, np.cumsum(~new_run & ((step < -MOST_LATE) | ((step < 0) & (seq[1:] == 1)))))
    first = np.append(0, np.flatnonzero(new_run) + 1)
    return np.asarray(count - np.repeat(count[first], np.diff(np.append(first, len(seq)))), np.int64)


def _has_fingerprint(buffer: Buffer, offsets: Offsets, lengths: Integers, fingerprint: bytes) -> npt.NDArray[np.bool_]:
    """Which payloads start with these 8 bytes."""
    result = np.zeros(len(offsets), bool)
    long_enough = np.flatnonzero(lengths >= 8)
    result[long_enough] = gather(buffer, offsets[long_enough], ">u8") == int.from_bytes(fingerprint, "big")
    return result


def _channel_order(report: ChannelReport) -> tuple[int, str]:
    known = list(CHANNELS)
    return (known.index(report.name) if report.name in known else len(known), report.name)


def _run_info(messages: LogMessages | None) -> RunInfo | None:
    if messages is None or not len(messages):
        return None
    message = messages.decoded(0)
    return RunInfo(**{name: getattr(message, name) for name in RunInfo.__dataclass_fields__})
