"""One recorded run: lcm-logger, stance-controller and stance-sim as three processes, from start to a closed log."""

from __future__ import annotations

import contextlib
import shutil
import signal
import struct
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any

from .configuration import option
from .errors import RunError
from .messages import SELF_TEST_CHANNEL, message_type
from .network import LCM_URL, announced, connect
from .programs import find_lcm_tool, find_program, mortal

READY_TIMEOUT = 15.0  # s, for a program to show that it is there
SILENCE_TIMEOUT = 20.0  # s without a ROBOT_STATE, after which a run is given up
STOP_TIMEOUT = 5.0  # s from SIGINT to SIGKILL
DRAIN_TIME = 0.3  # s for the last messages to reach the logger
RECEIVE_BUFFER = 32 << 20  # bytes
FELL = 1  # stance-sim's exit code for a robot that fell
TAIL_LINES = 12

LOG_NAME = "run.lcmlog"

Progress = Callable[[float, float | None], None]
"""called with the simulated time and the duration, both in s; the duration is None until it is known"""


@dataclass(frozen=True)
class RunRequest:
    """What to run. Names and options are those of the programs."""

    out: Path
    """the directory that takes the log and what the programs said; made where missing"""
    robot: str = "biped"
    scenario: str = "stand"
    realtime: bool = True
    duration: float | None = None
    """s, in place of the scenario's"""
    seed: int | None = None
    solver: str | None = None
    plant: str | None = None
    run_id: int | None = None
    """stands in every message; the simulator chooses where it is None"""
    url: str = LCM_URL

    @property
    def clock(self) -> str:
        return "--realtime" if self.realtime else "--lockstep"

    def controller_arguments(self) -> list[str]:
        return ["--robot", self.robot, self.clock, *_option("--solver", self.solver), "--lcm-url", self.url]

    def simulator_arguments(self) -> list[str]:
        chosen = (
            ("--duration", self.duration),
            ("--seed", self.seed),
            ("--plant", self.plant),
            ("--run-id", self.run_id),
        )
        options = [part for name, value in chosen for part in _option(name, value)]
        return ["--robot", self.robot, "--scenario", self.scenario, self.clock, *options, "--lcm-url", self.url]


@dataclass(frozen=True)
class RunOutcome:
    """How a run ended."""

    log: Path
    fell: bool
    interrupted: bool
    simulated: float
    """s, that were heard of over LCM"""
    notes: list[str] = field(default_factory=list)
    """what the programs said on stderr, a line each"""


def record(request: RunRequest, progress: Progress | None = None) -> RunOutcome:
    """Runs it and returns when every process has ended and the log is closed.

    Ctrl-C and SIGTERM end the run early, with a readable log. Raises MissingError where a program is absent, and
    RunError where there is a log already, or with what a program said last where one fails; of a run that fails before
    its first state no file stays. LCM's network must be usable (`stance.network.ensure`).
    """

    programs = {name: find_program(name) for name in ("stance-controller", "stance-sim")}
    logger_program = find_lcm_tool("lcm-logger")
    log = request.out / LOG_NAME
    if log.exists():
        raise RunError(f"{log} is there already: choose another --out, or remove it")
    request.out.mkdir(parents=True, exist_ok=True)
    listener = _Listener(connect(request.url))
    with (
        _nothing_left_unless(lambda: "ROBOT_STATE" in listener.heard, request.out),
        announced("stance run", request.url),
        Interruption() as interruption,
        _Children(request.out) as children,
    ):
        logger_options = ["--quiet", f"--lcm-url={_patient(request.url)}", str(log)]
        logger = children.start("lcm-logger", [*_hurried(), str(logger_program), *logger_options])
        listener.wait(lambda: _is_logging(listener, log), logger, interruption, "it records nothing")
        controller = children.start(
            "stance-controller", [str(programs["stance-controller"]), *request.controller_arguments()]
        )
        listener.wait(
            lambda: "RUN_INFO_CONTROLLER" in listener.heard, controller, interruption, "it sent no RUN_INFO_CONTROLLER"
        )
        exit_code: int | None = None
        if not interruption.requested:
            simulator = children.start("stance-sim", [str(programs["stance-sim"]), *request.simulator_arguments()])
            exit_code = _follow(listener, simulator, (controller, logger), interruption, progress)
            simulator.stop()
        time.sleep(DRAIN_TIME)
        controller.stop()
        logger.stop()
        notes = [line for child in children.started if child is not logger for line in child.said()]
    return RunOutcome(
        log=log,
        fell=exit_code == FELL,
        interrupted=exit_code is None,
        simulated=listener.simulated,
        notes=notes,
    )


