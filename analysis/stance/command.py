"""Commands a robot by hand, or by a script of timed commands: user_command_t over LCM, ten times a second.

A script is YAML, strict; its list is that of a scenario:

    commands:
      - {time: 0.0, behaviour: walk, velocity: [0.5, 0], yaw_rate: 0, height_offset: 0}    # s, -, m/s, rad/s, m
      - {time: 5.0, behaviour: walk, velocity: [0, 0], yaw_rate: 0.4, height_offset: 0}
      - {time: 9.0, behaviour: silent}    # nothing is sent from here on
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from . import strict
from .errors import StanceError
from .messages import message_type

PERIOD = 0.1  # s, well within the time after which a controller no longer believes a command
CHANNEL = "USER_COMMAND"
TAG_SIZE = 16  # bytes of the message's tag, which has no use here
LIE_DOWN = "lie-down"
BEHAVIOURS = ("stand", "walk", LIE_DOWN, "track", "catch", "track-smooth")
SILENT = "silent"  # of who commands, not of the robot


@dataclass(frozen=True)
class Command:
    """What the operator wants from `time` on."""

    time: float = 0.0
    """s, from the first message"""
    behaviour: str = "stand"
    """one of BEHAVIOURS, or SILENT: nothing is sent"""
    velocity: tuple[float, float] = (0.0, 0.0)
    """m/s, forward and left, in the heading frame"""
    yaw_rate: float = 0.0
    """rad/s"""
    height_offset: float = 0.0
    """m, of the centre of mass over its nominal height"""


def parse_script(text: str, name: str) -> list[Command]:
    """Reads a script; `name` stands in messages. Raises StanceError naming the entry and the key."""
    document = strict.mapping(strict.parse(text, name), name, ("commands",))
    entries = strict.sequence(document["commands"], f"{name}: commands")
    commands = [_command(entry, f"{name}: commands[{i}]") for i, entry in enumerate(entries)]
    for earlier, later in pairwise(commands):
        if later.time <= earlier.time:
            raise StanceError(f"{name}: commands must stand in the order of their times, one at a time")
    return commands


def load_script(path: Path) -> list[Command]:
    """Reads a script from a file. Raises StanceError."""
    return parse_script(strict.read(path), path.name)


def _command(entry: Any, where: str) -> Command:
    if isinstance(entry, dict) and entry.get("behaviour") == SILENT:
        strict.mapping(entry, where, ("time", "behaviour"))
        return Command(strict.number(entry["time"], f"{where}: time", 0.0), SILENT)
    strict.mapping(entry, where, ("time", "behaviour", "velocity", "yaw_rate", "height_offset"))
    if entry["behaviour"] not in BEHAVIOURS:
        known = ", ".join((*BEHAVIOURS, SILENT))
        raise StanceError(f"{where}: behaviour is {entry['behaviour']!r}, but must be one of {known}")
    velocity = strict.sequence(entry["velocity"], f"{where}: velocity")
    if len(velocity) != 2:
        raise StanceError(f"{where}: velocity is {velocity!r}, but must have 2 numbers")
    forward, left = (strict.number(part, f"{where}: velocity") for part in velocity)
    return Command(
        time=strict.number(entry["time"], f"{where}: time", 0.0),
        behaviour=entry["behaviour"],
        velocity=(forward, left),
        yaw_rate=strict.number(entry["yaw_rate"], f"{where}: yaw_rate"),
        height_offset=strict.number(entry["height_offset"], f"{where}: height_offset"),
    )


def publish(
    commands: Sequence[Command],
    connection: Any,
    duration: float | None = None,
    stopped: Callable[[], bool] = lambda: False,
) -> int:
    """Sends the command in force every PERIOD, until `duration` [s] has passed or it is `stopped`; then stands.

    `commands` in order of time; `connection` is an LCM. Each message leaves at an absolute deadline. Returns how many
    were sent. However it ends, the last one is to stand; to lie down, where that was wanted.
    """
    sent = periods = 0
    last = Command()
    begun = time.monotonic()
    try:
        while not stopped() and (duration is None or periods * PERIOD < duration - PERIOD / 2):
            due = [command for command in commands if command.time <= periods * PERIOD + PERIOD / 2]
            if due and due[-1].behaviour != SILENT:
                connection.publish(CHANNEL, encode(due[-1]))
                sent += 1
                last = due[-1] if due[-1].behaviour == LIE_DOWN else Command()
            periods += 1
            time.sleep(max(0.0, begun + periods * PERIOD - time.monotonic()))
    finally:
        connection.publish(CHANNEL, encode(last))
    return sent + 1


def encode(command: Command) -> bytes:
    """The user_command_t of this instant, of no run in particular."""
    message = message_type("user_command_t").python_class()
    message.utime = round(time.time() * 1e6)
    message.seq = message.utime  # grows from one sender to the next, too: a controller takes no number twice
    message.behaviour = getattr(message, command.behaviour.replace("-", "_").upper())
    message.velocity = list(command.velocity)
    message.yaw_rate = command.yaw_rate
    message.height_offset = command.height_offset
    message.tag = bytes(TAG_SIZE)
    return bytes(message.encode())
