"""Ticks of many rollouts, added up on the grid that they share."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from stance.errors import RunError
from stance.tick_cpu import TickCpu, merge

BINS_PER_DECADE = 20
BINS = 101


def told(times: np.ndarray, **more: Any) -> dict[str, Any]:
    """As stance-rollout tells of ticks that took so long [us]."""
    bins = np.clip(np.floor(BINS_PER_DECADE * np.log10(times)).astype(int), 0, BINS - 1)
    counts = np.bincount(bins, minlength=BINS).tolist()
    longest = float(times.max(initial=0.0))
    return {
        "max_us": longest,
        "first_edge_us": 1,
        "bins_per_decade": BINS_PER_DECADE,
        "counts": counts,
        **more,
    }


@pytest.mark.parametrize("seed", range(5))
def test_percentiles_of_the_sum_are_those_of_all_ticks_to_a_bin_and_never_below_them(seed: int) -> None:
    random = np.random.default_rng(seed)
    times = [random.lognormal(4.0 + part, 0.8, 700 * (part + 1)) + 1.0 for part in range(3)]
    together = np.concatenate(times)
    found = merge(map(told, times))
    assert (found.ticks, found.max_us) == (len(together), together.max())
    for share, value in ((0.5, found.p50_us), (0.99, found.p99_us), (0.999, found.p99_9_us)):
        exact = np.percentile(together, 100.0 * share, method="inverted_cdf")
        assert exact <= value <= exact * 10.0 ** (1.0 / BINS_PER_DECADE)


def test_no_percentile_is_above_the_longest_tick_nor_below_what_lies_beyond_the_grid() -> None:
    assert merge([told(np.full(3, 80.0))]) == TickCpu(3, 80.0, 80.0, 80.0, 80.0)
    beyond = merge([told(np.array([50.0, 2.5e5, 3.0e5]))])
    assert (beyond.p99_us, beyond.max_us) == (3.0e5, 3.0e5)


def test_counts_on_two_grids_or_of_no_tick_do_not_add_up() -> None:
    times = np.array([10.0])
    with pytest.raises(RunError, match="2 grids"):
        merge([told(times), told(times, bins_per_decade=10)])
    with pytest.raises(RunError, match="no tick"):
        merge([told(np.array([]))])
