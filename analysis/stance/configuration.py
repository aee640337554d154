"""What a run's log says of its robot: the URDF and the YAML that stand in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from .series import Run
from .urdf import Robot, parse_urdf


def configuration(run: Run) -> dict[str, Any]:
    """The robot's YAML as the controller read it, else as the simulator did; empty where the log has none."""
    for info in (run.controller, run.simulator):
        if info is not None and info.configuration:
            try:
                found = yaml.safe_load(info.configuration)
            except yaml.YAMLError:
                continue
            if isinstance(found, dict):
                return found
    return {}


def value(run: Run, path: str) -> Any:
    """What stands at a dotted path of the configuration, as controller.force_qp.friction; None where nothing does."""
    return _at(configuration(run), path)


def scenario_value(run: Run, path: str) -> Any:
    """The same of the scenario as it was drawn, as sensors.noise."""
    text = run.simulator.scenario if run.simulator is not None else ""
    try:
        return _at(yaml.safe_load(text), path)
    except yaml.YAMLError:
        return None


def _at(found: Any, path: str) -> Any:
    for key in path.split("."):
        found = found.get(key) if isinstance(found, dict) else None
    return found


def has_noisy_sensors(run: Run) -> bool:
    """Whether the log says that the simulator's sensors had noise."""
    return isinstance(scenario_value(run, "sensors.noise"), dict)


def friction(run: Run, walking: bool = False) -> float | None:
    """mu that the controller plans with while it stands, or while it has a gait."""
    paths = (["controller.walk.friction"] if walking else []) + ["controller.force_qp.friction"]
    return next((float(mu) for path in paths if isinstance(mu := value(run, path), int | float)), None)


def friction_text(run: Run) -> str:
    """The same for people, as "µ = 0.55, walking 0.45"; empty where the log does not say."""
    standing, walking = friction(run), friction(run, walking=True)
    if standing is None:
        return ""
    return f"µ = {standing:g}" if walking in (None, standing) else f"µ = {standing:g}, walking {walking:g}"


def robot(run: Run) -> Robot | None:
    """The robot's body, its joints in the order of every joint vector; None where the log has no URDF."""
    for info in (run.controller, run.simulator):
        if info is not None and info.urdf:
            names = configuration(run).get("joints")
            return parse_urdf(info.urdf, tuple(names) if names else None)
    return None


def foot_names(run: Run, count: int) -> list[str]:
    """Names of the contacts for people: left and right where there are two, else those of the configuration."""
    if count == 2:
        return ["left", "right"]
    names = configuration(run).get("feet") or []
    return [str(names[i]) if i < len(names) else f"contact {i}" for i in range(count)]


def option(words: str, name: str) -> str | None:
    """What follows an option such as --scenario on a command line."""
    found = words.split()
    return found[found.index(name) + 1] if name in found[:-1] else None


def run_option(run: Run, name: str) -> str | None:
    """The same on the simulator's (or the rollout's) command line."""
    infos = [info for info in (run.simulator, run.controller) if info is not None]
    return next((found for info in infos if (found := option(info.options, name)) is not None), None)


def title(run: Run) -> str:
    """Robot and scenario, for headings."""
    info = run.controller or run.simulator
    name = info.robot if info is not None else "robot"
    chosen = scenario_name(run)
    return f"{name}, {chosen}" if chosen else name


def scenario_name(run: Run) -> str:
    """Of the scenario that ran, without path and suffix; empty where the log does not say."""
    return Path(run_option(run, "--scenario") or "").stem
