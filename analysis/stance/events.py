"""The LCM event-log format: where each event stands in a file.

An event is, big-endian and without padding:

    sync word u32 = 0xEDA1DA01 | event number i64 | receive time i64 [us, wall clock]
    | channel length i32 | data length i32 | channel (no terminator) | data

Events follow one another without an index, so reading is a walk from header to header. `index_events` walks many
places of the file at once with numpy, joins the walks, and takes a step-by-step walk wherever they do not join: torn
events, damaged bytes, or payloads that hold the sync word. The result is always that of the step-by-step walk.
"""

from __future__ import annotations

import mmap
import struct
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

SYNC = 0xEDA1DA01
SYNC_BYTES = SYNC.to_bytes(4, "big")
HEADER = np.dtype(
    [("sync", ">u4"), ("number", ">i8"), ("time", ">i8"), ("channel_length", ">i4"), ("data_length", ">i4")]
)
HEADER_SIZE = HEADER.itemsize
MAX_CHANNEL_LENGTH = 63  # LCM's own bound
BLOCK = 32 << 20  # bytes that are walked together
LANE = 32 << 10  # bytes of a block that one lane walks

_HEADER_STRUCT = struct.Struct(">Iqqii")

Buffer = bytes | mmap.mmap
Offsets = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Skipped:
    """Bytes of a log that belong to no whole event."""

    offset: int
    """byte offset in the file"""
    length: int
    """bytes"""
    reason: str


@dataclass
class EventIndex:
    """Every whole event of a log in file order; arrays have one entry an event."""

    offset: Offsets
    """byte offset of the header"""
    number: npt.NDArray[np.int64]
    """the writer's own count of events"""
    time: npt.NDArray[np.int64]
    """us, wall clock, when the writer received it"""
    channel_length: npt.NDArray[np.int64]
    data_length: npt.NDArray[np.int64]
    skipped: list[Skipped] = field(default_factory=list)
    suspect: list[int] = field(default_factory=list)
    """offsets of events that damaged bytes follow: their payload may be damaged too"""

    def __len__(self) -> int:
        return len(self.offset)

    @property
    def data_offset(self) -> Offsets:
        """byte offset of each payload"""
        return self.offset + HEADER_SIZE + self.channel_length


