#!/usr/bin/env python3
"""Names that other programs rely on: fields, constants, topics, services, and effects of parameters."""

import subprocess

import numpy as np
import proximity_testing as pt
import rosgraph
import rospy
from ist_proximity.msg import LinkProximity, ProximityArray, SourceStatus, SpeedScaleState
from ist_proximity.srv import QueryProximity
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

POINTS = [[0.0, 0.0, 0.3], [0.0, 0.0, 0.1]]  # 0.2 m from the ball, and on it

# Messages may have more fields than these.
FIELDS = {
    LinkProximity: """string link; uint8 state; float64 distance; float64 lower_bound;
        geometry_msgs/Point point_on_link; geometry_msgs/Point point_on_link_local;
        geometry_msgs/Point point_on_obstacle; geometry_msgs/Vector3 direction;
        geometry_msgs/Vector3 repulsion; geometry_msgs/Wrench penetration; float64 closing_speed;
        string source; float64 interval_model; float64 interval_tolerance;
        float64 interval_sensor""",
    ProximityArray: """std_msgs/Header header; uint8 status; string status_text; time cloud_stamp;
        ist_proximity/SourceStatus[] sources; float64 computation_time;
        ist_proximity/LinkProximity[] links""",
    SourceStatus: """string name; uint8 status; time stamp; float64 age; uint32 points_received;
        uint32 points_used; float32 measured_share; uint32 points_on_robot; float64 blind_skin""",
    SpeedScaleState: """std_msgs/Header header; float64 scale; string link; string source;
        float64 bound; uint8 rule; string text; float64 stop_distance; float64 free_distance""",
}
CONSTANTS = {
    LinkProximity: ["UNKNOWN", "CLEAR", "NEAR", "CONTACT"],
    ProximityArray: ["OK", "NO_CLOUD", "STALE_CLOUD", "NO_POSE", "DEGRADED", "MODEL_ERROR", "LOADING"],
    SpeedScaleState: ["UNKNOWN", "STOP", "SLOW", "FREE", "SEPARATION"],
}
# Topics below the node's name: type, and whether it is latched.
TOPICS = {
    "proximity": (ProximityArray, False),
    "self_proximity": (ProximityArray, False),
    "min_distance": (Float64, False),
    "speed_scale": (Float64, False),
    "speed_scale_state": (SpeedScaleState, False),
    "markers": (MarkerArray, False),
    "spheres": (MarkerArray, True),
    "filtered_cloud": (PointCloud2, False),
}
SERVICES = {"query": QueryProximity, "reload_model": Trigger}


class ContractTest(pt.NodeTest):
    POINTS = POINTS

    def start(self, urdf=None, **parameters):
        super().start(urdf, **parameters)
        self.world.start_tf()
        self.world.start_clouds()
        return self.node

    def test_messages(self):
        for kind, text in FIELDS.items():
            fields = dict(zip(kind.__slots__, kind._slot_types))
            for field in text.split(";"):
                type_name, name = field.split()
                self.assertEqual(fields.get(name), type_name, "%s.%s" % (kind._type, name))
        for kind, names in CONSTANTS.items():
            self.assertEqual([getattr(kind, name) for name in names], list(range(len(names))))
        self.assertEqual(QueryProximity._request_class.__slots__[0], "states")

    def test_topics_and_services(self):
        node = self.start(pt.urdf(), **{"self_collision/enabled": True})
        node.wait_for_status(ProximityArray.OK)
        headers = {}
        for topic, (kind, _) in TOPICS.items():
            keep = lambda m, topic=topic: headers.setdefault(topic, m._connection_header)  # noqa: E731
            node.subscribe(topic, kind, keep)
        node.wait_until(lambda: len(headers) == len(TOPICS), "a message on each topic")
        for topic, (kind, latched) in TOPICS.items():
            self.assertEqual(headers[topic]["type"], kind._type, topic)
            self.assertEqual(headers[topic]["latching"], str(int(latched)), topic)
        for service, kind in SERVICES.items():
            self.assertTrue(rospy.ServiceProxy(node.name + "/" + service, kind)().success)
        node.wait_until(
            lambda: {"input cloud", "pose", "query", "model"} <= set(node.diagnostics),
            "all diagnostics",
        )
        subscribed = rosgraph.Master(rospy.get_name()).getSystemState()[1]
        topics = {topic for topic, nodes in subscribed if node.name in nodes}
        for name in ("cloud", "tf", "tf_static"):  # the last two are remapped
            self.assertIn(self.namespace + "/" + name, topics)

    def test_table(self):
        """`rosrun ist_proximity proximity_table` finds the program and shows every link."""
        node = self.start(pt.urdf())
        node.wait_for_status(ProximityArray.OK)
        command = ["rosrun", "ist_proximity", "proximity_table", node.name + "/proximity"]
        command += ["--duration", "5", "--require-ok"]
        table = subprocess.run(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        text = table.stdout.decode(errors="replace")
        self.assertEqual(table.returncode, 0, text)
        for one in node.messages[-1].links:
            self.assertIn(one.link, text)

    def test_name_of_the_description(self):
        """A robot_description of another name, in a namespace above the node's."""
        rospy.set_param("/urdf_of_another_name", pt.urdf())
        node = self.start(robot_description="urdf_of_another_name")
        node.wait_for_status(ProximityArray.OK)

    def test_geometry(self):
        """The visual geometry is used on request, or where there is no other."""
        visual = '<visual><geometry><sphere radius="%g"/></geometry></visual></link>'
        both = pt.urdf().replace("</collision></link>", "</collision>" + visual % 0.15, 1)
        only = '<link name="hat">' + visual % 0.05
        only += """<joint name="to_hat" type="fixed"><parent link="base"/><child link="hat"/>
            <origin xyz="0 0 0.5"/></joint>"""
        urdf = both.replace("</robot>", only + "</robot>")
        self.world.poses["hat"] = ("base", pt.transform((0, 0, 0.5)))
        for geometry, ball in (("collision", 0.2), ("visual", 0.15)):
            with self.subTest(geometry):
                node = self.start(urdf, geometry=geometry, self_filter=False)
                self.world.points = np.array(POINTS[:1])
                message = node.wait_for(
                    lambda m: m.links and all(one.state for one in m.links[::2]), "ball and hat"
                )
                self.assertAlmostEqual(pt.link(message, "ball_link").distance, ball, 5)
                self.assertAlmostEqual(pt.link(message, "hat").distance, 0.15, 5)
                said = "'hat' has no collision geometry" in node.log()
                self.assertEqual(said, geometry == "collision", node.log())
                self.finish(self.nodes.pop())


if __name__ == "__main__":
    pt.run("contract_test", ContractTest)
