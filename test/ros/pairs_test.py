#!/usr/bin/env python3
"""Each option with each other one, and a camera that dies and comes back: nothing is free that nobody
measures.

The camera is at the origin of `base` and looks along x at a patch beside the ball; the box is far away.
Several nodes run side by side, each with four of the options.
"""

import collections
import contextlib
import itertools
import time
import unittest

import numpy as np
import proximity_testing as pt
import rospy
from memory_test import BALL, FAR, LASTING, NEAR, distance_to
from proximity_testing import LinkProximity, ProximityArray
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64

from ist_proximity.msg import SpeedScaleState

TIMEOUT = 0.4  # [s] of a camera
# With a model that has just been made anew, no cloud has come.
SILENT = (ProximityArray.STALE_CLOUD, ProximityArray.NO_CLOUD)
OTHER = """<robot name="other">
  <link name="head"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
</robot>"""
WALL = {"shape": "box", "size": [0.1, 0.1, 0.1], "position": [1.5, 1.3, 0.0]}


def camera(**more):
    return dict({"topic": "cloud", "timeout": TIMEOUT}, **more)


def merged(one, other):
    """Two dictionaries, and those within them, as one."""
    result = dict(one)
    for name, value in other.items():
        both = isinstance(value, dict) and isinstance(result.get(name), dict)
        result[name] = merged(result[name], value) if both else value
    return result


MEMORY = {"memory": LASTING}
OPTIONS = {
    "memory": MEMORY,
    "unknown_space": dict(MEMORY, unknown_space="obstacle"),
    "extent": {"sources": {"camera": {"noise": "kinect_v1", "footprint": 0.006, "latency": 0.03}}},
    "view_filter": {"sources": {"camera": {"self_filter_mode": "view"}}},
    "world": {"sources": {"cell": {"type": "world", "objects": {"wall": WALL}}}},
    "second_robot": {
        "sources": {
            "other": {"type": "world", "robot": {"description": "other_description", "tf_prefix": "other/"}}
        }
    },
    "self_collision": {"self_collision": {"enabled": True, "in_minimum": True}},
    "optional": {
        "sources": {
            "camera": {"required": False},
            "side": {"topic": "side", "timeout": TIMEOUT, "required": False},
        }
    },
    "deadline": {"query": {"deadline": 1e-4}},
    "attached": {},
}


def fours():
    """Sets of four options; each two of all options are together in one of them."""
    pairs_of = lambda options: set(itertools.combinations(options, 2))  # noqa: E731
    missing = pairs_of(OPTIONS)
    while missing:
        best = max(itertools.combinations(OPTIONS, 4), key=lambda four: len(missing & pairs_of(four)))
        missing -= pairs_of(best)
        yield best


def by_stamp(messages):
    """Messages by their stamp, without those of which several have the same."""
    stamps = collections.Counter(m.header.stamp for m in messages)
    return {m.header.stamp: m for m in messages if stamps[m.header.stamp] == 1}


class OptionsNode:
    """A node with some options, its surroundings, and what it says."""

    def __init__(self, options):
        self.options = options
        self.name = "_".join(options)
        self.namespace = "/pairs/" + self.name
        self.world = pt.World(self.namespace)
        self.world.stand(pt.transform(BALL), pt.transform((0, 0, 5)))
        self.world.poses["other/head"] = ("base", pt.transform((1.5, 1.4, 0)))
        self.world.points = FAR
        self.last_cloud = 0.0
        self.world.start_tf(25)
        self.clouds = self.world.repeat(8, self.send_cloud)
        parameters = {"sources": {"camera": camera()}, "max_distance": 0.8, "rate": 10}
        parameters["speed_scale"] = {"enabled": True}
        for option in options:
            parameters = merged(parameters, OPTIONS[option])
        rospy.set_param(self.namespace + "/other_description", OTHER)
        self.node = pt.ProximityNode(self.namespace, parameters, pt.urdf(), diagnostics=False)
        self.scales = self.node.collect("speed_scale_state", SpeedScaleState)
        self.smallest = self.node.collect("min_distance", Float64, lambda m: m.data)

    def send_cloud(self):
        message = pt.cloud(self.world.points)
        self.last_cloud = message.header.stamp.to_sec()
        self.world.cloud_publisher.publish(message)

    def attach(self):
        if "attached" in self.options:
            self.node.attach("ball_link", (0.0, 0.0, 0.3), [0.02])

    def is_alive(self, message):
        """Whether the camera is used: OK, but for links that the deadline leaves."""
        if message.status == ProximityArray.DEGRADED:
            return "deadline" in self.options
        return message.status == ProximityArray.OK

    def stop(self):
        self.world.stop()
        return self.node.stop()


