#!/usr/bin/env python3
"""What says nothing of space is never OK, never CLEAR and never lets the robot go, unless the message's own
convention says that the space is free: every kind of content in every kind of message, for sources that are
required, optional, with a memory, and with unknown space as an obstacle."""

import unittest

import numpy as np
import proximity_testing as pt
import rospy
from ist_proximity.msg import SpeedScaleState
from proximity_testing import LinkProximity, ProximityArray
from sensor_msgs.msg import CameraInfo, Image, LaserScan, PointCloud2

WIDTH, HEIGHT, FOCAL_LENGTH = 64, 48, 50.0
V, U = np.mgrid[0:HEIGHT, 0:WIDTH]
RAYS = np.stack(
    [(U - 32) / FOCAL_LENGTH, (V - 24) / FOCAL_LENGTH, np.ones(U.shape)], axis=-1
).reshape(-1, 3)
BEAMS = 301


def points(z):
    """As many as pixels; every coordinate is z where that is not finite."""
    return RAYS * z if np.isfinite(z) else np.full(RAYS.shape, z)


def organized(p):
    message = pt.cloud(p)
    message.width, message.height = WIDTH, HEIGHT
    message.row_step = WIDTH * message.point_step
    return message


def image(z, encoding="16UC1"):
    kind = "<u2" if encoding == "16UC1" else "<f4"
    data = np.full((HEIGHT, WIDTH), z, kind)
    message = Image(width=WIDTH, height=HEIGHT, encoding=encoding, step=data.itemsize * WIDTH)
    message.header.frame_id, message.header.stamp = "camera", rospy.Time.now()
    message.data = data.tobytes()
    return message


def scan(r, range_max=30.0):
    message = LaserScan(angle_min=-1.5, angle_max=1.5, angle_increment=0.01, range_min=0.01)
    message.header.frame_id, message.header.stamp = "camera", rospy.Time.now()
    message.range_max, message.ranges = range_max, [r] * BEAMS
    return message


def camera_info():
    info = CameraInfo(width=WIDTH, height=HEIGHT)
    info.P = [FOCAL_LENGTH, 0, 32, 0, 0, FOCAL_LENGTH, 24, 0, 0, 0, 1, 0]
    info.header.frame_id = "camera"
    return info


INF, NAN = float("inf"), float("nan")
ONE_PLACE = np.tile([[0.3, 0.2, 0.9]], (len(RAYS), 1))
MIXED = np.vstack([np.zeros((2000, 3)), np.full((2000, 3), NAN), [[0, 0, 30.0]]])

# By type of message: what is in it, and whether that is a measurement that nothing is there.
ROWS = {
    "cloud": [
        ("zeros", lambda: pt.cloud(points(0.0)), False),
        ("zeros, organized", lambda: organized(points(0.0)), False),
        ("NaN", lambda: pt.cloud(points(NAN)), False),
        ("infinite", lambda: pt.cloud(points(INF)), False),
        ("infinite, organized", lambda: organized(points(-INF)), False),
        ("2 cm before the lens", lambda: pt.cloud(0.02 * RAYS), False),
        ("2 cm before the lens, organized", lambda: organized(0.02 * RAYS), False),
        ("millimetres", lambda: pt.cloud(points(1400.0)), False),
        ("millimetres, organized", lambda: organized(points(1400.0)), False),
        ("one place", lambda: pt.cloud(ONE_PLACE), False),
        ("one place, organized", lambda: organized(ONE_PLACE), False),
        ("one far point among zeros and NaN", lambda: pt.cloud(MIXED), False),
        ("one far point at a wrong place", lambda: pt.cloud([[0, 0, 1400.0]]), False),
        ("one point at the sensor", lambda: pt.cloud([[0, 0, 0]]), False),
        ("beyond max_range", lambda: pt.cloud(points(5.0)), True),
        ("beyond max_range, organized", lambda: organized(points(5.0)), True),
        ("empty", lambda: pt.cloud(np.zeros((0, 3))), True),
    ],
    "image": [
        ("zeros", lambda: image(0), False),
        ("zeros, float", lambda: image(0, "32FC1"), False),
        ("NaN", lambda: image(NAN, "32FC1"), False),
        ("-inf", lambda: image(-INF, "32FC1"), False),
        ("20 mm", lambda: image(20), False),
        ("20 mm, float", lambda: image(0.02, "32FC1"), False),
        ("millimetres", lambda: image(1400.0, "32FC1"), False),
        ("tenths of a millimetre", lambda: image(14000), False),
        ("saturated", lambda: image(65535), False),
        ("+inf", lambda: image(INF, "32FC1"), True),
        ("beyond max_range", lambda: image(5000), True),
        ("beyond max_range, float", lambda: image(5.0, "32FC1"), True),
    ],
    "scan": [
        ("zeros", lambda: scan(0.0), False),
        ("NaN", lambda: scan(NAN), False),
        ("-inf", lambda: scan(-INF), False),
        ("above range_min", lambda: scan(0.02), False),
        ("millimetres", lambda: scan(1400.0), False),
        ("millimetres, range_max too", lambda: scan(1400.0, 12000.0), False),
        ("+inf", lambda: scan(INF), True),
        ("range_max + 1", lambda: scan(31.0), True),
        ("beyond max_range", lambda: scan(5.0), True),
    ],
}
GOOD = {
    "cloud": lambda: pt.cloud(points(1.4)),
    "image": lambda: image(1400),
    "scan": lambda: scan(1.4),
}
TYPES = {"cloud": PointCloud2, "image": Image, "scan": LaserScan}
MEMORY = {"enabled": True, "decay": 600.0, "resolution": 0.05}
SETTINGS = {
    "required": {},
    "optional": {"required": False},
    "memory": {"required": False, "memory": MEMORY},
    "unknown": {"required": False, "memory": MEMORY},
    "frozen": {"frozen_after": 1.0},
}


