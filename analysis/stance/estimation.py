"""The controller's estimate of its base against the truth of the same instants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from . import signals
from .series import Array, Floats, Run

MIN_PATH = 1.0  # m, below it drift is no share of the path
NEES_FREEDOM = 5  # degrees, of `Errors.nees`


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
    heading_velocity_rms_standing: float | None
    """the same, of the time without a gait"""
    heading_velocity_rms_walking: float | None
    """the same, of the time with one"""
    height_rms: float | None
    """m, of B over the feet that bear load"""
    odometry_share: float | None
    """drift of the horizontal position over the length of the path; None for a path shorter than 1 m"""
    nees: float | None
    """normalised error squared per degree of freedom, of roll, pitch and the heading frame's velocity: 1 where the
    stated sigma are right; None where one is 0"""


@dataclass(frozen=True)
class Errors:
    """Estimate less truth at every tick that took a new state, n of them, and one standard deviation as stated."""

    time: Floats
    """s, (n,)"""
    position: Floats
    """m, (n, 3), of B in W"""
    position_sigma: Floats
    angles: Floats
    """rad, (n, 3), roll, pitch and yaw"""
    angles_sigma: Floats
    """rad, (n, 3), about the heading frame's axes"""
    velocity: Floats
    """m/s, (n, 3), estimate and truth each in their own heading frame"""
    velocity_sigma: Floats
    """m/s, (n, 3), along the same axes, yaw's part left out"""
    height: Floats
    """m, (n, contacts), of B over each foot; nan over one that bears no load"""
    nis: Floats
    """(n,), normalised innovation squared per degree of freedom"""
    walking: Array
    """(n,) bool, whether the robot had a gait"""

    @property
    def nees(self) -> Floats:
        """(n,), normalised error squared per degree of freedom of roll, pitch and velocity, which are observed.

        By the stated standard deviations, without correlations: they are not in the log. nan where one is 0.
        """
        error = np.column_stack([self.angles[:, :2], self.velocity])
        sigma = np.column_stack([self.angles_sigma[:, :2], self.velocity_sigma])
        return np.asarray(np.square(error / np.where(sigma > 0.0, sigma, np.nan)).mean(axis=1))


def errors(run: Run) -> Errors | None:
    """None where the log lacks the truth, the estimate or every instant that they share."""
    if "TRUTH" not in run or "CONTROLLER_TRACE" not in run:
        return None
    rows, truth_rows = signals.truth_of_ticks(run)
    if not len(rows):
        return None

    def estimate(name: str) -> Array:
        return run.field("CONTROLLER_TRACE", name)[rows]

    def truth(name: str) -> Array:
        return run.field("TRUTH", name)[truth_rows]

    turned, true_turned = signals.roll_pitch_yaw(estimate("quat_WB")), signals.roll_pitch_yaw(truth("quat_WB"))
    yaw = turned[:, 2]
    feet = slice(signals.num_contacts(run))
    height = _height(estimate, feet) - _height(truth, feet)
    return Errors(
        time=run.time("CONTROLLER_TRACE")[rows],
        position=estimate("p_WB") - truth("p_WB"),
        position_sigma=estimate("sigma_p"),
        angles=np.angle(np.exp(1j * (turned - true_turned))),
        angles_sigma=_sigma_in_heading(estimate("sigma_theta"), yaw),
        velocity=signals.in_heading(estimate("v_WB"), yaw) - signals.in_heading(truth("v_WB"), true_turned[:, 2]),
        velocity_sigma=_sigma_in_heading(_without_yaw(estimate("sigma_v"), estimate), yaw),
        height=np.where(truth("f_F_W")[:, feet, 2] > signals.MIN_NORMAL_FORCE, height, np.nan),
        nis=estimate("nis"),
        walking=estimate("gait_phase") != signals.STANDING,
    )


def _height(of: Callable[[str], Array], feet: slice) -> Floats:
    """m, (n, contacts), of B over each foot."""
    return np.asarray(of("p_WB")[:, None, 2] - of("p_WF")[:, feet, 2])


def _without_yaw(sigma_v: Array, of: Callable[[str], Array]) -> Floats:
    """m/s, (n, 3) in W: `sigma_v` less what the yaw's uncertainty adds to it, which the heading frame's error has not.

    A yaw error turns v: it adds (v_y sigma_yaw)^2 and (v_x sigma_yaw)^2 to the variances. As if the two were not
    correlated; a tenth of `sigma_v` always stays.
    """
    v_WB, yaw_sigma = of("v_WB"), of("sigma_theta")[:, 2]
    turning = np.column_stack([v_WB[:, 1], v_WB[:, 0], np.zeros(len(v_WB))]) * yaw_sigma[:, None]
    return np.asarray(np.sqrt(np.maximum(np.square(sigma_v) - np.square(turning), np.square(0.1 * sigma_v))))


def _sigma_in_heading(sigma_W: Array, yaw: Array) -> Floats:
    """Standard deviations (n, 3) along W's axes → along those of the heading frame, as if they were not correlated."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    x, y, z = sigma_W.T
    return np.column_stack([np.hypot(cos * x, sin * y), np.hypot(sin * x, cos * y), z])


def estimator_error(run: Run) -> EstimatorError | None:
    found = errors(run)
    if found is None:
        return None
    rows, truth_rows = signals.truth_of_ticks(run)
    distance = np.linalg.norm(found.position, axis=1)
    v_error = run.field("CONTROLLER_TRACE", "v_WB")[rows] - run.field("TRUTH", "v_WB")[truth_rows]
    quaternions = run.field("CONTROLLER_TRACE", "quat_WB")[rows], run.field("TRUTH", "quat_WB")[truth_rows]
    path = signals.path_length(run.field("TRUTH", "p_WB")[truth_rows], run.time("TRUTH")[truth_rows])
    drift = found.position[-1] - found.position[0]
    height = found.height[~np.isnan(found.height)]
    nees = found.nees

    def worst_axis(among: Array) -> float | None:
        return max(signals.rms(found.velocity[among, axis]) for axis in range(3)) if among.any() else None

    return EstimatorError(
        position_rms=signals.rms(distance),
        position_max=float(distance.max()),
        position_drift=float(np.linalg.norm(drift)),
        velocity_rms=signals.rms(np.linalg.norm(v_error, axis=1)),
        tilt_max_deg=float(np.degrees(np.abs(_tilt_between(*quaternions)).max())),
        yaw_max_deg=float(np.degrees(np.abs(found.angles[:, 2])).max()),
        roll_rms=signals.rms(found.angles[:, 0]),
        pitch_rms=signals.rms(found.angles[:, 1]),
        heading_velocity_rms=max(signals.rms(found.velocity[:, axis]) for axis in range(3)),
        heading_velocity_rms_standing=worst_axis(~found.walking),
        heading_velocity_rms_walking=worst_axis(found.walking),
        height_rms=signals.rms(height) if len(height) else None,
        odometry_share=float(np.linalg.norm(drift[:2])) / path if path >= MIN_PATH else None,
        nees=None if np.isnan(nees).any() else float(nees.mean()),
    )


def _tilt_between(first: Array, second: Array) -> Floats:
    """rad, between the z axes of two series of quaternions (n, 4)."""
    a, b = signals.z_axis(first), signals.z_axis(second)
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))
