#!/usr/bin/env python3
"""The launch files: two robots in one graph, two cameras, the nodelet in a camera's manager."""

import os
import re
import subprocess
import unittest
from xml.etree import ElementTree
from xmlrpc.client import ServerProxy

import numpy as np
import proximity_testing as pt
import rosgraph
import roslaunch.config
import roslaunch.xmlloader
import rospy
import yaml
from joint_states_test import ARM, arm_poses
from proximity_testing import ProximityArray
from sensor_msgs.msg import PointCloud2

LAUNCH = os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "..", "launch")


CONFIG = os.path.join(LAUNCH, "..", "config")
ROOT = os.path.realpath(os.path.join(LAUNCH, ".."))


Q = {"turn": 0.5, "slide": 0.2}


def launch_files():
    return sorted(name for name in os.listdir(LAUNCH) if name.endswith(".launch"))


def launch_arguments(name):
    root = ElementTree.parse(os.path.join(LAUNCH, name)).getroot()
    return {a.get("name") for a in root.findall("arg") if "value" not in a.attrib}


def loaded(name, *arguments):
    """What roslaunch would start."""
    required = ["cloud:=cloud"] if name == "camera_manager.launch" else []
    if required and not any(a.startswith("manager:=") and a != "manager:=" for a in arguments):
        arguments = [a for a in arguments if a != "manager:="] + ["manager:=a_manager"]
    config = roslaunch.config.ROSLaunchConfig()
    loader = roslaunch.xmlloader.XmlLoader(resolve_anon=True)
    path = os.path.join(LAUNCH, name)
    loader.load(path, config, argv=[*required, *arguments], verbose=False)
    return config


class Robot:
    """Joint states and clouds of one robot, and what its node answers."""

    def __init__(self, namespace, q, points):
        rospy.set_param(namespace + "/robot_description", ARM)
        self.points, self.answer = points, None
        self.world = pt.World(namespace, None, has_cloud=False)
        self.world.start_joints(q, rate=50)
        self.stop = self.world.stop
        self.clouds = {
            topic: rospy.Publisher(namespace + "/" + topic, PointCloud2, queue_size=5)
            for topic in points
        }
        self.subscriber = rospy.Subscriber(
            namespace + "/proximity/proximity", ProximityArray, self.on_answer
        )
        self.world.repeat(20, self.send_clouds)

    def on_answer(self, message):
        self.answer = message

    def send_clouds(self):
        for topic, points in self.points.items():
            self.clouds[topic].publish(pt.cloud(points, "base"))

    def wait_until_ok(self):
        answers = []

        def is_ok():
            answers.append(self.answer)
            return self.answer and answers[-1].status == ProximityArray.OK

        try:
            pt.wait_until(is_ok, "OK")
        except AssertionError as error:
            raise AssertionError("%s: %s" % (error, answers[-1] and answers[-1].status_text))
        return answers[-1]


def beside_the_ball(q, distance):
    return pt.apply(arm_poses(**q)["ball_link"], [[0.0, 0.0, pt.BALL_RADIUS + distance]])


