"""Campaigns: the trials of a study, each a rollout of its own, on every core; what is done stays done.

Trial k of every cell has the seed `first seed + k`, so that cells compare pair by pair. Everything goes below
<output>/<study>/<program>/, where <program> is a hash of stance-rollout and of the robot's files:

    program/        stance-rollout and the robot as they were, so that a build meanwhile or later changes nothing
    cells/          each cell's complete scenario, and its robot where that is not as it ships
    trials.jsonl    a line for each trial that is done, only ever added to: a campaign that was killed goes on after it
    failures/       the logs of trials that failed
    logs/           those of trials that are running, where they are asked for
    summary.json    what came of it

A result counts where program, robot, cell and scenario are the same: another program or robot has another directory,
another cell or scenario another key in each line.
"""

from __future__ import annotations

import fcntl
import hashlib
import inspect
import json
import os
import re
import shlex
import shutil
import subprocess
import tempfile
import threading
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from statistics import fmean, median
from typing import IO, Any

import yaml

from . import configuration, estimation, metrics, signals, walking
from .check import Finding, Limit, figure, judge, quantity
from .errors import RunError, StanceError
from .log import Log
from .plain import counted, to_json
from .programs import find_program, mortal, share_directory
from .pushes import PushTrial, drawn_scenario, has_one_push, push_of
from .study import Cell, Study
from .tick_cpu import TickCpu, merge

SCHEMA = {"schema": "stance.campaign", "version": 1}
ROLLOUT = "stance-rollout"
FELL = 1  # its exit code for a robot that fell
CONFIDENCE = 0.95
TOLERANCE = 1e-12  # of a rate, which is a quotient of whole numbers
MEASURING = (configuration, estimation, metrics, signals, walking)  # what a figure of a log depends on

Progress = Callable[[int, int], None]
"""called with the trials done and in all"""


@dataclass(frozen=True)
class Request:
    """What of a study to run, and where."""

    output: Path
    trials: int | None = None
    """of each cell, in place of the study's"""
    seed: int = 1
    """of the first trial"""
    workers: int | None = None
    """rollouts at once; one for each core where None"""
    names: tuple[str, ...] = ()
    """patterns of the cells' names, such as '*noisy'; all cells without one"""
    keep: int | None = None
    """failures of each cell whose log is kept; all where None"""


@dataclass(frozen=True)
class Failure:
    """A trial that did not succeed."""

    seed: int
    why: list[str]
    drawn: dict[str, Any]
    """the scenario's random values: path → value"""
    command: str
    """that runs it again, to the same bits"""
    log: str | None
    """None where it was not to be kept"""


@dataclass(frozen=True)
class Figure:
    """A limit's figure over the trials that did not fall."""

    name: str
    unit: str
    rule: str
    failed: int
    """trials past the limit; 1 where a mean is"""
    median: float | None
    """of a limit on the mean, that; None where no trial gives it"""
    worst: float | None

    @property
    def told(self) -> str:
        """Median and worst for people; empty where no trial gives them."""
        if self.median is None or self.worst is None:
            return ""
        return f"{quantity(self.median, self.unit)}, worst {quantity(self.worst, self.unit)}; "


@dataclass(frozen=True)
class Tally:
    """What came of a cell."""

    name: str
    trials: int
    succeeded: int
    fell: int
    interval: tuple[float, float]
    """Wilson's, 95%, of the success rate"""
    asked: str
    """for people; empty where nothing is asked"""
    met: bool | None
    """None where the cell that it is compared with did not run"""
    figures: list[Figure]
    failures: list[Failure]
    verdicts: dict[str, int] = field(default_factory=dict)
    """what became of the balls thrown at a catcher: verdict → throws, of every trial"""
    pushes: list[PushTrial] = field(default_factory=list)
    """every trial, where the scenario has exactly one push"""


@dataclass(frozen=True)
class Outcome:
    """A study's campaign."""

    study: str
    title: str
    robot: str
    seed: int
    """of the first trial of each cell"""
    program: str
    """hash of stance-rollout and of the robot's files"""
    directory: str
    cells: list[Tally]
    tick_cpu: TickCpu
    """of every trial"""
    qp_iterations_max: int | None
    """of any tick; None of a robot that solves no QP"""

    @property
    def met(self) -> bool:
        return all(cell.met is not False for cell in self.cells)

    def as_dict(self) -> dict[str, Any]:
        """Plain data, for JSON."""
        return {**SCHEMA, **asdict(self)}


