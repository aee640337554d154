"""What the closed-loop tests do inside a network of their own. Run as `python scenes.py SCENE OUT`; prints JSON."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lcm
from stance.network import LCM_URL
from stance.programs import find_lcm_tool, find_program
from stance.run import RunRequest, record
from stance_msgs import controller_trace_t, stop_t, truth_t, user_command_t

LOCKSTEP_DURATION = 9.0  # s: past the demo's first push
REAL_TIME_DURATION = 3.0  # s
RUN_ID = 1  # stance-rollout's own


def request(out: Path, realtime: bool, duration: float, scenario: str = "demo", robot: str = "biped") -> RunRequest:
    return RunRequest(
        out=out, robot=robot, scenario=scenario, realtime=realtime, duration=duration, seed=3, run_id=RUN_ID
    )


def lockstep(out: Path) -> dict[str, Any]:
    return {"fell": record(request(out, False, LOCKSTEP_DURATION)).fell}


def single_body(out: Path) -> dict[str, Any]:
    """The controller's own model as the plant."""
    return {"fell": record(request(out, False, LOCKSTEP_DURATION, "single_body")).fell}


def walk(out: Path) -> dict[str, Any]:
    return {"fell": record(request(out, False, LOCKSTEP_DURATION, "walk_noisy")).fell}


def arm(out: Path) -> dict[str, Any]:
    """The 3-joint arm plays the document's motion."""
    return {"fell": record(request(out, False, LOCKSTEP_DURATION, robot="arm3")).fell}


def arm_in_real_time(out: Path) -> dict[str, Any]:
    return {"fell": record(request(out, True, REAL_TIME_DURATION, robot="arm3")).fell}


def catcher(out: Path) -> dict[str, Any]:
    """Balls are thrown at the catcher."""
    return {"fell": record(request(out, False, LOCKSTEP_DURATION, robot="catcher")).fell}


def catcher_in_real_time(out: Path) -> dict[str, Any]:
    return {"fell": record(request(out, True, REAL_TIME_DURATION, robot="catcher")).fell}


def lockstep_with_false_truth(out: Path) -> dict[str, Any]:
    """Somebody else says TRUTH all the time, and nothing that it says is true."""
    done = threading.Event()
    sent = 0

    def lie() -> None:
        nonlocal sent
        network, lies = lcm.LCM(LCM_URL), random.Random(1)
        message = truth_t()
        while not done.is_set():
            message.seq = lies.randrange(1, 2000)
            message.p_WB = [lies.gauss(0, 5) for _ in range(3)]
            message.joint_position = [lies.gauss(0, 5) for _ in range(8)]
            network.publish("TRUTH", message.encode())
            sent += 1
            time.sleep(0.0005)

    liar = threading.Thread(target=lie)
    liar.start()
    try:
        result = lockstep(out)
    finally:
        done.set()
        liar.join()
    return {**result, "lies": sent}


