#!/usr/bin/env python3
"""Objects that a moveit_msgs/PlanningScene attaches to links: they move with them, against the true distance."""

import unittest

import numpy as np
import proximity_testing as pt
from joint_states_test import ARM, arm_poses
from planning_scene_test import APPEND, MOVE, REMOVE, Bridge, Publisher
from proximity_testing import LinkProximity, ProximityArray
from sensor_msgs.msg import JointState

from ist_proximity.srv import QueryProximity

EDGE = 0.2  # [m] of every object
HOME = pt.transform((0, 0, 0.75))  # of box_link
CUP = pt.transform((0, 0.35, 0))  # where the cup stands in the world: 0.15 m from the ball


def distance_to_cube(X, p):
    """Of a point from a cube of EDGE at a pose."""
    q = abs(pt.apply(pt.inverse(X), [p])[0]) - EDGE / 2
    return np.linalg.norm(np.maximum(q, 0)) + min(q.max(), 0)


class AttachedSceneTest(unittest.TestCase):
    """The ball of radius 0.1 m is at the origin; objects are attached to box_link, which moves."""

    @classmethod
    def setUpClass(cls):
        cls.world = pt.World("/attached").stand(box=HOME)
        cls.world.start_tf()
        cls.scenes = Publisher("/attached/scene", True)
        cls.scenes.send(is_diff=False)
        source = {"type": "world", "topic": "objects"}
        cls.node = pt.ProximityNode(
            "/attached", {"sources": {"moveit": source}, "max_distance": 1.5}, pt.urdf()
        )
        cls.bridge = Bridge("/attached", "scene", "objects")
        cls.node.wait_for_status(ProximityArray.OK)

    @classmethod
    def tearDownClass(cls):
        cls.bridge.stop()
        cls.node.stop()
        cls.world.stop()

    def setUp(self):
        self.world.poses["box_link"] = ("base", HOME)
        self.world.poses.pop("tool", None)
        self.scenes.send(is_diff=False)
        self.nothing()

    def nothing(self):
        self.wait("ball_link", np.inf, "nothing near the ball")
        self.wait("box_link", np.inf, "nothing near the box")

    def wait(self, name, expected, what):
        """Waits for the true distance of a link, inf where nothing is measured."""

        def is_true(message):
            one = pt.link(message, name)
            if message.status != ProximityArray.OK:
                return False
            if np.isinf(expected):
                return one.state == LinkProximity.CLEAR
            is_between = one.lower_bound - 1e-9 <= expected <= one.distance + 1e-9
            return is_between and one.distance - expected < 1.001e-3  # the tolerance

        return self.node.wait_for(is_true, "%s, %g from %s" % (what, expected, name))

    def attach(self, one=None, touch_links=(), link="box_link", **scene):
        """Attaches an object, which is the cup of the scene's world unless said."""
        one = self.scenes.box("cup") if one is None else one
        self.scenes.send(attached=[self.scenes.attached(link, one, touch_links)], **scene)

    def put_cup(self):
        self.scenes.send(self.scenes.box("cup", CUP[:3, 3]))
        self.wait("ball_link", 0.15, "the cup in the world")
        self.wait("box_link", np.hypot(0.05, 0.45), "the cup in the world")

    def unusable(self, text):
        self.node.wait_for_unknown(ProximityArray.NO_CLOUD, text)

    def test_1_an_attached_object_moves_with_its_link(self):
        self.put_cup()
        self.attach()
        # It stays where it is; its own link may touch it.
        self.wait("box_link", np.inf, "the attached cup")
        self.wait("ball_link", 0.15, "the attached cup")
        X_LC = pt.inverse(HOME) @ CUP
        rng = np.random.RandomState(5)
        measured = 0
        for i in range(30):
            axis = rng.normal(size=3)
            X_BL = pt.transform(rng.uniform(-0.4, 0.4, 3), axis / np.linalg.norm(axis), rng.uniform(0, 6))
            self.world.poses["box_link"] = ("base", X_BL)
            distance = distance_to_cube(X_BL @ X_LC, (0, 0, 0)) - pt.BALL_RADIUS
            if 0 < distance < 1.4:
                self.wait("ball_link", distance, "the cup at pose %d of its link" % i)
                measured += 1
        self.assertGreater(measured, 10)
        # Detached it stays where it is, and both links may not touch it.
        X_BL = pt.transform((0, 0.1, 0.9), (0, 0, 1), 0.3)
        self.world.poses["box_link"] = ("base", X_BL)
        X_BC = X_BL @ X_LC
        distance = distance_to_cube(X_BC, (0, 0, 0)) - pt.BALL_RADIUS
        self.wait("ball_link", distance, "the cup before it is detached")
        self.attach(self.scenes.box("cup", operation=REMOVE))
        p_L = pt.apply(pt.inverse(X_BL), pt.apply(X_BC, np.array(np.meshgrid(*[[-0.1, 0.1]] * 3)).reshape(3, -1).T))
        self.node.wait_for(lambda m: pt.link(m, "box_link").state == LinkProximity.NEAR, "the detached cup")
        self.assertGreater(pt.distance_to_box(p_L).min(), 0.1)
        self.world.poses["box_link"] = ("base", HOME)
        self.node.wait_for(
            lambda m: abs(pt.link(m, "box_link").point_on_link.z - 0.55) < 1e-6, "the box, back home"
        )
        self.wait("ball_link", distance, "the cup that stays")
        # What the scene says of it now is its place: it is in the world.
        self.scenes.send(self.scenes.box("cup", (0, 0.4, 0), MOVE))
        self.wait("ball_link", 0.2, "the cup that was moved")

    def test_2_touch_links_and_matrix(self):
        self.put_cup()
        self.attach(touch_links=["ball_link", "no_such_link"])
        self.nothing()
        # Attached anew without touch_links, in its link's frame.
        cup = self.scenes.box("cup", (0, 0.3, -0.75), frame="box_link")
        self.attach(cup)
        self.wait("ball_link", 0.1, "the cup that may not be touched")
        self.wait("box_link", np.inf, "its own link")
        self.scenes.send(allowed=["ball_link", "cup"])
        self.nothing()
        self.scenes.send(allowed=["ball_link", "other"])
        self.wait("ball_link", 0.1, "the cup, without its entries")
        self.wait("box_link", np.inf, "its own link, whatever the matrix says")

    def test_3_how_attachments_end(self):
        cup = self.scenes.box("cup", (0, 0.3, -0.75), frame="box_link")
        # MoveIt says of a detached object where it is.
        self.attach(cup)
        self.wait("ball_link", 0.1, "the cup")
        self.attach(self.scenes.box("cup", operation=REMOVE), link="", is_diff=True)
        self.wait("ball_link", 0.1, "the cup in the world")
        self.attach(cup)
        self.wait("box_link", np.inf, "the cup, attached again")
        detached = self.scenes.attached("", self.scenes.box("cup", operation=REMOVE))
        self.scenes.send(self.scenes.box("cup", (0, 0.45, 0)), attached=[detached])
        self.wait("ball_link", 0.25, "the cup where the message says")
        self.scenes.send(self.scenes.box("cup", operation=REMOVE))
        self.nothing()

    def tray(self):
        """An object that is far from the ball."""
        return self.scenes.box("tray", (0, 0, 2), frame="box_link")

    def test_4_other_frames(self):
        # A frame that stands still in that of the link, and one that tf learns later.
        X_LT = pt.transform((0.1, 0, 0), (0, 0, 1), np.pi / 2)
        self.world.poses["tool"] = ("box_link", X_LT)
        self.attach(self.scenes.box("cup", (0.3, 0.1, -0.75), frame="tool"))
        self.wait("ball_link", 0.1, "the cup in the tool's frame")
        self.world.poses["box_link"] = ("base", pt.transform((0, 0.2, 0.75)))
        self.wait("ball_link", 0.3, "the cup that moves with the link")
        self.world.poses["box_link"] = ("base", HOME)
        self.attach(self.scenes.box("cup", (0.35, 0, -0.75), frame="late"))
        self.unusable("'late'")
        self.world.poses["late"] = ("box_link", pt.transform((0, 0, 0)))
        self.wait("ball_link", 0.15, "the cup in a frame that tf has learnt")
        self.world.poses.pop("late")

    def test_5_what_cannot_be_attached_is_named(self):
        box, attach = self.scenes.box, self.attach
        attach(box("ghost"))
        self.unusable("'ghost'")
        attach(box("ghost", operation=REMOVE))
        self.nothing()
        attach(box("cup", (0, 0.3, 0), frame="box_link"), link="no_link")
        self.unusable("no_link")
        attach(box("cup", (0, 0.3, -0.75), frame="box_link"))
        self.wait("ball_link", 0.1, "the cup at a link that is there")
        for operation in (MOVE, APPEND):
            attach(box("cup", (0, 0.3, 0), operation, frame="box_link"))
            self.unusable("'cup'")
            attach(box("cup", (0, 0.3, -0.75), frame="box_link"))
            self.wait("ball_link", 0.1, "the cup that was sent anew")
        # The world's cup stays while what is to be attached cannot be used.
        self.scenes.send(is_diff=False)
        self.put_cup()
        attach(box("cup", (0, 0.3, 0), edge=-1.0, frame="box_link"))
        self.unusable("'cup'")
        attach(box("cup", operation=REMOVE))
        self.wait("ball_link", 0.15, "the cup of the world")
        # Neither does one that is read, and refused when it is built: here because of its name.
        long_name = "x" * 250
        self.scenes.send(box("cup", operation=REMOVE), box(long_name, (0, 0.4, 0)))
        self.wait("ball_link", 0.2, "an object with a long name")
        attach(box(long_name))
        self.unusable("name")
        attach(box(long_name, operation=REMOVE))
        self.wait("ball_link", 0.2, "the object with the long name, which stays")
        # More than the limit: the scene is not known any more.
        attach(self.tray(), is_diff=False)
        self.nothing()
        many = [box("part %d" % i, (0, 0, 5)) for i in range(10000)]
        self.scenes.send(*many)
        self.unusable("objects")
        self.scenes.send(is_diff=False)
        self.nothing()

    def test_6_what_is_not_measured_is_said(self):
        self.attach(self.tray())
        self.node.wait_until(
            lambda: "'tray' (to 'box_link'): measured against the robot's other links alone"
            in self.message(),
            "diagnostics",
        )
        self.scenes.send(is_diff=False)
        self.node.wait_until(lambda: "'tray'" not in self.message(), "diagnostics without it")

    def message(self):
        status = self.node.diagnostics.get("input moveit")
        return status.message if status else ""