def wilson(succeeded: int, trials: int) -> tuple[float, float]:
    """The 95% interval of a success rate, from its trials."""
    from scipy.stats import binomtest

    interval = binomtest(succeeded, trials).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)


def run_campaign(
    study: Study,
    request: Request,
    progress: Progress | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> Outcome:
    """Runs the trials that are not done yet, and counts them all. `say` takes what is worth knowing, a line each.

    Raises StanceError where no cell has such a name or another campaign writes to the same place, MissingError without
    stance-rollout, and RunError where a rollout does not run. Whatever ends it, what was done stays done.
    """
    chosen = [cell for cell in study.cells if not request.names or _named(cell, request.names)]
    if not chosen:
        names = ", ".join(repr(cell.name) for cell in study.cells)
        raise StanceError(f"{study.name}: no cell is named {' or '.join(request.names)}; there are {names}")
    program = _freeze(study, request.output / study.name)
    with _Store(program.directory) as store:
        for line in _unused(study, program, store):
            say(line)
        campaign = _Campaign(chosen, request, program, store)
        campaign.run(progress)
        outcome = Outcome(
            study=study.name,
            title=study.title,
            robot=study.robot,
            seed=request.seed,
            program=program.digest,
            directory=str(program.directory),
            cells=campaign.tallies(),
            tick_cpu=merge(told["tick_cpu"] for told in campaign.rollouts()),
            qp_iterations_max=max(
                (told["qp_iterations_max"] for told in campaign.rollouts() if "qp_iterations_max" in told), default=None
            ),
        )
    (program.directory / "summary.json").write_text(to_json(outcome.as_dict()) + "\n")
    return outcome


def as_text(outcome: Outcome, shown: int = 3) -> str:
    """For people: a line for each cell, and how to run its first failures again."""
    width = max(len(cell.name) for cell in outcome.cells)
    lines = [f"{outcome.title} ({outcome.study}, seeds from {outcome.seed})"]
    for cell in outcome.cells:
        mark = {True: "ok  " if cell.asked else "    ", False: "FAIL", None: "?   "}[cell.met]
        low, high = cell.interval
        count = f"{cell.succeeded}/{cell.trials}"
        asked = f"   asked {cell.asked}" if cell.asked else ""
        lines.append(f"{mark} {cell.name:<{width}} {count:>9}   {low:.3f} to {high:.3f}{asked}")
        for one in cell.figures:
            past = f"{counted(one.failed, 'trial')} not {one.rule}" if one.failed else f"all {one.rule}"
            if one.told or one.failed:
                lines.append(f"       {one.name} {one.told}{past}")
        if cell.verdicts:
            lines.append(f"       {told_verdicts(cell.verdicts)}")
        for failure in cell.failures[:shown]:
            drawn = [f"{path} = {value}" for path, value in failure.drawn.items()]
            lines.append(f"       seed {failure.seed}: {'; '.join([*failure.why, *drawn])}; again: {failure.command}")
        if len(cell.failures) > shown:
            lines.append(f"       and {len(cell.failures) - shown} more, all in {outcome.directory}/summary.json")
    cpu = outcome.tick_cpu
    times = " / ".join(f"{time:,.0f}" for time in (cpu.p50_us, cpu.p99_us, cpu.p99_9_us, cpu.max_us))
    lines.append(f"     {cpu.ticks:,} ticks: CPU p50 / p99 / p99.9 / max {times} µs")
    if outcome.qp_iterations_max is not None:
        lines[-1] += f"; at most {counted(outcome.qp_iterations_max, 'QP iteration')}"
    return "\n".join(lines)


def told_verdicts(verdicts: dict[str, int]) -> str:
    """For people: the verdicts that there were, most first."""
    return ", ".join(f"{name} {count}" for name, count in sorted(verdicts.items(), key=lambda one: -one[1]) if count)


# ---- the program -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Program:
    """stance-rollout and its robot, copied to where nothing changes them."""

    digest: str
    robot: str
    directory: Path
    """of everything that they give"""

    @property
    def share(self) -> Path:
        return self.directory / "program"

    def share_with(self, configuration: str | None, directory: Path) -> Path:
        """The share directory with the robot as it ships, or a copy of it in which the robot has this configuration."""
        if configuration is None:
            return self.share
        copy = directory / "robots" / self.robot
        shutil.copytree(self.share / "robots" / self.robot, copy, dirs_exist_ok=True)
        (copy / f"{self.robot}.yaml").write_text(configuration)
        return directory

    def words(self, scenario: Path, seed: int, log: Path | None) -> list[str]:
        words = [str(self.share / ROLLOUT), "--robot", self.robot, "--scenario", str(scenario), "--seed", str(seed)]
        return words if log is None else [*words, "--log", str(log)]

    def command(self, share: Path, scenario: Path, seed: int, log: Path) -> str:
        """For a shell."""
        return f"STANCE_SHARE={shlex.quote(str(share))} {shlex.join(self.words(scenario, seed, log))}"


def _freeze(study: Study, directory: Path) -> _Program:
    """Copies what a rollout is made of, where there is no such copy yet."""
    source = find_program(ROLLOUT)
    robot = share_directory() / "robots" / study.robot
    if not robot.is_dir():
        raise StanceError(f"no robot {study.robot!r}: {robot} does not exist")
    directory.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=directory, prefix=".new-") as fresh:
        copy = Path(fresh) / "program"
        shutil.copytree(robot, copy / "robots" / study.robot)
        shutil.copy2(source, copy / ROLLOUT)
        digest = _digest(copy)
        program = _Program(digest, study.robot, directory / digest[:12])
        if not program.share.is_dir():
            program.directory.mkdir(exist_ok=True)
            copy.rename(program.share)
    return program


