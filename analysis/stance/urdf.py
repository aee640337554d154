"""A robot's body from its URDF text: the tree, its limits and masses, and forward kinematics in numpy.

Only what logs and pictures need: revolute, continuous, prismatic and fixed joints; boxes, cylinders and spheres.
Frames as in `controller/math/frames.hpp`: T_WB takes points of B to W.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from .errors import UnreadableError
from .series import Array, Floats

MOVING = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class Shape:
    """One visual or collision shape of a link."""

    kind: str
    """box, cylinder or sphere"""
    size: tuple[float, ...]
    """m: box (x, y, z); cylinder (radius, length), along z; sphere (radius,)"""
    T_link: Floats
    """(4, 4), the shape's frame in the link's"""


@dataclass(frozen=True)
class Link:
    name: str
    mass: float
    """kg"""
    com: Floats
    """m, (3,), in the link's frame"""
    visual: tuple[Shape, ...]
    collision: tuple[Shape, ...]


@dataclass(frozen=True)
class Joint:
    name: str
    kind: str
    parent: str
    child: str
    T_parent: Floats
    """(4, 4), the joint's frame in the parent link's at zero"""
    axis: Floats
    """(3,), unit, in the joint's frame"""
    lower: float
    """rad or m; -inf where there is no limit"""
    upper: float
    effort: float
    """N m or N; inf where there is no limit"""
    velocity: float
    """rad/s or m/s; inf where there is no limit"""


@dataclass(frozen=True)
class Robot:
    """A tree of links. `joints` are in the URDF's order, fixed ones included."""

    name: str
    root: str
    links: Mapping[str, Link]
    joints: tuple[Joint, ...]
    joint_names: tuple[str, ...] = field(default=())
    """the moving joints, in the order of every joint vector of the messages"""

    @property
    def mass(self) -> float:
        """kg, of all links"""
        return sum(link.mass for link in self.links.values())

    @property
    def moving(self) -> tuple[Joint, ...]:
        """the moving joints in the order of `joint_names`"""
        by_name = {joint.name: joint for joint in self.joints}
        return tuple(by_name[name] for name in self.joint_names)

    def forward(self, q: Array, T_WB: Floats | None = None) -> dict[str, Floats]:
        """Every link's frame in W, (..., 4, 4), of postures `q` [rad or m] (..., joints) in the order of `joint_names`.

        T_WB (..., 4, 4): B is the root link.
        """
        value = dict(zip(self.joint_names, np.moveaxis(np.asarray(q, float), -1, 0), strict=False))
        frames: dict[str, Floats] = {self.root: np.eye(4) if T_WB is None else np.asarray(T_WB, float)}
        waiting = list(self.joints)
        while waiting:
            ready = [joint for joint in waiting if joint.parent in frames]
            for joint in ready:
                frames[joint.child] = frames[joint.parent] @ joint.T_parent @ _motion(joint, value.get(joint.name, 0.0))
            waiting = [joint for joint in waiting if joint.child not in frames]
        return frames

    def center_of_mass(self, q: Array, T_WB: Floats | None = None) -> Floats:
        """p_WC [m], (..., 3), of postures as in `forward`."""
        frames = self.forward(q, T_WB)
        moments = (link.mass * (frames[name] @ np.append(link.com, 1.0))[..., :3] for name, link in self.links.items())
        return np.asarray(sum(moments) / self.mass)

    def feet(self) -> list[tuple[str, Floats]]:
        """(link, centre of its collision sphere in the link's frame) of the tree's leaves, in the URDF's order."""
        parents = {joint.parent for joint in self.joints}
        leaves = [joint.child for joint in self.joints if joint.child not in parents]
        return [
            (name, shape.T_link[:3, 3])
            for name in leaves
            for shape in self.links[name].collision
            if shape.kind == "sphere"
        ]


def foot_radius(body: Robot, link: str) -> float:
    """m, of the ball that a foot's link ends in, as `Robot.feet` has them."""
    return next(shape.size[0] for shape in body.links[link].collision if shape.kind == "sphere")


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> Floats:
    """R = Rz(yaw) Ry(pitch) Rx(roll), (3, 3); angles in rad."""
    return np.asarray(Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix())