class PairsTest(unittest.TestCase):
    def setUp(self):
        self.failures = []

    @contextlib.contextmanager
    def noted(self, name):
        """Goes on with the other nodes; rostest does not show what a subTest says."""
        try:
            yield
        except AssertionError as error:
            self.failures.append(f"{name}: {error}")

    def test_each_with_each(self):
        nodes = [OptionsNode(options) for options in fours()]
        try:
            self.run_phases(nodes)
        finally:
            codes = {one.name: one.stop() for one in nodes}
        self.assertEqual(set(codes.values()), {0}, codes)
        for one in nodes:
            with self.noted(one.name):
                self.check_every_message(one)
        self.assertFalse(self.failures, "\n".join(self.failures))

    def run_phases(self, nodes):
        for one in nodes:
            one.node.wait_for(one.is_alive, one.name + ": answers")
            one.attach()
            one.node.wait_for(one.is_alive, one.name + ": answers with what is attached")
        for one in nodes:
            one.clouds.paused = True
        rospy.sleep(0.1)  # a cloud may be under way
        dead_since = {one.name: one.last_cloud for one in nodes}
        silent = lambda m: m.status in SILENT  # noqa: E731
        for one in nodes:
            message = one.node.wait_for(silent, one.name + ": a silent camera")
            self.assertIn("'camera'", message.status_text)
        rospy.sleep(0.3)  # ~min_distance has no stamp
        counts = {one.name: len(one.smallest) for one in nodes}
        rospy.sleep(0.6)
        until = rospy.Time.now().to_sec()
        for one in nodes:
            with self.noted(one.name):
                self.check_dead(one, dead_since[one.name] + TIMEOUT, until)
                smallest = one.smallest[counts[one.name] :]
                self.assertGreater(len(smallest), 0)
                self.assertTrue(np.isnan(smallest).all(), smallest)
        for one in nodes:
            one.clouds.paused = False
        for one in nodes:
            one.node.wait_for(one.is_alive, one.name + ": answers again")

    def check_dead(self, one, begin, end):
        messages = [m for m in one.node.messages if begin < m.header.stamp.to_sec() < end]
        self.assertGreater(len(messages), 2)
        for message in messages:
            self.assertIn(message.status, SILENT, message.status_text)
            self.assertTrue(pt.all_unknown(message), message)
        scales = [s for s in list(one.scales) if begin < s.header.stamp.to_sec() < end]
        self.assertGreater(len(scales), 0)
        self.assertEqual({s.scale for s in scales}, {0.0})

    def check_every_message(self, one):
        unseen = "unknown_space" in one.options
        compared = 0
        scales = by_stamp(one.scales)
        alone = by_stamp(one.node.messages)
        # Until an optional camera comes for the first time, a required world is all there is.
        is_there = "optional" not in one.options
        for message in one.node.messages:
            pt.check_invariants(self, message, -np.inf if unseen else 0.8)
            is_there = is_there or message.sources[0].status == ProximityArray.OK
            if is_there and not pt.all_unknown(message):
                vouching = {s.name for s in message.sources if s.status == ProximityArray.OK}
                self.assertIn("camera", vouching, message)
            if not message.links:  # there is no robot yet
                continue
            ball = pt.link(message, "ball_link")
            if is_there and ball.state != LinkProximity.UNKNOWN:
                self.assertLessEqual(ball.lower_bound, distance_to(FAR) + 1e-6)
            scale = scales.get(message.header.stamp)
            if scale is None or message.header.stamp not in alone:
                continue
            compared += 1
            bounds = {link.link: link.lower_bound for link in message.links}
            if scale.scale > 0:
                self.assertTrue(one.is_alive(message), message)
                self.assertGreater(min(bounds.values()), 0.1)  # ~speed_scale/stop_distance
            is_between_links = scale.source.endswith("_link")
            if scale.rule != SpeedScaleState.UNKNOWN and not is_between_links:
                self.assertLessEqual(scale.bound, bounds[scale.link] + 1e-9)
        self.assertGreater(compared, 5)


