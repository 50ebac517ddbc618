#!/usr/bin/env python3
"""LaserScan as a source: true distances, malformed scans, silence, and sensors that move."""

import re

import numpy as np
import proximity_testing as pt
import rospy
from proximity_testing import ProximityArray
from sensor_msgs.msg import LaserScan

X_BASE_LASER = pt.transform((-0.6, 0.0, 0.05), axis=(0, 0, 1), angle=0.2)
BEAMS = 181


def scan(ranges, stamp=None, frame="camera", **members):
    message = LaserScan(range_min=0.05, range_max=10.0, angle_min=-1.5, angle_max=1.5)
    message.header.frame_id = frame
    message.header.stamp = rospy.Time.now() if stamp is None else stamp
    message.angle_increment = 3.0 / max(len(ranges) - 1, 1)
    message.ranges = list(ranges)
    for name, value in members.items():
        setattr(message, name, value)
    return message


def scan_along_x(beam, distance, stamp, duration):
    """101 beams of a sensor that moves meanwhile; one of them goes along x, and meets something."""
    ranges = np.full(101, np.inf)
    ranges[beam] = distance
    timing = {"angle_increment": 0.01, "time_increment": duration / 100}
    return scan(ranges, stamp, "moving", angle_min=-0.01 * beam, **timing)


def endpoints(message):
    """Returns the beams' end points in the laser's frame."""
    angles = message.angle_min + message.angle_increment * np.arange(len(message.ranges))
    ranges = np.array(message.ranges)
    return np.stack([ranges * np.cos(angles), ranges * np.sin(angles), 0 * angles], axis=1)


def wall():
    """Ranges to the plane x = 0.9 m in the laser's frame, with a post in front of it."""
    angles = np.linspace(-1.5, 1.5, BEAMS)
    ranges = 0.9 / np.cos(angles)
    ranges[100:104] = 0.42
    return ranges


# Changes that make a scan malformed, and a word of the message; check_scan() has tests of its own.
MALFORMED = [
    ({"time_increment": 1e30}, "more than 10 s"),
    ({"angle_increment": 1e30}, "more than two turns"),
    ({"ranges": []}, "ranges is empty"),
]


class LaserScanTest(pt.NodeTest):
    CAMERA = X_BASE_LASER

    def setUp(self):
        super().setUp()
        self.publisher = rospy.Publisher(self.namespace + "/scan", LaserScan, queue_size=10)
        source = {"topic": "scan", "type": "sensor_msgs/LaserScan"}
        if "turns_back" in self._testMethodName:
            source["timeout"] = 3.0  # its scans take a second
        self.start(sources={"laser": source}, **{"query/tolerance": 0.0})
        self.world.start_tf()

    def stream(self, make, rate=20):
        return self.world.repeat(rate, lambda: self.publisher.publish(make()))

    def check_wall(self):
        message = scan(wall())
        points = endpoints(message)
        points = pt.apply(X_BASE_LASER, points[np.array(message.ranges) <= 3.0])  # max_range
        with self.stream(lambda: scan(wall())):
            answer = self.node.wait_for(
                lambda m: m.status == 0 and m.sources[0].points_received == BEAMS, "the wall"
            )
        for name, link_pose in (("ball_link", self.BALL), ("box_link", self.BOX)):
            signed = pt.DISTANCE[name](pt.apply(pt.inverse(link_pose), points))
            truth = signed[signed > 0.02].min()  # the self-filter's padding
            self.assertAlmostEqual(pt.link(answer, name).distance, truth, 5)
            self.assertEqual(pt.link(answer, name).source, "laser")

    def test_distances_and_silence(self):
        # There are two texts, before and after the node has connected to this test's publisher.
        words = re.compile("'laser'.*(sensor_msgs/LaserScan|there is a publisher)")
        message = self.node.wait_for(
            lambda m: m.status == ProximityArray.NO_CLOUD and words.search(m.status_text),
            "no scan yet",
        )
        self.assertTrue(pt.all_unknown(message))
        self.check_wall()
        self.node.wait_for_unknown(ProximityArray.STALE_CLOUD, "the newest scan is")
        self.check_wall()

    def test_malformed(self):
        for members, words in MALFORMED:
            with self.subTest(words):
                others = dict(members)
                ranges = others.pop("ranges", [1.0] * 5)
                with self.stream(lambda r=ranges, others=others: scan(r, **others)):
                    message = self.node.wait_for(
                        lambda m: m.status != 0 and words in m.status_text, words
                    )
                self.assertIn("malformed scan", message.status_text)
                self.assertTrue(pt.all_unknown(message))
        self.check_wall()

    def test_moving_sensor(self):
        """Each beam starts at the sensor's pose at the beam's own time."""

        # To and fro at an even 0.3 m/s. Between the turning points, what tf interpolates is exact,
        # however far apart the transforms are that reach it.
        speed, turn = 0.3, 2.0

        def X_base_moving(t):
            phase = t % (2 * turn)
            return pt.transform((-0.9 + speed * min(phase, 2 * turn - phase), 0.0, 0.0))

        # The transforms come in late and up to now at most, so the scan has to wait for its last beam.
        self.world.poses["moving"] = ("base", X_base_moving)
        point = 0.35  # [m] on the x axis: 0.25 m from the ball

        def make():
            stamp = rospy.Time.now()
            duration = 0.2
            at_point = X_base_moving(stamp.to_sec() + duration)[0, 3]
            return scan_along_x(100, point - at_point, stamp, duration)

        with self.stream(make, rate=10):
            self.node.wait_for_status(ProximityArray.OK)
            messages = self.node.next_messages(500)
        distances = [
            pt.link(m, "ball_link").distance
            for m in messages
            if m.status == 0 and 0.4 < m.cloud_stamp.to_sec() % turn < turn - 0.6
        ]
        self.assertGreater(len(distances), 100)
        self.assertLess(max(abs(np.array(distances) - 0.25)), 1e-3)
        print("moving sensor: largest error %.2f mm" % (1e3 * max(abs(np.array(distances) - 0.25))))

    def test_sensor_that_turns_back(self):
        """Between its ends a scan follows the sensor, which is at one place at both."""
        duration, amplitude, point = 1.0, 0.15, 0.35

        def X_base_moving(t):
            return pt.transform((-0.6 - amplitude * np.cos(2 * np.pi * t / duration), 0.0, 0.0))

        def make():
            stamp = rospy.Time.now()
            at_point = X_base_moving(stamp.to_sec() + 0.5 * duration)[0, 3]
            return scan_along_x(50, point - at_point, stamp, duration)

        self.world.poses["moving"] = ("base", X_base_moving)
        with self.stream(make):
            self.node.wait_for_status(ProximityArray.OK)
            messages = self.node.next_messages(200)
        distances = [pt.link(m, "ball_link").distance for m in messages if m.status == 0]
        self.assertGreater(len(distances), 100)
        error = max(abs(np.array(distances) - 0.25))
        print("sensor that turns back: largest error %.2f mm" % (1e3 * error))
        self.assertLess(error, 0.02)


if __name__ == "__main__":
    pt.run("laser_scan_test", LaserScanTest)
