"""The ball's filter and smoother of the analysis: reference vectors, and the laws of a smoother."""

from __future__ import annotations

import numpy as np
import pytest
from golden import golden_cases
from stance.errors import StanceError
from stance.smoother import ballistic, filtered, smoothed

TOLERANCE = 1e-10


@pytest.mark.parametrize("case", golden_cases("ball_kf001.json"), ids=lambda case: case["name"])
def test_filter_and_smoother_equal_the_reference_vectors(case: dict) -> None:
    model = ballistic(case["dt"], (0.0, case["g"], 0.0), case["Q"], case["R"])
    track = filtered(model, case["x0"], case["P0"], case["z"])
    for ours, theirs in ((track.x_prior, "x_prior"), (track.P_prior, "P_prior"), (track.x, "x"), (track.P, "P")):
        np.testing.assert_allclose(ours, [step[theirs] for step in case["steps"]], rtol=0, atol=TOLERANCE)
    x, _ = smoothed(model, track)
    np.testing.assert_allclose(x, case["x_rts"], rtol=0, atol=TOLERANCE)


def test_smoother_is_the_least_squares_trajectory() -> None:
    """Of few steps, all states at once: the smoother minimises the sum of all weighted squares."""
    random = np.random.default_rng(3)
    steps, n = 6, 6
    Q, R = np.diag(random.uniform(0.5, 2.0, 6)), np.diag(random.uniform(0.5, 2.0, 3))
    model = ballistic(0.1, (0.0, 0.0, -9.81), Q, R)
    z, x0, P0 = random.normal(size=(steps, 3)), random.normal(size=6), np.eye(6)
    rows, rhs = [], []
    for k in range(steps):
        at = np.zeros((n, steps * n))
        at[:, k * n : (k + 1) * n] = np.eye(n)
        before = np.zeros((n, steps * n))
        if k > 0:
            before[:, (k - 1) * n : k * n] = model.F
        covariance = Q if k > 0 else model.F @ P0 @ model.F.T + Q
        whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        rows.append(whiten @ (at - before))
        rhs.append(whiten @ (model.Bu if k > 0 else model.F @ x0 + model.Bu))
        whiten = np.linalg.inv(np.linalg.cholesky(R))
        rows.append(whiten @ model.H @ at)
        rhs.append(whiten @ z[k])
    least = np.linalg.lstsq(np.vstack(rows), np.concatenate(rhs), rcond=None)[0].reshape(steps, n)
    x, P = smoothed(model, filtered(model, x0, P0, z))
    np.testing.assert_allclose(x, least, atol=1e-9)
    information = np.vstack(rows).T @ np.vstack(rows)
    covariance = np.linalg.inv(information)
    for k in range(steps):
        np.testing.assert_allclose(P[k], covariance[k * n : (k + 1) * n, k * n : (k + 1) * n], atol=1e-9)


def test_steps_without_a_measurement_are_bridged() -> None:
    model = ballistic(0.01, (0.0, 0.0, -9.81), 1e-6 * np.eye(6), 1e-4 * np.eye(3))
    t = 0.01 * np.arange(1, 41)[:, None]
    truth = np.array([3.0, 0.0, 1.0]) + np.array([-4.0, 0.5, 3.0]) * t + 0.5 * np.array([0.0, 0.0, -9.81]) * t**2
    z = truth.copy()
    z[10:20] = np.nan
    track = filtered(model, [3.0, 0.0, 1.0, -4.0, 0.5, 3.0], np.eye(6), z)
    assert np.isnan(track.nis[10:20]).all() and np.isfinite(track.nis[20:]).all()
    x, P = smoothed(model, track)
    np.testing.assert_allclose(x[:, :3], truth, atol=1e-9)
    assert (np.trace(P, axis1=1, axis2=2) <= np.trace(track.P, axis1=1, axis2=2) + 1e-15).all()


def test_shapes_that_do_not_fit_are_named() -> None:
    model = ballistic(0.01, (0.0, 0.0, -9.81), np.eye(6), np.eye(3))
    with pytest.raises(StanceError, match=r"z must be \(steps, 3\)"):
        filtered(model, np.zeros(6), np.eye(6), np.zeros((10, 2)))