@contextlib.contextmanager
def _nothing_left_unless(begun: Callable[[], bool], directory: Path) -> Iterator[None]:
    """Where a run fails that has not `begun`, its files go, and the directory too where it holds no others."""
    before = set(directory.iterdir())
    try:
        yield
    except RunError:
        if not begun():
            for path in set(directory.iterdir()) - before:
                path.unlink()
            if not before:
                directory.rmdir()
        raise


def _patient(url: str) -> str:
    """The URL with as large a receive buffer as the kernel allows: the logger may be kept waiting for the processor."""
    try:
        allowed = int(Path("/proc/sys/net/core/rmem_max").read_text())
    except (OSError, ValueError):
        return url
    if not url.startswith("udpm:") or "recv_buf_size" in url:
        return url
    return f"{url}{'&' if '?' in url else '?'}recv_buf_size={min(allowed, RECEIVE_BUFFER)}"


def _hurried() -> list[str]:
    """What makes a command come before ordinary ones and after controller and simulator, where that is allowed.

    lcm-logger drops messages once 30 wait to be handled, and in lockstep they come every few tens of microseconds.
    """
    command = ["chrt", "--fifo", "1"]
    if shutil.which("chrt") is None or subprocess.run([*command, "true"], capture_output=True).returncode != 0:
        return []
    return command


def _option(name: str, value: object) -> list[str]:
    return [] if value is None else [name, str(value)]


def _is_logging(listener: _Listener, log: Path) -> bool:
    """Sends what every reader of logs skips, until the logger has written something."""
    listener.lcm.publish(SELF_TEST_CHANNEL, b"stance")
    return log.exists() and log.stat().st_size > 0


def _follow(
    listener: _Listener,
    simulator: _Child,
    others: tuple[_Child, ...],
    interruption: Interruption,
    progress: Progress | None,
) -> int | None:
    """Waits for the simulator's end: its exit code, or None where the run was interrupted. Raises RunError."""
    last_heard = time.monotonic()
    while simulator.process.poll() is None:
        if interruption.requested:
            return None
        for child in others:
            if child.process.poll() is not None:
                raise child.failure("ended during the run")
        before = listener.simulated
        listener.listen(0.1)
        if listener.simulated != before:
            last_heard = time.monotonic()
            if progress is not None:
                progress(listener.simulated, listener.duration)
        elif time.monotonic() - last_heard > SILENCE_TIMEOUT:
            raise simulator.failure(f"sent no ROBOT_STATE for {SILENCE_TIMEOUT:g} s")
    listener.listen(0.0)
    if progress is not None:
        progress(listener.simulated, listener.duration)
    exit_code = simulator.process.returncode
    if interruption.requested:
        return None
    if exit_code not in (0, FELL):
        raise simulator.failure("failed")
    return int(exit_code)


