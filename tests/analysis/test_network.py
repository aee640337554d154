"""Where LCM's multicast goes, and who may be joined."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from stance import network
from stance.errors import MissingError
from stance.network import announced, joining_command, multicast_interface, residents

HEAD = "Iface\tDestination\tGateway \tFlags\tRefCnt\tUse\tMetric\tMask\t\tMTU\tWindow\tIRTT\n"
DEFAULT = "eth0\t00000000\t0100000A\t0003\t0\t0\t0\t00000000\t0\t0\t0\n"
LOOPBACK = "lo\t000000E0\t00000000\t0001\t0\t0\t0\t000000F0\t0\t0\t0\n"
DOWN = "lo\t000000E0\t00000000\t0000\t0\t0\t0\t000000F0\t0\t0\t0\n"


@pytest.fixture(autouse=True)
def runtime_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(network.RUNTIME_DIRECTORY, str(tmp_path / "runtime"))
    return tmp_path / "runtime"


@pytest.mark.parametrize(
    ("routes", "interface"),
    [(DEFAULT, "eth0"), (DEFAULT + LOOPBACK, "lo"), (LOOPBACK, "lo"), (DEFAULT + DOWN, "eth0"), ("", None)],
)
def test_multicast_goes_by_the_most_specific_route(tmp_path: Path, routes: str, interface: str | None) -> None:
    table = tmp_path / "route"
    table.write_text(HEAD + routes)
    assert multicast_interface(table) == interface


def test_without_a_route_the_hosts_network_is_refused_with_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(network.INSIDE, raising=False)
    monkeypatch.setattr(network, "multicast_interface", lambda: None)
    with pytest.raises(MissingError, match="ip route add"):
        network.ensure("host", [])


def test_where_nothing_is_possible_one_line_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(network.INSIDE, raising=False)
    monkeypatch.setattr(network, "host_is_loopback", lambda: False)
    monkeypatch.setattr(network, "namespace_command", lambda: None)
    with pytest.raises(MissingError) as caught:
        network.ensure("auto", [])
    assert "\n" not in str(caught.value)
    assert "ip route add 224.0.0.0/4 dev lo" in str(caught.value)


def test_a_loopback_host_or_our_own_namespace_is_used_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "execvp", lambda *_: pytest.fail("must not re-execute"))
    monkeypatch.delenv(network.INSIDE, raising=False)
    monkeypatch.setattr(network, "host_is_loopback", lambda: True)
    network.ensure("auto", [])
    monkeypatch.setattr(network, "host_is_loopback", lambda: False)
    monkeypatch.setenv(network.INSIDE, "1")
    network.ensure("auto", [])


def test_a_process_is_a_resident_only_while_it_is_announced(runtime_directory: Path) -> None:
    with announced("stance run", "udpm://somewhere"):
        assert [(found.pid, found.command, found.url) for found in residents()] == [
            (os.getpid(), "stance run", "udpm://somewhere")
        ]
        assert oct(runtime_directory.stat().st_mode & 0o777) == "0o700"
    assert residents() == []


def test_notes_of_ended_processes_are_removed(runtime_directory: Path) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    runtime_directory.mkdir()
    notes = {
        "ended": {"pid": ended.pid, "started": 1, "command": "stance run", "url": ""},
        "another process of the same pid": {"pid": os.getpid(), "started": 1, "command": "stance run", "url": ""},
        "an older version's": {"pid": os.getpid()},
    }
    for name, content in notes.items():
        (runtime_directory / f"{name}.json").write_text(json.dumps(content))
    (runtime_directory / "torn.json").write_text('{"pid": 1')
    assert residents() == []
    assert list(runtime_directory.iterdir()) == []


def test_a_note_is_removed_even_when_the_run_fails() -> None:
    with pytest.raises(ValueError, match="of the run"), announced("stance run"):
        raise ValueError("of the run")
    assert residents() == []


def test_joining_ones_own_network_takes_no_namespace() -> None:
    with announced("stance run"):
        assert joining_command(residents()[0], ["lcm-spy"]) == ["lcm-spy"]
