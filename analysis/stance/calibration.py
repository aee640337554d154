"""Where a camera stands against the arm, from pairs of points: `stance calibrate`.

    rigid    p_A = R p_K + t     R = V diag(1, 1, det(V U^T)) U^T of the covariance's U S V^T (Kabsch)
    affine   p_A = A p_K + t     least squares
    linear   p_A = A p_K         least squares: document 001's T = P_A P_K^+, which cannot hold a translation
    planar   p_A = A p_K + t     least squares in the plane, (x, y) alone: the document's homogeneous form

The same fits and refusals as `controller/calibration`, and what only an operator needs: how far each point lies from
what the others say of it.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .errors import StanceError
from .series import Array, Floats
from .strict import read

KINDS = ("rigid", "affine", "linear", "planar")
FEWEST = {"rigid": 3, "affine": 4, "linear": 3, "planar": 3}
DIRECTIONS = {"rigid": 2, "affine": 3, "linear": 3, "planar": 2}
LEAST_SPREAD = 0.01
"""as kLeastSpread of controller/calibration"""
DEGENERATE = {
    "rigid": "lie nearly on a line",
    "affine": "lie nearly in a plane",
    "linear": "lie nearly in a plane with the camera",
    "planar": "lie nearly on a line",
}


@dataclass(frozen=True)
class Calibration:
    kind: str
    T: Floats
    """(3, 4), [A t]: p_A = T (p_K, 1) [m]; planar: (2, 3), of (x, y)"""
    residuals: Floats
    """m, (points,): |T (p_K, 1) - p_A|"""
    held_out: Floats | None
    """m, (points,): the same by the fit to all other points; None where one of these fits is refused"""

    @property
    def rms(self) -> float:
        return _rms(self.residuals)

    def as_dict(self) -> dict[str, Any]:
        """`worst_point` counts the points from 1, as the file's rows below its header."""
        worst = int(np.argmax(self.residuals))
        return {
            "kind": self.kind,
            "points": len(self.residuals),
            "T": self.T.tolist(),
            "rms_m": self.rms,
            "worst_m": float(self.residuals[worst]),
            "worst_point": worst + 1,
            "held_out_rms_m": None if self.held_out is None else _rms(self.held_out),
            "residuals_m": self.residuals.tolist(),
        }

    def as_text(self) -> str:
        told = self.as_dict()
        rows = ["  ".join(f"{value:>13.9f}" for value in row) for row in self.T]
        held_out = "no point can be spared" if self.held_out is None else f"{1e3 * told['held_out_rms_m']:.3f} mm"
        return "\n".join(
            [
                f"{self.kind}, {told['points']} points: p_A = T (p_K, 1), T [m] =",
                *rows,
                f"residuals        rms {1e3 * self.rms:.3f} mm, worst {1e3 * told['worst_m']:.3f} mm "
                f"(point {told['worst_point']})",
                f"by the others    rms {held_out}",
            ]
        )


def calibrate(kind: str, p_K: Array, p_A: Array) -> Calibration:
    """The fit of a kind of KINDS to pairs p_K, p_A: (points, 3) [m], planar (points, 2) [pixels or m; m].

    Raises StanceError, saying what to do, where the points are too few, not finite or do not determine the fit.
    """
    if kind not in KINDS:
        raise StanceError(f"no calibration {kind!r}: {', '.join(KINDS)}")
    width = 2 if kind == "planar" else 3
    K, A = np.asarray(p_K, float), np.asarray(p_A, float)
    if K.shape != A.shape or K.ndim != 2 or K.shape[1] != width:
        raise StanceError(f"{kind}: needs pairs of points, (points, {width}) each; have {K.shape} and {A.shape}")
    T = _fit(kind, K, A)
    everyone = np.arange(len(K))
    try:
        held_out = np.array(
            [_residuals(_fit(kind, K[everyone != i], A[everyone != i]), K[[i]], A[[i]])[0] for i in everyone]
        )
    except StanceError:
        held_out = None
    return Calibration(kind, T, _residuals(T, K, A), held_out)


def read_points(path: Path, kind: str) -> tuple[Floats, Floats]:
    """p_K and p_A from a CSV file with the columns x_K, y_K, z_K, x_A, y_A, z_A in any order, planar without the z's.

    Raises StanceError naming the file, the column or row, and the remedy.
    """
    axes = "xy" if kind == "planar" else "xyz"
    wanted = [f"{axis}_{frame}" for frame in "KA" for axis in axes]
    rows = list(csv.reader(read(path).splitlines()))
    header = [name.strip() for name in rows[0]] if rows else []
    for name in wanted:
        if header.count(name) != 1:
            problem = "is missing" if name not in header else "stands twice"
            raise StanceError(f"{path}: column {name} {problem}; a {kind} calibration takes {', '.join(wanted)}")
    for name in header:
        if name not in wanted:
            raise StanceError(f"{path}: unknown column {name!r}; a {kind} calibration takes {', '.join(wanted)}")
    values = []
    for number, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        if len(row) != len(header):
            raise StanceError(f"{path}: line {number} has {len(row)} values, but the header {len(header)}")
        values.append([_number(text, f"{path}: line {number}, {name}") for text, name in zip(row, header, strict=True)])
    table = np.array(values, float).reshape(-1, len(header))[:, [header.index(name) for name in wanted]]
    return table[:, : len(axes)], table[:, len(axes) :]


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise StanceError(f"{where} is {text.strip()!r}, but must be a number")
    return value


def _fit(kind: str, K: Floats, A: Floats) -> Floats:
    if len(K) < FEWEST[kind]:
        raise StanceError(f"{kind}: {len(K)} points are too few: give at least {FEWEST[kind]}")
    if not (np.isfinite(K).all() and np.isfinite(A).all()):
        raise StanceError(f"{kind}: a coordinate is no finite number: leave that pair out")
    zero = np.zeros(K.shape[1])
    K_mean, A_mean = (zero, zero) if kind == "linear" else (K.mean(0), A.mean(0))
    k, a = K - K_mean, A - A_mean
    spread = np.linalg.svd(k, compute_uv=False)
    needed = DIRECTIONS[kind]
    if len(spread) < needed or not spread[needed - 1] > LEAST_SPREAD * spread[0]:
        raise StanceError(f"{kind}: the points {DEGENERATE[kind]}: spread them out")
    if kind == "rigid":
        U, _, Vt = np.linalg.svd(k.T @ a)
        sign = np.diag([1.0, 1.0, np.linalg.det(Vt.T @ U.T)])
        M = Vt.T @ sign @ U.T
    else:
        M = np.linalg.lstsq(k, a, rcond=None)[0].T
    return np.column_stack([M, A_mean - M @ K_mean])


def _residuals(T: Floats, K: Floats, A: Floats) -> Floats:
    return np.asarray(np.linalg.norm(K @ T[:, :-1].T + T[:, -1] - A, axis=1))


def _rms(residuals: Floats) -> float:
    return float(np.sqrt(np.mean(residuals**2)))
