"""LCM's network: UDP multicast that stays on this machine.

`ensure` chooses: where the multicast route is the loopback, the host's own network; elsewhere a network namespace of
this process's own with multicast on its loopback, so that nothing leaves the machine and nothing else interferes. Other
LCM programs join such a namespace by `stance shell`, for which `announced` leaves a note of who lives in one.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from .errors import MissingError

LCM_URL = "udpm://239.255.76.67:7667?ttl=0"
MULTICAST_GROUP = "239.255.76.67"
INSIDE = "STANCE_NETWORK_NAMESPACE"
"""environment variable that is set within a namespace of ours"""
RUNTIME_DIRECTORY = "STANCE_RUNTIME_DIR"
"""environment variable that names `runtime_directory`: within a user namespace the user's id is another"""

_SET_UP = (
    "ip link set lo up && ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo "
    '|| { echo "stance: cannot set up multicast in the network namespace" >&2; exit 2; }; exec "$0" "$@"'
)
_MULTICAST_FLAG = 0x1000  # IFF_MULTICAST of linux/if.h
_HOW_TO = "as root: ip link set lo multicast on; ip route add 224.0.0.0/4 dev lo; then use --network host"


def multicast_interface(route_table: Path = Path("/proc/net/route")) -> str | None:
    """The interface that multicast to LCM's group leaves by, or None without a route."""
    target = struct.unpack("=I", socket.inet_aton(MULTICAST_GROUP))[0]
    best: tuple[int, int] | None = None
    interface = None
    try:
        lines = route_table.read_text().splitlines()[1:]
    except OSError:
        return None
    for line in lines:
        columns = line.split()
        destination, flags, metric, mask = (int(columns[i], base) for i, base in ((1, 16), (3, 16), (6, 10), (7, 16)))
        if not flags & 1 or (target & mask) != destination:
            continue
        rank = (bin(mask).count("1"), -metric)
        if best is None or rank > best:
            best, interface = rank, columns[0]
    return interface


def host_is_loopback() -> bool:
    """True where the host's own multicast already goes by the loopback."""
    if multicast_interface() != "lo":
        return False
    try:
        return bool(int(Path("/sys/class/net/lo/flags").read_text(), 16) & _MULTICAST_FLAG)
    except OSError:
        return False


def namespace_command() -> list[str] | None:
    """The start of a command line that runs the rest of it in a new namespace with multicast; None where refused."""
    unshare = shutil.which("unshare")
    if unshare is None or shutil.which("ip") is None:
        return None
    flags = ["--net"] if os.geteuid() == 0 else ["--map-root-user", "--net"]
    command = [unshare, *flags, "--", "sh", "-c", _SET_UP]
    tried = subprocess.run([*command, "true"], capture_output=True, check=False)
    return command if tried.returncode == 0 else None


def refusal() -> str:
    """Why there is no namespace to be had, and what to do."""
    missing = [name for name in ("unshare", "ip") if shutil.which(name) is None]
    if missing:
        return (
            f"no private network: {' and '.join(missing)} missing (apt-get install util-linux iproute2); or {_HOW_TO}"
        )
    return f"no private network: this machine refuses network namespaces; {_HOW_TO}"


def ensure(mode: str, arguments: Sequence[str]) -> None:
    """Makes LCM's network usable for this process, or raises MissingError with what to do.

    Where that takes a namespace, this process is replaced: Python starts again in it, with these arguments.
    """
    if os.environ.get(INSIDE):
        return
    if mode == "host":
        if multicast_interface() is None:
            raise MissingError(f"this machine has no multicast route: {_HOW_TO}")
        return
    if mode == "auto" and host_is_loopback():
        return
    command = namespace_command()
    if command is None:
        raise MissingError(refusal())
    os.environ[INSIDE] = "1"
    os.environ[RUNTIME_DIRECTORY] = str(runtime_directory())
    sys.stdout.flush()
    sys.stderr.flush()
    os.execvp(command[0], [*command, sys.executable, *arguments])


def connect(url: str = LCM_URL) -> Any:
    """An LCM. Raises MissingError where it cannot start."""
    import lcm

    try:
        return lcm.LCM(url)
    except RuntimeError as error:
        raise MissingError(f"LCM cannot start on {url}: no multicast route here; try --network namespace") from error


