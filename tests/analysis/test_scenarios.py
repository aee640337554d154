"""The biped's scenarios among each other."""

from __future__ import annotations

from typing import Any

import pytest
import yaml
from stance.programs import SOURCE_TREE

DIRECTORY = SOURCE_TREE / "sim/scenarios/biped"


def loaded(name: str) -> Any:
    return yaml.safe_load((DIRECTORY / f"{name}.yaml").read_text())


@pytest.mark.parametrize("path", sorted(DIRECTORY.glob("*_noisy.yaml")), ids=lambda path: path.stem)
def test_a_noisy_scenario_is_its_noise_free_one_with_the_default_noise(path: Any) -> None:
    noisy, clean = loaded(path.stem), loaded(path.stem.removesuffix("_noisy"))
    assert clean["sensors"]["noise"] == "none"
    assert noisy["sensors"].pop("noise") == loaded("demo")["sensors"]["noise"]
    del clean["sensors"]["noise"]
    assert noisy == clean
