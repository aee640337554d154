"""`stance calibrate`: reference vectors, what it prints, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from golden import golden_cases
from stance.calibration import calibrate, read_points
from stance.cli import main
from stance.errors import StanceError

TOLERANCE = 1e-10
R = np.array([[0.0, -1.0, 0.0], [0.6, 0.0, -0.8], [0.8, 0.0, 0.6]])
SHIFT = np.array([1.5, -2.5, 1.2])
AHEAD = np.array([0.0, 0.0, 2.0])


def pairs(count: int, noise: float, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    p_K = random.uniform(-1.0, 1.0, (count, 3)) + AHEAD
    return p_K, p_K @ R.T + SHIFT + noise * random.normal(size=(count, 3))


def write(path: Path, header: str, rows: np.ndarray) -> str:
    path.write_text(header + "\n" + "\n".join(",".join(repr(float(value)) for value in row) for row in rows) + "\n")
    return str(path)


@pytest.mark.parametrize("case", golden_cases("calib001.json"))
def test_fits_equal_the_reference_vectors(case: dict) -> None:
    K, A = np.array(case["P_cam"]).T, np.array(case["P_arm"]).T
    if case["kind"] == "planar_homogeneous":
        found = calibrate("planar", K[:, :2], A[:, :2])
        np.testing.assert_allclose(found.T, np.array(case["T"])[:2], atol=TOLERANCE)
        assert abs(found.rms - case["rms"]) < TOLERANCE
        return
    rigid, linear = calibrate("rigid", K, A), calibrate("linear", K, A)
    np.testing.assert_allclose(rigid.T, np.column_stack([case["R_rigid"], case["t_rigid"]]), atol=TOLERANCE)
    np.testing.assert_allclose(linear.T, np.column_stack([case["T_linear3x3"], np.zeros(3)]), atol=TOLERANCE)
    assert abs(rigid.rms - case["rms_rigid"]) < TOLERANCE
    assert abs(linear.rms - case["rms_linear"]) < TOLERANCE
    if "T_affine3x4" in case:
        affine = calibrate("affine", K, A)
        np.testing.assert_allclose(affine.T, case["T_affine3x4"], atol=TOLERANCE)
        assert abs(affine.rms - case["rms_affine"]) < TOLERANCE


def test_points_held_out_tell_the_rigid_fit_from_the_documents() -> None:
    K, A = pairs(20, 0.002)
    rigid, linear = calibrate("rigid", K, A), calibrate("linear", K, A)
    assert rigid.as_dict()["held_out_rms_m"] < 0.006
    assert linear.as_dict()["held_out_rms_m"] > 0.3
    assert calibrate("rigid", K[:3], A[:3]).held_out is None


def test_file_is_fitted_whatever_the_order_of_its_columns(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    K, A = pairs(20, 0.0)
    A[6] += [0.0, 0.3, 0.0]
    points = write(tmp_path / "p.csv", "x_A,y_A,z_A,z_K,y_K,x_K", np.hstack([A, K[:, ::-1]]))
    assert main(["calibrate", points, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["kind"] == "rigid" and told["points"] == 20 and told["worst_point"] == 7
    np.testing.assert_allclose(told["T"], calibrate("rigid", K, A).T, atol=TOLERANCE)
    assert main(["calibrate", points]) == 0
    assert "(point 7)" in capsys.readouterr().out


def test_planar_file_has_no_z(tmp_path: Path) -> None:
    K, A = pairs(10, 0.0)
    path = Path(write(tmp_path / "p.csv", "x_K,y_K,x_A,y_A", np.hstack([K[:, :2], A[:, :2]])))
    p_K, p_A = read_points(path, "planar")
    np.testing.assert_array_equal(p_K, K[:, :2])
    np.testing.assert_array_equal(p_A, A[:, :2])
    with pytest.raises(StanceError, match="column z_K is missing; a rigid calibration takes x_K, y_K, z_K, x_A"):
        read_points(path, "rigid")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x_K,y_K,z_K,x_A,y_A,z_A,w\n", "unknown column 'w'"),
        ("x_K,x_K,y_K,z_K,x_A,y_A,z_A\n", "column x_K stands twice"),
        ("x_K,y_K,z_K,x_A,y_A,z_A\n1,2,3,4,5,6\n1,2,3\n", "line 3 has 3 values, but the header 6"),
        ("x_K,y_K,z_K,x_A,y_A,z_A\n1,2,three,4,5,6\n", "line 2, z_K is 'three', but must be a number"),
        ("x_K,y_K,z_K,x_A,y_A,z_A\n1,2,nan,4,5,6\n", "line 2, z_K is 'nan', but must be a number"),
        ("x_K,y_K,z_K,x_A,y_A,z_A\n1,2,3,4,5,6\n", "1 points are too few: give at least 3"),
        ("", "column x_K is missing"),
    ],
)
def test_file_that_cannot_be_used_is_refused_by_name(
    text: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "p.csv"
    path.write_text(text)
    assert main(["calibrate", str(path)]) == 2
    assert message in capsys.readouterr().err


def test_points_that_do_not_determine_the_fit_are_refused() -> None:
    K, A = pairs(10, 0.0)
    line, plane = np.outer(np.arange(10), [1.0, 0.5, 0.2]) + AHEAD, K * [1.0, 1.0, 0.0] + AHEAD
    with pytest.raises(StanceError, match="lie nearly on a line: spread them out"):
        calibrate("rigid", line, A)
    with pytest.raises(StanceError, match="lie nearly in a plane: spread them out"):
        calibrate("affine", plane, A)
    assert calibrate("rigid", plane, A).T.shape == (3, 4)
    with pytest.raises(StanceError, match="leave that pair out"):
        calibrate("rigid", K * np.nan, A)
    with pytest.raises(StanceError, match="needs pairs of points"):
        calibrate("planar", K, A)
