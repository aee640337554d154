"""Playing a log again: what, in what order, when."""

from __future__ import annotations

from pathlib import Path

import pytest
from stance.errors import StanceError, UnreadableError
from stance.log import Log
from stance.replay import replay, select, verify
from synthetic import WALL, Synthetic, encode_log


class Recorder:
    def __init__(self) -> None:
        self.published: list[tuple[str, bytes]] = []

    def publish(self, channel: str, data: bytes) -> None:
        self.published.append((channel, data))


def test_every_message_is_published_again_byte_for_byte_in_order(log_path: Path) -> None:
    log, recorder = Log.open(log_path), Recorder()
    done = replay(log, select(log), speed=0, connection=recorder)
    written = [(channel, payload) for _, channel, payload in Synthetic().events() if channel != "LCM_SELF_TEST"]
    assert recorder.published == written
    assert done.messages == len(written)
    assert done.channels["TRUTH"] == 401


def test_duplicates_and_unknown_channels_are_played_too() -> None:
    events = [(WALL, "A", b"x"), (WALL + 1, "A", b"x"), (WALL + 2, "LCM_SELF_TEST", b"t"), (WALL + 3, "B", b"")]
    log, recorder = Log.from_bytes(encode_log(events)), Recorder()
    replay(log, select(log), speed=0, connection=recorder)
    assert recorder.published == [("A", b"x"), ("A", b"x"), ("B", b"")]


def test_what_the_logger_wrote_late_is_played_by_its_time() -> None:
    log, recorder = Log.from_bytes(encode_log([(WALL + 5, "A", b"2"), (WALL, "B", b"1")])), Recorder()
    replay(log, select(log), speed=0, connection=recorder)
    assert [data for _, data in recorder.published] == [b"1", b"2"]


def test_channels_and_times_are_chosen(log_path: Path) -> None:
    log = Log.open(log_path)
    names = {name for name in log.events_of if set(log.events_of[name]) & set(select(log, ["CONTROLLER_*"]).tolist())}
    assert names == {"CONTROLLER_TRACE", "CONTROLLER_TIMING"}
    assert len(select(log, ["TRUTH"], 1.0, 2.0)) == 100  # the log's first event is a little before the first state
    with pytest.raises(StanceError, match="no channel TRUHT"):
        select(log, ["TRUHT"])


@pytest.mark.parametrize(("speed", "wall"), [(1.0, 0.30), (3.0, 0.10)])
def test_it_keeps_the_logs_pace_times_the_speed(speed: float, wall: float) -> None:
    log = Log.from_bytes(encode_log([(WALL + 100_000 * i, "A", b"") for i in range(4)]))
    done = replay(log, select(log), speed=speed, connection=Recorder())
    assert done.duration == pytest.approx(0.3)
    assert wall <= done.wall < wall + 0.25


def test_progress_ends_at_the_end() -> None:
    log = Log.from_bytes(encode_log([(WALL, "A", b""), (WALL + 2_000_000, "A", b"")]))
    told: list[tuple[float, float]] = []
    replay(log, select(log), speed=0, connection=Recorder(), progress=lambda at, end: told.append((at, end)))
    assert told[-1] == (2.0, 2.0)


def test_a_log_of_self_tests_has_nothing_to_play() -> None:
    with pytest.raises(UnreadableError, match="nothing to play"):
        select(Log.from_bytes(encode_log([(WALL, "LCM_SELF_TEST", b"")])))


@pytest.mark.parametrize("code", [0, 1])
def test_verifying_gives_the_programs_own_verdict(
    code: int, tmp_path: Path, log_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "stance-replay"
    program.write_text(f'#!/bin/sh\necho "compared $1"\nexit {code}\n')
    program.chmod(0o755)
    monkeypatch.setenv("STANCE_BIN_DIR", str(tmp_path))
    done = verify(log_path, capture=True)
    assert (done.returncode, done.stdout) == (code, f"compared {log_path}\n")
