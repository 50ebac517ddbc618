#!/usr/bin/env python3
"""Wrong parameters: the node does not start, and names each one, the reason and the range."""

import os
import unittest

import numpy as np
import proximity_testing as pt
import rosparam
import yaml

# Parameters, and words of the message. All mistakes of one start are reported.
WRONG = [
    (
        {
            "rate": -5,
            "max_distance": float("nan"),
            "pose_timeout": 0,
            "query/tolerance": -0.1,
            "query/deadline": "soon",
            "packing/max_error": 0.0,
            "packing/max_spheres": 2.5,
            "geometry": "both",
            "links": "ball_link",
            "fixed_frame": 3,
        },
        [
            "~rate is -5 Hz",
            "~max_distance is nan m",
            "~pose_timeout is 0 s",
            "~query/tolerance is -0.1 m",
            '~query/deadline is "soon"',
            "~packing/max_error is 0 m",
            "~packing/max_spheres is 2.5",
            '~geometry is "both": allowed is collision, visual',
            "~links",
            "~fixed_frame",
            "more than 0",
        ],
    ),
    (
        {
            "repulsion/influence_distance": float("inf"),
            "repulsion/gain": -1,
            "repulsion/smoothing": 0.0,
            "robot_description": "",
            "cache_directory": 7,
            "pose_source": "joint_state",
            "self_collision": {"enabled": 1},
            "self_filter": "yes",
        },
        [
            "~repulsion/influence_distance is inf m",
            "~repulsion/gain is -1",
            "~repulsion/smoothing is 0 m",
            "~robot_description",
            "~cache_directory",
            '~pose_source is "joint_state": allowed is tf, joint_states',
            "~self_collision/enabled is 1: true or false is needed",
            "~self_filter",
        ],
    ),
    (
        {
            "sources": {
                "scan": {"type": "sensor_msgs/LaserScan", "max_range": "far"},
                "map": {"type": "octomap_msgs/Octomap", "self_filter": True, "timeout": 0},
                "file": {"type": "octomap_msgs/Octomap", "file": "room.bt", "topic": "room"},
                "odd": {"type": "sensor_msgs/Imu", "timeout": 0, "required": 1},
                "range": {"min_range": 2.0, "max_range": 1.0},
                "padding": {"self_filter_padding": -0.01, "topic": ""},
                "flat": 3,
            },
            "cache_directory": "~/packings",
        },
        [
            '~sources/scan/max_range is "far"',
            "~sources/map/self_filter is set: it is not for a source of type octomap_msgs/Octomap",
            "~sources/map/timeout is 0 s: allowed is more than 0 s, inf included",
            '~sources/file/file is "room.bt": an absolute path is needed',
            "~sources/file/topic and ~sources/file/file are both set",
            "~sources/odd/type",
            "~sources/odd/timeout is 0 s",
            "~sources/odd/required",
            "~sources/range/max_range is 1 m",
            "~sources/padding/self_filter_padding is -0.01 m",
            "~sources/padding/topic",
            "~sources/flat",
            '~cache_directory is "~/packings": an absolute path is needed',
        ],
    ),
    ({"sources": [1, 2]}, ["~sources"]),
    (  # the extent of points
        {
            "noise": {"a": -0.001, "b": float("nan"), "calibration": "some"},
            "footprint": -0.1,
            "latency": -1,
            "sources": {
                "unknown": {"noise": "kinect_v9"},
                "list": {"noise": ["a"], "footprint": "pixel", "latency": "late"},
                "far": {"noise": {"b": 0.01}, "max_range": float("inf")},
                "large": {"noise": {"a": 0.5}},
                "map": {"type": "octomap_msgs/Octomap", "noise": {"b": 0.1}, "footprint": "camera"},
            },
        },
        [
            "~noise/a is -0.001 m: allowed is from 0 to 1 m",
            "~noise/b is nan 1/m",
            '~noise/calibration is "some"',
            "~footprint is -0.1 rad",
            "~latency is -1 s",
            '~sources/unknown/noise is "kinect_v9": allowed is none, kinect_v1, realsense_d435',
            "~sources/list/noise",
            '~sources/list/footprint is "pixel": allowed is none, camera',
            '~sources/list/latency is "late"',
            "~sources/far/noise, footprint and latency: the radius of a point at max_range, inf m",
            "~sources/large/noise, footprint and latency: the points' radius is 1.5 m",
            "~sources/map/noise/b is set: it is not for a source of type octomap_msgs/Octomap",
            "~sources/map/footprint is set",
        ],
    ),
    (
        {
            "ignore_links": "base",
            "min_distance/fixed_links": "no",
            "speed_scale": {
                "stop_distance": -0.1,
                "hysteresis": "some",
                "links": {"ball_link": {"stop_distance": "near"}, "box_link": 3},
                "separation": {"stopping_time": -1, "enabled": 1},
            },
        },
        [
            "~ignore_links",
            '~min_distance/fixed_links is "no": true or false is needed',
            "~speed_scale/stop_distance is -0.1 m: allowed is from 0",
            '~speed_scale/hysteresis is "some"',
            '~speed_scale/links/ball_link/stop_distance is "near"',
            "~speed_scale/links/box_link is 3: a dictionary is needed",
            "~speed_scale/separation/stopping_time is -1 s",
            "~speed_scale/separation/enabled is 1: true or false is needed",
        ],
    ),
    (
        {
            "speed_scale": {
                "stop_distance": 0.5,
                "links": {"ball_link": {"free_distance": 0.02}, "box_link": {"free_distance": 4}},
            }
        },
        [
            "~speed_scale/stop_distance is 0.5 m: it must be less than ~speed_scale/free_distance, 0.3",
            "~speed_scale/stop_distance is 0.5 m: it must be less than "
            "~speed_scale/links/ball_link/free_distance, 0.02 m",
            "~speed_scale/links/box_link/free_distance is 4 m: it must not be more than ~max_distance",
        ],
    ),
    ({"speed_scale": 0.5}, ["~speed_scale is 0.5: a dictionary is needed"]),
    (
        {
            "memory": {
                "enabled": "yes",
                "decay": -1,
                "resolution": 0,
                "max_nodes": 1e12,
                "file": "memory.bt",
            },
            "unknown_space": "wall",
        },
        [
            "~memory/enabled",
            "~memory/decay is -1 s: allowed is more than 0 s, inf included",
            "~memory/resolution is 0 m: allowed is from 0.001 to 1 m",
            "~memory/max_nodes",
            '~memory/file is "memory.bt": an absolute path is needed',
            '~unknown_space is "wall": allowed is free, obstacle, report',
        ],
    ),
    (
        {
            "unknown_space": "report",
            "sources": {
                "scan": {"type": "sensor_msgs/LaserScan", "memory": {"enabled": True}},
                "one": {"memory": {"enabled": True, "file": "/tmp/a.bt", "resolution": 0.01}},
                "two": {"memory": {"enabled": True, "file": "/tmp/a.bt"}, "self_filter": False},
                "flat": {"memory": True},
            },
        },
        [
            "~sources/scan/memory/enabled is set: it is not for a source of type sensor_msgs/LaserScan",
            "each memory needs a file of its own",
            "need the same resolution",
            "'two' has self_filter: false",
            "~sources/flat/memory is true: a dictionary is needed",
        ],
    ),
    ({"unknown_space": "obstacle"}, ["~unknown_space is obstacle", "set ~memory/enabled"]),
    (
        {
            "zones": {
                "huge": {"frame_id": "base", "shape": "sphere", "radius": 100.0},
                "flat": {"frame_id": "base", "shape": "box", "size": [1.0, -1.0, 1.0]},
            }
        },
        ["zone 'huge' cannot be used: it measures 200 m", "~zones/flat/size"],
    ),
    (
        {"zones": {"nowhere": {"shape": "sphere", "radius": 0.1}}},
        ["zone 'nowhere' cannot be used: its frame"],
    ),
    ({"robot_description": pt.urdf()}, ["~robot_description holds a URDF: it must be the name"]),
    ({"robot_description": "the robot"}, ["the robot", "is not valid"]),
    ({"sources": {"a camera": {"timeout": 1.0}}}, ["a camera", "is not valid"]),
]


