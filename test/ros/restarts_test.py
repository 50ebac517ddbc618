#!/usr/bin/env python3
"""Sensors whose stamps go back are heard again, a clock at its end does not end the node, SIGINT always does."""

import os
import signal
import socket
import subprocess
import tempfile
import unittest

import proximity_testing as pt
import rospy
from proximity_testing import ProximityArray
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan

FAR_BOX = pt.transform((0, 0.8, 0))
LAST = 4294967295.0  # [s] the last second of ros::Time


def scan(stamp, duration):
    message = LaserScan(range_min=0.05, range_max=10.0, angle_min=-1.5, angle_max=1.5)
    message.header.frame_id = "camera"
    message.header.stamp = stamp
    message.ranges = [0.3] * 101
    message.angle_increment = 0.03
    message.time_increment = duration / 100
    return message


class LateClockTest(unittest.TestCase):
    """The last beam of a scan is later than any stamp can be: that was an uncaught exception."""

    def setUp(self):
        self.clock = rospy.Publisher("/clock", Clock, queue_size=10)
        self.now = LAST - 2.0
        self.repeaters = [pt.Repeater(100, self.tick)]
        pt.wait_until(lambda: rospy.Time.now().to_sec() > LAST - 10.0, "the clock")

    def tick(self):
        self.now = min(self.now + 0.01, LAST)
        self.clock.publish(Clock(rospy.Time.from_sec(self.now)))

    def tearDown(self):
        for repeater in self.repeaters:
            repeater.stop()

    def test_last_second(self):
        namespace = "/late_clock"
        world = pt.World(namespace).stand(box=FAR_BOX)
        publisher = rospy.Publisher(namespace + "/scan", LaserScan, queue_size=10)
        sources = {"laser": {"topic": "scan", "type": "sensor_msgs/LaserScan"}}
        node = pt.ProximityNode(namespace, {"sources": sources, "rate": 50}, pt.urdf())
        world.start_tf()
        for duration in (0.2, -0.2, 9.9):
            send = lambda duration=duration: publisher.publish(scan(rospy.Time.now(), duration))
            repeater = pt.Repeater(20, send)
            begin = len(node.messages)
            node.wait_for(
                lambda m: m.sources and m.header.stamp.to_sec() > LAST - 1.0,
                "messages in the last second",
            )
            node.wait_for(lambda m: len(node.messages) > begin + 50, "50 messages")
            repeater.stop()
        # The clock starts over, and everything is known again.
        self.now = 1000.0
        pt.wait_until(lambda: rospy.Time.now().to_sec() < LAST - 10.0, "the clock's jump")
        world.stop()
        world = pt.World(namespace).stand(box=FAR_BOX)
        world.start_tf()
        self.repeaters.append(pt.Repeater(20, lambda: publisher.publish(scan(rospy.Time.now(), 0))))
        message = node.wait_for_status(ProximityArray.OK)
        self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.2, 3)
        for m in node.messages:
            pt.check_invariants(self, m)
        world.stop()
        self.assertEqual(node.stop(), 0)


class RestartTest(pt.NodeTest):
    def test_start_without_master(self):
        """A node that is told to end while it waits for the master ends, without a word of a crash."""
        with socket.socket() as s, tempfile.TemporaryFile() as log:
            s.bind(("localhost", 0))  # and nobody listens
            environment = dict(os.environ, ROS_MASTER_URI="http://localhost:%d" % s.getsockname()[1])
            command = [pt.find_program("ist_proximity", "proximity_node")]
            node = subprocess.Popen(command, env=environment, stdout=log, stderr=subprocess.STDOUT)

            def said():
                log.seek(0)
                return log.read().decode()

            pt.wait_until(lambda: "Failed to contact master" in said(), "the wait for the master")
            node.send_signal(signal.SIGINT)
            self.assertEqual(node.wait(pt.TIMEOUT), 0, said())
            self.assertNotIn("ASSERTION", said())

    def test_camera(self):
        """A camera whose driver starts again with a clock that is behind."""
        world = self.world
        node = self.start(cloud_timeout=8.0, self_filter=False)
        world.start_tf()
        behind = [0.0, 0.3]  # [s] the clock, [m] the point

        def send():
            stamp = rospy.Time.now() - rospy.Duration(behind[0])
            world.cloud_publisher.publish(pt.cloud([[0.0, 0.0, behind[1]]], stamp=stamp))

        world.repeat(20, send)
        node.wait_for_distance(0.2, "the camera", within=1e-4)
        # Two seconds behind: within the timeout, and it is what the sensor sees now.
        behind[:] = [2.0, 0.5]
        node.wait_for_distance(0.4, "two seconds behind", within=1e-4)
        self.assertIn("went back by", node.log())
        # A minute behind: stale. The last good cloud stays in use until it is stale itself.
        behind[:] = [60.0, 0.3]
        node.wait_for_unknown(ProximityArray.STALE_CLOUD, "clock gone back?")
        behind[:] = [0.0, 0.3]
        node.wait_for_distance(0.2, "the clock put right", within=1e-4)


if __name__ == "__main__":
    pt.run("restarts_test", {"clock": LateClockTest, "sensors": RestartTest})
