"""The controller's estimate of its base against the truth of the same instants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import signals
from .series import Array, Floats, Integers, Run

MIN_PATH = 1.0  # m, below it drift is no share of the path


@dataclass(frozen=True)
class EstimatorError:
    """Of the controller's estimate of its base against the truth of the same instant."""

    position_rms: float
    """m"""
    position_max: float
    position_drift: float
    """m, change of the error from the run's start to its end"""
    velocity_rms: float
    """m/s"""
    tilt_max_deg: float
    yaw_max_deg: float
    roll_rms: float
    """rad"""
    pitch_rms: float
    """rad"""
    heading_velocity_rms: float
    """m/s, of the worst axis: estimate and truth each in their own heading frame, since yaw is not observed"""
    height_rms: float | None
    """m, of B over the feet that bear load"""
    odometry_share: float | None
    """drift of the horizontal position over the length of the path; None for a path shorter than 1 m"""
    nees: float | None
    """normalised error squared per degree of freedom, of roll, pitch and the heading frame's velocity: 1 where the
    stated sigma are right; None where one is 0"""


def estimator_error(run: Run) -> EstimatorError | None:
    if "TRUTH" not in run or "CONTROLLER_TRACE" not in run:
        return None
    rows, truth_rows = signals.truth_of_ticks(run)
    if not len(rows):
        return None

    def both(name: str) -> tuple[Array, Array]:
        return run.field("CONTROLLER_TRACE", name)[rows], run.field("TRUTH", name)[truth_rows]

    estimate, truth = both("p_WB")
    error = estimate - truth
    distance = np.linalg.norm(error, axis=1)
    v_estimate, v_truth = both("v_WB")
    q_estimate, q_truth = both("quat_WB")
    turn_estimate, turn_truth = signals.roll_pitch_yaw(q_estimate), signals.roll_pitch_yaw(q_truth)
    turned = np.angle(np.exp(1j * (turn_estimate - turn_truth)))
    v_error = signals.in_heading(v_estimate, turn_estimate[:, 2]) - signals.in_heading(v_truth, turn_truth[:, 2])
    sigma_v, sigma_theta = (run.field("CONTROLLER_TRACE", name)[rows] for name in ("sigma_v", "sigma_theta"))
    sigma = np.column_stack([sigma_theta[:, :2], sigma_v])
    normalised = np.column_stack([turned[:, :2], v_error]) / np.where(sigma > 0.0, sigma, np.nan)
    path = signals.path_length(truth, run.time("TRUTH")[truth_rows])
    return EstimatorError(
        position_rms=signals.rms(distance),
        position_max=float(distance.max()),
        position_drift=float(np.linalg.norm(error[-1] - error[0])),
        velocity_rms=signals.rms(np.linalg.norm(v_estimate - v_truth, axis=1)),
        tilt_max_deg=float(np.degrees(np.abs(_tilt_between(q_estimate, q_truth)).max())),
        yaw_max_deg=float(np.degrees(np.abs(turned[:, 2])).max()),
        roll_rms=signals.rms(turned[:, 0]),
        pitch_rms=signals.rms(turned[:, 1]),
        heading_velocity_rms=max(signals.rms(v_error[:, axis]) for axis in range(3)),
        height_rms=_height_rms(run, rows, truth_rows),
        odometry_share=float(np.linalg.norm((error[-1] - error[0])[:2])) / path if path >= MIN_PATH else None,
        nees=None if np.isnan(normalised).any() else float(np.mean(np.square(normalised))),
    )


def _height_rms(run: Run, rows: Integers, truth_rows: Integers) -> float | None:
    """m, error of B's height over the feet that bear load; None where none ever does."""
    feet = slice(signals.num_contacts(run))
    loaded = run.field("TRUTH", "f_F_W")[truth_rows][:, feet, 2] > signals.MIN_NORMAL_FORCE

    def height(channel: str, at: Integers) -> Floats:
        return np.asarray(run.field(channel, "p_WB")[at][:, None, 2] - run.field(channel, "p_WF")[at][:, feet, 2])

    error = height("CONTROLLER_TRACE", rows) - height("TRUTH", truth_rows)
    return signals.rms(error[loaded]) if loaded.any() else None


def _tilt_between(first: Array, second: Array) -> Floats:
    """rad, between the z axes of two series of quaternions (n, 4)."""
    a, b = signals.z_axis(first), signals.z_axis(second)
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))