class BareNode(pt.ProximityNode):
    """The node without any add-on."""

    command = [pt.find_program("ist_proximity", "test_bare_node")]


class ParametersTest(unittest.TestCase):
    def test_wrong(self):
        for i, (parameters, words) in enumerate(WRONG):
            with self.subTest(i):
                node = pt.ProximityNode("/wrong_%d" % i, parameters, pt.urdf(), listen=False)
                code = node.process.wait(pt.TIMEOUT)
                log = node.log()
                node.stop()
                self.assertGreater(code, 0, log)
                for word in words:
                    self.assertIn(word, log)

    def test_without_add_ons(self):
        """A node without add-ons measures, and says what to build where one of them is asked for."""
        world = pt.World("/bare").stand()
        self.addCleanup(world.stop)
        world.points = np.array([[0.0, 0.0, 1.0]])
        world.start_tf()
        node = BareNode(world.namespace, {}, pt.urdf())
        world.start_clouds()
        node.wait_for_status(pt.ProximityArray.OK)
        self.assertEqual(node.stop(), 0)
        node = BareNode(
            "/asked",
            {
                "self_collision/enabled": True,
                "unknown_space": "report",
                "memory/enabled": True,
                "trajectory/cancel_topic": "goal/cancel",
                "joint_deceleration": 1.0,
            },
            pt.urdf(),
            listen=False,
        )
        self.assertGreater(node.process.wait(pt.TIMEOUT), 0)
        log = node.log()
        node.stop()
        for parameter, add_on in (
            ("self_collision/enabled", "link_pairs"),
            ("unknown_space", "unknown_space"),
            ("trajectory/cancel_topic", "trajectory"),
        ):
            self.assertIn("~%s needs the add-on %s, which this node" % (parameter, add_on), log)
            self.assertIn('IST_PROXIMITY_ADD_ONS="%s"' % add_on, log)

    def test_unknown(self):
        """A misspelt name is reported with the nearest one, and the node runs."""
        parameters = {
            "max_distence": 0.5,
            "query/tolerence": 0.1,
            "sources": {"cloud": {"tiemout": 1.0}},
            "packing/max_spheres": 20000.0,
            "max_distance": 2,
        }
        node = pt.ProximityNode("/unknown", parameters, pt.urdf())
        node.wait_for(lambda m: m.links, "the model")
        log = node.log()
        self.assertIn("~max_distence has no effect; did you mean ~max_distance?", log)
        self.assertIn("did you mean ~query/tolerance?", log)
        self.assertIn("did you mean ~sources/cloud/timeout?", log)
        self.assertEqual(log.count("no effect"), 3, log)
        self.assertEqual(node.stop(), 0)

    def check_valid(self, namespace, parameters):
        node = pt.ProximityNode(namespace, parameters, pt.urdf())
        message = node.wait_for(lambda m: m.links, "the model")
        self.assertNotIn("unknown parameter", node.log())
        self.assertEqual(node.stop(), 0)
        return message

    def test_config_files(self):
        """The package's files are valid and hold no unknown names."""
        folder = os.path.join(os.path.dirname(__file__), "..", "..", "config")
        for name in ("proximity.yaml", "demo.yaml", "camera_and_laser.yaml"):
            with self.subTest(name):
                parameters = rosparam.load_file(os.path.join(folder, name))[0][0]
                self.check_valid("/file_" + name.split(".")[0], parameters)

    def test_example_of_sources(self):
        """The example of sources in config/proximity.yaml is valid."""
        package = os.path.join(os.path.dirname(__file__), "..", "..")
        with open(os.path.join(package, "config", "proximity.yaml")) as f:
            text = f.read()
        commented = text[text.index("# sources:") :].splitlines()
        parameters = yaml.safe_load("\n".join(line[2:] for line in commented))
        message = self.check_valid("/example", parameters)
        self.assertEqual({s.name for s in message.sources}, set(parameters["sources"]))


if __name__ == "__main__":
    pt.run("parameters_test", ParametersTest)
