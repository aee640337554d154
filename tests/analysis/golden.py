"""The reference vectors of tests/golden, as the C++ tests read them: $STANCE_GOLDEN_DIR, else the source tree's."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any


def load(name: str) -> dict[str, Any]:
    """The whole file."""
    directory = Path(os.environ.get("STANCE_GOLDEN_DIR", Path(__file__).parents[1] / "golden"))
    content: dict[str, Any] = json.loads((directory / name).read_text())
    return content


def golden_cases(name: str) -> list[dict[str, Any]]:
    """The cases of a file, at least one."""
    cases: list[dict[str, Any]] = load(name)["cases"]
    assert cases
    return cases
