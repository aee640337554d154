"""Log → columns: the values that were encoded, in order, with a report of all that is not as it should be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from stance import metrics
from stance.errors import UnreadableError
from stance.log import Log
from stance.messages import message_type, message_types
from stance.series import Run, match
from stance.timeline import timeline
from synthetic import PERIOD, RUN_ID, START, WALL, Synthetic, encode_log, records


def state_events(seqs: list[int], run_id: int = RUN_ID) -> list[tuple[int, str, bytes]]:
    states = records("robot_state_t", len(seqs))
    states["seq"], states["utime"], states["run_id"] = seqs, 1000 * np.array(seqs), run_id
    return [(WALL + i, "ROBOT_STATE", state.tobytes()) for i, state in enumerate(states)]


def test_columns_equal_the_generated_decode(log_path: Path) -> None:
    log = Log.open(log_path)
    for channel, messages in log.channels.items():
        for row in (0, len(messages) // 2, len(messages) - 1):
            decoded = messages.decoded(row)
            for name in messages.names:
                if name != "tag":
                    assert np.array_equal(messages.field(name)[row], getattr(decoded, name)), (channel, name)


def test_every_fixed_size_type_round_trips_through_its_dtype() -> None:
    for found in message_types().values():
        if found.dtype is None:
            continue
        assert len(found.python_class.encode(_filled(found.python_class()))) == found.dtype.itemsize
    assert message_type("run_info_t").dtype is None


def _filled(message: object) -> object:
    message.tag = bytes(16)  # type: ignore[attr-defined]
    return message


def test_a_field_keeps_its_shape_and_a_frame_flattens_it(stand: Run) -> None:
    n = stand.count("FORCE_PLAN")
    assert stand.field("FORCE_PLAN", "force").shape == (n, 32, 4, 3)
    frame = stand.frame("FORCE_PLAN")
    assert np.array_equal(frame["force_3_1_2"], stand.field("FORCE_PLAN", "force")[:, 3, 1, 2])
    assert frame.columns[0] == "t"
    assert not any(column.startswith("tag") for column in frame.columns)
    assert stand.field("TRUTH", "p_WC").dtype == np.dtype("=f8")


def test_a_field_that_does_not_exist_is_a_key_error_with_the_known_names(stand: Run) -> None:
    with pytest.raises(KeyError, match="p_WC"):
        stand.field("TRUTH", "p_wc")


def test_a_clean_log_has_no_problems(log_path: Path) -> None:
    report = Log.open(log_path).report
    assert report.problems() == []
    assert report.self_tests == 1
    assert {channel.name: channel.count for channel in report.channels}["TRUTH"] == 401
    assert next(channel.rate for channel in report.channels if channel.name == "TRUTH") == pytest.approx(100.0)


def test_the_run_knows_what_ran(stand: Run) -> None:
    assert stand.run_id == RUN_ID
    assert stand.start == START
    assert stand.duration == pytest.approx(4.0)
    assert stand.simulator is not None and stand.simulator.program == "stance-sim"
    assert stand.controller is not None and "robot name=" in stand.controller.urdf
    told = {use.name: use.count for use in metrics.channels(stand)}
    assert (told["RUN_INFO_SIMULATOR"], told["RUN_INFO_CONTROLLER"]) == (5, 1)
    assert stand.frame("RUN_INFO_CONTROLLER")["t"].tolist() == [0.0]


def test_a_run_is_described_by_what_was_heard_of_the_controller_last_before_its_end() -> None:
    def info(at: int, version: str) -> tuple[int, str, bytes]:
        message = message_type("run_info_t").python_class()
        message.version, message.tag = version, bytes(16)
        return WALL + at, "RUN_INFO_CONTROLLER", message.encode()

    states = [
        (at + 10 * at_run, *rest)
        for at_run, run_id in enumerate((7, 8))
        for at, *rest in state_events([1, 2, 3], run_id)
    ]
    log = Log.from_bytes(
        encode_log(sorted([info(-9, "older"), info(-5, "old"), info(5, "new"), info(99, "late"), *states]))
    )
    first, second = log.run(7).controller, log.run(8).controller
    assert first is not None and second is not None
    assert (first.version, second.version) == ("old", "new")


def test_messages_are_sorted_by_seq_and_late_ones_are_counted() -> None:
    log = Log.from_bytes(encode_log([*state_events([1, 2, 4, 3, 5])]))
    assert log.channels["ROBOT_STATE"].field("seq").tolist() == [1, 2, 3, 4, 5]
    assert log.report.channels[0].out_of_order == 1


def test_duplicates_are_left_out_and_conflicting_ones_kept() -> None:
    other = records("robot_state_t", 1)
    other["seq"], other["utime"], other["run_id"], other["num_joints"] = 3, 3000, RUN_ID, 5
    log = Log.from_bytes(encode_log([*state_events([1, 2, 2, 2, 3]), (WALL, "ROBOT_STATE", other[0].tobytes())]))
    report = log.report.channels[0]
    assert (report.count, report.duplicates, report.conflicting) == (4, 2, 1)


def test_gaps_are_found_with_their_size() -> None:
    log = Log.from_bytes(encode_log(state_events([1, 2, 5, 6, 10])))
    assert [(gap.after_utime, gap.missing) for gap in log.report.channels[0].gaps] == [(2000, 2), (6000, 3)]
    assert log.report.problems() == ["ROBOT_STATE: 5 messages missing in 2 gaps"]
    log = Log.from_bytes(encode_log(state_events([1, 3])))
    assert log.report.problems() == ["ROBOT_STATE: 1 message missing in 1 gap"]


def test_a_sender_that_starts_again_is_no_gap() -> None:
    states = records("controller_trace_t", 4)
    states["seq"], states["utime"], states["run_id"] = [1, 2, 1, 2], [1000, 2000, 3000, 4000], RUN_ID
    traces = [(WALL, "CONTROLLER_TRACE", state.tobytes()) for state in states]
    log = Log.from_bytes(encode_log([*state_events([1]), *traces]))
    report = next(channel for channel in log.report.channels if channel.name == "CONTROLLER_TRACE")
    assert (report.restarts, report.missing) == (1, 0)


def test_a_stamp_that_goes_back_is_nothing_amiss() -> None:
    """A tick without a new state is stamped ahead of the state that then comes."""
    messages = Synthetic(duration=1.0, pushes=[], late_ticks={70: 25_000.0}).messages()
    for channel in ("FORCE_PLAN", "JOINT_COMMAND", "CONTROLLER_TRACE"):
        messages[channel]["utime"][[40, 41, 80]] += 2 * round(PERIOD * 1e6)
    messages["CONTROLLER_TRACE"]["fault_count"][40:, 0] = 2
    events = [(WALL + int(row["seq"]), channel, row.tobytes()) for channel, rows in messages.items() for row in rows]
    log = Log.from_bytes(encode_log(sorted(events)))
    run = log.run()
    assert log.report.problems() == []
    assert run.field("CONTROLLER_TRACE", "seq").tolist() == list(range(1, 102))
    assert metrics.faults(run)["state_stale"] == 2
    ticks = metrics.ticks(run)
    assert ticks is not None and [round(miss.at, 2) for miss in ticks.misses] == [0.70]
    assert not {"gap", "restart"} & {event.kind for event in timeline(run)}


def test_a_sender_that_starts_again_keeps_its_sessions_apart() -> None:
    log = Log.from_bytes(encode_log(state_events([1, 2, 3, 5, 4, 1, 3, 2, 4])))
    run = log.run()
    assert run.field("ROBOT_STATE", "seq").tolist() == [1, 2, 3, 4, 5, 1, 2, 3, 4]
    assert run.channels["ROBOT_STATE"].session.tolist() == [0] * 5 + [1] * 4
    report = log.report.channels[0]
    assert (report.restarts, report.missing, report.out_of_order) == (1, 0, 2)


def test_a_sender_whose_first_message_is_lost_has_started_again_all_the_same() -> None:
    log = Log.from_bytes(encode_log(state_events([*range(1, 301), *range(2, 12)])))
    assert (log.report.channels[0].restarts, log.report.channels[0].missing) == (1, 0)


def test_what_is_sent_by_hand_stays_as_it_came_and_lacks_nothing() -> None:
    commands = records("user_command_t", 4)
    commands["seq"], commands["utime"], commands["yaw_rate"] = [7, 2, 9, 1], [5, 4, 3, 2], [0.1, 0.2, 0.3, 0.4]
    sent = [(WALL + 1 + i, "USER_COMMAND", command.tobytes()) for i, command in enumerate(commands)]
    log = Log.from_bytes(encode_log(sorted([*state_events([1, 2, 3, 4, 5, 6]), *sent])))
    assert log.report.problems() == []
    assert log.run().field("USER_COMMAND", "yaw_rate").tolist() == [0.1, 0.2, 0.3, 0.4]


def test_runs_of_one_log_are_kept_apart() -> None:
    log = Log.from_bytes(encode_log([*state_events([1, 2, 3], 7), *state_events([1, 2, 3, 4], 5)]))
    assert log.run_ids == [7, 5]
    assert log.run().run_id == 5
    assert log.run(7).count("ROBOT_STATE") == 3
    assert log.report.problems() == []
    with pytest.raises(UnreadableError, match="no run 6"):
        log.run(6)


def test_unknown_channels_other_types_and_wrong_sizes_are_reported() -> None:
    state = state_events([1])[0][2]
    log = Log.from_bytes(
        encode_log(
            [
                *state_events([1, 2]),
                (WALL, "ROBOT_STATE", bytes(8) + state[8:]),
                (WALL, "ROBOT_STATE", state[:-1]),
                (WALL, "ROBOT_STATE", b"abc"),
                (WALL, "SOMETHING_ELSE", b"abcdefghij"),
                (WALL, "COPY_OF_STATE", state),
                (WALL, "EMPTY", b""),
            ]
        )
    )
    by_name = {channel.name: channel for channel in log.report.channels}
    state_report = by_name["ROBOT_STATE"]
    assert (state_report.count, state_report.wrong_type, state_report.wrong_size) == (2, 2, 1)
    assert by_name["SOMETHING_ELSE"].type_name == ""
    assert by_name["COPY_OF_STATE"].type_name == "robot_state_t"
    assert "SOMETHING_ELSE: unknown type, 10 bytes not read" in log.report.problems()


def test_a_channel_keeps_file_order_where_its_name_ends_in_a_nul_at_times() -> None:
    names = ["ROBOT_STATE", "ROBOT_STATE\0", "ROBOT_STATE", "ROBOT_STATE\0"]
    states = [(at, name, data) for (at, _, data), name in zip(state_events([1, 2, 3, 4]), names, strict=True)]
    log = Log.from_bytes(encode_log(states))
    assert log.events_of["ROBOT_STATE"].tolist() == [0, 1, 2, 3]
    assert log.report.problems() == []


def test_damaged_run_info_is_reported_and_the_rest_is_read() -> None:
    good = Synthetic().run_info("stance-sim", 0, 1)
    infos = [(WALL, "RUN_INFO_SIMULATOR", good[:100]), (WALL, "RUN_INFO_SIMULATOR", good)]
    log = Log.from_bytes(encode_log([*state_events([1]), *infos]))
    report = next(channel for channel in log.report.channels if channel.name == "RUN_INFO_SIMULATOR")
    assert (report.count, report.wrong_size) == (1, 1)
    info = log.run().simulator
    assert info is not None and info.seed == 1


def test_a_log_torn_at_its_end_reads_up_to_there(log_path: Path) -> None:
    data = log_path.read_bytes()[:-100]
    report = Log.from_bytes(data).report
    assert [part.reason for part in report.skipped] == ["torn tail"]
    assert report.skipped[0].offset + report.skipped[0].length == len(data)


@pytest.mark.parametrize("content", [b"", b"no log at all", bytes(5000)])
def test_what_is_no_log_is_one_clear_error(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "file"
    path.write_bytes(content)
    with pytest.raises(UnreadableError, match="no LCM event"):
        Log.open(path)
    with pytest.raises(UnreadableError, match="No such file"):
        Log.open(tmp_path / "absent")


def test_a_log_without_states_has_no_run() -> None:
    with pytest.raises(UnreadableError, match="no ROBOT_STATE"):
        Log.from_bytes(encode_log([(WALL, "TRUTH", records("truth_t", 1)[0].tobytes())])).run()


def test_times_of_every_channel_count_from_the_first_state(stand: Run) -> None:
    for channel in ("ROBOT_STATE", "TRUTH", "CONTROLLER_TRACE", "CONTROLLER_TIMING"):
        assert stand.time(channel)[[0, -1]] == pytest.approx([0.0, 4.0]), channel
    assert stand.time("USER_COMMAND") == pytest.approx([0.5], abs=0.011)  # by when it was received


def test_match_gives_the_first_row_of_each_key() -> None:
    assert match(np.array([3, 9, 1]), np.array([1, 3, 3, 7])).tolist() == [1, -1, 0]
    assert match(np.array([3]), np.array([], int)).tolist() == [-1]
