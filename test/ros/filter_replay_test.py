#!/usr/bin/env python3
"""A recorded stream of commands, of the type that MoveIt Servo sends, through the nodelet of the filter."""

import os
import tempfile
import time

import numpy as np
import proximity_testing as pt
import rosbag
import rospy
from ist_proximity.msg import FilterState
from proximity_testing import LinkProximity, ProximityArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from velocity_filter_test import JOINTS, PERIOD, RADIUS, SLIDES, STOP, Filter, SlidesTest

APPROACH, MARGIN, PROXIMITY_TIMEOUT = 0.2, 0.01, 0.2  # the filter's defaults
LIMITS = [2.0, 0.4]  # [m/s] of the URDF


class FilterNodelet(Filter):
    program = ("nodelet", "nodelet")
    arguments = ["standalone", "ist_proximity/VelocityFilter"]


def record(path):
    """Ten seconds at 100 Hz: a hand that jogs to the wall, along it and back, and trembles."""
    random = np.random.default_rng(5)
    velocity = np.zeros(2)
    with rosbag.Bag(path, "w") as bag:
        for k in range(1000):
            if k % 100 == 0:
                aim = np.array([(0.7, 0.7, -0.5)[k // 100 % 3], random.uniform(-0.6, 0.6)])
            velocity = velocity + 0.1 * (aim - velocity) + random.normal(0.0, 0.02, 2)
            point = JointTrajectoryPoint(positions=[0.0, 0.0], velocities=list(velocity))
            point.time_from_start = rospy.Duration(PERIOD)
            bag.write("command", JointTrajectory(joint_names=JOINTS, points=[point]), rospy.Time(1.0 + PERIOD * k))


class FilterReplayTest(SlidesTest):
    def setUp(self):
        self.positions = []
        super().setUp()
        with self.lock:
            self.q = np.array([0.3, 0.0])
        self.start(SLIDES, pose_source="joint_states", self_filter=False)
        self.node.wait_for_status(ProximityArray.OK)
        self.filter = FilterNodelet(self.namespace)
        pt.wait_until(lambda: self.filter.is_heard(), "the filter's topics")

    def send_joints(self, q):
        self.positions.append(q)
        super().send_joints(q)

    def replay(self, path):
        with rosbag.Bag(path) as bag:
            stream = [(stamp.to_sec(), message) for _, message, stamp in bag.read_messages()]
        start = time.monotonic() - stream[0][0]
        for stamp, message in stream:
            time.sleep(max(0.0, start + stamp - time.monotonic()))
            self.filter.publisher.publish(message)
        return [message.points[0].velocities for _, message in stream]

    def distance_at(self, q):
        return np.linalg.norm(np.append(q, 0.0) - self.world.points, axis=1).min() - RADIUS

    @staticmethod
    def row_of(answer):
        """G and h of the ball by one answer of the node."""
        ball = answer.links[0]
        h = max((ball.lower_bound - STOP) / APPROACH, 0.0)
        return -pt.vector(ball.direction)[:2], h

    def test_each_given_velocity_meets_its_row(self):
        path = os.path.join(tempfile.mkdtemp(), "commands.bag")
        record(path)
        commands = {tuple(command) for command in self.replay(path)}
        time.sleep(0.5)  # for the last answers
        states = list(self.filter.states)
        # A busy machine loses some; what answers none is of a timeout.
        answers = [state for state in states if state.command in commands]
        self.assertGreater(len(answers), 0.3 * len(commands))
        others = [state for state in states if state.command not in commands]
        self.assertFalse(any(np.any(state.velocity) for state in others))
        published = [
            (answer.header.stamp.to_sec(), self.row_of(answer))
            for answer in list(self.node.messages)
            if answer.links and answer.links[0].state == LinkProximity.NEAR
        ]
        counts = {status: 0 for status in range(5)}
        for state in answers:
            counts[state.status] += 1
            given, stamp = np.array(state.velocity), state.header.stamp.to_sec()
            if state.status == FilterState.FREE:
                self.assertEqual(state.velocity, state.command)
            if state.status == FilterState.FAULT:
                self.assertFalse(given.any())
            # It is the row of one of the answers that are not too old.
            rows = [row for t, row in published if stamp - PROXIMITY_TIMEOUT <= t <= stamp]
            if state.status != FilterState.FAULT:
                self.assertTrue(any(G @ given <= h + 1e-6 for G, h in rows), (given, rows))
            self.assertTrue((np.abs(given) <= np.add(LIMITS, 1e-6)).all(), given)
        distances = np.array([self.distance_at(q) for q in self.positions])
        self.assertGreater(distances.min(), MARGIN)
        at_wall = np.flatnonzero(distances < STOP + 0.1)
        self.assertTrue(at_wall.size, "it has come to the wall")
        self.assertGreater(distances[at_wall[0] :].max(), STOP + 0.2, "it has left the wall")
        self.assertGreater(counts[FilterState.LIMITED], 50, counts)
        self.assertGreater(counts[FilterState.FREE], 50, counts)
        self.assertLess(counts[FilterState.FAULT], 0.3 * len(answers), counts)
        # What is sent are the velocities of the states, with the positions they lead to.
        told = {state.velocity for state in states}
        sent = [message.points[0] for message in self.filter.given]
        self.assertGreater(sum(point.velocities in told for point in sent), 0.3 * len(commands))
        self.assertEqual({len(point.positions) for point in sent}, {2})


if __name__ == "__main__":
    pt.run("filter_replay_test", FilterReplayTest)
