"""The rigid-body core against pinocchio and modern_robotics (setup/peers.lock), through the program chain_answers."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import modern_robotics as mr
import numpy as np
import pinocchio as pin
import pytest
from stance.programs import SOURCE_TREE, find_program

CASES = 100
TOLERANCE = 1e-10
"""relative to 1 + the largest entry"""
GRAVITY = np.array([0.0, 0.0, -9.81])


@dataclass(frozen=True)
class Robot:
    urdf: Path
    link: str
    tip: tuple[float, float, float]
    joints: tuple[str, ...]


ROBOTS = {
    "arm5": Robot(SOURCE_TREE / "tests/golden/arm5.urdf", "l5", (0.0, 0.0, 0.251), ("j1", "j2", "j3", "j4", "j5")),
    "biped": Robot(
        SOURCE_TREE / "robots/biped/biped.urdf",
        "tarsus_r",
        (0.01, 0.2, -0.03),
        ("q0_l", "q1_l", "q2_l", "q3_l", "q0_r", "q1_r", "q2_r", "q3_r"),
    ),
}


@dataclass(frozen=True)
class Answers:
    """What the core says, a case a row; twists and wrenches angular first."""

    T: np.ndarray
    J_b: np.ndarray
    J_s: np.ndarray
    tau: np.ndarray
    M: np.ndarray
    coriolis: np.ndarray
    gravity: np.ndarray
    thetadd: np.ndarray


def ask(robot: Robot) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, Answers]:
    """theta, thetad, thetadd (CASES, n) and F_tip (CASES, 6), and the answers to them."""
    n = len(robot.joints)
    random = np.random.default_rng(5)
    asked = random.uniform(-3.0, 3.0, (CASES, 3 * n + 6))
    said = subprocess.run(
        [find_program("chain_answers"), robot.urdf, robot.link, *map(str, robot.tip), *robot.joints],
        input="\n".join(" ".join(repr(float(value)) for value in row) for row in asked),
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    rows = np.array([[float(word) for word in line.split()] for line in said.splitlines()])
    assert len(rows) == CASES
    sizes = [9, 3, 6 * n, 6 * n, n, n * n, n, n, n]
    R, p, J_b, J_s, tau, M, coriolis, gravity, thetadd = np.split(rows, np.cumsum(sizes)[:-1], axis=1)
    T = np.tile(np.eye(4), (CASES, 1, 1))
    T[:, :3, :3], T[:, :3, 3] = R.reshape(-1, 3, 3), p
    square = (CASES, n, n)
    answers = Answers(
        T, J_b.reshape(-1, 6, n), J_s.reshape(-1, 6, n), tau, M.reshape(square), coriolis, gravity, thetadd
    )
    theta, thetad, thetadd_asked, F_tip = np.split(asked, [n, 2 * n, 3 * n], axis=1)
    return theta, thetad, thetadd_asked, F_tip, answers


def check(ours: np.ndarray, theirs: np.ndarray) -> None:
    assert np.abs(ours - theirs).max() <= TOLERANCE * (1.0 + np.abs(theirs).max())


@dataclass(frozen=True)
class Pinocchio:
    """pinocchio's model, and where our joints stand in its order."""

    model: pin.Model
    order: list[int]
    tip: int

    @classmethod
    def of(cls, robot: Robot) -> Pinocchio:
        model = pin.buildModelFromUrdf(str(robot.urdf))
        order = [model.joints[model.getJointId(name)].idx_q for name in robot.joints]
        link = model.frames[model.getFrameId(robot.link)]
        place = link.placement * pin.SE3(np.eye(3), np.array(robot.tip))
        tip = model.addFrame(pin.Frame("tip", link.parentJoint, 0, place, pin.FrameType.OP_FRAME))
        return cls(model, order, tip)

    def spread(self, ours: np.ndarray) -> np.ndarray:
        out = np.zeros(self.model.nq)
        out[self.order] = ours
        return out


@pytest.mark.parametrize("name", ROBOTS)
def test_core_agrees_with_pinocchio(name: str) -> None:
    robot = ROBOTS[name]
    peer = Pinocchio.of(robot)
    model, data = peer.model, peer.model.createData()
    swap = [3, 4, 5, 0, 1, 2]  # pinocchio is linear first
    theta, thetad, thetadd, F_tip, ours = ask(robot)
    for k in range(CASES):
        q, v, a = peer.spread(theta[k]), peer.spread(thetad[k]), peer.spread(thetadd[k])
        J = pin.computeFrameJacobian(model, data, q, peer.tip, pin.ReferenceFrame.LOCAL)[swap][:, peer.order]
        pin.framesForwardKinematics(model, data, q)
        check(ours.T[k], data.oMf[peer.tip].homogeneous)
        check(ours.J_b[k], J)
        tau = pin.rnea(model, data, q, v, a)[peer.order] + J.T @ F_tip[k]
        check(ours.tau[k], tau)
        check(ours.M[k], pin.crba(model, data, q)[np.ix_(peer.order, peer.order)])
        gravity = pin.computeGeneralizedGravity(model, data, q)[peer.order]
        check(ours.gravity[k], gravity)
        check(ours.coriolis[k], pin.nonLinearEffects(model, data, q, v)[peer.order] - gravity)
        free = pin.aba(model, data, q, v, peer.spread(ours.tau[k] - J.T @ F_tip[k]))[peer.order]
        check(ours.thetadd[k], free)


def test_core_agrees_with_modern_robotics() -> None:
    robot = ROBOTS["arm5"]
    peer = Pinocchio.of(robot)
    model, data, n = peer.model, peer.model.createData(), len(robot.joints)
    # The book's lists at home: links' frames at the centres of mass, axes of the links.
    pin.framesForwardKinematics(model, data, np.zeros(n))
    M_0i = [np.eye(4)]
    Glist, Slist = [], []
    for i in range(1, n + 1):
        inertia, joint = model.inertias[i], data.oMi[i]
        M_0i.append((joint * pin.SE3(np.eye(3), inertia.lever)).homogeneous)
        Glist.append(np.block([[inertia.inertia, np.zeros((3, 3))], [np.zeros((3, 3)), inertia.mass * np.eye(3)]]))
        Slist.append(np.concatenate([joint.rotation[:, 2], np.cross(joint.translation, joint.rotation[:, 2])]))
    M_0i.append(data.oMf[peer.tip].homogeneous)
    Mlist = [mr.TransInv(before) @ after for before, after in pairwise(M_0i)]
    S = np.array(Slist).T
    home = M_0i[-1]
    B = mr.Adjoint(mr.TransInv(home)) @ S

    theta, thetad, thetadd, F_tip, ours = ask(robot)
    for k in range(CASES):
        check(ours.T[k], mr.FKinSpace(home, S, theta[k]))
        check(ours.J_s[k], mr.JacobianSpace(S, theta[k]))
        check(ours.J_b[k], mr.JacobianBody(B, theta[k]))
        lists = (Mlist, Glist, S)
        tau = mr.InverseDynamics(theta[k], thetad[k], thetadd[k], GRAVITY, F_tip[k], *lists)
        check(ours.tau[k], tau)
        check(ours.M[k], mr.MassMatrix(theta[k], *lists))
        check(ours.coriolis[k], mr.VelQuadraticForces(theta[k], thetad[k], *lists))
        check(ours.gravity[k], mr.GravityForces(theta[k], GRAVITY, *lists))
        check(ours.thetadd[k], mr.ForwardDynamics(theta[k], thetad[k], tau, GRAVITY, F_tip[k], *lists))