def rotation_from_quaternion(quaternion: Array) -> Floats:
    """R of quaternions (w, x, y, z): (..., 4) → (..., 3, 3); nan where one is zero or not finite."""
    q = np.asarray(quaternion, float)
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    good = np.isfinite(norm) & (norm > 0.0)
    R = Rotation.from_quat(np.where(good, q, [1.0, 0.0, 0.0, 0.0]), scalar_first=True).as_matrix()
    return np.where(good[..., None], R, np.nan)


def transform(rotation: Array, position: Array) -> Floats:
    """(..., 4, 4) from R (..., 3, 3) and p [m] (..., 3)."""
    result = np.zeros((*np.broadcast_shapes(rotation.shape[:-2], position.shape[:-1]), 4, 4))
    result[..., :3, :3], result[..., :3, 3], result[..., 3, 3] = rotation, position, 1.0
    return result


def parse_urdf(text: str, joint_names: tuple[str, ...] | None = None) -> Robot:
    """Reads a URDF. `joint_names` gives the order of joint vectors, else the URDF's own. Raises UnreadableError."""
    try:
        root = ElementTree.fromstring(text)
        links = {element.attrib["name"]: _link(element) for element in root.iter("link")}
        joints = tuple(_joint(element) for element in root.findall("joint"))
    except (ElementTree.ParseError, KeyError, ValueError) as error:
        raise UnreadableError(f"the URDF cannot be read: {error}") from error
    children = {joint.child for joint in joints}
    roots = [name for name in links if name not in children]
    known = {joint.name for joint in joints}
    if len(roots) != 1 or not set(joint_names or ()) <= known or not all(joint.parent in links for joint in joints):
        raise UnreadableError("the URDF cannot be read: it is no tree of its links and named joints")
    names = joint_names or tuple(joint.name for joint in joints if joint.kind in MOVING)
    return Robot(root.attrib.get("name", ""), roots[0], links, joints, names)


def _numbers(text: str) -> Floats:
    return np.array([float(part) for part in text.split()])


def _origin(element: ElementTree.Element) -> Floats:
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    rpy = _numbers(origin.attrib.get("rpy", "0 0 0"))
    return transform(rotation_from_rpy(*rpy), _numbers(origin.attrib.get("xyz", "0 0 0")))


def _shapes(element: ElementTree.Element, tag: str) -> tuple[Shape, ...]:
    found = []
    for part in element.findall(tag):
        for kind, attributes in (("box", ("size",)), ("cylinder", ("radius", "length")), ("sphere", ("radius",))):
            geometry = part.find(f"geometry/{kind}")
            if geometry is not None:
                size = tuple(float(v) for name in attributes for v in geometry.attrib[name].split())
                found.append(Shape(kind, size, _origin(part)))
    return tuple(found)


def _link(element: ElementTree.Element) -> Link:
    inertial = element.find("inertial")
    mass = element.find("inertial/mass")
    com = _origin(inertial)[:3, 3] if inertial is not None else np.zeros(3)
    return Link(
        element.attrib["name"],
        float(mass.attrib["value"]) if mass is not None else 0.0,
        com,
        _shapes(element, "visual"),
        _shapes(element, "collision"),
    )


def _joint(element: ElementTree.Element) -> Joint:
    parent, child, limit, axis = (element.find(tag) for tag in ("parent", "child", "limit", "axis"))
    if parent is None or child is None:
        raise ValueError(f"joint {element.attrib['name']} lacks a parent or a child")
    limits = limit.attrib if limit is not None else {}
    direction = _numbers(axis.attrib["xyz"]) if axis is not None else np.array([1.0, 0.0, 0.0])
    return Joint(
        element.attrib["name"],
        element.attrib["type"],
        parent.attrib["link"],
        child.attrib["link"],
        _origin(element),
        direction / np.linalg.norm(direction),
        float(limits.get("lower", "-inf")),
        float(limits.get("upper", "inf")),
        float(limits.get("effort", "inf")),
        float(limits.get("velocity", "inf")),
    )


def _motion(joint: Joint, value: Array | float) -> Floats:
    """(..., 4, 4) of values [rad or m] (...)."""
    along = np.asarray(value)[..., None] * joint.axis
    if joint.kind == "prismatic":
        return transform(np.eye(3), along)
    if joint.kind not in MOVING:
        return np.eye(4)
    return transform(Rotation.from_rotvec(along).as_matrix(), np.zeros(3))
