"""Stand-ins for stance-sim and stance-controller: the same messages over the same network, and no physics.

FAKE_SIM chooses how the simulator behaves: good (default), fall, fail, forever. FAKE_CONTROLLER: good, fail, mute, die
(soon after the first state).
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from pathlib import Path

import lcm
from synthetic import Synthetic


def simulator(options: argparse.Namespace, connection: lcm.LCM) -> int:
    manner = os.environ.get("FAKE_SIM", "good")
    if manner == "fail":
        print("stance-sim: no scenario of that name", file=sys.stderr)
        return 2
    duration = 600.0 if manner == "forever" else options.duration or 1.0
    run = Synthetic(
        duration=duration if duration < 100 else 30.0, pushes=[], fall_at=duration / 2 if manner == "fall" else None
    )
    events = [event for event in run.events() if event[1] not in ("LCM_SELF_TEST", "RUN_INFO_CONTROLLER")]
    begun = time.monotonic()
    for received, channel, payload in events:
        wait = (received - events[0][0]) * 1e-6 / 4.0 - (time.monotonic() - begun)
        if wait > 0.0:
            time.sleep(wait)
        connection.publish(channel, payload)
    while manner == "forever":
        time.sleep(0.1)
    return 1 if manner == "fall" else 0


def controller(options: argparse.Namespace, connection: lcm.LCM) -> int:
    manner = os.environ.get("FAKE_CONTROLLER", "good")
    if manner == "fail":
        print("stance-controller: biped.yaml: controller.force_qp.friction is missing", file=sys.stderr)
        return 2
    heard: list[bytes] = []
    connection.subscribe("ROBOT_STATE", lambda _, data: heard.append(data))
    while manner != "die" or not heard:
        if manner != "mute":
            connection.publish("RUN_INFO_CONTROLLER", Synthetic().run_info("stance-controller", 0, 1))
        connection.handle_timeout(100)
    time.sleep(0.5)
    print("stance-controller: out of memory", file=sys.stderr)
    return 3


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("program", choices=("stance-sim", "stance-controller"))
    for name in ("--robot", "--scenario", "--seed", "--solver", "--plant", "--lcm-url"):
        parser.add_argument(name)
    parser.add_argument("--duration", type=float)
    parser.add_argument("--lockstep", action="store_true")
    parser.add_argument("--realtime", action="store_true")
    options = parser.parse_args()
    connection = lcm.LCM(options.lcm_url)
    try:
        return (simulator if options.program == "stance-sim" else controller)(options, connection)
    except KeyboardInterrupt:
        return 0


def install(directory: Path) -> None:
    """Puts the stand-ins where STANCE_BIN_DIR is to point."""
    for name in ("stance-sim", "stance-controller"):
        script = directory / name
        script.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{Path(__file__).resolve()}" {name} "$@"\n')
        script.chmod(0o755)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a background child may inherit it ignored
    sys.exit(main())
