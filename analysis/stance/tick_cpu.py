"""What the controller's ticks took of the CPU, over many rollouts: the counts of `stance-rollout --json`, added up.

Each rollout counts its ticks on the same logarithmic grid: bin i goes from first_edge · 10^(i / bins_per_decade) to the
next one's edge; the first and the last bin take what lies beyond (rollout/summary.hpp). A percentile of the sum is
known to a bin, which is 12% wide: it is told as the bin's upper edge, never above the longest tick, which is known.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .errors import RunError

GRID = ("first_edge_us", "bins_per_decade")


@dataclass(frozen=True)
class TickCpu:
    """CPU time [us] of every tick of some rollouts."""

    ticks: int
    p50_us: float
    p99_us: float
    p99_9_us: float
    max_us: float


def merge(told: Iterable[Mapping[str, Any]]) -> TickCpu:
    """Of the `tick_cpu` of at least one rollout. Raises RunError where they do not share a grid or hold no tick."""
    rollouts = list(told)
    grids = {(*(one[key] for key in GRID), len(one["counts"])) for one in rollouts}
    if len(grids) != 1:
        raise RunError(f"the rollouts counted their ticks on {len(grids)} grids, which do not add up: {sorted(grids)}")
    ((first, per_decade, bins),) = grids
    total = np.sum([one["counts"] for one in rollouts], axis=0).cumsum()
    ticks, longest = int(total[-1]), float(max(one["max_us"] for one in rollouts))
    if ticks == 0:
        raise RunError("the rollouts told of no tick")

    def percentile(share: float) -> float:
        place = int(np.searchsorted(total, share * ticks))
        return longest if place == bins - 1 else min(longest, first * 10.0 ** ((place + 1) / per_decade))

    return TickCpu(ticks, percentile(0.5), percentile(0.99), percentile(0.999), longest)
