"""The README's tables and figure of the force QP, from what `bench_force_qp --json` has written.

`python tests/bench/force_qp_tables.py --plain FILE... --coupled FILE... --readme README.md --figure docs/force-qp.png`.
Records of one engine, motion and horizon are averaged over their seeds; a ratio is of those means.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from stance import style
from stance.errors import StanceError
from stance.style import new_figure, styled

CASES = (("stand", 10), ("stand", 20), ("stand", 50), ("walk", 10), ("walk", 20), ("walk", 50), ("four feet", 20))

OURS = {
    "structured": "`structured`, AVX-512",
    "structured-avx2": "`structured`, AVX2",
    "structured-certified": "`structured` with inspection and check",
    "osqp-condensed": "`osqp-condensed`",
    "osqp-sparse": "`osqp-sparse`",
}
PEERS = {
    "osqp": "OSQP 1.0 alone",
    "daqp": "DAQP 0.11",
    "eiquadprog": "eiquadprog 1.3",
    "qpoases": "qpOASES 3.2",
    "proxqp": "ProxQP 0.8",
    "hpipm": "HPIPM",
    "piqp": "PIQP 0.7, dense",
}
NAMES = {**OURS, **PEERS}
COLOURS = (style.INK, style.MUTED, "#b02a8f", *style.JOINTS, style.PUSH)
PANELS = ("stand", "walk")

Case = tuple[str, int]


@dataclass(frozen=True)
class Result:
    """One engine in one case, over its seeds."""

    median_us: float
    p99_us: float
    max_force_error_N: float
    failures: int
    seeds: int


Results = dict[str, dict[Case, Result]]
"""by engine"""


def read(files: Iterable[Path]) -> Results:
    """Raises StanceError where a file is no list of records of bench_force_qp."""
    records: dict[str, dict[Case, list[dict[str, Any]]]] = {}
    for file in files:
        try:
            for record in json.loads(file.read_text()):
                case = record["case"].rsplit(" ", 1)[0], record["N"]
                records.setdefault(record["engine"], {}).setdefault(case, []).append(record)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise StanceError(f"{file} is not what bench_force_qp --json writes: {error}") from error
    return {
        engine: {
            case: Result(
                float(np.mean([one["median_us"] for one in seeds])),
                float(np.mean([one["p99_us"] for one in seeds])),
                max(one["max_force_error_N"] for one in seeds),
                sum(one["failures"] for one in seeds),
                len(seeds),
            )
            for case, seeds in cases.items()
        }
        for engine, cases in records.items()
    }


def table(results: Results) -> str:
    """Of the cases that there are: median / p99 [us] of each engine, and how much faster ours is than the best peer.

    A dash where an engine was not measured: left out, or given up by the benchmark for more than 1 s a tick.
    """
    cases = [case for case in CASES if case in results.get("structured", {})]
    lines = [
        "| | " + " | ".join(f"{motion} {stages}" for motion, stages in cases) + " | largest error, N | failures |",
        "|---" * (len(cases) + 3) + "|",
    ]
    for engine in (name for name in NAMES if name in results):
        held = [results[engine][case] for case in cases if case in results[engine]]
        cells = [
            f"{_short(results[engine][case].median_us)} / {_short(results[engine][case].p99_us)}"
            if case in results[engine]
            else "–"  # noqa: RUF001
            for case in cases
        ]
        worst = max(result.max_force_error_N for result in held)
        lines.append(f"| {NAMES[engine]} | {' | '.join(cells)} | {worst:.0e} | {sum(r.failures for r in held)} |")
    for ours, words in (("structured", "best peer / ours, AVX-512"), ("structured-avx2", "the same, AVX2")):
        if ours not in results:
            continue
        cells = [f"**{median:.1f} / {p99:.1f}**" for median, p99 in (ratios(results, ours, case) for case in cases)]
        lines.append(f"| {words} | {' | '.join(cells)} | | |")
    return "\n".join(lines)


def ratios(results: Results, ours: str, case: Case) -> tuple[float, float]:
    """Of the best peer's median to ours, and of the best peer's p99 to ours: each the fastest's of its own."""
    peers = [results[name][case] for name in PEERS if case in results.get(name, {})]
    mine = results[ours][case]
    return (
        min(peer.median_us for peer in peers) / mine.median_us,
        min(peer.p99_us for peer in peers) / mine.p99_us,
    )


def _short(us: float) -> str:
    return f"{us:.1f}" if us < 20.0 else f"{us:.0f}"


@styled
def figure(results: Results) -> Figure:
    """Median (line) and p99 (dots above it) against the horizon."""
    drawn = new_figure(9.2, 4.2, "The force QP's engines and their peers", "µs a tick: median, and p99 as dots")
    axes = drawn.subplots(1, len(PANELS), sharex=True, sharey=True)
    for ax, motion in zip(axes, PANELS, strict=True):
        for colour, engine in zip(COLOURS, (name for name in NAMES if name in results), strict=False):
            stages = sorted(stages for kind, stages in results[engine] if kind == motion)
            found = [results[engine][motion, count] for count in stages]
            ours = engine in OURS
            label = NAMES[engine].replace("`", "")
            ax.plot(stages, [one.median_us for one in found], color=colour, lw=1.8 if ours else 1.0, label=label)
            ax.plot(stages, [one.p99_us for one in found], ".", color=colour, ms=5.0 if ours else 3.5)
        ax.set(xscale="log", yscale="log", xlabel="stages N", title=motion)
        counts = sorted({stages for cases in results.values() for kind, stages in cases if kind == motion})
        ax.set_xticks(counts, [str(count) for count in counts])
        ax.minorticks_off()
    axes[0].set_ylabel("µs")
    axes[-1].legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    return drawn


def insert(text: str, name: str, content: str) -> str:
    """`text` with `content` between `<!-- name -->` and `<!-- /name -->`. Raises StanceError where they are not."""
    begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    if text.count(begin) != 1 or text.count(end) != 1:
        raise StanceError(f"there must be one {begin} and one {end} in it")
    head, rest = text.split(begin)
    return f"{head}{begin}\n{content}\n{end}{rest.split(end)[1]}"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plain", nargs="+", type=Path, required=True, help="of the document's model")
    parser.add_argument("--coupled", nargs="+", type=Path, required=True, help="with coupling and terminal P")
    parser.add_argument("--readme", type=Path, help="the file between whose marks the tables go, else to stdout")
    parser.add_argument("--figure", type=Path, help="a .png of time against N, of the plain model")
    options = parser.parse_args(arguments)
    try:
        plain, coupled = read(options.plain), read(options.coupled)
        tables = {"force-qp": table(plain), "force-qp-coupled": table(coupled)}
        if options.readme is None:
            print("\n\n".join(tables.values()))
        else:
            text = options.readme.read_text()
            for name, content in tables.items():
                text = insert(text, name, content)
            options.readme.write_text(text)
        if options.figure is not None:
            options.figure.write_bytes(style.render(figure(plain)))
    except StanceError as error:
        sys.exit(f"force_qp_tables: {error}")


if __name__ == "__main__":
    main()
