#!/usr/bin/env python3
"""What the bridge makes of planning scenes, of both layouts, without a node."""

import math
import os
import sys
import time
import unittest

import numpy as np
import proximity_testing as pt
from geometry_msgs.msg import Pose
from planning_scene_messages import planning_scene_types

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "src", "nodes"))
from scene_objects import IDENTITY, Fault, compose, inverse, rotated  # noqa: E402
from scene_state import SceneState  # noqa: E402

from ist_proximity.msg import WorldObject  # noqa: E402

ADD, REMOVE, APPEND, MOVE = range(4)
QUARTER = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))  # about z


def pose(p, q=(0.0, 0.0, 0.0, 1.0)):
    result = Pose()
    result.position.x, result.position.y, result.position.z = p
    result.orientation.x, result.orientation.y, result.orientation.z, result.orientation.w = q
    return result


class Scenes:
    """Scenes of one layout and what has become of them."""

    def __init__(self, is_noetic, **options):
        self.types, self.is_noetic = planning_scene_types(is_noetic), is_noetic
        self.state = SceneState("base", options.get("use_matrix", True))

    def make(self, name, **fields):
        return self.types[name](**fields)

    def object(self, name, shapes=(), operation=ADD, frame="world", at=None):
        one = self.make("moveit_msgs/CollisionObject", id=name, operation=operation)
        one.header.frame_id = frame
        for kind, shape, place in shapes:
            if shape is not None:
                getattr(one, kind + ("es" if kind == "mesh" else "s")).append(shape)
            if place is not None:
                getattr(one, kind + "_poses").append(place)
        if self.is_noetic and at is not None:
            one.pose = at
        return one

    def box(self, place=None, edges=(0.2, 0.2, 0.2)):
        shape = self.make("shape_msgs/SolidPrimitive", type=1, dimensions=list(edges))
        return ("primitive", shape, place)

    def send(self, *objects, is_diff=True, attached=(), is_state_diff=True, joints=(), **fields):
        scene = self.make("moveit_msgs/PlanningScene", is_diff=is_diff, **fields)
        scene.world.collision_objects = list(objects)
        scene.robot_state.attached_collision_objects = list(attached)
        scene.robot_state.is_diff = is_state_diff
        scene.robot_state.joint_state.name = list(joints)
        self.state.apply(scene)
        self.state.restate(lambda to, frame: IDENTITY)
        return self.state

    def attachment(self, link, one, touch_links=()):
        kind = "moveit_msgs/AttachedCollisionObject"
        return self.make(kind, link_name=link, object=one, touch_links=list(touch_links))

    def matrix(self, names, rows):
        entries = [self.make("moveit_msgs/AllowedCollisionEntry", enabled=row) for row in rows]
        return self.make("moveit_msgs/AllowedCollisionMatrix", entry_names=names, entry_values=entries)


def place_of(message):
    p, q = message.pose.position, message.pose.orientation
    return np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])


