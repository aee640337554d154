"""Commanding by hand: what is sent, in what order, how it ends; and scripts that are wrong."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest
import yaml
from stance.command import CHANNEL, PERIOD, Command, encode, parse_script, publish
from stance.errors import StanceError
from stance.messages import message_type
from stance.programs import SOURCE_TREE

SCRIPT = """\
commands:
  - {time: 0.2, behaviour: walk, velocity: [0.5, -0.1], yaw_rate: 0.3, height_offset: -0.05}
  - {time: 0.4, behaviour: lie-down, velocity: [0, 0], yaw_rate: 0, height_offset: 0}
  - {time: 0.6, behaviour: silent}
"""


class Recorder:
    def __init__(self) -> None:
        self.published: list[Any] = []

    def publish(self, channel: str, data: bytes) -> None:
        assert channel == CHANNEL
        self.published.append(message_type("user_command_t").python_class.decode(data))

    @property
    def behaviours(self) -> list[int]:
        return [message.behaviour for message in self.published]


STAND, WALK, LIE_DOWN = 0, 1, 2


def test_a_command_is_sent_again_and_again_and_ends_with_standing() -> None:
    recorder = Recorder()
    assert publish([Command(0.0, "walk", (0.5, 0.1), 0.2, -0.03)], recorder, 3 * PERIOD) == 4
    assert recorder.behaviours == [WALK, WALK, WALK, STAND]
    assert [list(message.velocity) for message in recorder.published] == [[0.5, 0.1]] * 3 + [[0.0, 0.0]]
    assert [message.yaw_rate for message in recorder.published] == [0.2] * 3 + [0.0]
    assert [message.height_offset for message in recorder.published] == [-0.03] * 3 + [0.0]


def test_its_numbers_grow_and_go_on_growing_in_the_next_program() -> None:
    first, second = Recorder(), Recorder()
    for recorder in (first, second):
        publish([Command()], recorder, 2 * PERIOD)
    numbers = [message.seq for message in first.published + second.published]
    assert all(later > earlier for earlier, later in pairwise(numbers))
    assert {message.run_id for message in first.published} == {0}


def test_a_script_is_sent_at_its_times() -> None:
    recorder = Recorder()
    assert publish(parse_script(SCRIPT, "script"), recorder, 0.8) == 5
    assert recorder.behaviours == [WALK, WALK, LIE_DOWN, LIE_DOWN, LIE_DOWN]  # nothing before 0.2 s, nor from 0.6 s on
    assert list(recorder.published[0].velocity) == [0.5, -0.1]


def test_it_ends_with_standing_when_it_is_stopped_and_when_it_fails() -> None:
    recorder = Recorder()
    publish([Command(behaviour="walk")], recorder, None, lambda: len(recorder.published) == 2)
    assert recorder.behaviours == [WALK, WALK, STAND]

    def interrupted() -> bool:
        if len(recorder.published) == 5:
            raise KeyboardInterrupt
        return False

    with pytest.raises(KeyboardInterrupt):
        publish([Command(behaviour="walk")], recorder, None, interrupted)
    assert recorder.behaviours == [WALK, WALK, STAND, WALK, WALK, STAND]


def test_a_robot_that_was_told_to_lie_down_is_not_told_to_stand_at_the_end() -> None:
    recorder = Recorder()
    publish([Command(behaviour="walk"), Command(PERIOD, "lie-down")], recorder, 3 * PERIOD)
    assert recorder.behaviours == [WALK, LIE_DOWN, LIE_DOWN, LIE_DOWN]


@pytest.mark.parametrize("behaviour", ["stand", "walk", "lie-down", "track", "catch"])
def test_a_behaviour_is_the_messages_own(behaviour: str) -> None:
    message_class = message_type("user_command_t").python_class
    sent = message_class.decode(encode(Command(behaviour=behaviour)))
    assert sent.behaviour == getattr(message_class, behaviour.upper().replace("-", "_"))
    assert len(sent.encode()) == len(encode(Command()))


@pytest.mark.parametrize("scenario", ["stepping", "walk"])
def test_a_scenarios_list_is_a_script(scenario: str) -> None:
    loaded = yaml.safe_load((SOURCE_TREE / f"sim/scenarios/biped/{scenario}.yaml").read_text())
    commands = parse_script(yaml.safe_dump({"commands": loaded["commands"]}), scenario)
    assert [command.behaviour for command in commands] == [one["behaviour"] for one in loaded["commands"]]
    assert [list(command.velocity) for command in commands] == [one["velocity"] for one in loaded["commands"]]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("commands:", "command:", "script: unknown key command; known are commands"),
        ("time: 0.4", "time: 0.2", "script: commands must stand in the order of their times, one at a time"),
        ("time: 0.2", "time: -1", "commands[0]: time is -1, but must be in [0, inf]"),
        ("time: 0.2, ", "", "commands[0]: time is missing"),
        ("behaviour: walk", "behaviour: run", "behaviour is 'run', but must be one of stand, walk, lie-down"),
        ("behaviour: silent", "behaviour: silent, yaw_rate: 0", "commands[2]: unknown key yaw_rate"),
        ("[0.5, -0.1]", "[0.5]", "commands[0]: velocity is [0.5], but must have 2 numbers"),
        ("[0.5, -0.1]", "0.5", "commands[0]: velocity is 0.5, but must be a list"),
        ("yaw_rate: 0.3", "yaw_rate: .nan", "commands[0]: yaw_rate is nan, but must be a number"),
        ("yaw_rate: 0.3", "yawrate: 0.3", "commands[0]: unknown key yawrate"),
    ],
)
def test_what_is_wrong_with_a_script_is_told_in_one_line(old: str, new: str, message: str) -> None:
    with pytest.raises(StanceError) as caught:
        parse_script(SCRIPT.replace(old, new, 1), "script")
    assert message in str(caught.value)
