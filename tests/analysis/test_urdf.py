"""The robot's body as Python reads it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from stance import configuration
from stance.errors import UnreadableError
from stance.series import Run
from stance.signals import roll_pitch_yaw
from stance.urdf import parse_urdf, rotation_from_quaternion, rotation_from_rpy, transform
from synthetic import URDF


def test_mass_limits_and_joint_order_are_the_urdfs() -> None:
    body = parse_urdf(URDF)
    assert body.mass == pytest.approx(13.2)
    assert body.root == "trunk"
    assert body.joint_names == tuple(f"q{i}_{side}" for side in "lr" for i in range(4))
    knee = body.moving[2]
    assert (knee.lower, knee.upper, knee.effort, knee.velocity) == (0.05, 2.6, 60.0, 30.0)


def test_joint_vectors_follow_the_order_that_is_asked_for(stand: Run) -> None:
    body = configuration.robot(stand)
    assert body is not None
    assert body.joint_names[:2] == ("q0_l", "q1_l")
    turned = parse_urdf(URDF, body.joint_names[::-1])
    q = np.linspace(-0.4, 0.5, 8)
    straight, reverse = body.forward(q), turned.forward(q[::-1])
    assert all(np.allclose(straight[name], reverse[name]) for name in straight)


def test_a_straight_leg_hangs_by_the_sum_of_its_lengths() -> None:
    body = parse_urdf(URDF)
    frames = body.forward(np.zeros(8))
    for name, centre in body.feet():
        foot = frames[name] @ np.append(centre, 1.0)
        assert foot[:3] == pytest.approx([0.0, 0.1 if name.endswith("_l") else -0.1, -0.1 - 0.08 - 0.26 - 0.26 - 0.24])


def test_positive_pitch_moves_the_foot_backward() -> None:
    body = parse_urdf(URDF)
    name, centre = body.feet()[0]
    foot = body.forward(np.array([0, 0.3, 0, 0, 0, 0, 0, 0]))[name] @ np.append(centre, 1.0)
    assert foot[0] < -0.1


def test_feet_are_where_the_truth_has_them(stand: Run) -> None:
    body = configuration.robot(stand)
    assert body is not None
    for row in (0, 170, 270):
        T_WB = transform(
            rotation_from_quaternion(stand.field("TRUTH", "quat_WB")[row]), stand.field("TRUTH", "p_WB")[row]
        )
        frames = body.forward(stand.field("TRUTH", "joint_position")[row], T_WB)
        for (name, centre), tip in zip(body.feet(), stand.field("TRUTH", "p_WF")[row], strict=False):
            assert (frames[name] @ np.append(centre, 1.0))[:3] == pytest.approx(tip, abs=1e-9)


def test_many_postures_at_once_are_each_of_them(stand: Run) -> None:
    body = configuration.robot(stand)
    assert body is not None
    q, rows = stand.field("TRUTH", "joint_position"), slice(165, 172)
    T_WB = transform(rotation_from_quaternion(stand.field("TRUTH", "quat_WB")), stand.field("TRUTH", "p_WB"))
    together, centres = body.forward(q[rows], T_WB[rows]), body.center_of_mass(q[rows], T_WB[rows])
    for i, row in enumerate(range(*rows.indices(len(q)))):
        alone = body.forward(q[row], T_WB[row])
        assert all(np.allclose(together[name][i], alone[name], atol=1e-15) for name in alone)
        assert np.allclose(centres[i], body.center_of_mass(q[row], T_WB[row]), atol=1e-15)


def test_the_whole_body_turns_with_its_base() -> None:
    body = parse_urdf(URDF)
    q = np.linspace(-0.3, 0.4, 8)
    T_WB = transform(rotation_from_rpy(0.1, -0.2, 0.7), np.array([1.0, 2.0, 3.0]))
    p_BC = body.center_of_mass(q)
    assert body.center_of_mass(q, T_WB) == pytest.approx(T_WB[:3, :3] @ p_BC + T_WB[:3, 3])


def test_quaternions_and_angles_agree() -> None:
    half = 0.3 / 2
    angles = [0.1, -0.2, 0.7]
    q = Rotation.from_matrix(rotation_from_rpy(*angles)).as_quat(scalar_first=True)
    assert roll_pitch_yaw(q) == pytest.approx(angles)
    assert rotation_from_quaternion(np.array([np.cos(half), 0, np.sin(half), 0])) == pytest.approx(
        rotation_from_rpy(0.0, 0.3, 0.0)
    )


@pytest.mark.parametrize(
    "text",
    [
        "",
        "<robot",
        "<robot name='r'><link/></robot>",
        "<robot name='r'><link name='a'/><link name='b'/></robot>",
        "<robot name='r'><link name='a'/><joint name='j' type='fixed'><child link='a'/></joint></robot>",
    ],
)
def test_what_is_no_robot_is_one_clear_error(text: str) -> None:
    with pytest.raises(UnreadableError, match="URDF cannot be read"):
        parse_urdf(text)


def test_an_unknown_joint_name_is_an_error() -> None:
    with pytest.raises(UnreadableError, match="named joints"):
        parse_urdf(URDF, ("q9",))
