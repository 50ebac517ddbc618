"""Reads the demo arm's URDF: its collision shapes, and where its links are for given joint values.

Only what the demo arm uses: revolute, prismatic and fixed joints; boxes, cylinders, spheres, and
meshes as make_meshes.py writes them.
"""

import os
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field

import numpy as np

DEMO = os.path.dirname(os.path.abspath(__file__))
URDF = os.path.join(DEMO, "demo_arm.urdf")
_COLLADA = "{http://www.collada.org/2005/11/COLLADASchema}"


@dataclass
class Shape:
    """A solid in its link's frame. size: box edges; cylinder (radius, length); sphere (radius,)."""

    kind: str
    X_LS: np.ndarray = field(default_factory=lambda: np.eye(4))
    size: tuple = ()
    vertices: np.ndarray = None
    triangles: np.ndarray = None


def rotation(axis, angle):
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def transform(R=np.eye(3), p=(0, 0, 0)):
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = R, p
    return X


def inverse(X):
    return transform(X[:3, :3].T, -X[:3, :3].T @ X[:3, 3])


def _numbers(text):
    return np.array([float(x) for x in text.split()])


def _origin(element):
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    roll, pitch, yaw = _numbers(origin.get("rpy", "0 0 0"))
    R = rotation([0, 0, 1], yaw) @ rotation([0, 1, 0], pitch) @ rotation([1, 0, 0], roll)
    return transform(R, _numbers(origin.get("xyz", "0 0 0")))


def read_mesh(path):
    """Vertices (n, 3) and triangles (m, 3) of a .stl, .obj or .dae file of make_meshes.py."""
    if path.endswith(".stl"):
        record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners = np.fromfile(path, record, offset=84)["corners"].reshape(-1, 3)
        vertices, triangles = np.unique(corners, axis=0, return_inverse=True)
        return vertices.astype(float), triangles.reshape(-1, 3)
    if path.endswith(".obj"):
        with open(path) as f:
            lines = [line.split() for line in f]
        vertices = [[float(x) for x in w[1:]] for w in lines if w[0] == "v"]
        triangles = [[int(x.split("/")[0]) - 1 for x in w[1:]] for w in lines if w[0] == "f"]
        return np.array(vertices), np.array(triangles)
    mesh = ElementTree.parse(path).getroot().find(f".//{_COLLADA}mesh")
    vertices = _numbers(mesh.find(f".//{_COLLADA}float_array").text).reshape(-1, 3)
    triangles = mesh.find(f"{_COLLADA}triangles/{_COLLADA}p").text.split()
    return vertices, np.array(triangles, int).reshape(-1, 3)


def _shape(element):
    X_LS = _origin(element)
    geometry = element.find("geometry")[0]
    if geometry.tag == "box":
        return Shape("box", X_LS, tuple(_numbers(geometry.get("size"))))
    if geometry.tag == "cylinder":
        size = (float(geometry.get("radius")), float(geometry.get("length")))
        return Shape("cylinder", X_LS, size)
    if geometry.tag == "sphere":
        return Shape("sphere", X_LS, (float(geometry.get("radius")),))
    path = geometry.get("filename").replace("package://ist_proximity", os.path.dirname(DEMO))
    vertices, triangles = read_mesh(path)
    scale = _numbers(geometry.get("scale", "1 1 1"))
    return Shape("mesh", X_LS, vertices=vertices * scale, triangles=triangles)


class ArmModel:
    def __init__(self, urdf=URDF):
        robot = ElementTree.parse(urdf).getroot()
        self.root = "base_link"
        self.shapes = {
            link.get("name"): [_shape(c) for c in link.findall("collision")]
            for link in robot.findall("link")
        }
        # The file lists every joint after the one that carries its parent.
        self._joints = robot.findall("joint")
        limits = {j.get("name"): j.find("limit") for j in self._joints if j.get("type") != "fixed"}
        self._limits = {
            name: (float(limit.get("lower")), float(limit.get("upper")))
            for name, limit in limits.items()
        }

    @property
    def joint_names(self):
        return list(self._limits)

    def check_limits(self, positions):
        for name, q in zip(self.joint_names, positions):
            lower, upper = self._limits[name]
            if not lower <= q <= upper:
                raise ValueError(f"{name}: {q:.3f} is outside [{lower}, {upper}]")

    def link_poses(self, positions):
        """X_BL, 4x4, by link name; positions in the order of joint_names."""
        q = dict(zip(self.joint_names, positions))
        X_BL = {self.root: np.eye(4)}
        for joint in self._joints:
            X = X_BL[joint.find("parent").get("link")] @ _origin(joint)
            if joint.get("type") != "fixed":
                axis, value = _numbers(joint.find("axis").get("xyz")), q[joint.get("name")]
                if joint.get("type") == "revolute":
                    X = X @ transform(rotation(axis, value))
                else:
                    X = X @ transform(p=axis * value)
            X_BL[joint.find("child").get("link")] = X
        return X_BL