class Recorder:
    """Writes all that is said into a log. Its queue has no limit: lcm-logger drops what waits behind 30 messages."""

    def __init__(self, log: Path) -> None:
        self._log = lcm.EventLog(str(log), "w")
        self._network = lcm.LCM(f"{LCM_URL}&recv_buf_size={4 << 20}")
        self._network.subscribe(".*", self._on_message).set_queue_capacity(0)
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def _on_message(self, channel: str, data: bytes) -> None:
        self._log.write_event(time.time_ns() // 1000, channel, data)

    def _listen(self) -> None:
        while self._network.handle_timeout(100) or not self._done.is_set():
            pass

    def stop(self) -> None:
        self._done.set()
        self._thread.join()
        self._log.close()


def two_runs(out: Path) -> dict[str, Any]:
    """One controller, two simulators one after the other; user commands that come again, and a stop."""
    out.mkdir(parents=True)
    recorder = Recorder(out / "run.lcmlog")
    controller = subprocess.Popen([str(find_program("stance-controller")), "--robot", "biped", "--lockstep"])
    time.sleep(1.0)
    listener = Listener()
    ticks = 0
    for run_id in (5, 6):
        words = ["--robot", "biped", "--scenario", "stand", "--lockstep", "--duration", "3", "--run-id", str(run_id)]
        simulator = subprocess.Popen([str(find_program("stance-sim")), *words], stderr=subprocess.DEVNULL)
        for height in (-0.02, -0.03, -0.03):
            listener.wait(lambda: bool(listener.trace and listener.trace.run_id == run_id), 20)  # noqa: B023
            command = user_command_t()
            command.seq, command.height_offset = 9, height - 0.01 * run_id
            listener.network.publish("USER_COMMAND", command.encode())
            listener.trace = None
        listener.wait(lambda: bool(listener.trace and listener.trace.run_id == run_id), 20)  # noqa: B023
        stop = stop_t()
        stop.seq = run_id
        listener.network.publish("STOP", stop.encode())
        listener.wait(lambda: bool(listener.trace and listener.trace.stop_seq == run_id), 20)  # noqa: B023
        simulator.wait(timeout=60)
        listener.wait(lambda: False, 0.2)
        ticks = listener.trace.seq if listener.trace else 0
    time.sleep(0.5)
    controller.send_signal(signal.SIGINT)
    controller.wait(timeout=10)
    recorder.stop()
    return {"ticks": ticks}


def real_time(out: Path) -> dict[str, Any]:
    return {"fell": record(request(out, True, REAL_TIME_DURATION)).fell}


class Listener:
    """Keeps the newest TRUTH and CONTROLLER_TRACE, and every change of what the test asks about."""

    def __init__(self) -> None:
        self.network = lcm.LCM(LCM_URL)
        self.truth: truth_t | None = None
        self.trace: controller_trace_t | None = None
        self.network.subscribe("TRUTH", self._on_truth)
        self.network.subscribe("CONTROLLER_TRACE", self._on_trace)

    def _on_truth(self, _: str, data: bytes) -> None:
        self.truth = truth_t.decode(data)

    def _on_trace(self, _: str, data: bytes) -> None:
        self.trace = controller_trace_t.decode(data)

    def wait(self, condition: Callable[[], bool], seconds: float) -> bool:
        """True once it holds; False after so many seconds of wall time."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.network.handle_timeout(20)
            if condition():
                return True
        return False


def kill_controller(out: Path) -> dict[str, Any]:
    """SIGKILL to the controller while the robot stands; another one takes over when the robot lies."""
    out.mkdir(parents=True)
    controller_command = [str(find_program("stance-controller")), "--robot", "biped"]
    listener = Listener()
    controller = subprocess.Popen(controller_command)
    time.sleep(1.0)
    with (out / "sim.txt").open("w") as said:
        words = ["--robot", "biped", "--scenario", "stand", "--duration", "6", "--run-id", "5"]
        simulator = subprocess.Popen([str(find_program("stance-sim")), *words], stderr=said)
    stood = listener.wait(
        lambda: listener.truth is not None and listener.truth.utime > 0 and listener.truth.seq > 100, 20
    )
    controller.send_signal(signal.SIGKILL)
    controller.wait()
    damped = listener.wait(lambda: bool(listener.truth and listener.truth.drives_damped), 5)
    damped_seq = listener.truth.seq if listener.truth else 0
    last_answered = listener.trace.state_seq if listener.trace else 0  # by now all that it said has been heard
    listener.wait(lambda: bool(listener.truth and listener.truth.seq > damped_seq + 150), 10)  # it falls
    listener.trace = None
    controller = subprocess.Popen(controller_command)
    accepted = listener.wait(lambda: bool(listener.truth and not listener.truth.drives_damped), 5)
    reported = listener.wait(
        lambda: bool(listener.trace and listener.trace.faults & (1 << listener.trace.ROBOT_FALLEN)), 5
    )
    damps = listener.wait(lambda: bool(listener.trace and listener.trace.safety >= listener.trace.DAMP), 5)
    simulator.wait(timeout=30)
    controller.send_signal(signal.SIGINT)
    controller.wait(timeout=10)
    return {
        "stood": stood,
        "damped": damped,
        "damped_after_s": (damped_seq - last_answered) * 0.01,
        "accepted": accepted,
        "reported_fallen": reported,
        "damps": damps,
        "said": (out / "sim.txt").read_text(),
    }


def kill_logger(out: Path) -> dict[str, Any]:
    """SIGKILL to the logger in the middle of a run."""
    out.mkdir(parents=True)
    log = out / "run.lcmlog"
    logger = subprocess.Popen([str(find_lcm_tool("lcm-logger")), "--quiet", f"--lcm-url={LCM_URL}", str(log)])
    controller = subprocess.Popen([str(find_program("stance-controller")), "--robot", "biped"])
    time.sleep(1.0)
    simulator = subprocess.Popen(
        [str(find_program("stance-sim")), "--robot", "biped", "--scenario", "stand", "--duration", "4"]
    )
    time.sleep(2.5)
    logger.send_signal(signal.SIGKILL)
    logger.wait()
    simulator.wait(timeout=30)
    controller.send_signal(signal.SIGINT)
    controller.wait(timeout=10)
    return {"log": str(log), "size": os.path.getsize(log)}


if __name__ == "__main__":
    scene = {
        "lockstep": lockstep,
        "single_body": single_body,
        "walk": walk,
        "arm": arm,
        "catcher": catcher,
        "catcher_in_real_time": catcher_in_real_time,
        "arm_in_real_time": arm_in_real_time,
        "lockstep_with_false_truth": lockstep_with_false_truth,
        "real_time": real_time,
        "two_runs": two_runs,
        "kill_controller": kill_controller,
        "kill_logger": kill_logger,
    }[sys.argv[1]]
    print(json.dumps(scene(Path(sys.argv[2]))))
