"""The command line `stance`. Results go to stdout (`--json`: as JSON), progress and errors to stderr.

Exit codes: 0 good, 1 a limit violated, 2 usage or something missing, 3 unreadable input, 130 interrupted.
Imports are local to each command, so that each starts as fast as it can.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from . import __version__
from .errors import GOOD, LIMIT_VIOLATED, USAGE, StanceError
from .plain import counted, to_json

INTERRUPTED = 130

Command = Callable[[argparse.Namespace], int]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns its exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    options = _parser().parse_args(given)
    options.restart = ["-m", "stance", *given]
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
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        print(f"stance: {place}{error.strerror or error}", file=sys.stderr)
        return USAGE


# ---- commands --------------------------------------------------------------------------------------------------------


def _run(options: argparse.Namespace) -> int:
    from .check import load_limits
    from .network import ensure
    from .run import RunRequest, progress_bar, record

    if options.limits is not None:
        load_limits(options.limits)  # a list that cannot be used is told before the run, not after it
    ensure(options.network, options.restart)
    name = f"{time.strftime('%Y%m%d-%H%M%S')}-{options.robot}-{Path(options.scenario).stem}"
    request = RunRequest(
        out=options.out or _fresh_directory(name),
        robot=options.robot,
        scenario=options.scenario,
        realtime=not options.lockstep,
        duration=options.duration,
        seed=options.seed,
        solver=options.solver,
        plant=options.plant,
        run_id=options.run_id,
    )
    with progress_bar(options.silent) as progress:
        outcome = record(request, progress)
    _say(options, *outcome.notes)
    if outcome.interrupted:
        _say(options, f"interrupted after {outcome.simulated:.2f} s; the log is {outcome.log}")
        return INTERRUPTED
    if options.no_report:
        result = {"log": str(outcome.log), "fell": outcome.fell, "simulated_s": outcome.simulated}
        _print(options, result, lambda: f"log      {outcome.log}\n{'FELL' if outcome.fell else 'did not fall'}")
        return LIMIT_VIOLATED if outcome.fell else GOOD
    return _write_report(options, outcome.log, outcome.log.parent)


def _fresh_directory(name: str) -> Path:
    """runs/<name>, or with a number after it where there is one already."""
    path = Path("runs") / name
    for number in range(2, 1000):
        if not path.exists():
            break
        path = Path("runs") / f"{name}-{number}"
    return path


def _write_report(options: argparse.Namespace, log: Path, out: Path) -> int:
    from .log import Log
    from .report import analyse, write

    analysis = analyse(Log.open(log), options.run, options.limits)
    _say(options, "drawing the report ...")
    written = write(analysis, out)
    verdict = analysis.verdict
    result = {
        "log": str(log),
        "report": str(written.report),
        "summary": str(written.summary),
        "plots": str(written.plots),
        "verdict": verdict.as_dict(),
        "metrics": analysis.metrics.as_dict(),
    }

    def text() -> str:
        places = [("log", log), ("report", written.report), ("summary", written.summary), ("plots", written.plots)]
        return "\n".join([verdict.as_text(), "", *(f"{name:<9}{place}" for name, place in places)])

    _print(options, result, text)
    return GOOD if verdict.passed else LIMIT_VIOLATED


def _report(options: argparse.Namespace) -> int:
    return _write_report(options, options.log, options.out or options.log.parent)


def _check(options: argparse.Namespace) -> int:
    from .log import Log
    from .report import analyse

    analysis = analyse(Log.open(options.log), options.run, options.limits)
    _print(options, analysis.verdict.as_dict(), analysis.verdict.as_text)
    return GOOD if analysis.verdict.passed else LIMIT_VIOLATED


def _plot(options: argparse.Namespace) -> int:
    from dataclasses import replace

    from .log import Log
    from .picture import picture
    from .report import analyse, figures, write_plots
    from .style import render

    drawing = options.at is not None or options.view is not None
    if drawing and (options.only or options.list):
        raise StanceError("--at and --view draw the robot and nothing else: leave out --only and --list")
    analysis = analyse(Log.open(options.log), options.run, options.limits)
    if options.list:
        names = list(figures(analysis))
        _print(options, names, lambda: "\n".join(names))
        return GOOD
    first, last = analysis.run.span
    if options.first is not None or options.last is not None:
        analysis = replace(analysis, run=analysis.run.between(options.first, options.last))
        if not analysis.run.count("ROBOT_STATE"):
            raise StanceError(f"no state between --from and --to: the run goes from {first:.2f} to {last:.2f} s")
    if not all(first <= instant <= last for instant in options.at or []):
        raise StanceError(f"--at must be within the run, from {first:.2f} to {last:.2f} s")
    out = options.out or options.log.parent / "plots"
    if drawing:
        out.mkdir(parents=True, exist_ok=True)
        path = out / f"picture.{options.format}"
        path.write_bytes(render(picture(analysis.run, options.at, options.view), options.format))
        written = [path]
    else:
        written = write_plots(analysis, out, options.only, options.format)
    _print(options, [str(path) for path in written], lambda: "\n".join(map(str, written)))
    return GOOD


def _replay(options: argparse.Namespace) -> int:
    from .replay import replay, select, verify

    if options.verify:
        if options.channels or options.speed != 1.0 or (options.first, options.last) != (None, None):
            raise StanceError("--verify takes the whole log: leave out --channels, --speed, --from and --to")
        done = verify(options.log, capture=options.json or options.silent)
        if options.json:
            result = {"equal": done.returncode == 0, "exit_code": done.returncode, "text": done.stdout.strip()}
            _print(options, result, str)
        return done.returncode
    from .log import Log
    from .network import announced, ensure
    from .run import progress_bar

    log = Log.open(options.log)
    rows = select(log, options.channels, options.first, options.last)
    ensure(options.network, options.restart)
    with announced("stance replay"), progress_bar(options.silent) as progress:
        done_playing = replay(log, rows, options.speed, progress=progress)
    result = {
        "messages": done_playing.messages,
        "channels": done_playing.channels,
        "duration_s": done_playing.duration,
        "wall_s": done_playing.wall,
    }
    played = counted(done_playing.messages, "message")
    words = f"{played}, {done_playing.duration:.2f} s of the log in {done_playing.wall:.2f} s"
    _print(options, result, lambda: words)
    return GOOD


def _export(options: argparse.Namespace) -> int:
    from .export import export, export_force_qps
    from .log import Log

    if options.format == "qp":
        out = options.out or options.log.with_suffix(".qp")
        said = export_force_qps(options.log, out, options.ticks)
        _print(options, [str(out)], lambda: f"{out}: {said}")
        return GOOD
    run = Log.open(options.log).run(options.run)
    default = options.log.with_suffix(".mat") if options.format == "mat" else options.log.parent / options.format
    written = export(run, options.format, options.out or default)
    _print(options, [str(path) for path in written], lambda: "\n".join(map(str, written)))
    return GOOD


def _campaign(options: argparse.Namespace) -> int:
    import yaml

    from .campaign import Request, as_text, run_campaign
    from .push_map import panels, push_map
    from .pushes import has_one_push
    from .run import progress_bar
    from .scoreboard import around, insert, keep, load, table
    from .study import load_study
    from .style import render

    if options.summary and options.name:
        raise StanceError("--summary keeps whole studies: leave out --name")
    if options.table and not options.summary:
        raise StanceError("--table is drawn from --summary: give both")
    if options.map and len(options.study) > 1:
        raise StanceError(f"--map draws one study: leave out all of {', '.join(options.study)} but one")
    if options.map and options.map.suffix not in (".png", ".svg", ".pdf"):
        raise StanceError(f"--map: {options.map} must end in .png, .svg or .pdf")
    if options.summary and options.summary.exists():
        load(options.summary)  # files that cannot be used are told before the campaign, not after it
    if options.table:
        around(options.table)
    studies = [load_study(study, options.robot) for study in options.study]
    if options.map and not any(has_one_push(yaml.safe_load(cell.scenario)) for cell in studies[0].cells):
        raise StanceError(f"--map: no scenario of {studies[0].name} has exactly one push")
    request = Request(
        output=options.output,
        trials=options.trials,
        seed=options.seed,
        workers=options.workers,
        names=tuple(options.name),
        keep=options.keep,
    )
    outcomes = []
    for number, study in enumerate(studies, 1):
        _say(options, f"study {number} of {len(studies)}: {study.name}, {counted(len(study.cells), 'cell')}")
        try:
            with progress_bar(options.silent, "trials") as progress:
                outcome = run_campaign(study, request, progress, lambda line: _say(options, line))
        except KeyboardInterrupt:
            _say(options, "what is done stays done: the same command goes on from there")
            raise
        outcomes.append(outcome)
        if options.map:
            shown = panels([(cell.name, cell.pushes) for cell in outcome.cells])
            drawn = push_map(shown, outcome.title, f"{outcome.study}, seeds from {outcome.seed}")
            options.map.write_bytes(render(drawn, options.map.suffix.removeprefix(".")))
            _say(options, f"map: {options.map}")
        if options.summary:
            kept = keep(options.summary, [outcome])
            if options.table:
                insert(options.table, table(kept))
        if not options.json and not options.silent:
            print(as_text(outcome), flush=True)
    met = all(outcome.met for outcome in outcomes)
    if options.json:
        print(to_json({"met": met, "studies": [outcome.as_dict() for outcome in outcomes]}))
    return GOOD if met else LIMIT_VIOLATED


def _calibrate(options: argparse.Namespace) -> int:
    from .calibration import calibrate, read_points

    result = calibrate(options.kind, *read_points(options.points, options.kind))
    _print(options, result.as_dict(), result.as_text)
    return GOOD


def _doctor(options: argparse.Namespace) -> int:
    from dataclasses import asdict

    from .doctor import examine

    found = examine()

    def text() -> str:
        marks = {(True, True): "ok     ", (True, False): "ok     ", (False, True): "MISSING", (False, False): "note   "}
        return "\n".join(f"{marks[one.good, one.needed]} {one.name:<20} {one.text}" for one in found)

    _print(options, [asdict(one) for one in found], text)
    return GOOD if all(one.good or not one.needed for one in found) else USAGE


def _info(options: argparse.Namespace) -> int:
    from .info import describe, describe_as_text
    from .log import Log

    log = Log.open(options.log)
    _print(options, describe(log), lambda: describe_as_text(log))
    return GOOD


def _steps(options: argparse.Namespace) -> int:
    from dataclasses import asdict

    from .arm3 import steps
    from .log import Log

    run = Log.open(options.log).run(options.run)
    found = steps(run, options.motion, options.first, options.last)
    if options.json:
        print(to_json([asdict(step) for step in found]))
    elif not options.silent:
        for step in found:
            print(step.as_text(), end="\n\n")
    return GOOD


def _command(options: argparse.Namespace) -> int:
    from .command import Command, load_script, publish
    from .network import connect, join, newest
    from .run import Interruption

    given = (options.behaviour, options.vx, options.vy, options.yaw_rate, options.height)
    if options.script is not None:
        if given != (None,) * len(given):
            raise StanceError("--script says it all: leave out the behaviour, velocities and height")
        commands = load_script(options.script)
    else:
        behaviour = options.behaviour or "walk"
        if behaviour != "walk" and given[1:4] != (None,) * 3:
            raise StanceError(f"--behaviour {behaviour} has no velocity: leave out --vx, --vy and --yaw-rate")
        vx, vy, yaw_rate, height = (value or 0.0 for value in given[1:])
        commands = [Command(0.0, behaviour, (vx, vy), yaw_rate, height)]
    url = options.lcm_url
    if url is None:
        run = newest(options.pid, ("stance run",))
        join(run, options.restart)
        url = run.url
    with Interruption() as interruption:
        sent = publish(commands, connect(url), options.duration, lambda: interruption.requested)
    _print(options, {"sent": sent}, lambda: f"{counted(sent, 'command')} sent, the last one to stand")
    return GOOD


def _shell(options: argparse.Namespace) -> int:
    from .network import joining_command, newest

    found = newest(options.pid)
    words = options.words[1:] if options.words[:1] == ["--"] else options.words
    command = joining_command(found, words or [os.environ.get("SHELL", "/bin/sh")])
    os.environ["LCM_DEFAULT_URL"] = found.url
    _say(options, f"in the network of {found.command} (pid {found.pid}); LCM_DEFAULT_URL is {found.url}")
    sys.stderr.flush()
    os.execvp(command[0], command)


# ---- output ----------------------------------------------------------------------------------------------------------


def _say(options: argparse.Namespace, *lines: str) -> None:
    if not options.silent:
        for line in lines:
            print(line, file=sys.stderr)


def _print(options: argparse.Namespace, result: Any, text: Callable[[], str]) -> None:
    if options.json:
        print(to_json(result))
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
    run.add_argument("--run-id", type=int, help="stands in every message (default: 1 in lockstep, else the time)")
    run.add_argument("--out", type=Path, metavar="DIR", help="where everything goes (default: runs/<time>-...)")
    after = run.add_mutually_exclusive_group()
    after.add_argument("--no-report", action="store_true", help="only the log")
    _add_limits(after)
    _add_network(run)
    run.set_defaults(run=None)

    info = add("info", _info, "What a log holds: channels, counts, rates, gaps, versions, and what was skipped.")
    _add_log(info)

    steps = add("steps", _steps, "Prints the steps of the 3-joint arm's motion as document 004's terminal does.")
    _add_log(steps, with_run=True)
    steps.add_argument("--motion", type=_count, default=1, metavar="N", help="of the log, from 1 (default: the first)")
    steps.add_argument("--from", dest="first", type=_count, default=1, metavar="N", help="first step (default: 1)")
    steps.add_argument("--to", dest="last", type=_count, metavar="N", help="last step (default: the motion's)")

    report = add("report", _report, "Writes report.html, summary.json and plots/ for a log; exit 1 by its verdict.")
    _add_log(report, with_run=True)
    _add_limits(report)
    report.add_argument("--out", type=Path, metavar="DIR", help="where to (default: beside the log)")

    check = add("check", _check, "Judges a run by its limits; exit 1 where one is violated.")
    _add_log(check, with_run=True)
    _add_limits(check)

    plot = add("plot", _plot, "Draws the plots of a run.")
    _add_log(plot, with_run=True)
    _add_limits(plot)
    _add_span(plot, "the run's start")
    chosen = plot.add_mutually_exclusive_group()
    chosen.add_argument("--only", nargs="+", metavar="PLOT", help="these plots (--list names them)")
    chosen.add_argument("--list", action="store_true", help="names of the plots that this log can give")
    plot.add_argument("--at", nargs="+", type=float, metavar="S", help="only the robot, at these seconds")
    plot.add_argument("--view", choices=("side", "front"), help="only the robot, from this side")
    plot.add_argument("--format", choices=("png", "svg", "pdf"), default="png")
    plot.add_argument("--out", "--save-plot", type=Path, metavar="DIR", help="where to (default: plots/ by the log)")

    replay = add("replay", _replay, "Publishes a log again over LCM, or verifies that the controller decides the same.")
    _add_log(replay)
    replay.add_argument("--channels", nargs="+", metavar="NAME", help="only these; patterns such as 'CONTROLLER_*'")
    replay.add_argument("--speed", type=_not_negative, default=1.0, help="times the log's own pace; 0: no waiting")
    _add_span(replay, "the log's first event")
    replay.add_argument("--verify", action="store_true", help="compare every byte that the controller would publish")
    _add_network(replay)

    export = add("export", _export, "Writes a run's channels for other tools.")
    export.add_argument("format", choices=("parquet", "csv", "mat", "qp"))
    _add_log(export, with_run=True)
    export.add_argument(
        "--out", type=Path, metavar="PATH", help="a directory, or the .mat or .qp file (default: by the log)"
    )
    export.add_argument(
        "--ticks", type=int, default=1000, metavar="N", help="qp: of the first N ticks that step (default: 1000)"
    )

    campaign = add("campaign", _campaign, "Runs studies: seeded rollouts on every core; exit 1 where less than asked.")
    campaign.add_argument("--robot", default="biped", help="robots/<robot> (default: biped)")
    campaign.add_argument(
        "--study", nargs="+", required=True, metavar="S", help="sim/scenarios/<robot>/studies/<S>.yaml, or a .yaml file"
    )
    campaign.add_argument("--trials", type=_count, metavar="N", help="of each cell (default: what the study says)")
    campaign.add_argument(
        "--seed", type=_natural, default=1, help="of each cell's first trial; 10000 and up judge (default: 1)"
    )
    campaign.add_argument("--workers", type=_count, metavar="N", help="rollouts at once (default: one for each core)")
    campaign.add_argument("--name", nargs="+", default=[], help="only these cells; patterns such as '*noisy'")
    campaign.add_argument(
        "--keep", type=_natural, metavar="N", help="failures of each cell whose log is kept (default: all)"
    )
    campaign.add_argument(
        "--output", type=Path, metavar="DIR", default=Path("runs/campaigns"), help="where to (default: runs/campaigns)"
    )
    campaign.add_argument("--summary", type=Path, metavar="FILE", help="keep what came of it in this JSON file, too")
    campaign.add_argument(
        "--map", type=Path, metavar="FILE", help="draw success by the push's direction and impulse: .png, .svg or .pdf"
    )
    campaign.add_argument("--table", type=Path, metavar="FILE", help="and draw it between this Markdown file's marks")

    command = add("command", _command, "Commands a robot ten times a second until Ctrl-C, and then to stand.")
    command.add_argument(
        "--behaviour", choices=("walk", "stand", "lie-down", "track", "track-smooth"), help="(default: walk)"
    )
    command.add_argument("--vx", type=_finite, metavar="M/S", help="forward")
    command.add_argument("--vy", type=_finite, metavar="M/S", help="to the left")
    command.add_argument("--yaw-rate", type=_finite, metavar="RAD/S", help="to the left")
    command.add_argument("--height", type=_finite, metavar="M", help="of the centre of mass over its nominal height")
    command.add_argument("--script", type=Path, metavar="FILE", help="YAML: timed commands, as a scenario has them")
    command.add_argument("--duration", type=_positive, metavar="S", help="seconds (default: until Ctrl-C)")
    whom = command.add_mutually_exclusive_group()
    whom.add_argument("--pid", type=int, help="of the `stance run` to command (default: the newest)")
    whom.add_argument("--lcm-url", metavar="URL", help="of a robot, in place of a run")

    shell = add("shell", _shell, "A shell, or a command, in the network of a running `stance run` or `stance replay`.")
    shell.add_argument("--pid", type=int, help="of the process to join (default: the newest)")
    shell.add_argument("words", nargs=argparse.REMAINDER, metavar="COMMAND", help="instead of a shell")

    calibrate = add("calibrate", _calibrate, "Fits where a camera stands against an arm, from pairs of points.")
    calibrate.add_argument(
        "points", type=Path, metavar="POINTS.csv", help="columns x_K, y_K, z_K, x_A, y_A, z_A [m]; planar: without z"
    )
    calibrate.add_argument(
        "--kind", choices=("rigid", "affine", "linear", "planar"), default="rigid", help="of the fit (default: rigid)"
    )

    add("doctor", _doctor, "What this machine has and lacks for a run, one line each.")
    return parser


def _add_log(parser: argparse.ArgumentParser, with_run: bool = False) -> None:
    parser.add_argument("log", type=Path, metavar="LOG", help="an LCM log")
    if with_run:
        parser.add_argument("--run", type=int, metavar="ID", help="run_id, where the log holds more than one run")


def _add_limits(parser: argparse._ActionsContainer) -> None:
    parser.add_argument("--limits", type=Path, metavar="FILE", help="YAML (default: the robot's and scenario's own)")


def _add_span(parser: argparse.ArgumentParser, origin: str) -> None:
    parser.add_argument("--from", dest="first", type=float, metavar="S", help=f"seconds from {origin}")
    parser.add_argument("--to", dest="last", type=float, metavar="S", help=f"seconds from {origin}")


def _add_network(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--network",
        choices=("auto", "namespace", "host"),
        default="auto",
        help="auto: the host's where its multicast is loopback, else a private namespace (default)",
    )


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return value


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text} is no number")
    return value


def _count(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} is below 1")
    return value


def _natural(text: str) -> int:
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is below 0")
    return value


def _not_negative(text: str) -> float:
    value = float(text)
    if not value >= 0.0:
        raise argparse.ArgumentTypeError(f"{text} is below 0")
    return value
