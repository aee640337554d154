"""What set-up says where it cannot go on, and the version that it installs."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import stance
from stance.programs import SOURCE_TREE


def test_without_root_or_sudo_one_line_names_the_packages_and_the_remedy(tmp_path: Path) -> None:
    shutil.copytree(SOURCE_TREE / "setup", tmp_path / "setup")
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in ("bash", "cat", "dirname", "env", "mkdir"):
        (programs / name).symlink_to(shutil.which(name) or name)
    for name, body in (("id", "echo 1000"), ("dpkg-query", "exit 1"), ("dpkg", "exit 0"), ("apt-get", "exit 0")):
        (programs / name).write_text(f"#!/bin/sh\n{body}\n")
        (programs / name).chmod(0o755)
    (programs / "sh").symlink_to("/bin/sh")
    done = subprocess.run(
        ["bash", str(tmp_path / "setup/setup.sh")],
        env={"PATH": str(programs)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr.startswith("setup: needs root to install ")
    assert "cmake" in done.stderr and "install sudo" in done.stderr
    assert done.stderr.count("\n") == 1


def test_the_libraries_and_the_python_package_are_of_one_version() -> None:
    found = re.search(r"project\(stance VERSION (\S+)", (SOURCE_TREE / "CMakeLists.txt").read_text())
    assert found is not None and found[1] == stance.__version__
