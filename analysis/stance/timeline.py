"""What happened in a run, in order of time: pushes, commands, faults, safety, misses, gaps, restarts, a fall."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import metrics, signals
from .plain import counted
from .series import Run, missing_after, restarted

MERGE = 0.1  # s, a fault that comes back sooner is still the same one


@dataclass(frozen=True)
class Event:
    at: float
    """s since the run's start"""
    kind: str
    """push, command, stop, fault, safety, missed, gap, restart, damped, fall, run"""
    text: str
    bad: bool = False


def timeline(run: Run) -> list[Event]:
    """Every event of the run, earliest first."""
    found = [Event(run.span[0], "run", "first state"), Event(run.span[1], "run", "last state")]
    for push in metrics.pushes(run):
        x, y, z = push.impulse_W
        found.append(
            Event(
                push.start,
                "push",
                f"{push.impulse:.2f} N s for {push.duration:.2f} s: ({x:+.2f}, {y:+.2f}, {z:+.2f}) N s in W",
            )
        )
    found += _commands(run) + _faults(run) + _missed(run) + _gaps(run) + _damped(run)
    changes = metrics.safety(run)
    found += [Event(change.at, "safety", f"mode {change.mode}", bad=change.mode != "run") for change in changes]
    fell = metrics.fall(run)
    if fell is not None:
        found.append(Event(fell, "fall", "the robot has fallen", bad=True))
    return sorted(found, key=lambda event: event.at)


def _commands(run: Run) -> list[Event]:
    found = []
    if "USER_COMMAND" in run:
        time = run.time("USER_COMMAND")
        names = ("behaviour", "velocity", "yaw_rate", "height_offset")
        columns = [run.field("USER_COMMAND", name) for name in names]
        before: tuple[object, ...] | None = None
        for row in range(len(time)):
            behaviour, velocity, yaw_rate, height = (column[row] for column in columns)
            wanted = (int(behaviour), *map(float, velocity), float(yaw_rate), float(height))
            if wanted == before:
                continue
            before = wanted
            known = 0 <= behaviour < len(signals.BEHAVIOURS)
            name = signals.BEHAVIOURS[behaviour] if known else f"behaviour {behaviour}"
            text = f"{name}, velocity ({velocity[0]:+.2f}, {velocity[1]:+.2f}) m/s, "
            text += f"yaw rate {yaw_rate:+.2f} rad/s, height {height:+.3f} m"
            found.append(Event(float(time[row]), "command", text, bad=not known))
    if "STOP" in run:
        found += [Event(float(at), "stop", "the operator's stop", bad=True) for at in run.time("STOP")]
    if "PUSH" in run:
        force, length = run.field("PUSH", "force_W"), run.field("PUSH", "duration")
        for row, at in enumerate(run.time("PUSH")):
            words = ", ".join(f"{value:+.1f}" for value in force[row])
            found.append(Event(float(at), "push", f"asked for: ({words}) N for {length[row]:.2f} s"))
    return found


def _faults(run: Run) -> list[Event]:
    if "CONTROLLER_TRACE" not in run:
        return []
    time = run.time("CONTROLLER_TRACE")
    bits = run.field("CONTROLLER_TRACE", "faults")
    found = []
    for place, name in enumerate(metrics.FAULTS):
        stood = (bits >> place) & 1 != 0
        merged: list[tuple[int, int]] = []
        for first, last in signals.intervals(stood):
            if merged and time[first] - time[merged[-1][1]] <= MERGE:
                merged[-1] = (merged[-1][0], last)
            else:
                merged.append((first, last))
        for first, last in merged:
            count = int(stood[first : last + 1].sum())
            length = f"for {time[last] - time[first]:.2f} s ({count} ticks)" if count > 1 else "once"
            text = f"{name.replace('_', ' ')}, {length}"
            found.append(Event(float(time[first]), "fault", text, bad=True))
    return found


def _missed(run: Run) -> list[Event]:
    ticks = metrics.ticks(run)
    misses = ticks.misses if ticks is not None else []
    return [Event(miss.at, "missed", f"{miss.ticks} missed: {miss.cause}", bad=True) for miss in misses]


def _gaps(run: Run) -> list[Event]:
    found = []
    for name, messages in run.channels.items():
        time, missing = run.time(name), missing_after(messages)
        for row in np.flatnonzero(missing).tolist():
            found.append(
                Event(float(time[row]), "gap", f"{name}: {counted(missing[row], 'message')} missing", bad=True)
            )
        for row in np.flatnonzero(restarted(messages)).tolist():
            found.append(Event(float(time[row]), "restart", f"{name}: its sender was started again", bad=True))
    return found


def _damped(run: Run) -> list[Event]:
    if "TRUTH" not in run:
        return []
    time = run.time("TRUTH")
    spans = signals.intervals(run.field("TRUTH", "drives_damped") != 0)
    return [
        Event(float(time[first]), "damped", f"the drives damp for {time[last] - time[first]:.2f} s", bad=first > 0)
        for first, last in spans
    ]
