"""A verdict: the figures of a run against a list of limits.

A list of limits is YAML, strict: an unknown key is an error that names it.

    limits:
      - {name: largest trunk tilt, metric: trunk.tilt_max_deg, unit: deg, max: 10.0}
      - {name: speed, metric: segments.1.velocity.0, unit: m/s, within: 0.05, of: segments.1.wanted_velocity.0}

`within` is a share of what it is `of`, a number or another figure. A part of a dotted path that is a number counts in a
list from 0.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import strict
from .errors import StanceError

BOUNDS = ("max", "min", "equals", "within")
SHARE = "share"  # a unit: of 1, told as a percentage
UNITS = {"us": " µs", "deg": "°"}  # for people
KEYS = {"unit", "optional", "machine", "of", *BOUNDS}  # besides those that every limit has
DIRECTORY = Path(__file__).parent / "limits"


@dataclass(frozen=True)
class Limit:
    name: str
    metric: str
    """dotted path into the figures, as those of `Metrics.as_dict()`"""
    bound: str
    """one of BOUNDS"""
    value: float | bool | str
    unit: str = ""
    optional: bool = False
    """passes where the log does not give the figure"""
    machine: bool = False
    """of the machine that it ran on: told where it is missed, and no reason to fail a run"""
    of: float | str | None = None
    """what `within` is a share of: a number, or the dotted path of another figure"""

    @property
    def rule(self) -> str:
        """For people, as "≤ 10 deg"."""
        if self.bound == "within":
            of = self.of if isinstance(self.of, str) else quantity(self.of, self.unit)
            return f"within {quantity(self.value, SHARE)} of {of}"
        sign = {"max": "≤ ", "min": "≥ ", "equals": "= "}[self.bound]
        return sign + quantity(self.value, self.unit)


@dataclass(frozen=True)
class Finding:
    """One limit, judged."""

    limit: Limit
    value: Any
    """None where the log does not give it"""
    passed: bool
    of: float | None = None
    """what the limit's `of` came to"""

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
                    **({} if finding.limit.of is None else {"of": finding.limit.of}),
                    "unit": finding.limit.unit,
                    "passed": finding.passed,
                }
                for finding in self.findings
            ],
        }

    def as_text(self) -> str:
        lines = [
            f"{self._mark(finding)} {finding.limit.name:<40} {finding.measured:>18}   {finding.limit.rule}"
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


def _judge(figures: Mapping[str, Any], limit: Limit) -> Finding:
    found = figure(figures, limit.metric, f"limit {limit.name!r}")
    if found is None:
        return Finding(limit, None, limit.optional)
    if limit.bound == "equals":
        return Finding(limit, found, found == limit.value)
    value = _number(found, limit.metric, limit)
    bound = float(limit.value)
    if limit.bound == "within":
        of = figure(figures, limit.of, f"limit {limit.name!r}") if isinstance(limit.of, str) else limit.of
        if of is None:
            return Finding(limit, found, limit.optional)
        of = _number(of, str(limit.of), limit)
        return Finding(limit, found, abs(value - of) <= bound * abs(of), of)
    return Finding(limit, found, value <= bound if limit.bound == "max" else value >= bound)


def _number(found: Any, metric: str, limit: Limit) -> float:
    if isinstance(found, bool) or not isinstance(found, int | float):
        raise StanceError(f"limit {limit.name!r}: {metric} is no number")
    return found


def figure(figures: Mapping[str, Any], metric: str, where: str) -> Any:
    """What stands at a dotted path; None in a section that is None or past a list's end.

    Raises StanceError where there is no such path.
    """
    found: Any = figures
    for key in metric.split("."):
        if found is None:
            return None  # a section that this log does not give
        if isinstance(found, Mapping) and key in found:
            found = found[key]
        elif isinstance(found, list | tuple) and key.isdecimal():
            found = found[int(key)] if int(key) < len(found) else None  # a run that ended earlier
        else:
            raise StanceError(f"{where}: no figure {metric!r} in a summary")
    return found


def parse_limits(text: str, name: str) -> list[Limit]:
    """Reads a list of limits; `name` stands in messages. Raises StanceError naming the entry and the key."""
    document = strict.mapping(strict.parse(text, name), name, ("limits",))
    return limits_of(document["limits"], f"{name}: limits")


def limits_of(entries: Any, where: str) -> list[Limit]:
    """Limits from a list that stands in any file. Raises StanceError likewise; `where` stands in its messages."""
    if not isinstance(entries, list):
        raise StanceError(f"{where} is {entries!r}, but must be a list")
    return [_limit(entry, f"{where}[{i}]") for i, entry in enumerate(entries)]


def _limit(entry: Any, where: str) -> Limit:
    strict.mapping(entry, where, ("name", "metric"), KEYS)
    bounds = [key for key in BOUNDS if key in entry]
    if len(bounds) != 1:
        raise StanceError(f"{where}: give one of {', '.join(BOUNDS)}")
    if (bounds[0] == "within") != ("of" in entry):
        raise StanceError(f"{where}: within and of go together")
    value, of = entry[bounds[0]], entry.get("of")
    if bounds[0] != "equals":
        strict.number(value, f"{where}: {bounds[0]}")
    if not isinstance(of, str | None):
        strict.number(of, f"{where}: of")
    return Limit(
        name=str(entry["name"]),
        metric=str(entry["metric"]),
        bound=bounds[0],
        value=value,
        unit=str(entry.get("unit", "")),
        optional=bool(entry.get("optional", False)),
        machine=bool(entry.get("machine", False)),
        of=of,
    )


def limits_file(robot: str, scenario: str) -> Path:
    """The list that comes with this package for a robot and scenario, else for any."""
    own = DIRECTORY / f"{robot}_{scenario}.yaml"
    return own if own.is_file() else DIRECTORY / "default.yaml"


def load_limits(path: Path) -> list[Limit]:
    """Reads a list of limits from a file. Raises StanceError."""
    return parse_limits(strict.read(path), path.name)


def quantity(value: Any, unit: str) -> str:
    """A figure for people, the same everywhere: 3 digits, lengths below 0.1 m in mm, angles above 0.02 rad in deg."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, int | float):
        return str(value)
    if unit == SHARE:
        value, unit = 100.0 * value, "%"
    elif unit == "rad":
        value, unit = (math.degrees(value), "deg") if abs(value) >= 0.02 else (1000.0 * value, "mrad")
    elif unit in ("m", "m/s") and abs(value) < 0.1:
        value, unit = 1000.0 * value, f"m{unit}"
    number = f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}" if isinstance(value, float) else str(value)
    return f"{number}{UNITS.get(unit, f' {unit}')}".rstrip()
