"""Strict YAML: what a file says is used, or is an error that names the file, the key and what is allowed."""

from __future__ import annotations

import math
from collections.abc import Collection
from pathlib import Path
from typing import Any

import yaml

from .errors import StanceError


class _Loader(yaml.SafeLoader):
    """YAML's own rule, which PyYAML does not keep: a key stands once in a mapping."""

    def compose_mapping_node(self, anchor: Any) -> Any:
        node = super().compose_mapping_node(anchor)
        seen = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    raise yaml.constructor.ConstructorError(None, None, f"{key.value} stands twice", key.start_mark)
                seen.add(key.value)
        return node


def parse(text: str, name: str) -> Any:
    """What a YAML text holds; `name` stands in messages. Raises StanceError where it is no YAML, or repeats a key."""
    try:
        return yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        raise StanceError(f"{name} is no YAML: {' '.join(str(error).split())}") from error


def read(path: Path) -> str:
    """A file's text. Raises StanceError where it cannot be read."""
    try:
        return path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise StanceError(f"{path}: {getattr(error, 'strerror', None) or error}") from error


def mapping(value: Any, where: str, required: Collection[str], optional: Collection[str] = ()) -> dict[str, Any]:
    """A mapping with these keys and no others. Raises StanceError naming the key and those that are known."""
    if not isinstance(value, dict):
        raise StanceError(f"{where} is no mapping")
    known = sorted({*required, *optional})
    for key in value:
        if key not in known:
            raise StanceError(f"{where}: unknown key {key}; known are {', '.join(known)}")
    for key in required:
        if key not in value:
            raise StanceError(f"{where}: {key} is missing")
    return value


def sequence(value: Any, where: str) -> list[Any]:
    """A list with something in it. Raises StanceError."""
    if not isinstance(value, list) or not value:
        raise StanceError(f"{where} is {value!r}, but must be a list with at least one entry")
    return value


def text(value: Any, where: str) -> str:
    """Words. Raises StanceError."""
    if not isinstance(value, str) or not value.strip():
        raise StanceError(f"{where} is {value!r}, but must be text")
    return value


def number(value: Any, where: str, lowest: float = -math.inf, highest: float = math.inf) -> float:
    """A finite number in [lowest, highest]. Raises StanceError."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise StanceError(f"{where} is {value!r}, but must be a number")
    if not lowest <= value <= highest:
        raise StanceError(f"{where} is {value!r}, but must be in [{lowest:g}, {highest:g}]")
    return value


def count(value: Any, where: str) -> int:
    """A whole number above 0. Raises StanceError."""
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise StanceError(f"{where} is {value!r}, but must be a whole number above 0")
    return value