class SceneStateTest(unittest.TestCase):
    def near(self, actual, expected):
        np.testing.assert_allclose(actual, expected, atol=1e-12)

    def each_layout(self):
        for is_noetic in (True, False):
            with self.subTest(noetic=is_noetic):
                yield Scenes(is_noetic)

    def test_poses_compose(self):
        X = (np.array([1.0, 2.0, 3.0]), np.array(QUARTER))
        self.near(rotated(X[1], np.array([1.0, 0.0, 0.0])), [0, 1, 0])
        self.near(compose(X, inverse(X))[0], [0, 0, 0])
        self.near(compose(X, X)[0], [-1, 3, 6])

    def test_every_shape_is_where_its_poses_say(self):
        for scenes in self.each_layout():
            z = 0.25 if scenes.is_noetic else 0.0
            triangle = scenes.make("shape_msgs/MeshTriangle", vertex_indices=[0, 1, 2])
            corners = [pose(p).position for p in ((0, 0, 0), (1, 0, 0), (0, 1, 0))]
            shapes = [
                scenes.box(pose((1, 0, 0)), (0.1, 0.2, 0.3)),
                ("primitive", scenes.make("shape_msgs/SolidPrimitive", type=3, dimensions=[2.0, 0.5]), None),
                (
                    "mesh",
                    scenes.make("shape_msgs/Mesh", triangles=[triangle], vertices=corners),
                    pose((0, 5, 0), QUARTER),
                ),
                ("plane", scenes.make("shape_msgs/Plane", coef=[0.0, 2.0, 0.0, 1.0]), pose((0, 0, 1))),
            ]
            state = scenes.send(scenes.object("all", shapes, at=pose((0, 0, 0.25))), is_diff=False)
            box, cylinder, mesh, plane = state.objects["all"].messages(["arm"])
            operations = [m.operation for m in (box, cylinder, mesh, plane)]
            self.assertEqual(operations, [WorldObject.ADD] + 3 * [WorldObject.APPEND])
            self.assertEqual((box.header.frame_id, box.id, box.allowed_links), ("world", "all", ["arm"]))
            self.assertEqual((box.shape, list(box.dimensions)), (WorldObject.BOX, [0.1, 0.2, 0.3]))
            self.near(place_of(box)[0], [1, 0, z])
            # Its height comes first there; its pose is missing, and so the identity.
            self.assertEqual((cylinder.shape, list(cylinder.dimensions)), (WorldObject.CYLINDER, [0.5, 2.0]))
            self.near(place_of(cylinder)[0], [0, 0, z])
            self.assertEqual((mesh.shape, mesh.triangles, len(mesh.vertices)), (WorldObject.MESH, [0, 1, 2], 3))
            self.near(place_of(mesh)[1], QUARTER)
            # Below y = -1/2 is solid, which is below z = 0 of ours.
            self.near(place_of(plane)[0], [0, -0.5, 1 + z])
            self.near(rotated(place_of(plane)[1], np.array([0, 0, 1.0])), [0, 1, 0])

    def test_objects_move_as_a_whole(self):
        for scenes in self.each_layout():
            two = [scenes.box(pose((1, 0, 0))), scenes.box(pose((2, 0, 0)))]
            scenes.send(scenes.object("two", two), scenes.object("one", [scenes.box(pose((1, 2, 3)))]), is_diff=False)
            moved = [("primitive", None, pose((1, 0, 5))), ("primitive", None, pose((2, 0, 5)))]
            state = scenes.send(scenes.object("two", moved, MOVE))
            self.near(place_of(state.objects["two"].messages([])[1])[0], [2, 0, 5])
            apart = [("primitive", None, pose((1, 0, 5))), ("primitive", None, pose((2, 1, 5)))]
            self.assertIn("against one another", scenes.send(scenes.object("two", apart, MOVE)).incomplete())
            self.assertIn("2 shapes", scenes.send(scenes.object("two", moved[:1], MOVE)).incomplete())
            scenes.send(scenes.object("two", moved, MOVE))
            # The pose of the only shape is the object's.
            state = scenes.send(scenes.object("one", operation=MOVE, at=pose((0, 7, 0))))
            if scenes.is_noetic:
                self.assertEqual(state.incomplete(), "")
                self.near(place_of(state.objects["one"].messages([])[0])[0], [0, 7, 0])
            else:
                self.assertIn("no pose", state.incomplete())
            self.assertIn("was never added", scenes.send(scenes.object("none", moved, MOVE)).incomplete())

    def test_shapes_are_appended_where_both_readings_agree(self):
        for scenes in self.each_layout():
            scenes.send(scenes.object("part", [scenes.box(pose((1, 0, 0)))]), is_diff=False)
            more = scenes.object("part", [scenes.box(pose((2, 0, 0)))], APPEND)
            state = scenes.send(more)
            if scenes.is_noetic:
                self.assertIn("another pose", state.incomplete())
                self.assertEqual(len(state.objects["part"].shapes), 1)
            else:
                self.assertEqual(state.incomplete(), "")
                self.near(place_of(state.objects["part"].messages([])[1])[0], [2, 0, 0])
            more.header.frame_id = "elsewhere"
            self.assertIn("elsewhere", scenes.send(more).incomplete())

    def test_one_that_cannot_be_used_is_named_alone(self):
        for scenes in self.each_layout():

            def solid(**fields):
                return ("primitive", scenes.make("shape_msgs/SolidPrimitive", **fields), pose((0, 0, 0)))

            triangle = scenes.make("shape_msgs/MeshTriangle", vertex_indices=[0, 1, 3])
            mesh = scenes.make("shape_msgs/Mesh", triangles=[triangle], vertices=[pose((0, 0, 0)).position] * 3)
            for shape, said in (
                (solid(type=1, dimensions=[1.0, 1.0]), "2 dimensions; needed are 3"),
                (solid(type=9, dimensions=[1.0]), "of type 9; allowed is 1 to 4"),
                (solid(type=2, dimensions=[0.0]), "dimension is 0 m"),
                (solid(type=2, dimensions=[1e5]), "dimension is 100000 m"),
                (("mesh", mesh, None), "names vertex 3 of 3"),
                (("plane", scenes.make("shape_msgs/Plane", coef=[0.0] * 4), None), "no normal"),
                (scenes.box(pose((0, 0, 0), (0, 0, 0, 1.5))), "quaternion of length 1.5"),
                (scenes.box(pose((math.nan, 0, 0))), "is at (nan, 0, 0) m"),
            ):
                good = [scenes.object(name, [scenes.box()]) for name in ("before", "after")]
                state = scenes.send(good[0], scenes.object("bad", [shape]), good[1], is_diff=False)
                self.assertEqual(set(state.objects), {"before", "after"})
                self.assertTrue(state.incomplete().startswith("object 'bad': "), state.incomplete())
                self.assertIn(said, state.incomplete())
            state = scenes.send(scenes.object("bad", [scenes.box(pose((1, 2, 3), (0, 0, 0, 0)))]))
            self.assertEqual(state.incomplete(), "")
            self.near(state.objects["bad"].X_BP[1], [0, 0, 0, 1])  # as MoveIt reads it

    def test_attached_objects_stay_until_they_are_detached(self):
        for scenes in self.each_layout():

            def attach(name, link, operation=ADD):
                shapes = [scenes.box()] if operation == ADD else []
                return scenes.attachment(link, scenes.object(name, shapes, operation, link or "world"), ["finger"])

            some = [attach("cup", "hand"), attach("drill", "hand"), attach("hat", "head"), attach("saw", "foot")]
            state = scenes.send(attached=some, is_diff=False)
            self.assertIn("'cup' (to 'hand'), 'drill' (to 'hand'), 'hat' (to 'head') and 1 more: ", state.doubt())
            self.assertEqual(state.allowed_links("saw (attached)"), ["finger", "foot"])
            scenes.send(attached=[attach("cup", "head", REMOVE), attach("bag", "", REMOVE)])  # MoveIt refuses it
            self.assertEqual(len(state.attached), 4)
            scenes.send(attached=[attach("cup", "hand", REMOVE), attach("", "head", REMOVE)])
            self.assertEqual(set(state.attached), {"drill (attached)", "saw (attached)"})
            self.assertEqual(state.objects["cup"].frame, "base")  # in the world again
            # Whole states end attachments: not differences, nor a state that says nothing.
            scenes.send()
            scenes.send(joints=["turn"])
            scenes.send(is_state_diff=False)
            self.assertEqual(len(state.attached), 2)
            scenes.send(is_state_diff=False, joints=["turn"])
            self.assertEqual((state.attached, state.doubt()), ({}, ""))

    def test_the_octomap_is_replaced_as_in_moveit(self):
        scenes = Scenes(True)
        octomap = scenes.make("octomap_msgs/OctomapWithPose", origin=pose((1, 2, 3)))
        octomap.header.frame_id = "map"
        octomap.octomap.id, octomap.octomap.data, octomap.octomap.resolution = "OcTree", [-1, 2], 0.1

        def send(one=None, removed=False, **fields):
            scene = scenes.make("moveit_msgs/PlanningScene", **fields)
            scene.robot_state.is_diff = True
            if one is not None:
                scene.world.octomap = one
            if removed:
                scene.world.collision_objects = [scenes.object("<octomap>", operation=REMOVE)]
            scenes.state.apply(scene)
            return scenes.state.octomap

        self.assertEqual((send(octomap, is_diff=True).data, send(is_diff=True).header.frame_id), (b"\xff\x02", "map"))
        self.near(place_of_origin(scenes.state.octomap), [1, 2, 3])
        self.assertEqual(send(removed=True, is_diff=True).data, b"")
        send(octomap, is_diff=True)
        self.assertEqual(send(is_diff=False).data, b"")
        send(octomap, is_diff=True)
        cleared = scenes.make("octomap_msgs/OctomapWithPose")
        cleared.octomap.id = "cleared"
        self.assertEqual(send(cleared, is_diff=True).data, b"")

    def test_allowed_pairs_need_both_entries(self):
        scenes = Scenes(True)
        table = scenes.object("table", [scenes.box()])
        names, rows = ["table", "wall", "base", "arm"], [[0, 1, 1, 1], [1, 0, 1, 1], [1, 1, 0, 0], [0, 1, 0, 0]]
        wall = scenes.object("wall", [scenes.box()])
        state = scenes.send(table, wall, is_diff=False, allowed_collision_matrix=scenes.matrix(names, rows))
        self.assertEqual(state.allowed_links("table"), ["base"])
        self.assertEqual(state.allowed_links("unknown"), [])
        state = scenes.send(allowed_collision_matrix=scenes.matrix(names, rows[:3]))
        self.assertEqual(state.allowed_links("table"), [])
        self.assertIn("not square", state.doubt())

    def test_limits(self):
        scenes = Scenes(True)
        begin = time.monotonic()
        with self.assertRaises(Fault):
            scenes.send(*[scenes.object("%d" % i, [scenes.box()] * 1000) for i in range(101)])
        self.assertLess(time.monotonic() - begin, 5.0)
        self.assertEqual(scenes.state.objects, {})


def place_of_origin(octomap):
    return [octomap.origin.position.x, octomap.origin.position.y, octomap.origin.position.z]


if __name__ == "__main__":
    pt.run("scene_state_test", SceneStateTest)
