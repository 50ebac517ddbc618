#!/usr/bin/env python3
"""Zones whose points are no obstacles, and links that are left out for a while."""


import numpy as np
import proximity_testing as pt
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion
from ist_proximity.srv import IgnoreLinks, RemoveZone, SetZone, SetZoneRequest
from proximity_testing import LinkProximity, ProximityArray
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float64
from visualization_msgs.msg import Marker, MarkerArray

NEAR = [0.0, 0.0, 0.3]  # 0.2 m from the ball at the origin
FAR = [0.0, 0.0, -0.6]  # 0.5 m from it
BALL, BOX = "ball_link", "box_link"
HERE = pt.transform(NEAR)


def request(name="target", frame_id="target", dimensions=(0.2, 0.2, 0.2), **others):
    others.setdefault("shape", SetZoneRequest.BOX)
    others.setdefault("pose", Pose(orientation=Quaternion(w=1.0)))
    return SetZoneRequest(name=name, frame_id=frame_id, dimensions=dimensions, **others)


class ZonesTest(pt.NodeTest):
    BOX = pt.transform((0, 0.8, 0))
    POINTS = np.array([NEAR, FAR])

    def setUp(self):
        super().setUp()
        self.world.poses["target"] = ("base", HERE)
        self.world.start_tf()
        self.clouds = self.world.start_clouds()

    def start_node(self, **parameters):
        node = self.start(self_filter=False, **parameters)
        node.wait_for_status(ProximityArray.OK)
        self.set_zone = node.service("set_zone", SetZone)
        self.remove = node.service("remove_zone", RemoveZone)
        self.ignore = node.service("ignore_links", IgnoreLinks)
        return node

    def wait_for_distance(self, link, distance, zones):
        """The first message from now on with this distance that these zones have left points out of."""

        def is_it(message):
            one = pt.link(message, link)
            is_known = message.status == ProximityArray.OK and message.zones == zones
            return is_known and abs(one.distance - distance) < 1e-4

        return self.node.wait_for(is_it, "%s at %g m with the zones %s" % (link, distance, zones))

    def set(self, **arguments):
        answer = self.set_zone(request(**arguments))
        self.assertTrue(answer.success, answer.message)
        return answer

    def test_points_in_a_zone_are_no_obstacles(self):
        node = self.start_node()
        markers = node.collect("zones", MarkerArray)
        self.wait_for_distance(BALL, 0.2, [])
        self.set()
        message = self.wait_for_distance(BALL, 0.5, ["target"])
        # The other link does not see them either: its nearest point is FAR.
        box = pt.distance_to_box(pt.apply(pt.inverse(self.BOX), np.array([NEAR, FAR])))
        self.assertAlmostEqual(pt.link(message, BOX).distance, box[1], 4)
        node.wait_until(lambda: "'target' for all links" in node.diagnostic("query", "zones"), "told")
        node.wait_until(lambda: node.diagnostic("input cloud", "points in zones") == "1", "counted")
        node.wait_until(lambda: markers, "markers")
        marker = markers[-1].markers[0]
        self.assertEqual((marker.ns, marker.id, marker.type), ("target", 0, Marker.CUBE))
        self.assertEqual((marker.header.frame_id, marker.frame_locked), ("target", True))
        # It moves with its frame.
        self.world.poses["target"] = ("base", pt.transform((0, 0, 2)))
        self.wait_for_distance(BALL, 0.2, [])
        self.world.poses["target"] = ("base", pt.transform(FAR))
        self.wait_for_distance(BALL, 0.2, ["target"])
        self.world.poses["target"] = ("base", HERE)
        self.wait_for_distance(BALL, 0.5, ["target"])
        # Nothing that it has hidden stays hidden when it is removed, not even in one message.
        begin = len(node.messages)
        self.assertTrue(self.remove("target").success)
        removed = rospy.Time.now()  # a cycle may be under way
        self.assertFalse(self.remove("target").success)
        self.wait_for_distance(BALL, 0.2, [])
        node.wait_for(lambda m: m.header.stamp > removed, "a cycle that began after it")
        for late in node.messages[begin:]:
            if late.header.stamp > removed:
                self.assertFalse(pt.link(late, BALL).lower_bound > 0.2)
        node.wait_until(lambda: markers[-1].markers[0].action == Marker.DELETE, "the deletion")

    def test_only_named_links_do_not_see_them(self):
        node = self.start_node()
        shapes = (
            (SetZoneRequest.BOX, (0.2, 0.2, 0.2)),
            (SetZoneRequest.CYLINDER, (0.1, 0.2)),
            (SetZoneRequest.SPHERE, (0.1,)),
        )
        for shape, dimensions in shapes:
            self.set(shape=shape, dimensions=dimensions, links=[BALL])
            message = self.wait_for_distance(BALL, 0.5, ["target"])
            box = pt.distance_to_box(pt.apply(pt.inverse(self.BOX), [NEAR]))[0]
            self.assertAlmostEqual(pt.link(message, BOX).distance, box, 4)
            self.assertEqual(pt.link(message, BOX).source, "cloud")
            self.assertLessEqual(pt.link(message, BOX).lower_bound, box + 1e-6)
        # In contact, too.
        self.world.points = np.array([[0.0, 0.8, 0.0], [0.0, 0.0, 0.05]])
        self.world.poses["target"] = ("base", pt.transform((0.0, 0.8, 0.0)))
        self.set(dimensions=(0.1, 0.1, 0.1), links=[BALL])
        in_contact = lambda m: [one.state for one in m.links] == [LinkProximity.CONTACT] * 2  # noqa: E731
        node.wait_for(in_contact, "both links in contact, each with its own point")
        self.set(dimensions=(0.1, 0.1, 0.1), links=[BOX])
        message = node.wait_for(
            lambda m: m.zones and pt.link(m, BOX).state == LinkProximity.NEAR, "the box is free"
        )
        self.assertEqual(pt.link(message, BALL).state, LinkProximity.CONTACT)

    def test_scans(self):
        publisher = rospy.Publisher(self.namespace + "/scan", LaserScan, queue_size=1)

        def send():
            scan = LaserScan(angle_increment=-np.pi / 2, range_min=0.05, range_max=5.0, ranges=[0.3, 0.6])
            scan.header.stamp, scan.header.frame_id = rospy.Time.now(), "camera"
            publisher.publish(scan)

        self.world.poses["target"] = ("base", pt.transform((0.3, 0, 0)))
        self.world.repeat(20, send)
        self.start_node(sources={"laser": {"topic": "scan", "type": "sensor_msgs/LaserScan"}})
        self.wait_for_distance(BALL, 0.2, [])
        self.set(links=[BALL])
        message = self.wait_for_distance(BALL, 0.5, ["target"])
        box = pt.distance_to_box(pt.apply(pt.inverse(self.BOX), [[0.3, 0, 0]]))[0]
        self.assertAlmostEqual(pt.link(message, BOX).distance, box, 4)

    def test_without_its_frame_a_zone_is_off(self):
        node = self.start_node(pose_timeout=0.3)
        self.set()
        self.wait_for_distance(BALL, 0.5, ["target"])
        del self.world.poses["target"]
        self.wait_for_distance(BALL, 0.2, [])
        node.wait_until(
            lambda: "zone 'target' is off" in str(node.diagnostics), "the diagnostics to say so"
        )
        self.world.poses["target"] = ("base", HERE)
        self.wait_for_distance(BALL, 0.5, ["target"])

    def test_a_zone_ends_with_its_lifetime(self):
        node = self.start_node(cloud_timeout=8.0)
        begin = rospy.Time.now()
        self.set(lifetime=1.5)
        self.wait_for_distance(BALL, 0.5, ["target"])
        # The same again: it goes on.
        rospy.sleep(0.7)
        again = rospy.Time.now()
        self.set(lifetime=1.5)
        end = rospy.Time.now() + rospy.Duration(1.5)  # at the latest
        message = self.wait_for_distance(BALL, 0.2, [])
        self.assertGreater((message.header.stamp - again).to_sec(), 1.4)
        self.assertGreater((message.header.stamp - begin).to_sec(), 2.0)
        for late in node.messages:
            if late.header.stamp > end:
                self.assertFalse(pt.link(late, BALL).lower_bound > 0.2)
        # A camera that is gone leaves nothing hidden behind.
        self.set(lifetime=1.5)
        self.wait_for_distance(BALL, 0.5, ["target"])
        self.clouds.paused = True
        node.wait_for_status(ProximityArray.NO_CLOUD, "zone 'target' has left points out of it")

    def test_a_memory_keeps_what_is_in_a_zone(self):
        """It is an obstacle when it is out of view, and none while it is seen."""
        node = self.start_node(memory={"enabled": True})
        self.assertIn("no effect on 'cloud/memory'", self.set().message)
        for links in ([], [BALL]):
            self.world.points = np.array([NEAR, FAR])
            self.set(links=links)
            message = self.wait_for_distance(BALL, 0.5, ["target"])
            self.assertEqual(pt.link(message, BALL).source, "cloud")
            self.world.points = np.array([FAR])
            message = node.wait_for(
                lambda m: pt.link(m, BALL).source == "cloud/memory", "what is remembered"
            )
            self.assertLess(pt.link(message, BALL).distance, 0.21)
            self.assertGreater(pt.link(message, BALL).distance, 0.1)

    def test_parameters(self):
        zones = {
            "target": {
                "frame_id": "target",
                "shape": "sphere",
                "radius": 0.1,
                "links": [BALL],
            },
            "typo": {"frame_id": "base", "shape": "box", "size": [9.0, 9.0, 9.0], "links": ["bal_link"]},
        }
        node = self.start_node(zones=zones)
        self.wait_for_distance(BALL, 0.5, ["target", "typo"])
        node.wait_until(
            lambda: "'bal_link' is no monitored link; did you mean 'ball_link'?" in str(node.diagnostics),
            "the unknown link to be told",
        )

    def check_refused(self, text, **arguments):
        answer = self.set_zone(request(**arguments))
        self.assertFalse(answer.success)
        self.assertIn(text, answer.message)
        self.assertIn("is not set", answer.message)

    def test_wrong_zones_are_refused_by_name(self):
        self.start_node()
        self.set()
        self.wait_for_distance(BALL, 0.5, ["target"])
        nan = float("nan")
        wrong = [
            (dict(name=""), "name"),
            (dict(name="x" * 300), "its name"),
            (dict(frame_id=""), "its frame"),
            (dict(frame_id="atlantis"), "'atlantis'"),
            (dict(shape=0), "its shape is 0"),
            (dict(shape=7), "its shape is 7"),
            (dict(dimensions=()), "dimensions holds 0 numbers"),
            (dict(dimensions=(0.1, nan, 0.1)), "nan"),
            (dict(dimensions=(0.1, -0.1, 0.1)), "-0.1 m"),
            (dict(dimensions=(0.1, 0.1, 11.0)), "11 m"),
            (dict(shape=SetZoneRequest.SPHERE, dimensions=(6.0,)), "12 m"),
            (dict(pose=Pose(position=Point(x=nan), orientation=Quaternion(w=1.0))), "pose"),
            (dict(pose=Pose()), "pose"),
            (dict(links=["gripper"]), "'gripper' is no monitored link"),
            (dict(links=["bal_link"]), "did you mean 'ball_link'?"),
            (dict(lifetime=nan), "nan s"),
            (dict(lifetime=-1.0), "-1 s"),
        ]
        for arguments, text in wrong:
            with self.subTest(str(arguments)[:80]):
                self.check_refused(text, **arguments)
        self.set_zone = rospy.ServiceProxy(self.node.name + "/set_zone", SetZone, persistent=True)
        for i in range(31):
            self.set(name="zone %d" % i, pose=Pose(Point(3, 3, i), Quaternion(w=1.0)))
        for i in range(31, 300):
            self.check_refused("zone 'zone %d' is one too many" % i, name="zone %d" % i)
        message = self.wait_for_distance(BALL, 0.5, self.node.messages[-1].zones)
        self.assertIn("target", message.zones)

    def test_links_are_left_out_for_a_while(self):
        node = self.start_node()
        minima = node.collect("min_distance", Float64, lambda m: m.data)
        is_near = lambda value: minima and abs(minima[-1] - value) < 0.002  # noqa: E731
        box = pt.distance_to_box(pt.apply(pt.inverse(self.BOX), np.array([NEAR, FAR]))).min()
        node.wait_until(lambda: is_near(0.2), "the ball's distance")
        for links, lifetime, text in (
            ([BALL], -1.0, "lifetime is -1 s"),
            ([BALL], float("nan"), "lifetime is nan s"),
            ([BALL], 1e9, "lifetime is 1e+09 s"),
            ([], 1.0, "links is empty"),
            ([BALL, "bal_link"], 1.0, "did you mean 'ball_link'?"),
        ):
            answer = self.ignore(links, lifetime)
            self.assertFalse(answer.success)
            self.assertIn(text, answer.message)
        self.assertTrue(is_near(0.2))
        self.assertTrue(self.ignore([BALL], 2.5).success)
        node.wait_until(lambda: is_near(box), "the box's distance")
        message = node.wait_for(lambda m: m.ignored_links, "the message to tell it")
        self.assertEqual(message.ignored_links, [BALL])
        self.assertAlmostEqual(pt.link(message, BALL).distance, 0.2, 4)
        node.wait_until(lambda: BALL in node.diagnostic("query", "links left out"), "told")
        node.wait_until(lambda: is_near(0.2), "the ball to count again")
        self.assertTrue(self.ignore([BALL], 100.0).success)
        node.wait_until(lambda: is_near(box), "the box's distance")
        self.assertTrue(self.ignore([BALL], 0.0).success)
        node.wait_until(lambda: is_near(0.2), "the ball to count again")


if __name__ == "__main__":
    pt.run("zones_test", ZonesTest)
