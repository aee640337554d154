"""Study files: one question put to many seeded rollouts. Strict YAML: an unknown or missing key is an error.

    title: Pushes while stepping in place
    robot: biped
    scenario: stepping          # what the cells change: a name below sim/scenarios/<robot>/, or a .yaml beside this one
    trials: 100                 # of each cell
    set:                        # over the scenario: mappings are merged, all else is replaced
      pushes: [{time: {uniform: [4, 5]}, duration: 0.1, impulse: $push.impulse, direction: 0, point_B: [0, 0, 0]}]
    set_robot: {}               # the same over robots/<robot>/<robot>.yaml, for a robot that is not as it ships
    limits:                     # what a trial keeps to, besides not to fall: figures of stance-rollout's JSON
      - {name: largest tilt, metric: max_tilt_rad, unit: rad, max: 0.9}
    log_limits:                 # the same, figures of the trial's log (stance.metrics): slower
      - {name: estimated velocity, metric: estimator.velocity_rms, unit: m/s, max: 0.006}
    mean_limits:                # figures of the logs, too, asked of the mean over a cell's trials
      - {name: NEES, metric: estimator.nees, min: 0.4}
    cells:
      - name: $push.impulse N s
        for: {push: [{impulse: 6, rate: 0.98}, {impulse: 10, rate: 0.95}]}    # a cell for each combination of values
        asked: {success_rate: $push.rate}
      - name: 12 N s from behind
        set: {pushes: [...]}
        asked: {within: 0.1, of: 10 N s}    # its success rate is at most 0.1 below that of the other cell
    twin: {name: noisy, scenario: "${scenario}_noisy", within: 0.05}    # each cell again, named ..., noisy

`$name`, `$name.key` or `${name.key}` stands for a value of `for`, anywhere in a cell and in what it takes over from the
study: alone for the value as it is, within other words for its text. A cell's limits of each kind are added to the
study's, its `set` and `set_robot` are merged over the study's, its `scenario` takes the place of the study's; its
`trials` is its own, which the command may lower and not raise. A cell without `asked` is stated, and passes.

A `twin` differs in its scenario alone, where `$scenario` stands for the cell's. Where anything is asked of the cell,
its twin's success rate may be `within` below the cell's. `twin: false` in a cell leaves it alone.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import yaml

from . import strict
from .check import Limit, limits_of
from .errors import StanceError
from .programs import share_directory

RANDOM_VALUES = {"uniform", "normal", "choice"}  # a mapping with one of these is a value that the simulator draws
VARIABLE = re.compile(r"\$(?:\{([A-Za-z_][\w.]*)\}|([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*))")
OPTIONAL = ("set", "set_robot", "limits", "log_limits", "mean_limits")


class _Plain(yaml.SafeDumper):
    """Writes out what stands in several places, so that the simulator draws a random value for each of them."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


@dataclass(frozen=True)
class Asked:
    """What a cell must reach."""

    success_rate: float | None = None
    """of 1, at least"""
    within: float | None = None
    """of 1: by how much its success rate may be below that of the cell `of`"""
    of: str | None = None
    """the name of another cell"""


@dataclass(frozen=True)
class Cell:
    """Trials of one kind; they differ in their seed alone."""

    name: str
    scenario: str
    """the whole scenario, YAML"""
    trials: int
    configuration: str | None = None
    """of the robot, the whole YAML; None for the robot as it ships"""
    most: bool = False
    """`trials` is the cell's own: the command may lower it and not raise it"""
    asked: Asked = field(default_factory=Asked)
    limits: tuple[Limit, ...] = ()
    """what a trial keeps to, figures of the rollout's JSON"""
    log_limits: tuple[Limit, ...] = ()
    """the same, figures of its log"""
    mean_limits: tuple[Limit, ...] = ()
    """what the trials that do not fall keep to in the mean, figures of their logs"""

    @property
    def measured(self) -> tuple[Limit, ...]:
        """Those that need the log."""
        return (*self.log_limits, *self.mean_limits)

    def count(self, wanted: int | None) -> int:
        """Trials to run where the command wants so many of each cell."""
        if wanted is None:
            return self.trials
        return min(wanted, self.trials) if self.most else wanted


