#!/usr/bin/env python3
"""dynamic_reconfigure: live parameters change at once and stay within their ranges."""

import os

import proximity_testing as pt
import rospy
import yaml
from dynamic_reconfigure.client import Client
from dynamic_reconfigure.msg import BoolParameter, Config, DoubleParameter, IntParameter, StrParameter
from proximity_testing import ProximityArray
from std_msgs.msg import Float64


class ReconfigureTest(pt.NodeTest):
    BOX, MAX_DISTANCE = pt.transform((0, 5, 0)), 0.6
    POINTS = [[0.3, 0.0, 0.0]]  # 0.2 m from the ball

    def setUp(self):
        super().setUp()
        self.world.start_tf()
        self.world.start_clouds()
        self.start(max_distance=0.6, **{"query/margin": 0.02})
        self.node.wait_for_status(ProximityArray.OK)

    def client(self, group):
        client = Client(self.node.name + "/" + group, timeout=30)
        pt.wait_until(client.get_configuration, "~%s/parameter_updates" % group)
        return client

    def ball(self, words, check):
        return self.node.wait_for(lambda m: check(pt.link(m, "ball_link")), words)

    def test_groups(self):
        query, repulsion = self.client("query"), self.client("repulsion")
        # The values are those set at the start, and the defaults.
        self.assertAlmostEqual(query.get_configuration()["margin"], 0.02)
        self.assertAlmostEqual(query.get_configuration()["tolerance"], 0.001)
        described = {d["name"]: d for d in query.get_parameter_descriptions(timeout=30)}
        self.assertEqual(described["tolerance"]["min"], 0.0)
        self.assertAlmostEqual(described["margin"]["default"], 0.0)

        answer = query.update_configuration({"margin": 0.05, "tolerance": 0.0})
        self.assertAlmostEqual(answer["margin"], 0.05)
        self.ball("the margin", lambda ball: abs(ball.lower_bound - 0.15) < 1e-4)
        self.assertAlmostEqual(rospy.get_param(self.node.name + "/query/margin"), 0.05)
        answer = repulsion.update_configuration({"gain": 0.0})
        self.ball("no gain", lambda ball: not pt.vector(ball.repulsion).any())

        # A change by another program is shown and not overwritten.
        rospy.set_param(self.node.name + "/query/margin", 0.1)
        pt.wait_until(lambda: query.get_configuration()["margin"] == 0.1, "the update")
        query.update_configuration({"deadline": 0.5})
        self.assertAlmostEqual(rospy.get_param(self.node.name + "/query/margin"), 0.1)
        self.ball("the other margin", lambda ball: abs(ball.lower_bound - 0.1) < 1e-4)

    def test_sliders(self):
        """Ends of sliders are what robots need: influence_distance went to 1000 m, gain to 10^6."""
        ends = {
            "query": {"tolerance": 0.05, "deadline": 0.05, "margin": 0.2},
            "repulsion": {
                "influence_distance": 0.6,  # ~max_distance
                "gain": 5.0,
                "smoothing": 0.5,
            },
            "speed_scale": {
                "stop_distance": 0.6,
                "free_distance": 0.6,
                "hysteresis": 0.1,
            },
            "speed_scale/separation": {
                "enabled": True,
                "obstacle_speed": 5.0,
                "robot_speed": 5.0,
                "reaction_time": 2.0,
                "stopping_time": 2.0,
            },
        }
        least = {"deadline": -1.0, "robot_speed": 0.001, "enabled": False}
        folder = os.path.join(os.path.dirname(__file__), "..", "..", "config")
        with open(os.path.join(folder, "proximity.yaml")) as f:
            explained = yaml.safe_load(f)
        for group, expected in ends.items():
            client = self.client(group)
            defaults = explained
            for part in group.split("/"):
                defaults = defaults[part]
            described = client.get_parameter_descriptions(timeout=30)
            self.assertEqual({d["name"]: d["max"] for d in described}, expected)
            for one in described:
                self.assertEqual(one["min"], least.get(one["name"], 0.0))
                name = "~%s/%s" % (group, one["name"])
                self.assertRegex(one["description"], "^" + name + r"( \[.*\])?: [A-Z].{20,}\.$")
                self.assertLessEqual(one["default"], one["max"])
                self.assertEqual(one["default"], defaults[one["name"]], name)
            if group == "query":  # the parameter's own range is wider
                answer = client.update_configuration({"margin": 0.3})
                self.assertAlmostEqual(answer["margin"], 0.3)

    def test_read_at_the_start_only(self):
        """A change that has no effect is named, with the value in use, once in the log."""
        words = "~max_distance is 2, in use is 0.6"
        rospy.set_param(self.node.name + "/max_distance", 2.0)
        self.node.wait_until(lambda: words in self.node.log(), words)
        self.node.wait_for_diagnostic("query", words)
        self.assertIn("the node has to be restarted", self.node.log())
        rospy.set_param(self.node.name + "/query/margin", 0.03)  # has effect
        rospy.set_param(self.node.name + "/rate", 10.0)
        self.node.wait_until(lambda: "~rate has been set to 10" in self.node.log(), "the rate")
        self.assertNotIn("~query/margin", self.node.diagnostics["query"].message)
        rospy.delete_param(self.node.name + "/rate")
        rospy.set_param(self.node.name + "/max_distance", 0.6)
        self.node.wait_until(
            lambda: "restarted" not in self.node.diagnostics["query"].message, "no complaint"
        )
        self.assertLessEqual(self.node.log().count(words), 2)

    def test_refusals(self):
        """A request takes effect entirely or not at all, and the response holds the values in use."""
        query = self.client("query")
        service = query._set_service  # the client itself would leave these out
        for name, value in (
            ("tolerance", -1.0),
            ("tolerance", float("nan")),
        ):
            wrong = [DoubleParameter("margin", 0.07), DoubleParameter(name, value)]
            answer = service(Config(doubles=wrong)).config
            values = {one.name: one.value for one in answer.doubles}
            self.assertAlmostEqual(values["margin"], 0.02)
            self.assertAlmostEqual(values["tolerance"], 0.001)
            self.assertNotAlmostEqual(
                rospy.get_param(self.node.name + "/query").get("margin"), 0.07
            )
        # Each has its reason in the log, also where they come one after the other.
        for words in ("~query/tolerance is -1 m", "~query/tolerance is nan m"):
            self.node.wait_until(lambda words=words: words in self.node.log(), words)
        self.ball("as before", lambda ball: abs(ball.distance - ball.lower_bound - 0.02) < 0.0011)

    def test_speed_scale(self):
        """Distances change at once; values that do not go together change nothing."""
        scales = self.node.collect("speed_scale", Float64, lambda m: m.data)
        # The bound is 0.2 m less the margin and the tolerance, between 0.1 and 0.3 m.
        self.node.wait_until(lambda: scales and abs(scales[-1] - 0.4) < 0.01, "a scale of 0.4")
        group = self.client("speed_scale")
        group.update_configuration({"stop_distance": 0.0, "free_distance": 0.18})
        self.node.wait_until(lambda: scales[-1] > 0.98, "full speed")
        name = self.node.name + "/speed_scale"
        self.assertAlmostEqual(rospy.get_param(name + "/free_distance"), 0.18)
        service = group._set_service
        answer = service(Config(doubles=[DoubleParameter("stop_distance", 0.4)])).config
        self.assertAlmostEqual({d.name: d.value for d in answer.doubles}["stop_distance"], 0.0)
        rospy.set_param(name + "/stop_distance", 0.4)  # more than free_distance
        self.node.wait_until(
            lambda: "must be less than ~speed_scale/free_distance, 0.18 m" in self.node.log(), "why"
        )
        self.assertGreater(scales[-1], 0.98)
        rospy.set_param(name + "/free_distance", 0.26)
        rospy.set_param(name + "/stop_distance", 0.1)
        self.node.wait_until(lambda: abs(scales[-1] - 0.5) < 0.01, "the new distances")
        separation = self.client("speed_scale/separation")
        separation.update_configuration({"enabled": True, "stopping_time": 0.1})
        self.node.wait_until(lambda: scales[-1] == 0.0, "a walking person 0.18 m away")
        rospy.set_param(name + "/links", {"ball_link": {"stop_distance": 0.01}})
        words = "has to be restarted: ~speed_scale/links/ball_link/stop_distance has been set to 0.01"
        self.node.wait_until(lambda: words in self.node.log(), words)

    def margin_stays(self, words, margin):
        """The ball's lower bound stays that of the margin for two readings of the server."""
        begin = len(self.node.messages)
        self.node.wait_until(
            lambda: words in self.node.diagnostic("query", "live parameters")
            and words in self.node.log(),
            words,
        )
        self.ball("a second more", lambda ball: len(self.node.messages) > begin + 100)
        for message in self.node.messages[begin:]:
            if message.status == ProximityArray.OK:
                self.assertLess(pt.link(message, "ball_link").lower_bound, 0.2 - margin + 1e-6)

    def test_lost_values(self):
        """What was configured stays until something valid replaces it, and the loss is told."""
        name = self.node.name + "/query"
        # Nothing that has never been there is missed.
        self.node.wait_for_value("query", "live parameters", "^as on the server$")
        rospy.delete_param(name + "/margin")
        self.margin_stays("no longer on the parameter server: ~query/margin (0.02 m)", 0.02)
        rospy.set_param(name, "x")  # in place of all names below
        self.margin_stays('~query is "x": a dictionary is needed', 0.02)
        rospy.set_param(name, {"margin": -1.0, "tolerance": 0.002})
        self.margin_stays("~query/margin is -1 m: allowed is from 0", 0.02)
        rospy.set_param(self.node.name, 3)
        self.margin_stays("no longer on the parameter server: ~query/tolerance (0.002 m)", 0.02)
        rospy.delete_param(self.node.name)
        self.margin_stays("~query/margin (0.02 m)", 0.02)
        # A wrong value elsewhere does not keep a larger margin away.
        rospy.set_param(self.node.name + "/repulsion/gain", "strong")
        rospy.set_param(name + "/margin", 0.05)
        self.ball("the new margin", lambda ball: ball.lower_bound < 0.15 + 1e-6)
        self.margin_stays('~repulsion/gain is "strong"', 0.05)

    def test_unknown_names(self):
        """A request that names anything but the group's parameters fails and writes nothing."""
        query = self.client("query")
        before = rospy.get_param(self.node.name)
        wrong = [
            Config(doubles=[DoubleParameter("margin", 0.07), DoubleParameter(name, 0.0)])
            for name in ("", "margins", "margin/x", "/margin", "../rate", "repulsion/gain")
        ]
        wrong += [
            Config(strs=[StrParameter("", "x")]),
            Config(ints=[IntParameter("arbitrary", 1)]),
            Config(bools=[BoolParameter("", True)]),
        ]
        for request in wrong:
            with self.assertRaises(rospy.ServiceException):
                query._set_service(request)
            self.assertEqual(rospy.get_param(self.node.name), before)
        self.ball("as before", lambda ball: abs(ball.distance - ball.lower_bound - 0.02) < 0.0011)


if __name__ == "__main__":
    pt.run("reconfigure_test", ReconfigureTest)
