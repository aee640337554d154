"""A verdict: the figures of a run against a list of limits.

A list of limits is YAML, strict: an unknown key is an error that names it.

    limits:
      - {name: largest trunk tilt, metric: trunk.tilt_max_deg, unit: deg, max: 10.0}
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from .errors import StanceError

BOUNDS = ("max", "min", "equals")
SHARE = "share"  # a unit: of 1, told as a percentage
UNITS = {"us": " µs", "deg": "°"}  # for people
KEYS = {"name", "metric", "unit", "optional", "machine", *BOUNDS}
DIRECTORY = Path(__file__).parent / "limits"


@dataclass(frozen=True)
class Limit:
    name: str
    metric: str
    """dotted path into `Metrics.as_dict()`"""
    bound: str
    """one of BOUNDS"""
    value: float | bool | str
    unit: str = ""
    optional: bool = False
    """passes where the log does not give the figure"""
    machine: bool = False
    """of the machine that it ran on: told where it is missed, and no reason to fail a run"""


@dataclass(frozen=True)
class Finding:
    """One limit, judged."""

    limit: Limit
    value: Any
    """None where the log does not give it"""
    passed: bool

    @property
    def rule(self) -> str:
        """The limit for people, as "≤ 10 deg"."""
        sign = {"max": "≤ ", "min": "≥ ", "equals": "= "}[self.limit.bound]
        return sign + quantity(self.limit.value, self.limit.unit)

    @property
    def measured(self) -> str:
        """The figure for people."""
        return "not in the log" if self.value is None else quantity(self.value, self.limit.unit)


@dataclass(frozen=True)
class Verdict:
    findings: list[Finding]
    source: str
    """the list of limits"""

    @property
    def passed(self) -> bool:
        return not self.violated

    @property
    def violated(self) -> list[Finding]:
        return [finding for finding in self.findings if not finding.passed and not finding.limit.machine]

    @property
    def slow(self) -> list[Finding]:
        """What the machine did not keep up with."""
        return [finding for finding in self.findings if not finding.passed and finding.limit.machine]

    def as_dict(self) -> dict[str, Any]:
        return {
            "passed": self.passed,
            "limits": self.source,
            "findings": [
                {
                    "name": finding.limit.name,
                    "metric": finding.limit.metric,
                    "value": finding.value,
                    finding.limit.bound: finding.limit.value,
                    "unit": finding.limit.unit,
                    "passed": finding.passed,
                }
                for finding in self.findings
            ],
        }

    def as_text(self) -> str:
        lines = [
            f"{self._mark(finding)} {finding.limit.name:<40} {finding.measured:>18}   {finding.rule}"
            for finding in self.findings
        ]
        kept = len(lines) - len(self.violated) - len(self.slow)
        verdict = f"PASS: {kept} limits kept" if self.passed else f"FAIL: {len(self.violated)} of {len(lines)}"
        if self.slow:
            verdict += f"; this machine was too slow for {len(self.slow)}"
        return "\n".join([*lines, verdict])

    @staticmethod
    def _mark(finding: Finding) -> str:
        if finding.passed:
            return "ok  "
        return "slow" if finding.limit.machine else "FAIL"


def judge(metrics: Mapping[str, Any], limits: list[Limit], source: str = "") -> Verdict:
    """Judges `Metrics.as_dict()`. Raises StanceError where a limit names a figure that no run has."""
    return Verdict([_judge(metrics, limit) for limit in limits], source)


def _judge(metrics: Mapping[str, Any], limit: Limit) -> Finding:
    found: Any = metrics
    for key in limit.metric.split("."):
        if found is None:
            break  # a section that this log does not give
        if not isinstance(found, Mapping) or key not in found:
            raise StanceError(f"limit {limit.name!r}: no figure {limit.metric!r} in a summary")
        found = found[key]
    if found is None:
        return Finding(limit, None, limit.optional)
    if limit.bound == "equals":
        return Finding(limit, found, found == limit.value)
    if isinstance(found, bool) or not isinstance(found, int | float):
        raise StanceError(f"limit {limit.name!r}: {limit.metric} is no number")
    bound = float(limit.value)
    return Finding(limit, found, found <= bound if limit.bound == "max" else found >= bound)


def parse_limits(text: str, name: str) -> list[Limit]:
    """Reads a list of limits; `name` stands in messages. Raises StanceError naming the entry and the key."""
    try:
        document = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise StanceError(f"{name} is no YAML: {' '.join(str(error).split())}") from error
    if not isinstance(document, dict) or set(document) != {"limits"} or not isinstance(document["limits"], list):
        raise StanceError(f"{name}: must hold one key, limits, with a list")
    return [_limit(entry, f"{name}: limits[{i}]") for i, entry in enumerate(document["limits"])]


def _limit(entry: Any, where: str) -> Limit:
    if not isinstance(entry, dict):
        raise StanceError(f"{where} is no mapping")
    unknown = [str(key) for key in entry if key not in KEYS]
    missing = [key for key in ("name", "metric") if key not in entry]
    bounds = [key for key in BOUNDS if key in entry]
    if unknown:
        raise StanceError(f"{where}: unknown key {unknown[0]}; known are {', '.join(sorted(KEYS))}")
    if missing:
        raise StanceError(f"{where}: {missing[0]} is missing")
    if len(bounds) != 1:
        raise StanceError(f"{where}: give one of {', '.join(BOUNDS)}")
    value = entry[bounds[0]]
    if bounds[0] != "equals" and (isinstance(value, bool) or not isinstance(value, int | float)):
        raise StanceError(f"{where}: {bounds[0]} is {value!r}, but must be a number")
    return Limit(
        name=str(entry["name"]),
        metric=str(entry["metric"]),
        bound=bounds[0],
        value=value,
        unit=str(entry.get("unit", "")),
        optional=bool(entry.get("optional", False)),
        machine=bool(entry.get("machine", False)),
    )


def limits_file(robot: str, scenario: str) -> Path:
    """The list that comes with this package for a robot and scenario, else for any."""
    own = DIRECTORY / f"{robot}_{scenario}.yaml"
    return own if own.is_file() else DIRECTORY / "default.yaml"


def load_limits(path: Path) -> list[Limit]:
    """Reads a list of limits from a file. Raises StanceError."""
    try:
        text = path.read_text()
    except OSError as error:
        raise StanceError(f"{path}: {error.strerror or error}") from error
    return parse_limits(text, path.name)


def quantity(value: Any, unit: str) -> str:
    """A figure for people, the same in the verdict, the card and the report: 3 digits, lengths below 0.1 m in mm."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, int | float):
        return str(value)
    if unit == SHARE:
        value, unit = 100.0 * value, "%"
    elif unit in ("m", "m/s") and abs(value) < 0.1:
        value, unit = 1000.0 * value, f"m{unit}"
    number = f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}" if isinstance(value, float) else str(value)
    return f"{number}{UNITS.get(unit, f' {unit}')}".rstrip()
