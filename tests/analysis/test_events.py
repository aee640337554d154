"""The scan of the event-log format: whatever the bytes, no exception, and every whole event."""

from __future__ import annotations

from pathlib import Path

import lcm
import numpy as np
import pytest
import stance.events as events
from hypothesis import given, settings
from hypothesis import strategies as st
from stance.events import HEADER, SYNC_BYTES, gather, index_events
from synthetic import encode_event, encode_log

channels = st.text(alphabet="ABCDEF_012", min_size=1, max_size=12)
payloads = st.one_of(
    st.binary(max_size=80),
    st.binary(max_size=30).map(lambda data: data[:10] + SYNC_BYTES + data[10:]),  # holds the sync word
    st.binary(max_size=20).map(lambda data: encode_event(1_000_000, 5, "INNER", data)),  # holds a whole event
)
Written = list[tuple[int, str, bytes]]
event_lists = st.lists(st.tuples(st.integers(0, 2**60), channels, payloads), min_size=1, max_size=25)


def found_events(data: bytes) -> list[tuple[int, str, bytes]]:
    index = index_events(data)
    result = []
    columns = (index.data_offset, index.time, index.channel_length, index.data_length)
    for at, time, name, length in zip(*columns, strict=True):
        result.append((int(time), data[at - name : at].decode("ascii", "replace"), data[at : at + length]))
    return result


@pytest.fixture(params=["lanes", "one block"], autouse=True)
def block_size(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Small blocks and lanes, so that small logs take every path of the walk."""
    if request.param == "lanes":
        monkeypatch.setattr(events, "BLOCK", 400)
        monkeypatch.setattr(events, "LANE", 64)


def test_reads_what_lcm_wrote(tmp_path: Path) -> None:
    path = tmp_path / "log"
    writer = lcm.EventLog(str(path), "w", overwrite=True)
    written = [(1000 + i, f"CHANNEL_{i % 3}", bytes([i % 256]) * (i * 7 % 90)) for i in range(500)]
    for event in written:
        writer.write_event(*event)
    writer.close()
    assert found_events(path.read_bytes()) == written
    assert index_events(path.read_bytes()).skipped == []


@settings(max_examples=100, deadline=None)
@given(st.binary(min_size=HEADER.itemsize, max_size=100), st.data())
def test_gather_reads_what_stands_at_each_offset_up_to_the_last_byte(buffer: bytes, data: st.DataObject) -> None:
    dtype = data.draw(st.sampled_from([HEADER, np.dtype(">u8"), np.dtype("V7")]))
    last = len(buffer) - dtype.itemsize
    offsets = [*data.draw(st.lists(st.integers(0, last))), last]
    expected = [np.frombuffer(buffer, dtype, 1, offset)[0] for offset in offsets]
    assert gather(buffer, np.array(offsets), dtype).tolist() == [value.item() for value in expected]


def test_gather_of_no_offsets_reads_nothing() -> None:
    assert gather(b"", np.empty(0, np.int64), HEADER).shape == (0,)


def test_an_empty_file_has_no_events() -> None:
    assert len(index_events(b"")) == 0


@settings(max_examples=100, deadline=None)
@given(event_lists)
def test_finds_every_event_of_a_whole_log_even_where_payloads_hold_sync_words(written: Written) -> None:
    data = encode_log(written)
    assert found_events(data) == written
    assert index_events(data).skipped == []


@settings(max_examples=120, deadline=None)
@given(event_lists, st.data())
def test_a_torn_tail_costs_only_the_torn_event(written: Written, data: st.DataObject) -> None:
    whole = encode_log(written)
    cut = data.draw(st.integers(0, len(whole)))
    ends = np.cumsum([len(encode_event(i, *event)) for i, event in enumerate(written)])
    complete = int((ends <= cut).sum())
    index = index_events(whole[:cut])
    found = found_events(whole[:cut])
    assert found[:complete] == written[:complete]
    if not any(SYNC_BYTES in payload for _, _, payload in written[complete : complete + 1]):
        assert found == written[:complete]
        assert sum(part.length for part in index.skipped) == cut - (int(ends[complete - 1]) if complete else 0)


@settings(max_examples=120, deadline=None)
@given(event_lists, st.data())
def test_bytes_lost_in_the_middle_cost_only_the_events_they_touch(written: Written, data: st.DataObject) -> None:
    whole = encode_log(written)
    first = data.draw(st.integers(0, len(whole)))
    last = data.draw(st.integers(first, len(whole)))
    torn = whole[:first] + whole[last:]
    ends = np.cumsum([len(encode_event(i, *event)) for i, event in enumerate(written)])
    starts = np.concatenate([[0], ends[:-1]])
    spans = list(zip(written, starts, ends, strict=True))
    untouched = [event for event, start, end in spans if end <= first or start >= last]
    affected = [event for event, start, end in spans if end >= first and start < last]
    found = found_events(torn)
    if any(SYNC_BYTES[:1] in payload for _, _, payload in affected):
        return  # what is left of a payload may complete a torn header, and either reading is whole
    if found and found[-1] not in written:
        return  # the torn event claims, to the byte, all that follows it to the file's end
    remaining = iter(found)
    assert all(event in remaining for event in untouched)
    assert len(found) <= len(untouched) + 1  # two torn halves may join to something that reads as an event


@settings(max_examples=120, deadline=None)
@given(event_lists, st.data())
def test_overwritten_bytes_never_raise_and_every_byte_is_accounted_for(written: Written, data: st.DataObject) -> None:
    damaged = bytearray(encode_log(written))
    at = data.draw(st.integers(0, len(damaged) - 1))
    noise = data.draw(st.binary(min_size=1, max_size=60))
    damaged[at : at + len(noise)] = noise
    index = index_events(bytes(damaged))
    read = int((events.HEADER_SIZE + index.channel_length + index.data_length).sum())
    assert read + sum(part.length for part in index.skipped) == len(damaged)


@settings(max_examples=120, deadline=None)
@given(st.binary(max_size=300))
def test_any_bytes_at_all_never_raise(data: bytes) -> None:
    index_events(data)


def test_a_torn_event_that_swallows_the_next_one_exactly_is_found_out() -> None:
    swallowed = encode_event(1, 11, "B", b"whole")
    head = encode_event(0, 10, "A", b"x" * 100)[: -len(swallowed)]
    data = head + swallowed + encode_event(2, 12, "C", b"after")
    assert found_events(data) == [(11, "B", b"whole"), (12, "C", b"after")]
    assert [part.reason for part in index_events(data).skipped] == ["torn event"]


def test_an_event_before_damaged_bytes_is_kept_and_marked() -> None:
    data = encode_event(0, 10, "A", b"whole") + b"\x00" * 50 + encode_event(1, 12, "C", b"after")
    index = index_events(data)
    assert found_events(data) == [(10, "A", b"whole"), (12, "C", b"after")]
    assert index.suspect == [0]
    assert [(part.length, part.reason) for part in index.skipped] == [(50, "no event")]
