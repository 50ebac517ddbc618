#!/usr/bin/env python3
"""Simulated time: no clock yet, a clock that stands still, and one that jumps back."""

import os
import tempfile
import threading

import numpy as np
import proximity_testing as pt
import rospy
from joint_states_test import ARM
from memory_test import BALL, FAR, LASTING, NEAR, VOXEL, distance_to
from proximity_testing import LinkProximity, ProximityArray
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from velocity_filter_test import JOINTS, SLIDES, Filter
from visualization_msgs.msg import MarkerArray


class SimulatedClock:
    def __init__(self):
        self._publisher = rospy.Publisher("/clock", Clock, queue_size=10)
        self._lock = threading.Lock()
        self.now, self.step = 1000.0, 0.005
        self._repeater = None

    def start(self):
        self._repeater = pt.Repeater(200, self.tick)

    def tick(self):
        with self._lock:
            self.now += self.step
            self._publisher.publish(Clock(rospy.Time.from_sec(self.now)))

    def jump(self, seconds):
        with self._lock:
            self.now += seconds

    def stop(self):
        if self._repeater:
            self._repeater.stop()


class JointRobot:
    """The arm of joint_states_test, standing still: a node, its joint states and its clouds."""

    def __init__(self, namespace):
        self.world = pt.World(namespace, None)
        self.world.start_joints({"turn": 0.3, "slide": 0.5}, rate=50)
        self.world.start_points([[0.6, 0.6, 0.6]])
        self.node = pt.ProximityNode(namespace, {"pose_source": "joint_states"}, ARM)

    def stop(self, test):
        for m in self.node.messages:
            pt.check_invariants(test, m)
        self.world.stop()
        test.assertEqual(self.node.stop(), 0)


