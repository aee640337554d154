"""What this machine has and lacks for a run, one line each: `stance doctor`."""

from __future__ import annotations

import os
import platform
import resource
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from . import network
from .errors import MissingError, StanceError
from .messages import CHANNELS, message_type, message_types
from .programs import find_lcm_tool, find_program

PROGRAMS = ("stance-sim", "stance-controller", "stance-rollout", "stance-replay")
LCM_TOOLS = ("lcm-logger", "lcm-logplayer", "lcm-spy")
_CAP_SYS_NICE = 23
_CAP_IPC_LOCK = 14


@dataclass(frozen=True)
class Finding:
    name: str
    good: bool
    text: str
    """what was found, or what to do"""
    needed: bool = True
    """False where a run works without it, only less well"""


def examine() -> list[Finding]:
    """Looks at everything; never raises."""
    found = [_examine(name, lambda name=name: str(find_program(name))) for name in PROGRAMS]  # type: ignore[misc]
    found += [_examine(name, lambda name=name: str(find_lcm_tool(name))) for name in LCM_TOOLS]  # type: ignore[misc]
    found.append(_examine("message types", _message_types))
    found.append(_examine("network", _network))
    found += [_java(), _priority(), _locked_memory(), _cores(), _preemption()]
    return found


def _examine(name: str, look: Callable[[], str]) -> Finding:
    try:
        return Finding(name, True, look())
    except StanceError as error:
        return Finding(name, False, str(error))


def _message_types() -> str:
    found = message_types()
    try:
        for name in set(CHANNELS.values()):
            message_type(name)
    except KeyError as error:
        raise MissingError(f"the generated type {error} is missing: build the project") from error
    return f"{len(found)} types"


def _network() -> str:
    if network.host_is_loopback():
        return "the host's multicast goes by the loopback"
    if network.namespace_command() is not None:
        return "a private network namespace can be made"
    raise MissingError(network.refusal())


def _capable(capability: int) -> bool:
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return False
    effective = next((int(line.split()[1], 16) for line in lines if line.startswith("CapEff")), 0)
    return bool(effective >> capability & 1)


def _java() -> Finding:
    java = shutil.which("java")
    return Finding("java", java is not None, java or "lcm-spy needs it: apt-get install default-jre", needed=False)


def _priority() -> Finding:
    limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    if _capable(_CAP_SYS_NICE) or limit > 0 or limit == resource.RLIM_INFINITY:
        return Finding("real-time priority", True, "allowed")
    remedy = "not allowed: add '@<group> - rtprio 95' to /etc/security/limits.conf and log in again"
    return Finding("real-time priority", False, remedy, needed=False)


def _locked_memory() -> Finding:
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    enough = limit == resource.RLIM_INFINITY or limit >= 256 << 20
    if _capable(_CAP_IPC_LOCK) or enough:
        return Finding("locked memory", True, "allowed")
    remedy = f"only {limit >> 10} KiB: add '@<group> - memlock unlimited' to /etc/security/limits.conf and log in again"
    return Finding("locked memory", False, remedy, needed=False)


def _cores() -> Finding:
    count = len(os.sched_getaffinity(0))
    text = f"{count}" if count > 1 else "1: simulator and controller share it, expect missed ticks"
    return Finding("cores", count > 1, text, needed=False)


def _preemption() -> Finding:
    real_time = Path("/sys/kernel/realtime").exists()
    tester = "cyclictest is here to compare with" if shutil.which("cyclictest") else "no cyclictest (rt-tests)"
    kernel = platform.release() if real_time else f"{platform.release()} is not PREEMPT_RT: wake-ups have a tail"
    return Finding("kernel", real_time, f"{kernel}; {tester}", needed=False)
