"""The installed libraries and programs serve another project."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import lcm
import pytest
from stance.programs import SOURCE_TREE

BUILD = SOURCE_TREE / "build/release"


def run(*words: str | Path, **environment: str) -> str:
    done = subprocess.run(
        [str(word) for word in words], env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    where = tmp_path_factory.mktemp("install")
    run("cmake", "--install", BUILD, "--prefix", where)
    return where


def test_another_project_finds_links_and_runs_the_libraries(prefix: Path, tmp_path: Path) -> None:
    wheel = Path(lcm.__file__).parents[1]
    source = SOURCE_TREE / "tests/contract/consumer"
    run("cmake", "-S", source, "-B", tmp_path, "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={prefix};{wheel}")
    run("cmake", "--build", tmp_path)
    assert run(tmp_path / "consumer", STANCE_SHARE=str(prefix / "share/stance")) == "13.200000\n"


def test_installed_programs_find_the_installed_robots(prefix: Path) -> None:
    words = ["--robot", "biped", "--scenario", "stand", "--duration", "0.5"]
    said = run(prefix / "bin/stance-rollout", *words, STANCE_SHARE=str(prefix / "share/stance"))
    assert said.startswith("no fall in 0.5 s")