class LaunchFilesTest(unittest.TestCase):
    def robot(self, *arguments):
        robot = Robot(*arguments)
        self.addCleanup(robot.stop)
        return robot

    def check(self, robot, distance, source):
        one = pt.link(robot.wait_until_ok(), "ball_link")
        self.assertAlmostEqual(one.distance, distance, delta=0.0011)
        self.assertEqual(one.source, source)

    def test_two_robots(self):
        left_q, right_q = Q, {"turn": -1.0, "slide": 0.9}
        left = self.robot("/left", left_q, {"cloud": beside_the_ball(left_q, 0.1)})
        right = self.robot("/right", right_q, {"cloud": beside_the_ball(right_q, 0.2)})
        self.check(left, 0.1, "cloud")
        self.check(right, 0.2, "cloud")
        # One robot's silence is not the other's.
        left.stop()
        pt.wait_until(lambda: left.answer.status == ProximityArray.STALE_CLOUD, "a stale cloud")
        self.assertTrue(pt.all_unknown(left.answer))
        right.answer = None
        self.check(right, 0.2, "cloud")

    def test_two_cameras(self):
        far, near = beside_the_ball(Q, 0.3), beside_the_ball(Q, 0.15)
        robot = self.robot("/cameras", Q, {"first/points": far, "second/points": near})
        self.check(robot, 0.15, "second_camera")
        names = [source.name for source in robot.answer.sources]
        self.assertEqual(names, ["first_camera", "second_camera"])
        robot.points = {"first/points": far, "second/points": far + [0, 0, 0.1]}
        pt.wait_until(
            lambda: pt.link(robot.answer, "ball_link").source == "first_camera", "the other camera"
        )
        robot.points = {"first/points": far}
        pt.wait_until(lambda: robot.answer.status == ProximityArray.STALE_CLOUD, "a stale cloud")
        self.assertIn("second_camera", robot.answer.status_text)

    def test_camera_manager(self):
        robot = self.robot("/managed", Q, {"camera/points": beside_the_ball(Q, 0.1)})
        self.check(robot, 0.1, "cloud")

    def check_not_copied(self, topic):
        """The manager hands the topic's messages to itself, by pointer."""
        (manager,) = {node for name, nodes in rosgraph.Master("/launch_files").getSystemState()[0]
                      if name == topic for node in nodes}
        uri = rosgraph.Master("/launch_files").lookupNode(manager)
        _, _, connections = ServerProxy(uri).getBusInfo("/launch_files")
        self.assertEqual({one[3] for one in connections if one[4] == topic}, {"INTRAPROCESS"})

    def test_filters_of_pcl(self):
        """What a nodelet of pcl_ros drops, here below z = 0.68, is no obstacle; points that it joins are
        one, in their middle."""
        kept, dropped = beside_the_ball(Q, 0.1), beside_the_ball(Q, 0.05)
        self.assertLess(dropped[0, 2], 0.68)
        robot = self.robot("/filtered", Q, {"camera/points": np.vstack([kept, dropped])})
        self.check(robot, 0.1, "cloud")
        self.check_not_copied("/filtered/camera/points_filtered")

        ends = np.vstack([beside_the_ball(Q, 0.06), beside_the_ball(Q, 0.14)])
        self.assertEqual(len(set(map(tuple, np.floor(ends / 0.5)))), 1)  # one voxel
        robot = self.robot("/thinned", Q, {"camera/points": ends})
        self.check(robot, 0.1, "cloud")
        self.check_not_copied("/thinned/camera/points_filtered")

    def test_cell(self):
        """The ball is above the table of config/cell.yaml, the box beyond its back wall; no camera."""
        robot = self.robot("/in_cell", {"turn": 0.0, "slide": 0.2}, {})
        self.check(robot, 0.5 + 0.005 - pt.BALL_RADIUS, "cell")
        # The wall reaches to x = -0.625, the box to -0.8 + 0.05 + 0.1.
        self.assertAlmostEqual(pt.link(robot.answer, "box_link").distance, 0.025, delta=0.0011)

    def test_planning_scenes(self):
        """The bridge is started where it is asked for, and its objects are those of the cell."""
        self.assertNotIn("planning_scene_bridge", [n.type for n in loaded("cell.launch").nodes])
        config = loaded("cell.launch", "planning_scene:=/scenes", "fixed_frame:=world", "name:=near")
        (bridge,) = [n for n in config.nodes if n.type == "planning_scene_bridge"]
        self.assertIn(["planning_scene", "/scenes"], [list(pair) for pair in bridge.remap_args])
        self.assertEqual(config.params["/near_planning_scene_bridge/fixed_frame"].value, "world")
        self.assertEqual(config.params["/near/sources/cell/topic"].value, "world_objects")
        self.assertTrue(pt.find_program("ist_proximity", bridge.type))

    def test_scale_for_servo(self):
        topic = "/servo_server/internal/collision_velocity_scale"
        for manager in ("", "some_manager"):
            arguments = ["speed_scale:=" + topic, "tool:=tool0", "manager:=" + manager]
            arguments.append("proximity_speed_scale:=/near/speed_scale")
            (node,) = loaded("velocity_filter.launch", *arguments).nodes
            remaps = dict(tuple(pair) for pair in node.remap_args)
            self.assertEqual(remaps["~speed_scale"], topic)
            self.assertEqual(remaps["proximity/speed_scale"], "/near/speed_scale")
            self.assertTrue(node.required)
        (node,) = loaded("velocity_filter.launch", "name:=near").nodes
        self.assertEqual(dict(map(tuple, node.remap_args))["~speed_scale"], "near/speed_scale")

    def test_common_arguments(self):
        """roslaunch drops arguments that a file does not know, without a word."""
        common = launch_arguments("proximity.launch") - {"cloud"}
        self.assertGreater(len(common), 12)
        for name in launch_files():
            if name == "velocity_filter.launch":
                continue  # it starts no proximity node
            with self.subTest(name):
                self.assertLessEqual(common, launch_arguments(name))
                given = ["fixed_frame:=world", "pose_source:=joint_states", "max_distance:=0.7"]
                config = loaded(name, *given, "rviz:=true", "name:=near")
                nodes = [n for n in config.params if n.endswith("/near/fixed_frame")]
                self.assertEqual(len(nodes), 2 if name == "two_robots.launch" else 1)
                for node in (n[: -len("fixed_frame")] for n in nodes):
                    self.assertEqual(config.params[node + "fixed_frame"].value, "world")
                    self.assertEqual(config.params[node + "pose_source"].value, "joint_states")
                    self.assertEqual(config.params[node + "max_distance"].value, 0.7)
                shown = [n for n in config.nodes if n.type == "proximity_rviz"]
                self.assertEqual(len(shown), len(nodes))
                for manager in ("", "some_manager"):
                    config = loaded(name, "rviz:=false", "manager:=" + manager)
                    self.assertFalse([n for n in config.nodes if "rviz" in n.type])

    def test_parameters_are_cleared(self):
        """`sources` and `fixed_frame` of another launch file stayed on the master."""
        for name in launch_files():
            for manager in ("", "some_manager"):
                with self.subTest(name + manager):
                    config = loaded(name, "name:=near", "manager:=" + manager)
                    nodes = {n.namespace + n.name for n in config.nodes if n.name == "near"}
                    self.assertTrue(nodes)
                    self.assertLessEqual(nodes, {c.rstrip("/") for c in config.clear_params})

    def test_rviz_needs_no_editing(self):
        """proximity_rviz writes the node's topics, robot and fixed frame into the configuration."""
        program = pt.find_program("ist_proximity", "proximity_rviz")
        rospy.set_param("/shown/robot_description", ARM)

        def configuration(file):
            command = [program, "--print", "--config", os.path.join(CONFIG, file), "near"]
            environment = dict(os.environ, ROS_NAMESPACE="/shown")
            return yaml.safe_load(subprocess.check_output(command, env=environment))

        for file in ("proximity.rviz", "demo.rviz", "dodge.rviz"):
            manager = configuration(file)["Visualization Manager"]
            self.assertEqual(manager["Global Options"]["Fixed Frame"], "base", file)
            displays = manager["Displays"]
            topics = {d.get("Marker Topic", d.get("Topic")) for d in displays}
            self.assertLessEqual({"/shown/near/markers", "/shown/near/spheres"}, topics)
            robots = [d["Robot Description"] for d in displays if d["Class"] == "rviz/RobotModel"]
            self.assertEqual(robots, ["shown/robot_description"])
        self.assertFalse(any("world" in topic for topic in topics if topic))
        rospy.set_param("/shown/near/fixed_frame", "odom")
        rospy.set_param("/shown/near/sources", {"cell": {"type": "world"}, "camera": {"topic": "c"}})
        manager = configuration("proximity.rviz")["Visualization Manager"]
        worlds = [d["Marker Topic"] for d in manager["Displays"] if "Known world" in d["Name"]]
        self.assertEqual(worlds, ["/shown/near/world/cell"])
        topics = {d.get("Marker Topic") for d in manager["Displays"]}
        self.assertIn("/shown/filter/filter_markers", topics)
        self.assertEqual(manager["Global Options"]["Fixed Frame"], "odom")
        for display in manager["Displays"]:  # "<Fixed Frame>" of a display stays
            if "Reference Frame" in display:
                self.assertEqual(display["Reference Frame"], "<Fixed Frame>")

    def test_what_readme_starts(self):
        """A nodelet without a name publishes under another one than the README says."""
        for folder, _, files in os.walk(ROOT):
            if any(part in folder for part in ("/build", "/devel", "/.git")):
                continue
            for file in files:
                if not file.endswith(".md"):
                    continue
                with open(os.path.join(folder, file)) as f:
                    commands = re.findall(r"nodelet load ist_proximity/Proximity[^`\n]*", f.read())
                for command in commands:
                    self.assertIn("__name:=proximity", command, file)

    def test_dependencies(self):
        """What is installed for the core is declared, PCL is for tests and users, diagnostics can be read."""
        with open(os.path.join(ROOT, "scripts", "install_dependencies")) as f:
            groups = dict(re.findall(r"\[(\w+)\]=\"([^\"]*)\"", f.read()))
        package = ElementTree.parse(os.path.join(ROOT, "package.xml")).getroot()
        declared = {depend.text for depend in package.findall("depend")}
        other_names = {"libassimp-dev": "assimp-dev", "libcli11-dev": "cli11"}
        other_names.update({"libeigen3-dev": "eigen", "libtinyxml2-dev": "tinyxml2"})
        libraries = {p for p in groups["core"].split() if p.startswith("lib")}
        self.assertIn("libhwy-dev", libraries)
        self.assertLessEqual({other_names.get(p, p) for p in libraries}, declared)
        self.assertEqual({name for name, packages in groups.items() if "pcl" in packages}, {"test"})
        tags = {d.tag for d in package.iter() if "depend" in d.tag and "pcl" in (d.text or "")}
        self.assertEqual(tags, {"build_export_depend", "test_depend"})
        self.assertIn("python3-diagnostic-msgs", groups["run"])

    def test_documented(self):
        """Every argument of every launch file says what it is for."""
        self.assertGreaterEqual(len(launch_files()), 5)
        for name in launch_files():
            for argument in ElementTree.parse(os.path.join(LAUNCH, name)).getroot().findall("arg"):
                if "value" not in argument.attrib:
                    self.assertGreater(len(argument.get("doc", "")), 5, (name, argument.attrib))


if __name__ == "__main__":
    pt.run("launch_files_test", LaunchFilesTest)
