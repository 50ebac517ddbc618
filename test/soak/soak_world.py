"""The world of the soak: a robot of primitives and moving points, both functions of a stamp alone.

Every process computes the same positions from a stamp, so truth needs no record of what was sent:
the joints of header.stamp and the points of cloud_stamp say what every distance is.
"""

import numpy as np

MAX_DISTANCE = 1.0  # [m]
MARGIN = 0.03  # [m] ~query/margin, for the whole run
TOLERANCE = 0.001  # [m] ~query/tolerance
TIMEOUT = 0.5  # [s] of clouds and of poses
POINTS = 60
AHEAD = 0.2  # [s] of stamps while a clock is ahead of the node's
# [s] The robot moves, then rests, again and again. While it rests its pose is the same at every instant:
# that is when joint states can be ahead, and the truth is still that of header.stamp.
MOVE, REST = 3.0, 1.5
TOOL_RADIUS = 0.04  # [m] of the sphere that is attached to tool0

URDF = """<robot name="soak">
  <link name="base"/>
  <link name="column"><collision><origin xyz="0 0 0.2"/>
    <geometry><cylinder radius="0.08" length="0.4"/></geometry></collision></link>
  <link name="upper"><collision><origin xyz="0 0 0.2"/>
    <geometry><box size="0.1 0.12 0.4"/></geometry></collision></link>
  <link name="fore"><collision><origin xyz="0 0 0.18"/>
    <geometry><cylinder radius="0.05" length="0.36"/></geometry></collision></link>
  <link name="hand"><collision><geometry><sphere radius="0.07"/></geometry></collision></link>
  <link name="tool0"/>
  <joint name="turn" type="continuous"><parent link="base"/><child link="column"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="lift" type="revolute"><parent link="column"/><child link="upper"/>
    <origin xyz="0 0 0.45"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="5"/></joint>
  <joint name="bend" type="revolute"><parent link="upper"/><child link="fore"/>
    <origin xyz="0 0 0.45"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="5"/></joint>
  <joint name="slide" type="prismatic"><parent link="fore"/><child link="hand"/>
    <origin xyz="0 0 0.45"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="0.3" effort="1" velocity="5"/></joint>
  <joint name="to_tool" type="fixed"><parent link="hand"/><child link="tool0"/>
    <origin xyz="0 0 0.15"/></joint>
</robot>"""
JOINTS = ("turn", "lift", "bend", "slide")
LINKS = ("column", "upper", "fore", "hand", "tool0")


def _rotation(axis, angle):
    """(n, 4, 4) about z or y."""
    c, s = np.cos(angle), np.sin(angle)
    X = np.broadcast_to(np.eye(4), angle.shape + (4, 4)).copy()
    if axis == "z":
        X[..., 0, 0], X[..., 0, 1], X[..., 1, 0], X[..., 1, 1] = c, -s, s, c
    else:
        X[..., 0, 0], X[..., 0, 2], X[..., 2, 0], X[..., 2, 2] = c, s, -s, c
    return X


def _lift(z):
    """(n, 4, 4), a translation along z."""
    z = np.asarray(z, float)
    X = np.broadcast_to(np.eye(4), z.shape + (4, 4)).copy()
    X[..., 2, 3] = z
    return X


def inverse(X):
    Y = np.eye(4)
    Y[:3, :3], Y[:3, 3] = X[:3, :3].T, -X[:3, :3].T @ X[:3, 3]
    return Y


# Poses of the cameras in base; the second is for clouds in another frame.
CAMERAS = {"camera": np.eye(4), "other_camera": np.eye(4)}
CAMERAS["camera"][:3, 3] = (0.4, -0.3, 0.2)
CAMERAS["other_camera"][:3, :3] = _rotation("z", np.array(0.7))[:3, :3]
CAMERAS["other_camera"][:3, 3] = (-0.2, 0.1, 0.3)


