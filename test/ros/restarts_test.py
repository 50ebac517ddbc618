#!/usr/bin/env python3
"""Sensors whose stamps go back are heard again, and a clock at its end does not end the node."""

import sys
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


class RestartTest(unittest.TestCase):
    """A camera whose driver starts again with a clock that is behind."""

    def test_camera(self):
        namespace = "/restarts"
        world = pt.World(namespace).stand(box=FAR_BOX)
        node = pt.ProximityNode(namespace, {"cloud_timeout": 8.0, "self_filter": False}, pt.urdf())
        world.start_tf()
        behind = [0.0, 0.3]  # [s] the clock, [m] the point

        def send():
            stamp = rospy.Time.now() - rospy.Duration(behind[0])
            world.cloud_publisher.publish(pt.cloud([[0.0, 0.0, behind[1]]], stamp=stamp))

        world.repeat(20, send)
        self.wait_for_ball(node, 0.2)
        # Two seconds behind: within the timeout, and it is what the sensor sees now.
        behind[:] = [2.0, 0.5]
        self.wait_for_ball(node, 0.4)
        self.assertIn("went back by", node.log())
        # A minute behind: stale. The last good cloud stays in use until it is stale itself.
        behind[:] = [60.0, 0.3]
        message = node.wait_for_status(ProximityArray.STALE_CLOUD, "clock gone back?")
        self.assertTrue(pt.all_unknown(message))
        behind[:] = [0.0, 0.3]
        self.wait_for_ball(node, 0.2)
        for m in node.messages:
            pt.check_invariants(self, m)
        world.stop()
        self.assertEqual(node.stop(), 0)

    def wait_for_ball(self, node, truth):
        node.wait_for(
            lambda m: m.status == 0 and abs(pt.link(m, "ball_link").distance - truth) < 1e-4,
            "%.1f m" % truth,
        )


if __name__ == "__main__":
    import rostest

    rospy.init_node("restarts_test")
    kinds = {"clock": LateClockTest, "sensors": RestartTest}
    suite = sys.argv[1] if len(sys.argv) > 1 else ""
    rostest.rosrun("ist_proximity", "restarts_" + suite, kinds[suite], sys.argv)
