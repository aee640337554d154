"""Where the other programs are: the project's own (C++), and LCM's tools from its wheel."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from .errors import MissingError

SOURCE_TREE = Path(__file__).resolve().parents[2]


def share_directory() -> Path:
    """Where robots/ and sim/scenarios/ are: $STANCE_SHARE, else the source tree."""
    return Path(os.environ.get("STANCE_SHARE", SOURCE_TREE))


def find_program(name: str) -> Path:
    """A program of this project: below $STANCE_BIN_DIR, else the source tree's release build, else on PATH.

    Raises MissingError saying where it was looked for.
    """
    chosen = os.environ.get("STANCE_BIN_DIR")
    directories = [Path(chosen)] if chosen else [SOURCE_TREE / "build/release/bin"]
    for directory in directories:
        if os.access(directory / name, os.X_OK):
            return directory / name
    on_path = None if chosen else shutil.which(name)
    if on_path is None:
        where = f"in $STANCE_BIN_DIR ({chosen})" if chosen else "in build/release/bin nor on PATH"
        raise MissingError(f"{name} is not {where}: build the project, or set STANCE_BIN_DIR to where it is")
    return Path(on_path)


def mortal(command: Sequence[str]) -> list[str]:
    """The command line of a program that the kernel interrupts where this process dies without ending it."""
    setpriv = shutil.which("setpriv")
    return [setpriv, "--pdeathsig", "INT", "--", *command] if setpriv else list(command)


def find_lcm_tool(name: str) -> Path:
    """A tool of LCM itself, such as lcm-logger: the wheel's real binary, since its wrapper script passes no signal on.

    Raises MissingError.
    """
    import lcm

    path = Path(lcm.__file__).parents[1] / "bin" / name
    if not os.access(path, os.X_OK):
        raise MissingError(f"{name} is not in the installed lcm package: pip install lcm==1.5.3")
    return path