class SoakWorld:
    """Joints and points at any time [s] since the epoch, for a seed."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self._rate = rng.uniform(0.3, 1.1, len(JOINTS))
        self._phase = rng.uniform(0, 2 * np.pi, len(JOINTS))
        self._middle = np.array([0.0, 0.3, 0.5, 0.15])
        self._amplitude = np.array([2.5, 0.8, 1.0, 0.14])
        self._home = rng.uniform(-1, 1, (POINTS, 3)) * [1.1, 1.1, 0.8] + [0, 0, 0.8]
        self._swing = rng.uniform(-0.25, 0.25, (POINTS, 3))
        self._swing_rate = rng.uniform(0.2, 1.5, (POINTS, 1))
        self._swing_phase = rng.uniform(0, 2 * np.pi, (POINTS, 1))

    def joints(self, t):
        """(..., 4) positions [rad, m]."""
        t = np.asarray(t, float)[..., None]
        rounds, phase = np.divmod(t, MOVE + REST)
        part = np.minimum(phase / MOVE, 1.0)
        t = 2 * MOVE * (rounds + part * part * (3 - 2 * part))  # starts and stops smoothly
        return self._middle + self._amplitude * np.sin(self._rate * t + self._phase)

    def points(self, t):
        """(n, 3) float32, in the frame `camera`."""
        return (self._home + self._swing * np.sin(self._swing_rate * t + self._swing_phase)).astype("<f4")


def rest_left(t):
    """[s] for which the robot still rests at a time; 0 while it moves."""
    phase = t % (MOVE + REST)
    return MOVE + REST - phase if phase > MOVE else 0.0


def link_poses(q):
    """By link (n, 4, 4), X_BL for positions (n, 4)."""
    column = _rotation("z", q[:, 0])
    upper = column @ _lift(0.45) @ _rotation("y", q[:, 1])
    fore = upper @ _lift(0.45) @ _rotation("y", q[:, 2])
    hand = fore @ _lift(0.45 + q[:, 3])
    return {"column": column, "upper": upper, "fore": fore, "hand": hand, "tool0": hand @ _lift(0.15)}


def _to_box(p, size):
    d = abs(p) - np.array(size) / 2
    return np.linalg.norm(np.maximum(d, 0), axis=-1) + np.minimum(d.max(-1), 0)


def _to_cylinder(p, radius, length):
    d = np.stack([np.hypot(p[..., 0], p[..., 1]) - radius, abs(p[..., 2]) - length / 2], -1)
    return np.linalg.norm(np.maximum(d, 0), axis=-1) + np.minimum(d.max(-1), 0)


DISTANCE = {
    "column": lambda p: _to_cylinder(p - [0, 0, 0.2], 0.08, 0.4),
    "upper": lambda p: _to_box(p - [0, 0, 0.2], (0.1, 0.12, 0.4)),
    "fore": lambda p: _to_cylinder(p - [0, 0, 0.18], 0.05, 0.36),
    "hand": lambda p: np.linalg.norm(p, axis=-1) - 0.07,
    "tool0": lambda p: np.linalg.norm(p, axis=-1) - TOOL_RADIUS,
}


def lagging_truths(world, pose_at, cloud_at, link, lag):
    """(n) distances of a link where one joint's position is older than the others' by up to `lag`."""
    lags = np.linspace(0.0, lag, 61)
    q = np.repeat(world.joints(np.full(1, pose_at)), len(JOINTS) * len(lags), axis=0)
    for j in range(len(JOINTS)):
        rows = slice(j * len(lags), (j + 1) * len(lags))
        q[rows, j] = world.joints(pose_at - lags)[:, j]
    return distances(world, q, np.full(len(q), cloud_at))[link]


def truth(world, poses_at, clouds_at):
    """By link the smallest signed distance (n), for poses and clouds of these times (n), in double."""
    return distances(world, world.joints(poses_at), clouds_at)


def distances(world, q, clouds_at):
    """The same for positions (n, 4)."""
    poses = link_poses(q)
    X_BC = CAMERAS["camera"]
    unique, index = np.unique(clouds_at, return_inverse=True)
    points = np.stack([world.points(t).astype(float) for t in unique])[index]
    points = points @ X_BC[:3, :3].T + X_BC[:3, 3]
    result = {}
    for name, X in poses.items():
        # p_L = R^T (p_B - p_BL)
        p = np.einsum("nji,nkj->nki", X[:, :3, :3], points - X[:, None, :3, 3])
        result[name] = DISTANCE[name](p).min(-1)
    return result
