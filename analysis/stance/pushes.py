"""What trials were pushed with: their scenario as it was drawn, and the impulse and direction of its one push."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .study import RANDOM_VALUES

CHOSEN = re.compile(r"choice\[(\d+)\]")  # what stands for a list or a mapping that was drawn, counted from 1


@dataclass(frozen=True)
class PushTrial:
    """A trial with one push."""

    seed: int
    impulse: float
    """N s, horizontal"""
    direction: float
    """rad, in -pi..pi"""
    succeeded: bool


def drawn_scenario(node: Any, drawn: Mapping[str, Any], path: str = "") -> Any:
    """A scenario with the values that a rollout tells as `drawn` (path → value) in place of what they are drawn from.

    Paths as sim/random_values.hpp has them: pushes[1].impulse, counted from 1.
    """
    if isinstance(node, dict):
        if RANDOM_VALUES & set(node):
            value = drawn[path]
            chosen = CHOSEN.fullmatch(value) if isinstance(value, str) else None
            return drawn_scenario(node["choice"][int(chosen[1]) - 1], drawn, f"{path}.{value}") if chosen else value
        return {key: drawn_scenario(part, drawn, f"{path}.{key}".lstrip(".")) for key, part in node.items()}
    if isinstance(node, list):
        return [drawn_scenario(part, drawn, f"{path}[{place}]") for place, part in enumerate(node, 1)]
    return node


def has_one_push(scenario: Mapping[str, Any]) -> bool:
    """Whether trials of this scenario belong on a map."""
    pushes = scenario.get("pushes")
    return isinstance(pushes, list) and len(pushes) == 1


def push_of(scenario: Mapping[str, Any]) -> tuple[float, float]:
    """(impulse [N s], direction [rad]), horizontal, of the one push of a scenario as it was drawn."""
    (push,) = scenario["pushes"]
    if "force_W" in push:
        x, y = (float(push["duration"]) * float(component) for component in push["force_W"][:2])
        return float(np.hypot(x, y)), float(np.arctan2(y, x))
    turned = float(push["direction"])
    return float(push["impulse"]), float(np.arctan2(np.sin(turned), np.cos(turned)))
