"""The message types of lcmtypes/, as numpy reads them: which channel carries which, and the dtype of each."""

from __future__ import annotations

import functools
import importlib
import pkgutil
from dataclasses import dataclass
from typing import Any

import numpy as np

from .errors import MissingError

CHANNELS = {
    "ROBOT_STATE": "robot_state_t",
    "TRUTH": "truth_t",
    "USER_COMMAND": "user_command_t",
    "STOP": "stop_t",
    "PUSH": "push_t",
    "JOINT_COMMAND": "joint_command_t",
    "FORCE_PLAN": "force_plan_t",
    "ARM3_MOTION": "arm3_motion_t",
    "CALIBRATION_POINTS": "calibration_points_t",
    "BALL_OBSERVATION": "ball_observation_t",
    "BALL_TRUTH": "ball_truth_t",
    "BALL_ESTIMATE": "ball_estimate_t",
    "CATCH_PLAN": "catch_plan_t",
    "CONTROLLER_TRACE": "controller_trace_t",
    "CONTROLLER_TIMING": "controller_timing_t",
    "TICK_INPUT": "tick_input_t",
    "RUN_INFO_SIMULATOR": "run_info_t",
    "RUN_INFO_CONTROLLER": "run_info_t",
}
"""channel → type. Other channels are decoded too where their fingerprint is a known type's."""

OPERATOR_CHANNELS = ("USER_COMMAND", "STOP", "PUSH")
"""sent by hand: their clock is the operator's, not the simulator's"""

CONTROLLER_CHANNELS = (
    "JOINT_COMMAND",
    "FORCE_PLAN",
    "ARM3_MOTION",
    "BALL_ESTIMATE",
    "CATCH_PLAN",
    "CONTROLLER_TRACE",
    "CONTROLLER_TIMING",
)
"""what the controller sends once a tick"""

SELF_TEST_CHANNEL = "LCM_SELF_TEST"
"""what every LCM instance sends itself at start: never data"""

_BASE_TYPES = {
    "int8_t": "i1",
    "int16_t": ">i2",
    "int32_t": ">i4",
    "int64_t": ">i8",
    "float": ">f4",
    "double": ">f8",
    "boolean": "i1",
    "byte": "u1",
}


@dataclass(frozen=True)
class MessageType:
    """One generated LCM type."""

    name: str
    python_class: Any
    fingerprint: bytes
    """the 8 bytes that start every encoded message of this type"""
    dtype: np.dtype[np.void] | None
    """of a whole encoded message, fingerprint included; None where the size varies (strings, variable arrays)"""

    @property
    def fields(self) -> tuple[str, ...]:
        return tuple(self.python_class.__slots__)


def _dtype(python_class: Any) -> np.dtype[np.void] | None:
    fields: list[Any] = [("fingerprint", "V8")]
    for name, type_name, dimensions in zip(
        python_class.__slots__, python_class.__typenames__, python_class.__dimensions__, strict=True
    ):
        base = _BASE_TYPES.get(type_name)
        shape = tuple(dimensions or ())
        if base is None or not all(isinstance(size, int) for size in shape):
            return None
        fields.append((name, base, shape))
    return np.dtype(fields)


@functools.cache
def message_types() -> dict[bytes, MessageType]:
    """Every generated type, by fingerprint. Raises MissingError where none were generated."""
    try:
        package = importlib.import_module("stance_msgs")
    except ImportError as error:
        raise MissingError(
            "the generated message types are missing: build the project, "
            "or run lcm-gen -p --ppath analysis lcmtypes/*.lcm"
        ) from error
    found: dict[bytes, MessageType] = {}
    for module in pkgutil.iter_modules(package.__path__):
        python_class = getattr(importlib.import_module(f"stance_msgs.{module.name}"), module.name)
        fingerprint = python_class._get_packed_fingerprint()
        found[fingerprint] = MessageType(module.name, python_class, fingerprint, _dtype(python_class))
    return found


@functools.cache
def message_type(name: str) -> MessageType:
    """The generated type of that name, such as `truth_t`. Raises KeyError where there is none."""
    for found in message_types().values():
        if found.name == name:
            return found
    raise KeyError(name)