def _digest(directory: Path) -> str:
    """sha256 over every file's path and content."""
    digest = hashlib.sha256()
    for path in sorted(path for path in directory.rglob("*") if path.is_file()):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(directory)}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()


# ---- what is done ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Trial:
    """One line of trials.jsonl."""

    key: str
    """of the cell: `_key`"""
    seed: int
    rollout: dict[str, Any]
    """what stance-rollout told"""
    log: dict[str, Any] = field(default_factory=dict)
    """figures of its log: dotted path → value"""


def _key(cell: Cell) -> str:
    """A hash of all that a trial's record depends on besides program, robot and seed."""
    paths = sorted(_paths(cell.measured))
    measured = [*paths, *map(inspect.getsource, MEASURING)] if paths else []
    return hashlib.sha256(
        "\0".join([cell.name, cell.scenario, cell.configuration or "", *measured]).encode()
    ).hexdigest()[:16]


def _paths(limits: Sequence[Limit]) -> set[str]:
    """The figures that limits name."""
    named = {of for limit in limits if isinstance(of := limit.of, str)}
    return named | {limit.metric for limit in limits}


class _Store:
    """trials.jsonl: read at the start, then only added to, by one campaign at a time."""

    def __init__(self, directory: Path) -> None:
        self.path = directory / "trials.jsonl"
        self.trials: dict[tuple[str, int], _Trial] = {}
        self._file: IO[str] | None = None

    def __enter__(self) -> _Store:
        file = self.path.open("a+")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            file.close()
            raise StanceError(
                f"another campaign is writing to {self.path}: wait for it, or give another --output"
            ) from error
        file.seek(0)
        text = file.read()
        if text and not text.endswith("\n"):
            file.write("\n")  # a line that a kill left torn stays alone
        for line in text.splitlines():
            try:
                trial = _Trial(**json.loads(line))
            except (ValueError, TypeError):
                continue
            self.trials[trial.key, trial.seed] = trial
        self._file = file
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.close()

    def add(self, trial: _Trial) -> None:
        assert self._file is not None
        self._file.write(json.dumps(asdict(trial)) + "\n")
        self._file.flush()
        self.trials[trial.key, trial.seed] = trial


def _unused(study: Study, program: _Program, store: _Store) -> Iterator[str]:
    """What is there and does not count, a line for each reason."""
    keys = {_key(cell) for cell in study.cells}
    others = sum(key not in keys for key, _ in store.trials)
    if others:
        yield f"{study.name}: {counted(others, 'result')} of cells or scenarios that are no longer so: not used"
    for path in sorted(program.directory.parent.glob("*/trials.jsonl")):
        if path != store.path:
            with path.open() as file:
                count = sum(1 for _ in file)
            yield f"{study.name}: {counted(count, 'result')} of another program or robot in {path.parent}: not used"


