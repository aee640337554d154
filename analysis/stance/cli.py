"""The command line `stance`. Results go to stdout (`--json`: as JSON), progress and errors to stderr.

Exit codes: 0 good, 1 a limit violated, 2 usage or something missing, 3 unreadable input, 130 interrupted.
Imports are local to each command, so that each starts as fast as it can.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from . import __version__
from .errors import GOOD, LIMIT_VIOLATED, StanceError

INTERRUPTED = 130

Command = Callable[[argparse.Namespace], int]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns its exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    options = _parser().parse_args(given)
    options.given = given
    command: Command = options.command
    try:
        return command(options)
    except StanceError as error:
        print(f"stance: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("stance: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115  (nobody reads any more: not an error of ours)
        return GOOD


# ---- commands --------------------------------------------------------------------------------------------------------


def _run(options: argparse.Namespace) -> int:
    from .network import ensure
    from .run import RunRequest, progress_bar, record

    ensure(options.network, options.given)
    stamp = time.strftime("%Y%m%d-%H%M%S")
    request = RunRequest(
        out=options.out or Path("runs") / f"{stamp}-{options.robot}-{options.scenario}",
        robot=options.robot,
        scenario=options.scenario,
        realtime=not options.lockstep,
        duration=options.duration,
        seed=options.seed,
        solver=options.solver,
        plant=options.plant,
    )
    with progress_bar(options.silent) as progress:
        outcome = record(request, progress)
    _say(options, *outcome.notes)
    if outcome.interrupted:
        _say(options, f"interrupted after {outcome.simulated:.2f} s; the log is {outcome.log}")
        return INTERRUPTED
    return GOOD if not outcome.fell else LIMIT_VIOLATED


def _info(options: argparse.Namespace) -> int:
    from .info import describe, describe_as_text
    from .log import Log

    log = Log.open(options.log)
    _print(options, describe(log), lambda: describe_as_text(log))
    return GOOD


def _shell(options: argparse.Namespace) -> int:
    from .errors import MissingError
    from .network import joining_command, residents

    found = [resident for resident in residents() if options.pid in (None, resident.pid)]
    if not found:
        raise MissingError("no running stance process to join: start `stance run` or `stance replay` first")
    words = options.words[1:] if options.words[:1] == ["--"] else options.words
    command = joining_command(found[0], words or [os.environ.get("SHELL", "/bin/sh")])
    os.environ["LCM_DEFAULT_URL"] = found[0].url
    _say(options, f"in the network of {found[0].command} (pid {found[0].pid}); LCM_DEFAULT_URL is {found[0].url}")
    sys.stderr.flush()
    os.execvp(command[0], command)


# ---- output ----------------------------------------------------------------------------------------------------------


def _say(options: argparse.Namespace, *lines: str) -> None:
    if not options.silent:
        for line in lines:
            print(line, file=sys.stderr)


def _print(options: argparse.Namespace, result: Any, text: Callable[[], str]) -> None:
    if options.json:
        print(json.dumps(result, indent=2))
    elif not options.silent:
        print(text())


# ---- arguments -------------------------------------------------------------------------------------------------------


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="stance", description="Runs, replays and analyses the Stance controller.")
    parser.add_argument("--version", action="version", version=f"stance {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def add(name: str, command: Command, help_text: str) -> argparse.ArgumentParser:
        added = commands.add_parser(name, help=help_text, description=help_text)
        added.set_defaults(command=command)
        added.add_argument("--json", action="store_true", help="the result as JSON on stdout")
        added.add_argument("--silent", action="store_true", help="no progress and no text, only errors")
        return added

    run = add("run", _run, "Runs simulator, controller and logger for a scenario; writes log, report and plots.")
    run.add_argument("--robot", default="biped", help="robots/<robot> (default: biped)")
    run.add_argument("--scenario", default="stand", help="sim/scenarios/<robot>/<scenario>.yaml (default: stand)")
    clock = run.add_mutually_exclusive_group()
    clock.add_argument("--realtime", action="store_true", help="on absolute deadlines (default)")
    clock.add_argument("--lockstep", action="store_true", help="as fast as the machine allows, each state answered")
    run.add_argument("--duration", type=_positive, metavar="S", help="seconds, in place of the scenario's")
    run.add_argument("--seed", type=int, help="of the scenario's random numbers")
    run.add_argument("--solver", help="the controller's force QP engine")
    run.add_argument("--plant", help="the simulator's plant")
    run.add_argument("--out", type=Path, metavar="DIR", help="where everything goes (default: runs/<time>-...)")
    _add_network(run)

    info = add("info", _info, "What a log holds: channels, counts, rates, gaps, versions, and what was skipped.")
    _add_log(info)

    shell = add("shell", _shell, "A shell, or a command, in the network of a running `stance run` or `stance replay`.")
    shell.add_argument("--pid", type=int, help="of the process to join (default: the newest)")
    shell.add_argument("words", nargs=argparse.REMAINDER, metavar="COMMAND", help="instead of a shell")
    return parser


def _add_log(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("log", type=Path, metavar="LOG", help="an LCM log")


def _add_network(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--network",
        choices=("auto", "namespace", "host"),
        default="auto",
        help="auto: the host's where its multicast is loopback, else a private namespace (default)",
    )


def _positive(text: str) -> float:
    value = float(text)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return value
