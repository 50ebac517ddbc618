"""Objects of MoveIt's planning scene, from messages of any version of moveit_msgs.

Poses are pairs of a position p [m] and a unit quaternion q = x, y, z, w. X_AB is the pose of frame B in frame A.
"""

import numpy as np

from ist_proximity.msg import WorldObject

ADD, REMOVE, APPEND, MOVE = range(4)  # of moveit_msgs/CollisionObject
MAX_LENGTH = 1e4  # [m]
SAME_POSE = 1e-6  # [m, and of a quaternion] Poses that differ by less are the same: messages round.
IDENTITY = (np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
# Numbers of shape_msgs/SolidPrimitive: our shape, and our dimensions' places among theirs.
PRIMITIVES = {
    1: (WorldObject.BOX, (0, 1, 2)),
    2: (WorldObject.SPHERE, (0,)),
    3: (WorldObject.CYLINDER, (1, 0)),
    4: (WorldObject.CONE, (1, 0)),
}


class Fault(Exception):
    """Says why something of a scene cannot be used."""


def rotated(q, v):
    """The vector v, turned by q."""
    t = 2 * np.cross(q[:3], v)
    return v + q[3] * t + np.cross(q[:3], t)


def compose(X_AB, X_BC):
    (p, q), (r, s) = X_AB, X_BC
    vector = q[3] * s[:3] + s[3] * q[:3] + np.cross(q[:3], s[:3])
    return p + rotated(q, r), np.append(vector, q[3] * s[3] - q[:3] @ s[:3])


def inverse(X_AB):
    q = X_AB[1] * [-1, -1, -1, 1]
    return -rotated(q, X_AB[0]), q


def is_same(A, B):
    turn = min(abs(A[1] - B[1]).max(), abs(A[1] + B[1]).max())
    return max(abs(A[0] - B[0]).max(), turn) <= SAME_POSE


def read_pose(message, what):
    """A quaternion of length 0 is the identity, as in MoveIt."""
    p = np.array([getattr(message.position, k) for k in "xyz"])
    q = np.array([getattr(message.orientation, k) for k in "xyzw"])
    length = np.linalg.norm(q)
    if length != 0 and not abs(length - 1) <= 0.01:
        raise Fault("%s has a quaternion of length %g" % (what, length))
    if not (abs(p) <= MAX_LENGTH).all():
        raise Fault("%s is at (%g, %g, %g) m; allowed are %g m" % (what, *p, MAX_LENGTH))
    return p, (q / length if length != 0 else IDENTITY[1])


def write_pose(X, message):
    for k, value in zip("xyz", X[0]):
        setattr(message.position, k, value)
    for k, value in zip("xyzw", X[1]):
        setattr(message.orientation, k, value)


def frame_of(header):
    return header.frame_id.lstrip("/")


class Shape:
    """A shape, the pose that its message states in the object's frame, and where ours is in that pose."""

    def __init__(self, shape, dimensions=(), mesh=None, X_ME=IDENTITY):
        self.shape, self.dimensions, self.mesh, self.X_ME = shape, dimensions, mesh, X_ME
        self.X_PM = IDENTITY

    def at(self, X_PM):
        self.X_PM = X_PM
        return self

    def message(self, X_BP):
        one = WorldObject(operation=WorldObject.APPEND, shape=self.shape, dimensions=self.dimensions)
        if self.mesh:
            one.vertices = self.mesh.vertices
            one.triangles = [i for t in self.mesh.triangles for i in t.vertex_indices]
        write_pose(compose(X_BP, compose(self.X_PM, self.X_ME)), one.pose)
        return one


def read_primitive(message):
    if message.type not in PRIMITIVES:
        raise Fault("a primitive is of type %d; allowed is 1 to 4" % message.type)
    shape, places = PRIMITIVES[message.type]
    if len(message.dimensions) < len(places):
        numbers = (message.type, len(message.dimensions), len(places))
        raise Fault("a primitive of type %d has %d dimensions; needed are %d" % numbers)
    dimensions = [message.dimensions[place] for place in places]
    for size in dimensions:
        if not 0 < size <= MAX_LENGTH:
            raise Fault("a dimension is %g m; allowed is more than 0, to %g m" % (size, MAX_LENGTH))
    return Shape(shape, dimensions)


def read_mesh(message):
    corners = [i for t in message.triangles for i in t.vertex_indices]
    if not corners or max(corners) >= len(message.vertices):
        numbers = (len(message.triangles), max(corners, default=0), len(message.vertices))
        raise Fault("a mesh of %d triangles names vertex %d of %d" % numbers)
    return Shape(WorldObject.MESH, mesh=message)


def read_plane(message):
    """ax + by + cz + d = 0; below it is solid."""
    n, d = np.array(message.coef[:3]), message.coef[3]
    length = np.linalg.norm(n)
    if not (1e-9 < length < 1e9 and abs(d) < np.inf):
        raise Fault("a plane has no normal: ax + by + cz + d = 0 with (a, b, c) not 0 is needed")
    n = n / length
    q = np.array([-n[1], n[0], 0.0, 1.0 + n[2]])  # turns z to n
    q = np.array([1.0, 0.0, 0.0, 0.0]) if np.linalg.norm(q) < 1e-6 else q / np.linalg.norm(q)
    return Shape(WorldObject.PLANE, X_ME=(-d / length * n, q))


class SceneObject:
    """An object P in its frame B, which is not changed once it is made."""

    def __init__(self, name, frame, X_BP=IDENTITY, shapes=(), target=None):
        self.name, self.frame, self.X_BP, self.shapes = name, frame, X_BP, shapes
        self.target = target  # the frame that it moves with from now on; None: its own

    def but(self, **changes):
        return SceneObject(**dict(vars(self), **changes))

    def messages(self, allowed_links):
        messages = [shape.message(self.X_BP) for shape in self.shapes]
        messages[0].operation, messages[0].allowed_links = WorldObject.ADD, list(allowed_links)
        for message in messages:
            message.id, message.header.frame_id = self.name, self.frame
        return messages


def read_object(message, default_frame):
    """An object of a moveit_msgs/CollisionObject, and the poses of its shapes, of MOVE too."""
    has_pose = hasattr(message, "pose")  # from moveit_msgs 0.11 on
    X_BP = read_pose(message.pose, "its pose") if has_pose else IDENTITY
    shapes, X_PM = [], []
    for kind, read in (("primitive", read_primitive), ("mesh", read_mesh), ("plane", read_plane)):
        some = [read(one) for one in getattr(message, kind + ("es" if kind == "mesh" else "s"))]
        poses = [read_pose(pose, "a shape's pose") for pose in getattr(message, kind + "_poses")]
        if some and len(poses) > len(some):
            raise Fault("it has %d %s shapes and %d poses of them" % (len(some), kind, len(poses)))
        poses += [IDENTITY] * (len(some) - len(poses))
        shapes += [shape.at(pose) for shape, pose in zip(some, poses)]
        X_PM += poses
    if is_same(X_BP, IDENTITY) and len(shapes) == 1:
        # The shape's pose becomes the object's, as in MoveIt, so that the object can be moved.
        X_BP = shapes[0].X_PM
        shapes[0].at(IDENTITY)
    frame = frame_of(message.header) or default_frame
    return SceneObject(message.id, frame, X_BP, tuple(shapes)), X_PM


def append(known, more, message):
    """The known object with more shapes, at its own pose."""
    if known.frame != more.frame:
        raise Fault(
            "shapes are to be appended in frame '%s', and it stands in '%s': send all of it with ADD"
            % (more.frame, known.frame)
        )
    # MoveIt reads such poses relative to the known object, their definition relative to the frame.
    if hasattr(message, "pose") and not is_same(known.X_BP, more.X_BP):
        raise Fault("shapes are to be appended at another pose than the object's: send all of it with ADD")
    X_PA = compose(inverse(known.X_BP), more.X_BP)
    moved = [Shape(s.shape, s.dimensions, s.mesh, s.X_ME).at(compose(X_PA, s.X_PM)) for s in more.shapes]
    return known.but(shapes=known.shapes + tuple(moved))


def move(known, stated, X_PM, message):
    """The known object, moved as a whole."""
    if not X_PM:
        if not hasattr(message, "pose"):
            raise Fault("it is to be moved, and no pose is stated")
        return known.but(frame=stated.frame, X_BP=stated.X_BP, target=None)
    if len(X_PM) != len(known.shapes):
        numbers = (len(X_PM), len(known.shapes))
        raise Fault("it is to be moved with %d poses, and it has %d shapes: send all of it with ADD" % numbers)
    X_BM = [compose(stated.X_BP, pose) for pose in X_PM]
    X_BP = compose(X_BM[0], inverse(known.shapes[0].X_PM))
    if not all(is_same(compose(X_BP, s.X_PM), pose) for s, pose in zip(known.shapes, X_BM)):
        raise Fault("its shapes are to be moved against one another: send all of it with ADD")
    return known.but(frame=stated.frame, X_BP=X_BP, target=None)