# ---- the campaign ----------------------------------------------------------------------------------------------------


def _verdicts(trials: Sequence[_Trial]) -> dict[str, int]:
    counts: Counter[str] = Counter()
    for trial in trials:
        counts.update(trial.rollout.get("catch", {}).get("verdicts", {}))
    return dict(counts)


def _named(cell: Cell, patterns: Sequence[str]) -> bool:
    return any(fnmatchcase(cell.name, pattern) for pattern in patterns)


class _Stopped(Exception):
    """The campaign ends: this rollout is not wanted any more."""


class _Campaign:
    def __init__(self, cells: Sequence[Cell], request: Request, program: _Program, store: _Store) -> None:
        self._cells = cells
        self._request = request
        self._program = program
        self._store = store
        self._keys = {cell.name: _key(cell) for cell in cells}
        self._share: dict[str, Path] = {}
        self._lock = threading.Lock()  # of what follows
        self._running: set[subprocess.Popen[str]] = set()
        self._stopping = False
        self._kept: Counter[str] = Counter()

    def run(self, progress: Progress | None) -> None:
        """Every trial that is not done, and the logs of failures that were not kept."""
        for folder in ("cells", "failures"):
            (self._program.directory / folder).mkdir(exist_ok=True)
        for cell in self._cells:
            self._scenario(cell).write_text(cell.scenario)
            self._share[cell.name] = self._program.share_with(cell.configuration, self._scenario(cell).with_suffix(""))
            self._kept[cell.name] = sum(self._log(cell, seed).exists() for seed in self._seeds(cell))
        # Each seed in every cell before the next: an error in any cell shows at once, and an early end leaves pairs.
        trials = [
            (cell, self._request.seed + k)
            for k in range(max(map(self._count, self._cells)))
            for cell in self._cells
            if k < self._count(cell)
        ]
        to_do = [trial for trial in trials if self._is_wanting(*trial)]
        done = len(trials) - len(to_do)
        if progress is not None:
            progress(done, len(trials))
        logs = self._program.directory / "logs"
        shutil.rmtree(logs, ignore_errors=True)  # what a kill left there
        logs.mkdir()
        with self._pool() as pool:
            futures = [pool.submit(self._do, cell, seed, logs) for cell, seed in to_do]
            for future in as_completed(futures):
                trial = future.result()
                if (trial.key, trial.seed) not in self._store.trials:
                    self._store.add(trial)
                done += 1
                if progress is not None:
                    progress(done, len(trials))
        logs.rmdir()

    def rollouts(self) -> list[dict[str, Any]]:
        """What stance-rollout told of each trial."""
        return [trial.rollout for cell in self._cells for trial in self._trials(cell)]

    def tallies(self) -> list[Tally]:
        trials = {cell.name: self._trials(cell) for cell in self._cells}
        rates = {
            cell.name: sum(not _why(cell, trial) for trial in trials[cell.name]) / self._count(cell)
            for cell in self._cells
        }
        return [self._tally(cell, trials[cell.name], rates) for cell in self._cells]

    def _tally(self, cell: Cell, trials: list[_Trial], rates: dict[str, float]) -> Tally:
        failures = []
        for trial in trials:
            why = _why(cell, trial)
            if why:
                log = self._log(cell, trial.seed)
                command = self._command(cell, trial.seed)
                failures.append(
                    Failure(trial.seed, why, trial.rollout["drawn"], command, str(log) if log.exists() else None)
                )
        succeeded = len(trials) - len(failures)
        stood = [trial for trial in trials if not trial.rollout.get("fallen")]
        means = _means(cell, stood)
        return Tally(
            name=cell.name,
            trials=len(trials),
            succeeded=succeeded,
            fell=sum(bool(trial.rollout.get("fallen")) for trial in trials),
            interval=wilson(succeeded, len(trials)),
            asked=_asked(cell),
            met=False if any(mean.failed for mean in means) else _met(cell, rates),
            figures=[*_figures(cell, stood), *means],
            failures=failures,
            verdicts=_verdicts(trials),
            pushes=_pushes(cell, trials, {failure.seed for failure in failures}),
        )

    # ---- where things are

    def _trials(self, cell: Cell) -> list[_Trial]:
        return [self._store.trials[self._keys[cell.name], seed] for seed in self._seeds(cell)]

    def _count(self, cell: Cell) -> int:
        return cell.count(self._request.trials)

    def _seeds(self, cell: Cell) -> range:
        return range(self._request.seed, self._request.seed + self._count(cell))

    def _slug(self, cell: Cell) -> str:
        return re.sub(r"[^a-z0-9.]+", "-", cell.name.lower()).strip("-") + "-" + self._keys[cell.name][:8]

    def _scenario(self, cell: Cell) -> Path:
        return self._program.directory / "cells" / f"{self._slug(cell)}.yaml"

    def _log(self, cell: Cell, seed: int) -> Path:
        return self._program.directory / "failures" / f"{self._slug(cell)}-{seed}.lcmlog"

    def _command(self, cell: Cell, seed: int) -> str:
        return self._program.command(self._share[cell.name], self._scenario(cell), seed, self._log(cell, seed))

    # ---- one trial

    def _is_wanting(self, cell: Cell, seed: int) -> bool:
        """True where a trial is not done, or has failed and lacks its log."""
        trial = self._store.trials.get((self._keys[cell.name], seed))
        return trial is None or (bool(_why(cell, trial)) and self._is_to_keep(cell, seed))

    def _is_to_keep(self, cell: Cell, seed: int) -> bool:
        """True where the log of this failure is wanted and not there; counted as kept from then on."""
        if self._log(cell, seed).exists():
            return False
        with self._lock:
            if self._request.keep is not None and self._kept[cell.name] >= self._request.keep:
                return False
            self._kept[cell.name] += 1
            return True

    def _do(self, cell: Cell, seed: int, logs: Path) -> _Trial:
        """Runs a trial, or again for its log alone; where it fails, the log is there before it counts as done."""
        key = self._keys[cell.name]
        log = logs / f"{self._slug(cell)}-{seed}.lcmlog"
        trial = self._store.trials.get((key, seed))
        keep = trial is not None
        if trial is None:
            told = self._rollout(cell, seed, log if cell.measured else None)
            measured = {}
            if cell.measured and not told.get("fallen"):
                figures = metrics.measure(Log.open(log).run()).as_dict()
                where = f"cell {cell.name!r}: log_limits"
                measured = {path: figure(figures, path, where) for path in sorted(_paths(cell.measured))}
            trial = _Trial(key, seed, told, measured)
            keep = bool(_why(cell, trial)) and self._is_to_keep(cell, seed)
        if keep:
            if not log.exists():
                again = self._rollout(cell, seed, log)
                if again["command_hash"] != trial.rollout["command_hash"]:
                    raise RunError(
                        f"cell {cell.name!r}, seed {seed}: the rollout came out otherwise a second time; "
                        "it must give the same bits"
                    )
            log.rename(self._log(cell, seed))
        log.unlink(missing_ok=True)
        return trial

    def _rollout(self, cell: Cell, seed: int, log: Path | None) -> dict[str, Any]:
        """What stance-rollout tells. Raises RunError."""
        words = self._program.words(self._scenario(cell), seed, log)
        with self._lock:
            if self._stopping:
                raise _Stopped
            # A session of its own: Ctrl-C reaches this process alone, which ends the rollouts.
            process = subprocess.Popen(
                mortal([*words, "--json"]),
                env={**os.environ, "STANCE_SHARE": str(self._share[cell.name])},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                start_new_session=True,
            )
            self._running.add(process)
        out, err = process.communicate()
        with self._lock:
            self._running.discard(process)
            if self._stopping:
                raise _Stopped
        try:
            if process.returncode not in (0, FELL):
                raise ValueError
            told = json.loads(out)
        except ValueError as error:
            said = " ".join(err.split()) or f"it gave no result, exit {process.returncode}"
            command = self._command(cell, seed)
            raise RunError(f"cell {cell.name!r}, seed {seed}: {said}; again: {command}") from error
        if not isinstance(told, dict):
            raise RunError(f"{ROLLOUT} told {told!r} in place of a summary")
        return told

    @contextmanager
    def _pool(self) -> Iterator[ThreadPoolExecutor]:
        """Threads that each wait for a rollout; however it ends, no rollout goes on."""
        pool = ThreadPoolExecutor(self._request.workers or os.cpu_count())
        try:
            yield pool
        finally:
            with self._lock:
                self._stopping = True
                for process in self._running:
                    process.kill()
            pool.shutdown(wait=True, cancel_futures=True)