class Watched:
    """A node with one source, and its last speed scale."""

    def __init__(self, kind, setting):
        self.namespace = "/%s_%s" % (kind, setting)
        self.kind, self.setting = kind, setting
        self.world = pt.World(self.namespace)
        self.world.stand(pt.transform((0, 0, 1)), pt.transform((0.6, 0, 1)))
        self.world.start_tf(20)
        source = {"topic": "/" + kind, "type": TYPES[kind]._type, **SETTINGS[setting]}
        parameters = {"sources": {"eye": source}, "rate": 20.0, "min_distance/fixed_links": True}
        if setting != "frozen":  # a machine that stops for a while makes nothing stale
            parameters.update(cloud_timeout=8.0, pose_timeout=8.0)
        if setting == "unknown":
            parameters["unknown_space"] = "obstacle"
        self.node = pt.ProximityNode(self.namespace, parameters, pt.urdf())
        self.scales = self.node.collect("speed_scale_state", SpeedScaleState)

    def of(self, begin):
        """The messages that rest on something measured since."""
        messages = list(self.node.messages[-40:])
        return [m for m in messages if m.sources and m.sources[0].stamp >= begin]

    def stamps_of(self, begin):
        """Their stamps, without those that an earlier answer has, too: tf that is late stands still."""
        stamps = {True: set(), False: set()}
        for message in list(self.node.messages[-80:]):
            is_new = bool(message.sources) and message.sources[0].stamp >= begin
            stamps[is_new].add(message.header.stamp)
        return stamps[True] - stamps[False]

    def stop(self):
        self.world.stop()
        return self.node.stop()


class UnmeasuredTest(unittest.TestCase):
    def setUp(self):
        self.make = dict(GOOD)
        self.repeaters, self.publishers = [], []
        info = rospy.Publisher("/camera_info", CameraInfo, queue_size=2)
        self.repeaters.append(pt.Repeater(5, lambda: info.publish(camera_info())))
        for kind, type_ in TYPES.items():
            publisher = rospy.Publisher("/" + kind, type_, queue_size=2)
            self.publishers.append(publisher)
            send = lambda p=publisher, k=kind: p.publish(self.make[k]())  # noqa: E731
            self.repeaters.append(pt.Repeater(15, send))
        self.watched = []

    def tearDown(self):
        for repeater in self.repeaters:
            repeater.stop()
        for watched in self.watched:
            self.assertEqual(watched.stop(), 0)

    def row_of(self, kind, i):
        rows = ROWS[kind]
        return rows[min(i, len(rows) - 1)]

    def check(self, watched, what, is_free, begin):
        node = watched.node
        node.wait_until(lambda: len(watched.of(begin)) >= 3, "%s of %s" % (what, watched.namespace))
        for message in watched.of(begin):
            if watched.setting != "unknown":  # there a CLEAR link's bound ends at unknown space
                pt.check_invariants(self, message)
            source = message.sources[0]
            self.assertEqual(source.measured_share > 0.1, is_free, message)
            if is_free:
                self.assertEqual(source.status, ProximityArray.OK, message)
                self.assertEqual(source.measured_share, 1.0)
                continue
            self.assertEqual(source.status, ProximityArray.NO_CLOUD, message)
            self.assertEqual(message.status, ProximityArray.NO_CLOUD, message)
            self.assertTrue(pt.all_unknown(message), message)
            if what == "NaN":
                self.assertRegex(message.status_text, "every point of the newest (cloud|image|scan) is NaN")
        stamps = watched.stamps_of(begin)
        for state in watched.scales[-40:]:
            if state.header.stamp in stamps and not is_free:
                self.assertEqual(state.scale, 0.0, state)
        if is_free and watched.setting in ("required", "optional"):
            self.assertEqual(message.status, ProximityArray.OK, message)
            self.assertEqual(pt.states(message), [LinkProximity.CLEAR] * 2)

    def test_frozen(self):
        """The same bytes with new stamps, which a simulation without noise may send."""
        self.watched = [Watched(kind, "frozen") for kind in TYPES]
        for watched in self.watched:
            watched.node.wait_for_unknown(ProximityArray.STALE_CLOUD, "the same bytes")
        noise = np.random.default_rng(1)
        self.make = {
            "cloud": lambda: pt.cloud(points(1.4 + 1e-3 * noise.random())),
            "image": lambda: image(1400 + noise.integers(20)),
            "scan": lambda: scan(1.4 + 1e-3 * noise.random()),
        }
        for watched in self.watched:
            watched.node.wait_for_status(ProximityArray.OK)

    def test_matrix(self):
        self.watched = [
            Watched(kind, setting)
            for kind in TYPES
            for setting in ("required", "optional", "memory", "unknown")
            if kind != "scan" or "memory" not in SETTINGS[setting]
        ]
        for watched in self.watched:
            watched.node.wait_for_status(ProximityArray.OK)
        for i in range(max(len(rows) for rows in ROWS.values())):
            for kind in TYPES:
                self.make[kind] = self.row_of(kind, i)[1]
            # A message that was made before may still come.
            begin = rospy.Time.now() + rospy.Duration(0.02)
            for watched in self.watched:
                what, _, is_free = self.row_of(watched.kind, i)
                with self.subTest(what, node=watched.namespace):
                    self.check(watched, what, is_free, begin)
        self.make = dict(GOOD)
        for watched in self.watched:
            watched.node.wait_for_status(ProximityArray.OK)


if __name__ == "__main__":
    pt.run("unmeasured_test", UnmeasuredTest, disable_signals=True)
