#!/usr/bin/env python3
"""Faults of simulated time: the clock jumps forward and back."""

import time

import faults
import proximity_testing as pt
import rospy
from clock_test import SimulatedClock
from faults import PERIOD


# [s] in which a loaded machine brings the clock's next tick to the node.
DELIVERY = 1.0


class FaultsClockTest(faults.FaultTest):
    def setUp(self):
        self.clock = SimulatedClock()
        self.clock.start()
        pt.wait_until(lambda: not rospy.Time.now().is_zero(), "the clock")
        super().setUp()

    def tearDown(self):
        super().tearDown()
        self.clock.stop()

    def jump(self, node, seconds):
        """No cloud from shortly before the jump until the node has said what it thinks of it."""
        self.sensor.pause(node)
        self.tf.paused = True
        begin = len(node.messages)
        self.clock.jump(seconds)
        self.clock.tick()
        since = time.monotonic()
        message = node.wait_for(
            lambda m: not self.known(m, ("ball_link", "box_link")), "nothing known", start=begin
        )
        received = next(t for t, m in zip(node.times, node.messages) if m is message)
        limit = PERIOD
        self.assertLess(received - since, limit + self.slack(node, since, received) + DELIVERY)
        reaction = 1e3 * max(0.0, min(limit, received - since))
        self.tf.paused = False
        again = time.monotonic()
        self.sensor.resume()
        return message, reaction, self.recover(node, again), limit

    def test_jumps(self):
        node = self.start()
        for way, seconds in (("forward", 10.0), ("back", -10.0)):
            with self.subTest(way):
                message, reaction, recovery, limit = self.jump(node, seconds)
                self.record("/clock jumps " + way, "by 10 s, with use_sim_time", message, reaction,
                            "with the next inputs", recovery, limit)


if __name__ == "__main__":
    pt.run("faults_clock_test", FaultsClockTest)
