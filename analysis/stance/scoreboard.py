"""What studies came to, kept: a small JSON file that is committed, and the README's table, which is drawn from it."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .campaign import Outcome, told_verdicts
from .check import quantity
from .errors import StanceError
from .plain import counted

SCHEMA = {"schema": "stance.studies", "version": 1}
DEFAULT_ROBOT = "biped"  # of `stance campaign`
DIGITS = 4  # of what is kept: more would only make noise between two runs
BEGIN, END = "<!-- studies -->", "<!-- /studies -->"
HEAD = ("", "succeeded", "95% interval", "asked", "median, worst (asked)", "`stance campaign` with")


def keep(path: Path, outcomes: Iterable[Outcome]) -> dict[str, Any]:
    """Writes outcomes into the file, each in place of the same study's earlier one; returns what it holds then.

    Raises StanceError where the file is there and is no such file.
    """
    studies = {study["study"]: study for study in load(path)["studies"]} if path.exists() else {}
    for outcome in outcomes:
        studies[outcome.study] = _small(outcome)
    document = {**SCHEMA, "studies": list(studies.values())}
    path.write_text(_text(document) + "\n")
    return document


def _text(document: dict[str, Any]) -> str:
    """JSON with a line for each cell, so that two versions compare cell by cell."""

    def line(value: Any) -> str:
        return json.dumps(value, ensure_ascii=False)

    def mapping(one: dict[str, Any], last: str, entries: list[str], indent: str) -> str:
        head = ", ".join(f"{line(key)}: {line(value)}" for key, value in one.items() if key != last)
        body = f",\n{indent}".join(entries)
        return f"{{{head}, {line(last)}: [\n{indent}{body}]}}"

    studies = [mapping(one, "cells", [line(cell) for cell in one["cells"]], "  ") for one in document["studies"]]
    return mapping(document, "studies", studies, " ")


def load(path: Path) -> dict[str, Any]:
    """What `keep` wrote. Raises StanceError."""
    try:
        document = json.loads(path.read_text())
        good = {key: document[key] for key in SCHEMA} == SCHEMA
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise StanceError(f"{path} cannot be read as kept studies: {error}") from error
    if not good:
        raise StanceError(f"{path} holds no kept studies of version {SCHEMA['version']}: remove it, and run them again")
    return dict(document)


def _small(outcome: Outcome) -> dict[str, Any]:
    """Without what is this machine's own, and without each failure."""

    def rounded(value: float | None) -> float | None:
        return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value

    return {
        "study": outcome.study,
        "title": outcome.title,
        "robot": outcome.robot,
        "seed": outcome.seed,
        "program": outcome.program[:12],
        "tick_cpu": {key: rounded(value) for key, value in asdict(outcome.tick_cpu).items()},
        "qp_iterations_max": outcome.qp_iterations_max,
        "cells": [
            {
                "name": cell.name,
                "trials": cell.trials,
                "succeeded": cell.succeeded,
                "fell": cell.fell,
                "interval": [rounded(bound) for bound in cell.interval],
                "asked": cell.asked,
                "met": cell.met,
                "verdicts": cell.verdicts,
                "figures": [
                    {
                        "name": one.name,
                        "unit": one.unit,
                        "rule": one.rule,
                        "failed": one.failed,
                        "median": rounded(one.median),
                        "worst": rounded(one.worst),
                    }
                    for one in cell.figures
                ],
            }
            for cell in outcome.cells
        ],
    }


def table(document: dict[str, Any]) -> str:
    """Markdown of what `keep` wrote: a row for each cell."""
    rows = [HEAD, ("---",) * len(HEAD)]
    for study in document["studies"]:
        rows.append((f"**{study['title']}**", "", "", "", _ticks(study), ""))
        for cell in study["cells"]:
            low, high = cell["interval"]
            asked = f"{cell['asked']}, {'met' if cell['met'] else 'not met'}" if cell["asked"] else "stated"
            robot = "" if study["robot"] == DEFAULT_ROBOT else f"--robot {study['robot']} "
            words = f"{robot}--study {study['study']} --trials {cell['trials']} --seed {study['seed']}"
            rows.append(
                (
                    cell["name"],
                    f"{cell['succeeded']}/{cell['trials']}",
                    f"{low:.2f} to {high:.2f}",
                    asked,
                    "; ".join(filter(None, [*map(_figure, cell["figures"]), told_verdicts(cell.get("verdicts", {}))])),
                    f"`{words}`",
                )
            )
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _ticks(study: dict[str, Any]) -> str:
    """The tick's CPU and the QP's iterations over a study for people; "-" where what is kept is older than they are."""
    if "tick_cpu" not in study:
        return "-"
    times = " / ".join(f"{study['tick_cpu'][key]:,.0f}" for key in ("p50_us", "p99_us", "p99_9_us", "max_us"))
    most = study["qp_iterations_max"]
    return f"ticks: {times} µs" + ("" if most is None else f", at most {counted(most, 'QP iteration')}")


def _figure(one: dict[str, Any]) -> str:
    """A limit's figure for people; empty where it is no number and every trial kept to it."""
    past = f"{one['failed']} not" if one["failed"] else ""
    if one["median"] is None:
        return f"{one['name']} {one['rule']}: {past}" if past else ""
    told = f"{one['name']} {quantity(one['median'], one['unit'])}, {quantity(one['worst'], one['unit'])}"
    return f"{told} ({one['rule']}{f': {past}' if past else ''})"


def insert(path: Path, text: str) -> None:
    """Puts a table between a Markdown file's marks, in place of what is there. Raises StanceError without marks."""
    before, after = around(path)
    path.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}")


def around(path: Path) -> tuple[str, str]:
    """What stands before and after a Markdown file's marks. Raises StanceError without them."""
    before, begin, rest = path.read_text().partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise StanceError(f"{path}: put {BEGIN} and {END} on lines of their own, where the table is to stand")
    return before, after