class QueryTest(unittest.TestCase):
    """In a configuration that ~query states, what a link carries is where the link is then."""

    def setUp(self):
        self.world = pt.World("/carried", None)
        X = arm_poses(turn=0.3, slide=0.5)
        column = pt.transform((0, 0, 0.5), angle=0.3)
        self.world.poses = {"column": ("base", column), "camera": ("base", X["camera"])}
        for name in ("ball_link", "box_link"):
            self.world.poses[name] = ("column", pt.inverse(column) @ X[name])
        self.world.start_tf()
        self.scenes = Publisher("/carried/scene", True)
        # Between ball and box, whose gap it leaves is 2.5 slide - 0.05.
        cup = self.scenes.box("cup", (-0.3, 0, 0), frame="ball_link")
        self.scenes.send(attached=[self.scenes.attached("ball_link", cup)], is_diff=False)
        source = {"type": "world", "topic": "objects"}
        self.node = pt.ProximityNode("/carried", {"sources": {"moveit": source}, "max_distance": 3.0}, ARM)
        self.bridge = Bridge("/carried", "scene", "objects")
        self.node.wait_for_status(ProximityArray.OK)
        self.ask = self.node.service("query", QueryProximity)

    def tearDown(self):
        self.bridge.stop()
        self.assertEqual(self.node.stop(), 0)
        self.world.stop()

    def state(self, turn, slide):
        return JointState(name=["turn", "slide"], position=[turn, slide])

    def test_query(self):
        rng = np.random.default_rng(8)
        slides = rng.uniform(0.03, 1.0, 20)
        answer = self.ask(states=[self.state(rng.uniform(-3, 3), slide) for slide in slides])
        self.assertTrue(answer.success, answer.message)
        for slide, result in zip(slides, answer.results):
            self.assertEqual(result.status, ProximityArray.OK, result.status_text)
            box, truth = pt.link(result, "box_link"), 2.5 * slide - 0.05
            self.assertLessEqual(box.lower_bound, truth + 1e-9)
            self.assertGreaterEqual(box.distance, truth - 1e-9)
            self.assertLessEqual(box.distance - truth, 1.001e-3)
            self.assertEqual(pt.link(result, "ball_link").state, LinkProximity.CLEAR)
        # Of the robot as it is now, the cycles say the same.
        self.assertLess(abs(pt.link(self.node.messages[-1], "box_link").distance - 1.2), 1.001e-3)

    def test_times_of_impact(self):
        motion = [self.state(0.3, 0.5), self.state(1.3, 0.0)]
        answer = self.ask(states=motion, times=[0.0, 1.0])
        times = dict(zip(answer.impact_links, answer.impact_times))
        self.assertEqual(times["ball_link"], np.inf)
        self.assertLessEqual(times["box_link"], 0.96)  # where slide is 0.02
        self.assertGreater(times["box_link"], 0.955)


if __name__ == "__main__":
    pt.run("attached_scene_test", {"attached": AttachedSceneTest, "carried": QueryTest})
