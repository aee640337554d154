"""A thrown ball's track after the fact: the controller's Kalman filter again, and the smoother that looks back.

For a log's analysis, where the whole throw is known; in the loop `controller/estimation/ball_filter` runs.

State x = (p, v) [m, m/s], n = 6; measurements z = p [m], m = 3:

    x(k+1) = F x(k) + B u + w,  w ~ N(0, Q)        z = H x + r,  r ~ N(0, R)

Reference: Rauch, Tung and Striebel, Maximum likelihood estimates of linear dynamic systems, AIAA J. 3 (1965).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .errors import StanceError
from .series import Array, Floats


@dataclass(frozen=True)
class LinearModel:
    """x(k+1) = F x(k) + Bu + N(0, Q), z = H x + N(0, R)."""

    F: Floats
    """(n, n)"""
    Bu: Floats
    """(n,)"""
    H: Floats
    """(m, n)"""
    Q: Floats
    """(n, n)"""
    R: Floats
    """(m, m)"""


@dataclass(frozen=True)
class Track:
    """Estimates at the times of the measurements, one a row; `nis` is nan where nothing was measured."""

    x_prior: Floats
    """(steps, n)"""
    P_prior: Floats
    """(steps, n, n)"""
    x: Floats
    """(steps, n)"""
    P: Floats
    """(steps, n, n)"""
    nis: Floats
    """(steps,): y^T S^-1 y, chi^2 of m degrees of freedom where the model holds"""


def ballistic(dt: float, gravity: Array, Q: Array, R: Array) -> LinearModel:
    """A ball under `gravity` [m/s^2], (3,), one step of `dt` [s]; Q (6, 6) a step, R (3, 3). Document 001."""
    eye = np.eye(3)
    g = np.asarray(gravity, float)
    return LinearModel(
        F=np.block([[eye, dt * eye], [np.zeros((3, 3)), eye]]),
        Bu=np.concatenate([0.5 * dt**2 * g, dt * g]),
        H=np.hstack([eye, np.zeros((3, 3))]),
        Q=np.asarray(Q, float),
        R=np.asarray(R, float),
    )


def filtered(model: LinearModel, x0: Array, P0: Array, z: Array) -> Track:
    """The Kalman filter, in Joseph's form, over `z` (steps, m); a row of nan is a step without a measurement.

    Each step predicts from the one before, the first from `x0` (n,) and `P0` (n, n). Raises StanceError where the
    shapes do not fit.
    """
    measured = np.asarray(z, float)
    x, P = np.asarray(x0, float), np.asarray(P0, float)
    n, m = x.size, model.H.shape[0]
    if measured.ndim != 2 or measured.shape[1] != m or P.shape != (n, n) or model.F.shape != (n, n):
        raise StanceError(
            f"z must be (steps, {m}), P0 and F ({n}, {n}): have {measured.shape}, {P.shape}, {model.F.shape}"
        )
    steps = len(measured)
    track = Track(
        *(np.full(shape, np.nan) for shape in ((steps, n), (steps, n, n), (steps, n), (steps, n, n), (steps,)))
    )
    for k in range(steps):
        x, P = model.F @ x + model.Bu, model.F @ P @ model.F.T + model.Q
        track.x_prior[k], track.P_prior[k] = x, P
        if np.isfinite(measured[k]).all():
            y = measured[k] - model.H @ x
            S = model.H @ P @ model.H.T + model.R
            K = np.linalg.solve(S, model.H @ P).T
            x = x + K @ y
            L = np.eye(n) - K @ model.H
            P = L @ P @ L.T + K @ model.R @ K.T
            track.nis[k] = y @ np.linalg.solve(S, y)
        track.x[k], track.P[k] = x, P
    return track


def smoothed(model: LinearModel, track: Track) -> tuple[Floats, Floats]:
    """x (steps, n) and P (steps, n, n) given every measurement, those after an instant too.

    C = P(k) F^T P_prior(k+1)^-1,  x_s(k) = x(k) + C (x_s(k+1) - x_prior(k+1)),  P_s(k) = P(k) + C (P_s(k+1) -
    P_prior(k+1)) C^T, from the last step back.
    """
    x, P = track.x.copy(), track.P.copy()
    for k in range(len(x) - 2, -1, -1):
        C = np.linalg.solve(track.P_prior[k + 1], model.F @ track.P[k]).T
        x[k] += C @ (x[k + 1] - track.x_prior[k + 1])
        P[k] += C @ (P[k + 1] - track.P_prior[k + 1]) @ C.T
    return x, P