class ClockTest(pt.NodeTest):
    def setUp(self):
        super().setUp()
        self.clock = SimulatedClock()
        self.addCleanup(self.clock.stop)

    def test_clock(self):
        clock, world = self.clock, self.world
        node = self.start(rate=50)
        node.wait_for_unknown(ProximityArray.NO_CLOUD, "/clock")

        clock.start()
        pt.wait_until(lambda: not rospy.Time.now().is_zero(), "the clock")
        world.points = np.array([[0.0, 0.0, 0.3]])
        world.start_tf()
        world.start_clouds()
        node.wait_for_status(ProximityArray.OK)

        spheres = node.collect("spheres", MarkerArray)
        pt.wait_until(lambda: spheres, "~spheres")

        # The clock stands still: answers go on, and nothing becomes stale.
        clock.step = 0.0
        frozen = node.next_messages(100)[20:]
        self.assertEqual({m.status for m in frozen}, {ProximityArray.OK})
        self.assertEqual(len({m.header.stamp for m in frozen}), 1)
        clock.step = 0.005

        # A second robot, with joint states in place of tf.
        robot = JointRobot("/clock_joints")
        robot.node.wait_for_status(ProximityArray.OK)

        # Back in time, a little and a lot, with other clouds than before.
        for i, jump in enumerate((-5.0, -400.0, -0.9)):
            node.wait_for_status(ProximityArray.OK)
            world.points = np.array([[0.0, 0.0, 0.35 + 0.05 * i]])
            before = rospy.Time.now()
            begin = len(node.messages)
            clock.jump(jump)
            message = node.wait_for(
                lambda m: m.status == 0 and m.header.stamp < before, "OK after the jump"
            )
            new = [m for m in node.messages[begin:] if m.header.stamp < before and m.status == 0]
            for m in new:
                self.assertLess(m.cloud_stamp, before)
            node.wait_for_distance(0.25 + 0.05 * i, "the new cloud", within=1e-5)
            robot.node.wait_for(
                lambda m: m.status == 0 and m.header.stamp < before, "OK of the second robot"
            )
        robot.stop(self)

        shown = len(spheres)
        pt.wait_until(lambda: len(spheres) > shown, "~spheres again: rviz has forgotten them")

        # Transforms from before a jump that come in after it, and such of the far future, whose
        # distance ros::Duration cannot hold: tf would take them for the newest, and refuse the
        # present ones as too old.
        for ahead in (12.0, 400.0, 3.0e9):
            stamp = rospy.Time.from_sec(clock.now + ahead)
            world.publish_transforms(
                [pt.transform_message("base", "ball_link", pt.transform((1, 0, 0)), stamp)]
            )
            for m in node.next_messages(60):
                if m.status != ProximityArray.DEGRADED or "in the future" not in m.status_text:
                    self.assertEqual(m.status, ProximityArray.OK, m.status_text)
                self.assertAlmostEqual(pt.link(m, "ball_link").distance, 0.35, 5)
            node.wait_for_status(ProximityArray.OK)
        # Future transforms alone are reported and not used.
        world.poses = {"box_link": world.poses["box_link"]}
        future = world.repeat(
            50,
            lambda: world.publish_transforms(
                [
                    pt.transform_message(
                        "base", "ball_link", pt.transform(), rospy.Time.from_sec(clock.now + 5.0)
                    )
                ]
            ),
        )
        message = node.wait_for_status(ProximityArray.NO_POSE, "in the future")
        self.assertIn("ball_link", message.status_text)
        self.assertEqual(pt.link(message, "ball_link").state, LinkProximity.UNKNOWN)
        future.stop()

    def show_far_patch(self):
        clock, world = self.clock, self.world
        clock.start()
        world.stand(pt.transform(BALL), pt.transform((0, 0, 5)))
        world.points = FAR
        world.start_tf()
        world.start_clouds()
        self.MAX_DISTANCE = 0.8
        return clock, world

    # What is hidden from the camera is remembered, whatever the clock does.
    def test_memory_of_a_clock_that_is_set_back(self):
        clock, world = self.show_far_patch()
        node = self.start(rate=50, links=["ball_link"], max_distance=0.8, memory=LASTING)
        ball = lambda m: pt.link(m, "ball_link")  # noqa: E731
        node.wait_for(lambda m: m.status == 0 and ball(m).source == "cloud", "the far patch")
        world.points = NEAR
        node.wait_for(lambda m: ball(m).source == "cloud/memory", "the far patch remembered")
        for jump in (-0.3, -0.3, -5.0, -400.0):
            before = rospy.Time.now()
            begin = len(node.messages)
            clock.jump(jump)
            node.wait_for(lambda m: m.status == 0 and m.header.stamp < before, "OK after the jump")
            node.next_messages(50)
            for m in node.messages[begin:]:
                if m.status == 0:
                    self.assertEqual(ball(m).source, "cloud/memory")
                    self.assertAlmostEqual(ball(m).distance, distance_to(FAR), delta=2 * VOXEL)
                    self.assertLessEqual(ball(m).lower_bound, distance_to(FAR))
                else:
                    self.assertTrue(pt.all_unknown(m))

    # A node may begin before the clock does, and the clock at any time.
    def test_memory_file_that_is_there_before_the_clock(self):
        clock, world = self.show_far_patch()
        memory = dict(LASTING, file=os.path.join(tempfile.mkdtemp(), "memory.bt"))
        parameters = dict(rate=50, links=["ball_link"], max_distance=0.8, memory=memory)
        node = self.start(**parameters)
        node.wait_for(lambda m: m.status == 0 and m.links[0].source == "cloud", "the far patch")
        self.assertTrue(node.service("save_memory", Trigger)().success)
        self.assertEqual(node.stop(), 0)

        clock.stop()
        world.points = NEAR  # the far patch is never seen by the next node
        node = self.start(**parameters)
        node.wait_for_unknown(ProximityArray.NO_CLOUD, "/clock")
        node.next_messages(20)
        clock.jump(1.7e9)
        clock.start()
        node.wait_for(lambda m: m.status == 0, "the clock")
        for m in node.next_messages(20):
            self.assertEqual(m.links[0].source, "cloud/memory")
            self.assertLessEqual(m.links[0].lower_bound, distance_to(FAR))

    def test_filter_while_the_clock_stands(self):
        self.clock.start()
        rospy.set_param("/standing_filter/robot_description", SLIDES)
        one = Filter("/standing_filter", command_type="sensor_msgs/JointState")
        command = JointState(name=JOINTS, velocity=[0.1, 0.0])
        commands = pt.Repeater(50, lambda: one.publisher.publish(command))
        pt.wait_until(lambda: one.states, "the filter")
        self.assertFalse(any("stands still" in s.status_text for s in one.states))
        self.clock.step = 0.0
        pt.wait_until(lambda: "clock stands still" in one.states[-1].status_text, "the fault")
        self.clock.step = 0.005
        pt.wait_until(lambda: "clock stands still" not in one.states[-1].status_text, "its end")
        commands.stop()
        self.assertEqual(one.stop(), 0)

    def test_filter_without_commands(self):
        """The last command is from the future then, and 0 is given all the same."""
        clock = self.clock
        clock.start()
        rospy.set_param("/clock_filter/robot_description", SLIDES)
        one = Filter("/clock_filter", command_type="sensor_msgs/JointState")
        command = JointState(name=JOINTS, velocity=[0.1, 0.0])
        commands = pt.Repeater(50, lambda: one.publisher.publish(command))
        pt.wait_until(lambda: one.given, "the filter")
        commands.stop()
        clock.jump(-50.0)
        pt.wait_until(lambda: any("gone back" in s.status_text for s in one.states), "the jump")
        begin = len(one.given), len(one.scales)
        pt.wait_until(lambda: len(one.given) > begin[0] + 20, "velocities of 0")
        self.assertFalse(any(np.any(m.velocity) for m in one.given))
        pt.wait_until(lambda: len(one.scales) > begin[1] + 20, "speed scales")
        self.assertFalse(any(one.scales[begin[1] :]))
        self.assertEqual(one.stop(), 0)


if __name__ == "__main__":
    pt.run("clock_test", ClockTest)