class _Listener:
    """What is heard over LCM while a run goes on: only the newest of each channel, so that it costs next to nothing."""

    def __init__(self, connection: Any) -> None:
        self.lcm = connection
        self.heard: set[str] = set()
        self.simulated = 0.0
        """s since the first ROBOT_STATE heard"""
        self.duration: float | None = None
        self._first: int | None = None
        for channel in ("ROBOT_STATE", "RUN_INFO_CONTROLLER", "RUN_INFO_SIMULATOR"):
            self.lcm.subscribe(channel, self._on_message).set_queue_capacity(1)

    def listen(self, seconds: float) -> None:
        """Handles what has come, then sleeps for the time given."""
        for _ in range(100):
            if not self.lcm.handle_timeout(0):
                break
        time.sleep(seconds)

    def wait(self, ready: Callable[[], bool], child: _Child, interruption: Interruption, otherwise: str) -> None:
        """Returns when `ready`, or when interrupted. Raises RunError where the child ends or is not heard of."""
        deadline = time.monotonic() + READY_TIMEOUT
        while not ready():
            if interruption.requested:
                return
            if child.process.poll() is not None:
                raise child.failure("failed at its start")
            if time.monotonic() > deadline:
                raise child.failure(f"is not ready after {READY_TIMEOUT:g} s: {otherwise}")
            self.listen(0.05)

    def _on_message(self, channel: str, data: bytes) -> None:
        self.heard.add(channel)
        if channel == "ROBOT_STATE" and len(data) >= 16:
            utime = struct.unpack_from(">q", data, 8)[0]
            self._first = utime if self._first is None else self._first
            self.simulated = (utime - self._first) * 1e-6
        elif channel == "RUN_INFO_SIMULATOR" and self.duration is None:
            self.duration = _duration(data)


def _duration(run_info: bytes) -> float | None:
    """s: what the simulator was asked for, else what its scenario says."""
    import yaml

    with contextlib.suppress(ValueError, TypeError, LookupError, AttributeError, struct.error, yaml.YAMLError):
        info = message_type("run_info_t").python_class.decode(run_info)
        asked = option(info.options, "--duration")
        return float(asked or yaml.safe_load(info.scenario)["duration"])
    return None


class _Child:
    """One process of ours. Only ever signalled by its own pid."""

    def __init__(self, name: str, command: list[str], directory: Path) -> None:
        self.name = name
        self.output = directory / f"{name}.txt"
        # Its own session: Ctrl-C reaches this process alone, which ends the others in order.
        with self.output.open("wb") as file:
            self.process = subprocess.Popen(
                mortal(command), stdin=subprocess.DEVNULL, stdout=file, stderr=file, start_new_session=True
            )

    def stop(self) -> None:
        """Interrupts it, waits, and kills it where that did not help."""
        if self.process.poll() is not None:
            return
        self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(STOP_TIMEOUT)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def said(self) -> list[str]:
        """The last lines that it wrote."""
        try:
            return self.output.read_text(errors="replace").strip().splitlines()[-TAIL_LINES:]
        except OSError:
            return []

    def failure(self, what: str) -> RunError:
        code = self.process.poll()
        how = "" if code is None else f" (signal {-code})" if code < 0 else f" (exit {code})"
        last = "; ".join(self.said()) or "it said nothing"
        return RunError(f"{self.name} {what}{how}: {last}")


class _Children:
    """The processes of a run; on the way out, whatever happened, they end in reverse order."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.started: list[_Child] = []

    def start(self, name: str, command: list[str]) -> _Child:
        try:
            child = _Child(name, command, self.directory)
        except OSError as error:
            raise RunError(f"{name} cannot be started: {error.strerror or error}") from error
        self.started.append(child)
        return child

    def __enter__(self) -> _Children:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for child in reversed(self.started):
            child.stop()


class Interruption:
    """Turns SIGINT and SIGTERM into a request that the run's own loop sees; a second one raises KeyboardInterrupt."""

    def __init__(self) -> None:
        self.requested = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Interruption:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._before[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True


@contextlib.contextmanager
def progress_bar(silent: bool, unit: str = "s") -> Iterator[Progress | None]:
    """A progress bar on stderr for whatever tells how far it is, in seconds or another unit; none when `silent`."""
    if silent:
        yield None
        return
    from tqdm import tqdm

    digits = ".1f" if unit == "s" else ".0f"
    layout = f"{{l_bar}}{{bar}}| {{n:{digits}}}/{{total:{digits}}} {unit} [{{elapsed}}]"
    with tqdm(total=0.0, bar_format=layout, disable=None) as bar:  # disable=None: only where stderr is a terminal

        def show(done: float, of: float | None) -> None:
            bar.total = max(of or 0.0, done)
            bar.n = done
            bar.refresh()

        yield show
