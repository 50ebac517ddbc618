#!/usr/bin/env python3
"""~self_proximity: truth, contact, pairs that are left out, and what is missing."""

import unittest

import numpy as np
import proximity_testing as pt
import rospy
from joint_states_test import ARM, JointStatesTest
from proximity_testing import LinkProximity, ProximityArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from ist_proximity.msg import JointRepulsion, LinkPair
from ist_proximity.srv import DetachObject, ListLinkPairs, QueryProximity

SRDF = '<robot name="arm"><disable_collisions link1="box_link" link2="ball_link"/></robot>'
SRDF_DEFAULT = '<robot name="arm"><disable_default_collisions link="box_link"/></robot>'


class SelfProximityNode(pt.ProximityNode):
    """Collects ~self_proximity in place of ~proximity."""

    def subscribe(self, topic, kind, callback):
        return super().subscribe("self_" + topic if topic == "proximity" else topic, kind, callback)


class SelfProximityTest(unittest.TestCase):
    def start(self, case, arm=ARM, **parameters):
        self.namespace = "/self_" + case
        self.q = {"turn": 0.7, "slide": 0.1}
        self.world = pt.World(self.namespace, None)  # the arm has the camera
        self.joints = self.world.start_joints(lambda: self.q)
        parameters = {
            "pose_source": "joint_states",
            "self_collision/enabled": True,
            "max_distance": 2.0,
            **parameters,
        }
        self.node = SelfProximityNode(self.namespace, parameters, arm)
        return self.node

    def tearDown(self):
        self.world.stop()
        self.assertEqual(self.node.stop(), 0)

    def check_vectors(self, one):
        apart = pt.vector(one.point_on_link) - pt.vector(one.point_on_obstacle)
        direction = pt.vector(one.direction)
        self.assertAlmostEqual(np.linalg.norm(direction), 1.0, 6)
        np.testing.assert_allclose(apart, one.distance * direction, atol=1e-6)

    def test_truth(self):
        node = self.start("truth")
        for slide in (0.1, 0.4, 0.0):
            self.q = {"turn": 0.7, "slide": slide}
            truth = 2.5 * slide + 0.25  # between the ball and the box that goes the other way
            message = node.wait_for_distance(truth, "the box", within=0.0011)
            self.assertEqual(message.header.frame_id, "base")
            self.assertEqual(message.sources, [])
            for name, other in (("ball_link", "box_link"), ("box_link", "ball_link")):
                one = pt.link(message, name)
                self.assertEqual(one.state, LinkProximity.NEAR)
                self.assertEqual(one.source, other)
                self.assertLessEqual(one.lower_bound, truth + 1e-6)
                self.assertGreater(one.lower_bound, truth - 0.007)
                self.check_vectors(one)
            # The direction of the ball is along the slide.
            expected = [np.cos(0.7), np.sin(0.7), 0.0]
            one = pt.link(message, "ball_link")
            np.testing.assert_allclose(pt.vector(one.direction), expected, atol=1e-3)

        # The blended push of the one other link, as long as that of a point as near.
        for name, sign in (("ball_link", 1.0), ("box_link", -1.0)):
            push = pt.vector(pt.link(message, name).repulsion)
            np.testing.assert_allclose(push, sign * (1 - 0.25 / 0.3) * np.array(expected), atol=0.005)

        # ~query/margin can be set while the node runs, here too.
        rospy.set_param(node.name + "/query/margin", 0.05)
        node.wait_for(
            lambda m: pt.link(m, "ball_link").lower_bound < truth - 0.05, "a bound with the margin"
        )
        rospy.set_param(node.name + "/query/margin", 0.0)

        self.q = {"turn": 0.7, "slide": -0.2}  # the ball in the box
        message = node.wait_for(
            lambda m: pt.states(m) == [LinkProximity.CONTACT] * 2, "contact of both"
        )
        one = pt.link(message, "ball_link")
        self.assertLess(one.lower_bound, one.distance)
        self.assertLess(one.distance, 0.0)
        self.check_vectors(one)

        message = node.wait_for(
            lambda m: np.isfinite(pt.vector(pt.link(m, "ball_link").penetration.force)).all(),
            "contact forces",
        )
        forces = [pt.vector(one.penetration.force) for one in message.links]
        np.testing.assert_allclose(forces[0], -forces[1], atol=1e-9)

        self.joints.paused = True
        node.wait_for_unknown(ProximityArray.NO_POSE, "'turn'")

    def test_joint_that_is_late(self):
        """What a joint between the links may have moved since its sample comes off the bounds; a
        joint that carries both does not matter."""
        node = self.start("late")
        self.joints.stop()
        publisher = JointStatesTest.joint_publisher(self.namespace)

        def motion(t):
            """The slide speeds up by up to 0.2 m/s from one rare sample to the next."""
            return {"turn": np.sin(0.7 * t), "slide": 0.5 + 0.3 * np.sin(3.0 * t)}

        for often, rare in (("turn", "slide"), ("slide", "turn")):
            sent = []

            def send():
                stamp = rospy.Time.now()
                q = motion(stamp.to_sec())
                names = [often, rare] if len(sent) % 5 == 0 else [often]
                publisher.publish(pt.joint_state({name: q[name] for name in names}, stamp))
                sent.append(stamp)

            self.joints = self.world.repeat(60, send)
            node.wait_until(lambda: len(sent) > 60, "a second of positions")
            beyond, below = [], []
            for message in node.next_messages(150):
                one = pt.link(message, "ball_link")
                if one.state == LinkProximity.UNKNOWN:
                    continue
                truth = 2.5 * motion(message.header.stamp.to_sec())["slide"] + 0.25
                self.assertLessEqual(one.lower_bound, truth + 5e-4)
                self.assertLessEqual(message.pairs[0].lower_bound, truth + 5e-4)
                beyond.append(one.distance - truth)
                below.append(truth - one.lower_bound)
            self.joints.stop()
            self.assertGreater(len(beyond), 120)
            if rare == "slide":
                self.assertGreater(max(beyond), 0.002)  # the joint that is late matters
                self.assertLess(np.median(below), 0.12)
            else:
                self.assertLess(np.median(below), 0.007)

    def link_pairs(self, until=lambda answer: answer.success, **kwargs):
        """The answer of ~link_pairs, which comes a little after the model."""
        service, answers = self.node.service("link_pairs", ListLinkPairs), []

        def ask():
            answers.append(service(**kwargs))
            return until(answers[-1])

        pt.wait_until(ask, "the link pairs")
        return answers[-1]

    def test_sampled_pairs(self):
        """The one pair is watched, and touches in the share of random configurations that it has to."""
        arm = ARM.replace('lower="0"', 'lower="-0.5"')
        self.start("sampled", arm)
        answer = self.link_pairs(lambda a: a.configurations > 0, never=True)
        self.assertEqual(answer.configurations, 2000)
        self.assertEqual(answer.message, "")
        (pair,) = answer.pairs
        self.assertEqual({pair.first, pair.second}, {"ball_link", "box_link"})
        self.assertEqual(pair.reason, LinkPair.WATCHED)
        self.assertEqual(pair.measured, 2000)
        # The ball is in the box from -0.26 to -0.1 of the slide, which goes from -0.5 to 1.
        self.assertAlmostEqual(pair.contacts / 2000, 0.16 / 1.5, delta=0.05)
        self.assertEqual(pair.sampled, LinkPair.SOMETIMES)
        self.assertTrue(answer.srdf.startswith('<?xml version="1.0"?>'))
        self.assertNotIn("disable_collisions", answer.srdf)

        # Within the limits of the URDF as it is they never touch: an SRDF may say so, if asked.
        self.tearDown()
        self.start("never")
        for never in (False, True):
            answer = self.link_pairs(lambda a: a.configurations > 0, never=never)
            self.assertEqual(answer.configurations, 2000)
            (pair,) = answer.pairs
            self.assertEqual((pair.sampled, pair.contacts, pair.measured), (LinkPair.NEVER, 0, 2000))
            self.assertEqual('reason="Never"' in answer.srdf, never)

    def test_joint_repulsion(self):
        """With in_minimum the links push each other apart in ~joint_repulsion too."""
        node = self.start("pushed", **{"self_collision/in_minimum": True, "self_filter": False})
        self.q = {"turn": 0.7, "slide": 0.0}
        self.world.start_points([[9.0, 9.0, 9.0]])
        efforts = node.collect("joint_repulsion", JointRepulsion)
        # Each is pushed by 1 - 0.25 / 0.3, and they part by 2.5 m per metre of the slide.
        wanted = 2.5 * (1 - 0.25 / 0.3)

        def is_pushed(m):
            return m.status == 0 and abs(dict(zip(m.joints, m.effort))["slide"] - wanted) < 0.02

        pt.first_of(efforts, is_pushed, "the efforts")

    def test_what_touches_at_rest_because_it_is_carried(self):
        """A tool that is in the box with all joints at zero is far from it elsewhere, and watched."""
        node = self.start("carried")
        self.q["slide"] = 0.5
        node.wait_for_distance(1.5, "the box", within=0.0011)
        node.attach("ball_link", (-0.3, 0.0, 0.0), [0.1])
        message = node.wait_for_distance(1.2, "the box from the tool", within=0.0011)
        self.assertLessEqual(pt.link(message, "ball_link").lower_bound, 1.2 + 1e-6)
        self.q["slide"] = 0.0
        node.wait_for(lambda m: pt.states(m) == [LinkProximity.CONTACT] * 2, "contact of tool and box")

    def test_minimum_of_what_is_carried(self):
        """As soon as it is known again, ~min_distance is that of the links with the tool."""
        node = self.start("minimum", **{"self_collision/in_minimum": True, "self_filter": False})
        self.q["slide"] = 0.5
        self.world.start_points([[9.0, 9.0, 9.0]], rate=100)
        minima, firsts = node.collect("min_distance", Float64, lambda m: m.data), []
        detach = node.service("detach_object", DetachObject)
        for _ in range(12):
            pt.wait_until(lambda: minima and abs(minima[-1] - 1.5) < 0.0011, "the minimum")
            begin = len(minima)
            node.attach("ball_link", (-0.3, 0.0, 0.0), [0.1])
            pt.wait_until(lambda: abs(minima[-1] - 1.2) < 0.0011, "the minimum with the tool")
            after = minima[begin:]
            unknown = np.flatnonzero(np.isnan(after))
            if unknown.size:
                firsts += [one for one in after[unknown[0] :] if np.isfinite(one)]
            self.assertTrue(detach("tool").success)
        self.assertTrue(firsts)
        self.assertLessEqual(max(firsts), 1.2 + 1e-6)

    def test_srdf_that_cannot_be_used(self):
        """It may enable pairs that are left out without it."""
        name = "/self_srdf/robot_description_semantic"
        for srdf in ("<robot name='arm'><enable_collisions", {"a": 1}):
            rospy.set_param(name, srdf)
            node = self.start("srdf")
            message = node.wait_for_status(ProximityArray.MODEL_ERROR, "the SRDF in '%s' cannot be used" % name)
            self.assertTrue(pt.all_unknown(message))
            answer = node.service("query", QueryProximity)([JointState()], [], [], True)
            self.assertIn("cannot be used", answer.message)
            self.assertFalse(answer.success)
            rospy.set_param(name, SRDF)
            self.assertTrue(node.reload().success)
            node.wait_for_status(ProximityArray.OK)
            if srdf != {"a": 1}:
                self.tearDown()

    def test_left_out(self):
        for case, srdf in (("by_srdf", SRDF), ("by_default", SRDF_DEFAULT)):
            rospy.set_param("/self_%s/robot_description_semantic" % case, srdf)
            with self.subTest(case):
                node = self.start(case)
                message = node.wait_for_status(ProximityArray.OK)
                self.assertEqual(pt.states(message), [LinkProximity.CLEAR] * 2)
                self.assertEqual([pair.reason for pair in self.link_pairs().pairs], [LinkPair.SRDF])
                if case != "by_default":
                    self.tearDown()


if __name__ == "__main__":
    pt.run("self_proximity_test", SelfProximityTest)