# ---- who lives in a namespace ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Resident:
    """A process whose network others may join."""

    pid: int
    started: int
    """clock ticks since boot: tells it from a later process of the same pid"""
    command: str
    url: str

    def alive(self) -> bool:
        return _start_of(self.pid) == self.started


def runtime_directory() -> Path:
    """Where notes on running processes are: $XDG_RUNTIME_DIR/stance, else a directory of this user's own in tmp."""
    if RUNTIME_DIRECTORY in os.environ:
        return Path(os.environ[RUNTIME_DIRECTORY])
    base = os.environ.get("XDG_RUNTIME_DIR")
    if base and os.access(base, os.W_OK):
        return Path(base) / "stance"
    return Path(tempfile.gettempdir()) / f"stance-{os.getuid()}"


def _start_of(pid: int) -> int | None:
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return None
    fields = stat.rpartition(")")[2].split()
    return None if fields[0] == "Z" else int(fields[19])


@contextlib.contextmanager
def announced(command: str, url: str = LCM_URL) -> Iterator[None]:
    """While it lasts, `stance shell` can join this process's network."""
    directory = runtime_directory()
    directory.mkdir(mode=0o700, parents=True, exist_ok=True)
    if directory.stat().st_uid != os.getuid():
        raise MissingError(f"{directory} belongs to another user: set {RUNTIME_DIRECTORY} to a directory of your own")
    resident = Resident(os.getpid(), _start_of(os.getpid()) or 0, command, url)
    note = directory / f"{resident.pid}.json"
    fresh = note.with_suffix(".new")
    fresh.write_text(json.dumps(asdict(resident)))
    fresh.replace(note)
    try:
        yield
    finally:
        note.unlink(missing_ok=True)


def residents() -> list[Resident]:
    """Running processes whose network can be joined, newest first. Notes of those that ended are removed."""
    found: list[Resident] = []
    for note in runtime_directory().glob("*.json"):
        if note.lstat().st_uid != os.getuid():
            continue
        try:
            resident = Resident(**json.loads(note.read_text()))
            alive = resident.alive()
        except (OSError, ValueError, TypeError):
            alive = False
        if alive:
            found.append(resident)
        else:
            note.unlink(missing_ok=True)
    return sorted(found, key=lambda resident: resident.started, reverse=True)


def newest(pid: int | None = None, commands: Sequence[str] = ("stance run", "stance replay")) -> Resident:
    """The newest resident of one of these commands, or that of `pid`. Raises MissingError without one."""
    for found in residents():
        if found.command in commands and pid in (None, found.pid):
            return found
    which = "" if pid is None else f" of pid {pid}"
    remedy = " or ".join(f"`{command}`" for command in commands)
    raise MissingError(f"no running stance process{which} to join: start {remedy} first")


def join(resident: Resident, arguments: Sequence[str]) -> None:
    """Makes a resident's network this process's. Raises MissingError.

    Where that is another one, this process is replaced: Python starts again in it, with these arguments.
    """
    here = [sys.executable, *arguments]
    command = joining_command(resident, here)
    if command == here:
        return
    os.environ[RUNTIME_DIRECTORY] = str(runtime_directory())
    sys.stdout.flush()
    sys.stderr.flush()
    os.execvp(command[0], command)


def joining_command(resident: Resident, command: Sequence[str]) -> list[str]:
    """The command line that runs `command` in a resident's network. Raises MissingError."""
    if os.stat(f"/proc/{resident.pid}/ns/net").st_ino == os.stat("/proc/self/ns/net").st_ino:
        return list(command)
    nsenter = shutil.which("nsenter")
    if nsenter is None:
        raise MissingError("nsenter is missing (util-linux): it is needed to join a run's network")
    user_namespace = os.stat(f"/proc/{resident.pid}/ns/user").st_ino != os.stat("/proc/self/ns/user").st_ino
    user = ["--user", "--preserve-credentials"] if user_namespace else []
    return [nsenter, "--target", str(resident.pid), *user, "--net", "--", *command]
