"""Results as text: JSON that every reader takes, and counts in words."""

from __future__ import annotations

import json
import math
from typing import Any


def counted(count: int, noun: str) -> str:
    """As in "1 gap" and "2 gaps"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def to_json(document: Any) -> str:
    """Where a number is not finite, null stands in its place, and `not_finite` says by its path what it was."""
    not_finite: dict[str, str] = {}
    plain = _plain(document, "", not_finite)
    return json.dumps({**plain, "not_finite": not_finite} if not_finite else plain, indent=2, allow_nan=False)


def _plain(value: Any, path: str, not_finite: dict[str, str]) -> Any:
    if isinstance(value, dict):
        return {key: _plain(part, f"{path}.{key}".lstrip("."), not_finite) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part, f"{path}.{place}", not_finite) for place, part in enumerate(value)]
    if isinstance(value, float) and not math.isfinite(value):
        not_finite[path] = str(value)
        return None
    return value
