#!/usr/bin/env python3
"""launch/dodge.launch: the simulated arm goes to its goals and keeps away from obstacles; it stops
when the clouds stop, and goes on when they come back.

The simulator makes the time, so that a busy machine makes it slower and nothing else.
"""

import threading
import unittest

import numpy as np
import proximity_testing as pt
import rospy
from proximity_testing import ProximityArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String, UInt32
from std_srvs.srv import SetBool

MOVING = 0.05  # [rad/s]


class DodgeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.lock = threading.Condition()
        cls.joints, cls.answers, cls.distances, cls.states = [], [], [], []
        cls.goals = [0]
        cls.subscribe("/joint_states", JointState, cls.joints)
        cls.subscribe("/proximity/proximity", ProximityArray, cls.answers)
        cls.subscribe("/simulator/distance", Float64, cls.distances, lambda m: m.data)
        cls.subscribe("/dodge/state", String, cls.states, lambda m: m.data)
        cls.subscribe("/dodge/goals", UInt32, cls.goals, lambda m: m.data)

    @classmethod
    def subscribe(cls, topic, kind, where, of=lambda m: m):
        def keep(message):
            with cls.lock:
                where.append(of(message))
                cls.lock.notify_all()

        rospy.Subscriber(topic, kind, keep, queue_size=1000)

    def wait_until(self, condition, what, timeout=90.0):
        pt.wait_until(condition, what, timeout, self.lock)

    def is_moving(self, since=0):
        return any(np.abs(m.velocity).max() > MOVING for m in self.joints[since:])

    def stands_still(self, count):
        last = self.joints[-count:]
        return len(last) == count and all(not np.any(m.velocity) for m in last)

    def test_1_does_its_task(self):
        self.wait_until(lambda: self.goals[-1] >= 2, "two goals; %s" % self.states[-1:])
        self.assertTrue(self.is_moving())
        with self.lock:
            self.assertGreater(len(self.distances), 0)
            self.assertGreater(min(self.distances), 0.0, "collision")
            self.assertTrue(any(m.status == ProximityArray.OK for m in self.answers))
            names = [s.name for s in self.answers[-1].sources]
        self.assertEqual(sorted(names), ["back", "front"])

    def test_2_stops_without_clouds(self):
        cameras = rospy.ServiceProxy("/simulator/cameras", SetBool)
        cameras.wait_for_service(pt.TIMEOUT)
        self.wait_until(self.is_moving, "the arm to move")
        self.assertTrue(cameras(False).success)
        # A second of the simulation without any motion: no gap between two motions is as long.
        self.wait_until(lambda: self.stands_still(200), "the arm to stop")
        with self.lock:
            where = list(self.joints[-1].position)
            since = len(self.joints)
        self.wait_until(lambda: self.states[-1].startswith("stopped"), "a reason")
        self.wait_until(
            lambda: self.answers[-1].status == ProximityArray.STALE_CLOUD, "STALE_CLOUD"
        )
        self.wait_until(lambda: len(self.joints) > since + 200, "joint states")
        self.assertEqual(list(self.joints[-1].position), where)

        reached = self.goals[-1]
        self.assertTrue(cameras(True).success)
        self.wait_until(lambda: self.is_moving(since), "the arm to go on")
        self.wait_until(lambda: self.goals[-1] > reached, "another goal")
        with self.lock:
            self.assertGreater(min(self.distances), 0.0, "collision")


if __name__ == "__main__":
    pt.run("dodge_test", DodgeTest)