# ---- judging ---------------------------------------------------------------------------------------------------------


def _why(cell: Cell, trial: _Trial) -> list[str]:
    """Why a trial failed; empty where it succeeded. Raises StanceError where a limit names a figure that is absent."""
    told = trial.rollout
    if told.get("fallen"):
        on = f" ({told['fallen_on']})" if told["fallen_on"] else ""
        return [f"fell at {told['first_fall_s']:.2f} s by {told['fall_reason'].replace('_', ' ')}{on}"]
    judged = [judge(told, list(cell.limits)), judge(_nested(trial.log), list(cell.log_limits))]
    return [
        f"{finding.limit.name} {finding.measured}, not {finding.limit.rule}"
        for one in judged
        for finding in one.violated
    ]


def _pushes(cell: Cell, trials: Sequence[_Trial], failed: Collection[int]) -> list[PushTrial]:
    """What each trial was pushed with."""
    scenario = yaml.safe_load(cell.scenario)
    if not has_one_push(scenario):
        return []
    return [
        PushTrial(trial.seed, *push_of(drawn_scenario(scenario, trial.rollout["drawn"])), trial.seed not in failed)
        for trial in trials
    ]


def _nested(figures: dict[str, Any]) -> dict[str, Any]:
    """Dotted paths → mappings in mappings, as limits read them."""
    nested: dict[str, Any] = {}
    for path, value in figures.items():
        *sections, name = path.split(".")
        place = nested
        for section in sections:
            place = place.setdefault(section, {})
        place[name] = value
    return nested


