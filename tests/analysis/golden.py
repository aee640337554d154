"""The reference vectors of tests/golden, as the C++ tests read them: $STANCE_GOLDEN_DIR, else the source tree's."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any


def golden_cases(name: str) -> list[dict[str, Any]]:
    """The cases of a file, at least one."""
    directory = Path(os.environ.get("STANCE_GOLDEN_DIR", Path(__file__).parents[1] / "golden"))
    cases: list[dict[str, Any]] = json.loads((directory / name).read_text())["cases"]
    assert cases
    return cases