class OptionalCamerasTest(pt.NodeTest):
    """Two cameras that may be missing, and what one of them remembers."""

    BALL, BOX, MAX_DISTANCE = pt.transform(BALL), pt.transform((0, 0, 5)), 0.8
    DECAY = 2.0

    def setUp(self):
        super().setUp()
        self.world.start_tf()
        self.side = rospy.Publisher(self.namespace + "/side", PointCloud2, queue_size=5)
        self.world.points = FAR
        self.front_clouds = self.world.start_clouds()
        # Behind the camera: seen, and near to nothing.
        self.side_clouds = self.world.repeat(20, lambda: self.side.publish(pt.cloud([[-1.0, 0, 0]])))
        memory = dict(LASTING, decay=self.DECAY)
        sources = {
            "front": camera(required=False, memory=memory),
            "side": camera(topic="side", required=False),
        }
        self.start(sources=sources, max_distance=0.8, links=["ball_link"])

    def test_what_a_silent_camera_remembers(self):
        ball = lambda m: pt.link(m, "ball_link")  # noqa: E731
        self.node.wait_for(lambda m: m.status == 0 and ball(m).source == "front", "the patch in view")
        hidden = self.world.points = NEAR
        self.assertGreater(distance_to(hidden), 0.8)
        self.node.wait_for(lambda m: ball(m).source == "front/memory", "the patch remembered")
        # In view when the camera dies, and hidden from it.
        self.world.points = FAR
        self.node.wait_for(lambda m: ball(m).source == "front", "the patch in view again")
        begin = len(self.node.messages)
        self.front_clouds.paused = True
        died = time.monotonic()
        clear = self.node.wait_for(
            lambda m: m.status == 0 and ball(m).state == LinkProximity.CLEAR, "the patch forgotten"
        )
        self.assertGreater(time.monotonic() - died, self.DECAY - 0.3)
        self.assertLess(time.monotonic() - died, self.DECAY + 2.0)
        last = self.node.messages.index(clear)
        remembered = [m for m in self.node.messages[begin:last] if ball(m).source == "front/memory"]
        self.assertGreater(len(remembered), 20)
        for message in self.node.messages[begin:last]:
            self.assertEqual(message.status, ProximityArray.OK, message.status_text)
            self.assertLessEqual(ball(message).lower_bound, distance_to(FAR) + 1e-6)
        for message in remembered:
            by_name = {s.name: s.status for s in message.sources}
            self.assertEqual(by_name["front"], ProximityArray.STALE_CLOUD)
            self.assertEqual(by_name["front/memory"], ProximityArray.STALE_CLOUD)
        # Nobody is left.
        self.side_clouds.paused = True
        begin = len(self.node.messages)
        message = self.node.wait_for_status(ProximityArray.STALE_CLOUD, "'side'")
        self.assertIn("'front'", message.status_text)
        self.assertTrue(pt.all_unknown(message))
        self.front_clouds.paused = False
        self.node.wait_for(lambda m: m.status == 0 and ball(m).source == "front", "one is enough")


if __name__ == "__main__":
    pt.run("pairs_test", {"options": PairsTest, "cameras": OptionalCamerasTest}, anonymous=True)
