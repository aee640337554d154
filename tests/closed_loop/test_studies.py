"""The biped's studies are such as the programs take: a typing error must not wait for the hour that they take."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from stance.programs import SOURCE_TREE, find_program
from stance.study import load_study

STUDIES = sorted(path.stem for path in (SOURCE_TREE / "sim/scenarios/biped/studies").glob("*.yaml"))


@pytest.mark.parametrize("study", STUDIES)
def test_every_cell_starts(study: str, tmp_path: Path) -> None:
    for cell in load_study(study, "biped").cells:
        path = tmp_path / "cell.yaml"
        path.write_text(cell.scenario)
        words = [str(find_program("stance-rollout")), "--robot", "biped", "--scenario", str(path), "--duration", "0.01"]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{cell.name}: {done.stderr}"