def gather(buffer: Buffer, offsets: Offsets, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Copies the records of `dtype` that start at `offsets`."""
    dtype = np.dtype(dtype)
    if not len(offsets):
        return np.empty(0, dtype)
    raw = np.dtype((np.void, dtype.itemsize))  # taken whole: field by field costs five times as much
    return np.ndarray((len(buffer) - dtype.itemsize + 1,), raw, buffer, 0, (1,))[offsets].view(dtype)


def index_events(buffer: Buffer) -> EventIndex:
    """Finds every whole event of a log. Never raises, whatever the bytes are."""
    walker = _Walker(buffer)
    parts: list[Offsets] = []
    header_parts: list[npt.NDArray[np.void]] = []
    position = 0
    while position < walker.size:
        stop = min(position + BLOCK, walker.size)
        fast = walker.walk_lanes(position, stop)
        offsets, position = fast if fast is not None else walker.walk_steps(position, stop)
        parts.append(offsets)
        header_parts.append(gather(buffer, offsets, HEADER))
    offset = np.concatenate(parts) if parts else np.empty(0, np.int64)
    headers = np.concatenate(header_parts) if parts else np.empty(0, HEADER)
    freed = walker.split_swallowed(offset, headers["number"].astype(np.int64))
    if freed is not None:
        offset, headers = freed, gather(buffer, freed, HEADER)
    return EventIndex(
        offset=offset,
        number=headers["number"].astype(np.int64),
        time=headers["time"].astype(np.int64),
        channel_length=headers["channel_length"].astype(np.int64),
        data_length=headers["data_length"].astype(np.int64),
        skipped=sorted(walker.skipped, key=lambda skipped: skipped.offset),
        suspect=sorted(set(walker.suspect).intersection(offset.tolist())) if walker.suspect else [],
    )


class _Walker:
    def __init__(self, buffer: Buffer) -> None:
        self.buffer = buffer
        self.size = len(buffer)
        self.skipped: list[Skipped] = []
        self.suspect: list[int] = []

    # ---- many places at once ---------------------------------------------------------------------------------------

    def walk_lanes(self, start: int, stop: int) -> tuple[Offsets, int] | None:
        """Walks [start, stop) from an event at `start` in parallel lanes.

        Returns the headers' offsets and where the next event starts, or None where anything is out of the ordinary.
        """
        if not self._has_sync(start):
            return None
        first = [start]
        for boundary in range(start + LANE, stop, LANE):
            found = self.buffer.find(SYNC_BYTES, boundary, stop)
            if found < 0:
                break
            if found > first[-1]:
                first.append(found)
        position = np.array(first, np.int64)
        limit = np.append(position[1:], stop)
        lane = np.arange(len(first))
        last_lane = len(first) - 1
        visited: list[Offsets] = []  # a row a step, an entry a lane, -1 where the lane has ended
        end = start
        while len(position):
            if position.max() > self.size - HEADER_SIZE:
                return None
            header = gather(self.buffer, position, HEADER)
            channel_length = header["channel_length"].astype(np.int64)
            data_length = header["data_length"].astype(np.int64)
            following = position + HEADER_SIZE + channel_length + data_length
            plausible = (
                (header["sync"] == SYNC)
                & (channel_length >= 1)
                & (channel_length <= MAX_CHANNEL_LENGTH)
                & (data_length >= 0)
                & (following <= self.size)
            )
            if not plausible.all():
                return None
            visited.append(np.full(last_lane + 1, -1, np.int64))
            visited[-1][lane] = position
            walking = following < limit
            if ((following > limit) & (lane != last_lane)).any():
                return None
            if lane[-1] == last_lane and not walking[-1]:
                end = int(following[-1])
            position, limit, lane = following[walking], limit[walking], lane[walking]
        if end != self.size and not self._has_sync(end):
            return None
        by_lane = np.array(visited).T
        return by_lane[by_lane >= 0], end

    # ---- step by step ----------------------------------------------------------------------------------------------

    def walk_steps(self, start: int, stop: int) -> tuple[Offsets, int]:
        """The same walk, event by event, past whatever is damaged. What it skips goes to `skipped`."""
        offsets: list[int] = []
        position = start
        number: int | None = None
        while position < stop:
            header = self._header(position)
            if header is None:
                following = self._next_event(position + 1, self.size, number)
                is_tail = following == self.size and self._starts_like_sync(position)
                self._skip(position, following, "torn tail" if is_tail else "no event")
                position = following
                continue
            number, end = header
            if end <= self.size and self._starts_like_sync(end):
                offsets.append(position)
                position = end
                continue
            inside = self._next_event(position + 4, min(end, self.size), number)
            if inside < min(end, self.size):
                self._skip(position, inside, "torn event")
                position = inside
            elif end <= self.size:
                offsets.append(position)
                self.suspect.append(position)
                position = end
            else:
                self._skip(position, self.size, "torn tail")
                position = self.size
        return np.array(offsets, np.int64), position

    def split_swallowed(self, offset: Offsets, number: npt.NDArray[np.int64]) -> Offsets | None:
        """Frees the whole events that a torn event's claimed length covers exactly: the event numbers give them away.

        Returns the corrected offsets, or None where there is nothing to correct.
        """
        jumps = np.flatnonzero(number[1:] != number[:-1] + 1)
        torn: list[int] = []
        freed: list[int] = []
        for i in jumps.tolist():
            start = int(offset[i])
            end = self._header(start)[1]  # type: ignore[index]
            inside = self._next_event(start + 4, end, int(number[i]), numbered=True)
            if inside >= end:
                continue
            before = len(self.skipped), len(self.suspect)
            steps, last = self.walk_steps(inside, end)
            if last == end:
                self._skip(start, inside, "torn event")
                torn.append(i)
                freed.extend(steps.tolist())
            else:
                del self.skipped[before[0] :], self.suspect[before[1] :]
        return np.sort(np.append(np.delete(offset, torn), np.array(freed, np.int64))) if torn else None

    # ---- what stands at one place ----------------------------------------------------------------------------------

    def _has_sync(self, position: int) -> bool:
        return self.buffer[position : position + 4] == SYNC_BYTES

    def _starts_like_sync(self, position: int) -> bool:
        """True at the file's end, at a sync word, and at one that the file's end cuts short."""
        found = self.buffer[position : position + 4]
        return found == SYNC_BYTES[: len(found)] and (len(found) == 4 or position + len(found) == self.size)

    def _header(self, position: int) -> tuple[int, int] | None:
        """(event number, offset of the event's end) of a plausible header, else None. The end may be past it all."""
        if position + HEADER_SIZE > self.size:
            return None
        sync, number, _, channel_length, data_length = _HEADER_STRUCT.unpack_from(self.buffer, position)
        if sync != SYNC or not 1 <= channel_length <= MAX_CHANNEL_LENGTH or data_length < 0:
            return None
        return number, position + HEADER_SIZE + channel_length + data_length

    def _has_printable_channel(self, position: int) -> bool:
        start = position + HEADER_SIZE
        length = int.from_bytes(self.buffer[start - 8 : start - 4], "big")
        return all(32 <= letter < 127 for letter in self.buffer[start : start + length])

    def _next_event(self, start: int, stop: int, number: int | None, numbered: bool = False) -> int:
        """Offset of the first credible event in [start, stop), else `stop`.

        Credible is a plausible, whole event that another event or the file's end follows, or whose number follows
        `number`. With `numbered`, both are asked.
        """
        position = self.buffer.find(SYNC_BYTES, start, stop + 3)  # a sync word may start just before `stop`
        while position >= 0:
            header = self._header(position)
            if header is not None and header[1] <= self.size:
                chained = self._starts_like_sync(header[1])
                follows = number is not None and header[0] == number + 1
                credible = (chained and follows) if numbered else (chained or follows)
                if credible and self._has_printable_channel(position):
                    return position
            position = self.buffer.find(SYNC_BYTES, position + 1, stop + 3)
        return stop

    def _skip(self, start: int, stop: int, reason: str) -> None:
        self.skipped.append(Skipped(start, stop - start, reason))
