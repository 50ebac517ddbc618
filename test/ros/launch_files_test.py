#!/usr/bin/env python3
"""The launch files: two robots in one graph, two cameras, the nodelet in a camera's manager."""

import os
import sys
import unittest
from xml.etree import ElementTree

import proximity_testing as pt
import rospy
from joint_states_test import ARM, JointStatesTest, arm_poses, joint_state
from proximity_testing import ProximityArray
from sensor_msgs.msg import PointCloud2

LAUNCH = os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "..", "launch")


class Robot:
    """Joint states and clouds of one robot, and what its node answers."""

    def __init__(self, namespace, q, points):
        rospy.set_param(namespace + "/robot_description", ARM)
        self.q, self.points, self.answer = q, points, None
        self.joints = JointStatesTest.joint_publisher(namespace)
        self.clouds = {
            topic: rospy.Publisher(namespace + "/" + topic, PointCloud2, queue_size=5)
            for topic in points
        }
        self.subscriber = rospy.Subscriber(
            namespace + "/proximity/proximity", ProximityArray, self.on_answer
        )
        self.repeaters = [pt.Repeater(50, self.send_joints), pt.Repeater(20, self.send_clouds)]

    def on_answer(self, message):
        self.answer = message

    def send_joints(self):
        self.joints.publish(joint_state(self.q))

    def send_clouds(self):
        for topic, points in self.points.items():
            self.clouds[topic].publish(pt.cloud(points, "base"))

    def wait_until_ok(self):
        pt.wait_until(lambda: self.answer and self.answer.status == ProximityArray.OK, "OK")
        return self.answer

    def stop(self):
        for repeater in self.repeaters:
            repeater.stop()


def beside_the_ball(q, distance):
    return pt.apply(arm_poses(**q)["ball_link"], [[0.0, 0.0, pt.BALL_RADIUS + distance]])


class LaunchFilesTest(unittest.TestCase):
    def check(self, robot, distance, source):
        one = pt.link(robot.wait_until_ok(), "ball_link")
        self.assertAlmostEqual(one.distance, distance, delta=0.0011)
        self.assertEqual(one.source, source)

    def test_two_robots(self):
        left_q, right_q = {"turn": 0.5, "slide": 0.2}, {"turn": -1.0, "slide": 0.9}
        left = Robot("/left", left_q, {"cloud": beside_the_ball(left_q, 0.1)})
        right = Robot("/right", right_q, {"cloud": beside_the_ball(right_q, 0.2)})
        self.check(left, 0.1, "cloud")
        self.check(right, 0.2, "cloud")
        # One robot's silence is not the other's.
        left.stop()
        pt.wait_until(lambda: left.answer.status == ProximityArray.STALE_CLOUD, "a stale cloud")
        self.assertTrue(pt.all_unknown(left.answer))
        right.answer = None
        self.check(right, 0.2, "cloud")
        right.stop()

    def test_two_cameras(self):
        q = {"turn": 0.5, "slide": 0.2}
        far, near = beside_the_ball(q, 0.3), beside_the_ball(q, 0.15)
        robot = Robot("/cameras", q, {"first/points": far, "second/points": near})
        self.check(robot, 0.15, "second_camera")
        names = [source.name for source in robot.answer.sources]
        self.assertEqual(names, ["first_camera", "second_camera"])
        robot.points = {"first/points": far, "second/points": far + [0, 0, 0.1]}
        pt.wait_until(
            lambda: pt.link(robot.answer, "ball_link").source == "first_camera", "the other camera"
        )
        robot.points = {"first/points": far}
        pt.wait_until(lambda: robot.answer.status == ProximityArray.STALE_CLOUD, "a stale cloud")
        self.assertIn("second_camera", robot.answer.status_text)
        robot.stop()

    def test_camera_manager(self):
        q = {"turn": 0.5, "slide": 0.2}
        robot = Robot("/managed", q, {"camera/points": beside_the_ball(q, 0.1)})
        self.check(robot, 0.1, "cloud")
        robot.stop()

    def test_documented(self):
        """Every argument of every launch file says what it is for."""
        files = sorted(name for name in os.listdir(LAUNCH) if name.endswith(".launch"))
        self.assertGreaterEqual(len(files), 5)
        for name in files:
            for argument in ElementTree.parse(os.path.join(LAUNCH, name)).getroot().findall("arg"):
                if "value" not in argument.attrib:
                    self.assertGreater(len(argument.get("doc", "")), 5, (name, argument.attrib))


if __name__ == "__main__":
    import rostest

    rospy.init_node("launch_files_test")
    rostest.rosrun("ist_proximity", "launch_files_test", LaunchFilesTest, sys.argv)