def _asked(cell: Cell) -> str:
    asked = cell.asked
    parts = [] if asked.success_rate is None else [f"≥ {100 * asked.success_rate:g} %"]
    if asked.within is not None:
        parts.append(f"≥ that of '{asked.of}' less {100 * asked.within:g} points")
    return ", ".join(parts)


def _met(cell: Cell, rates: dict[str, float]) -> bool | None:
    asked, rate = cell.asked, rates[cell.name]
    if asked.success_rate is not None and rate < asked.success_rate - TOLERANCE:
        return False
    if asked.within is None or asked.of is None:
        return True
    return None if asked.of not in rates else rate >= rates[asked.of] - asked.within - TOLERANCE


def _figures(cell: Cell, stood: list[_Trial]) -> list[Figure]:
    """Of each limit, over the trials that stood."""
    found = []
    for limits, of_trial in (
        (cell.limits, lambda trial: trial.rollout),
        (cell.log_limits, lambda trial: _nested(trial.log)),
    ):
        for limit in limits:
            findings = [judge(of_trial(trial), [limit]).findings[0] for trial in stood]
            given = [one for one in findings if isinstance(one.value, int | float)]
            worst = max(given, key=_badness, default=None)
            found.append(
                Figure(
                    name=limit.name,
                    unit=limit.unit,
                    rule=limit.rule,
                    failed=sum(not one.passed for one in findings),
                    median=median(float(one.value) for one in given) if given else None,
                    worst=None if worst is None else float(worst.value),
                )
            )
    return found


def _means(cell: Cell, stood: list[_Trial]) -> list[Figure]:
    """Of each limit on means: the mean over the trials that stood in place of their median."""
    found = []
    for limit in cell.mean_limits:
        each = [judge(_nested(trial.log), [limit]).findings[0] for trial in stood]
        values = [float(one.value) for one in each if one.value is not None]
        mean = fmean(values) if values else None
        (judged,) = judge(_nested({limit.metric: mean}), [limit]).findings
        worst = max((one for one in each if one.value is not None), key=_badness, default=None)
        found.append(
            Figure(
                name=f"mean {limit.name}",
                unit=limit.unit,
                rule=limit.rule,
                failed=int(not judged.passed),
                median=mean,
                worst=None if worst is None else float(worst.value),
            )
        )
    return found


def _badness(finding: Finding) -> float:
    """Larger where a figure is closer to its limit, or further past it."""
    value = float(finding.value)
    if finding.of is not None:
        return abs(value - finding.of)
    return -value if finding.limit.bound == "min" else value