@dataclass(frozen=True)
class Study:
    """One file."""

    name: str
    """of the file, without its suffix"""
    title: str
    robot: str
    cells: tuple[Cell, ...]


def load_study(study: str, robot: str) -> Study:
    """`study` is a name below sim/scenarios/<robot>/studies/, or a path that ends in .yaml.

    Raises StanceError naming file, key and what is allowed. What the simulator finds wrong in a cell's scenario shows
    when its first trial runs.
    """
    if study.endswith(".yaml"):
        path = Path(study)
    else:
        directory = share_directory() / "sim/scenarios" / robot / "studies"
        path = directory / f"{study}.yaml"
        if not path.is_file():
            there = ", ".join(sorted(found.stem for found in directory.glob("*.yaml"))) or "none"
            raise StanceError(f"no study {study!r} of robot {robot}; there are {there}, or give a .yaml file")
    name = path.name
    keys = ("title", "robot", "scenario", "trials", "cells")
    document = strict.mapping(strict.parse(strict.read(path), name), name, keys, ("twin", *OPTIONAL))
    if document["robot"] != robot:
        raise StanceError(f"{name}: robot is {document['robot']!r}, but the campaign is of {robot!r}")
    strict.count(document["trials"], f"{name}: trials")
    if "twin" in document:
        _check_twin(document["twin"], f"{name}: twin")
    cells = [
        cell
        for i, entry in enumerate(strict.sequence(document["cells"], f"{name}: cells"))
        for cell in _cells(document, entry, path, f"{name}: cells[{i}]")
    ]
    names = [cell.name for cell in cells]
    for cell in cells:
        if names.count(cell.name) > 1:
            raise StanceError(f"{name}: two cells are named {cell.name!r}; put into the name what tells them apart")
        if cell.asked.of is not None and (cell.asked.of not in names or cell.asked.of == cell.name):
            raise StanceError(f"{name}: {cell.name!r} is asked for within of {cell.asked.of!r}, which is no other cell")
    return Study(path.stem, strict.text(document["title"], f"{name}: title"), robot, tuple(cells))


def _check_twin(twin: Any, where: str) -> None:
    strict.mapping(twin, where, ("name", "scenario", "within"))
    for key in ("name", "scenario"):
        strict.text(twin[key], f"{where}: {key}")
    strict.number(twin["within"], f"{where}: within", 0.0, 1.0)


def _cells(document: dict[str, Any], entry: Any, path: Path, where: str) -> list[Cell]:
    """The cells that an entry stands for: one for each combination of its values, each followed by its twin."""
    strict.mapping(entry, where, ("name",), ("for", "scenario", "trials", "asked", "twin", *OPTIONAL))
    if entry.get("twin", False) is not False or ("twin" in entry and "twin" not in document):
        raise StanceError(f"{where}: twin must be false, in a study with a twin, or be left out")
    for source, place in ((document, path.name), (entry, where)):
        for key in ("set", "set_robot"):
            if not isinstance(source.get(key, {}), dict):
                raise StanceError(f"{place}: {key} is no mapping")
    variables = entry.get("for", {})
    if not isinstance(variables, dict):
        raise StanceError(f"{where}: for is {variables!r}, but must be a mapping of names to lists of values")
    lists = [strict.sequence(values, f"{where}: for: {variable}") for variable, values in variables.items()]
    found = []
    for values in itertools.product(*lists):
        chosen = dict(zip(variables, values, strict=True))
        cell, scenario = _cell(document, entry, chosen, path, where)
        found.append(cell)
        if "twin" in document and "twin" not in entry:
            twin = document["twin"]
            scenario = _fill(twin["scenario"], {"scenario": scenario}, f"{path.name}: twin: scenario")
            again, _ = _cell(document, {**entry, "scenario": scenario}, chosen, path, where)
            asked = Asked() if cell.asked == Asked() else Asked(within=twin["within"], of=cell.name)
            found.append(replace(again, name=f"{cell.name}, {twin['name']}", asked=asked))
    return found


def _cell(
    document: dict[str, Any], entry: dict[str, Any], variables: dict[str, Any], path: Path, where: str
) -> tuple[Cell, str]:
    """A cell, and the name of the scenario that it changes."""

    def filled(source: dict[str, Any], key: str, default: Any = None) -> Any:
        return _fill(source.get(key, default), variables, f"{where}: {key}")

    def limits(key: str) -> tuple[Limit, ...]:
        of_study = limits_of(filled(document, key, []), f"{path.name}: {key}")
        return (*of_study, *limits_of(filled(entry, key, []), f"{where}: {key}"))

    def changed(key: str, base: dict[str, Any]) -> str:
        changes = _fill(_merge(document.get(key, {}), entry.get(key, {})), variables, f"{where}: {key}")
        return yaml.dump(_merge(base, changes), Dumper=_Plain, sort_keys=False, allow_unicode=True)

    robot = document["robot"]
    name = strict.text(filled({**document, **entry}, "scenario"), f"{where}: scenario")
    is_as_it_ships = not document.get("set_robot") and not entry.get("set_robot")
    cell = Cell(
        name=strict.text(str(filled(entry, "name")), f"{where}: name"),
        scenario=changed("set", _base(name, path, robot)),
        trials=strict.count(filled({**document, **entry}, "trials"), f"{where}: trials"),
        configuration=None
        if is_as_it_ships
        else changed("set_robot", _mapping(share_directory() / "robots" / robot / f"{robot}.yaml")),
        most="trials" in entry,
        asked=_asked(filled(entry, "asked", {}), f"{where}: asked"),
        limits=limits("limits"),
        log_limits=limits("log_limits"),
        mean_limits=limits("mean_limits"),
    )
    return cell, name


def _asked(entry: Any, where: str) -> Asked:
    strict.mapping(entry, where, (), ("success_rate", "within", "of"))
    if ("within" in entry) != ("of" in entry):
        raise StanceError(f"{where}: within and of go together")
    rates = {key: strict.number(entry[key], f"{where}: {key}", 0.0, 1.0) for key in entry if key != "of"}
    return Asked(**rates, of=strict.text(entry["of"], f"{where}: of") if "of" in entry else None)


def _base(scenario: str, study: Path, robot: str) -> dict[str, Any]:
    """The scenario that a cell changes."""
    if scenario.endswith(".yaml"):
        path = study.parent / scenario
    else:
        path = share_directory() / "sim/scenarios" / robot / f"{scenario}.yaml"
        if not path.is_file():
            raise StanceError(f"{study.name}: no scenario {scenario!r}: give a name below sim/scenarios/{robot}/")
    return _mapping(path)


def _mapping(path: Path) -> dict[str, Any]:
    """What a YAML file holds."""
    loaded = strict.parse(strict.read(path), path.name)
    if not isinstance(loaded, dict):
        raise StanceError(f"{path.name} must be a YAML mapping")
    return loaded


def _merge(base: Any, change: Any) -> Any:
    """`change` over `base`: mappings key by key, anything else in place of what was there."""
    both = isinstance(base, dict) and isinstance(change, dict)
    if not both or RANDOM_VALUES & {*base, *change}:
        return change
    return {**base, **{key: _merge(base.get(key), value) for key, value in change.items()}}


def _fill(value: Any, variables: Mapping[str, Any], where: str) -> Any:
    """`value` with its variables replaced. Raises StanceError where one is unknown or does not fit into words."""
    if isinstance(value, dict):
        return {key: _fill(part, variables, where) for key, part in value.items()}
    if isinstance(value, list):
        return [_fill(part, variables, where) for part in value]
    if not isinstance(value, str):
        return value
    whole = VARIABLE.fullmatch(value)
    if whole:
        return _value(whole, variables, where)

    def as_text(match: re.Match[str]) -> str:
        found = _value(match, variables, where)
        if isinstance(found, dict | list):
            raise StanceError(f"{where}: {match[0]} is a {type(found).__name__}, which does not fit into {value!r}")
        return f"{found:g}" if isinstance(found, float) else str(found)

    return VARIABLE.sub(as_text, value)


def _value(match: re.Match[str], variables: Mapping[str, Any], where: str) -> Any:
    found: Any = variables
    for key in (match[1] or match[2]).split("."):
        if not isinstance(found, Mapping) or key not in found:
            known = ", ".join(f"${name}" for name in variables) or "none, without for"
            raise StanceError(f"{where}: unknown {match[0]}; known are {known}")
        found = found[key]
    return found
