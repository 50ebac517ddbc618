#!/usr/bin/env python3
"""Bad clouds, meshes and URDFs: no crash, no made-up value, and the node recovers."""

import os
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

import numpy as np
import proximity_testing as pt
import rospy
from proximity_testing import LinkProximity, ProximityArray
from std_msgs.msg import Float64

FAR_BOX = pt.transform((0, 0.8, 0))
OTHER_DRIVER = """
import proximity_testing as pt, rospy, time
from sensor_msgs.msg import PointCloud2
rospy.init_node("other_driver")
publisher = rospy.Publisher("/bad_clouds/cloud", PointCloud2, queue_size=1)
while True:
    publisher.publish(pt.cloud([[9.0, 9.0, 9.0]]))
    time.sleep(0.05)
"""
POINT = [[0.0, 0.0, 0.3]]  # 0.2 m from the ball at the origin


def changed(**members):
    """Makes clouds with these members, or what functions of the message give for them."""

    def make():
        message = pt.cloud(POINT)
        for name, value in members.items():
            setattr(message, name, value(message) if callable(value) else value)
        return message

    return make


without_z = changed(fields=lambda m: m.fields[:2])
# What makes a cloud unusable, and words of the text that says what is wrong; check_layout() has tests of
# its own.
UNUSABLE = [
    (without_z, "z"),
    (changed(width=0xFFFFFFFF, height=0xFFFFFFFF), "malformed"),
    (
        lambda: pt.cloud(POINT, frame="far_camera"),
        "(1e+16, 0, 0) m, allowed are at most 10000 m",
    ),
    (lambda: pt.cloud(POINT, frame="nowhere"), "nowhere"),
    (lambda: pt.cloud(POINT, frame=""), "frame_id"),
    (lambda: pt.cloud(POINT, frame="f" * 1000000), "frame_id of 1000000 characters"),
]


class BadCloudTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.world = pt.World("/bad_clouds").stand(box=FAR_BOX)
        cls.node = pt.ProximityNode("/bad_clouds", {}, pt.urdf())
        cls.world.poses["far_camera"] = ("base", pt.transform((1e16, 0, 0)))
        cls.world.start_tf()

    @classmethod
    def tearDownClass(cls):
        cls.world.stop()
        assert cls.node.stop() == 0

    def setUp(self):
        self.begin = len(self.node.messages)

    def tearDown(self):
        for message in self.node.messages[self.begin :]:
            pt.check_invariants(self, message)

    def test_two_drivers_on_one_topic(self):
        """Each in the same frame: what one of them sees would hide what the other one does."""
        with self.stream(lambda: pt.cloud(POINT)):
            self.node.wait_for_distance(0.2, "the point")
            folder = os.path.dirname(os.path.realpath(__file__))
            other = subprocess.Popen([sys.executable, "-c", OTHER_DRIVER], cwd=folder)
            try:
                told = self.node.wait_for_status(ProximityArray.STALE_CLOUD, "by turns in the frames")
                self.assertIn("(of /other_driver)", told.status_text)
            finally:
                other.kill()
                other.wait()
            self.node.wait_for_distance(0.2, "the point once more")

    def stream(self, make, rate=20):
        return self.world.repeat(rate, lambda: self.world.cloud_publisher.publish(make()))

    def check_recovery(self):
        with self.stream(lambda: pt.cloud(POINT)):
            message = self.node.wait_for(
                lambda m: m.status == 0 and pt.link(m, "ball_link").state == LinkProximity.NEAR,
                "recovery",
            )
        self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.2, 5)

    def test_unusable(self):
        told = (ProximityArray.NO_CLOUD, ProximityArray.STALE_CLOUD)
        for make, word in UNUSABLE:
            with self.subTest(word):
                with self.stream(make):
                    message = self.node.wait_for(
                        lambda m: m.status in told and word in m.status_text and pt.all_unknown(m), word
                    )
                self.assertIn("'cloud'", message.status_text)
                self.check_recovery()

    def test_unusable_beside_good_ones(self):
        """Every other cloud is malformed: the good ones are used."""
        with self.stream(lambda: pt.cloud(POINT)), self.stream(without_z):
            self.node.wait_for_status(ProximityArray.OK)
            wrong = [m for m in self.node.next_messages(100) if m.status != ProximityArray.OK]
            self.assertLess(len(wrong), 10, wrong[-1].status_text if wrong else "")


def write_stl(path, triangles):
    """A binary file of (n, 3, 3) corners."""
    facets = np.zeros(len(triangles), [("numbers", "<f4", 12), ("spare", "<u2")])
    facets["numbers"][:, 3:] = triangles.reshape(-1, 9)
    with open(path, "wb") as f:
        f.write(b" " * 80 + np.uint32(len(triangles)).tobytes() + facets.tobytes())


class BadModelTest(pt.NodeTest):
    POINTS = POINT

    def setUp(self):
        super().setUp()
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        self.world.start_tf()
        self.world.start_clouds()

    def test_bad_geometry(self):
        """Each link of geometry that cannot be used says why; the others are measured."""

        def path(name):
            return os.path.join(self.folder, name)

        def mesh(name, more=""):
            return '<mesh filename="file://%s"%s/>' % (path(name), more)

        open(path("empty.stl"), "w").close()
        write_stl(path("triangle.stl"), np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]))
        os.mkfifo(path("pipe.stl"))  # opening it waits for a writer
        bad = [
            (mesh("missing.stl"), "missing.stl"),
            ('<mesh filename="package://no_such_package/a.stl"/>', "no_such_package"),
            (mesh("empty.stl"), "empty.stl"),
            (mesh("triangle.stl", ' scale="1 0 1"'), "scale"),
            (mesh("pipe.stl"), "no regular file but a FIFO"),
            ('<box size="1e300 1 1"/>', "m; allowed is more than 0 and at most 10000 m"),
        ]
        link = """<link name="bad%d"><collision><geometry>%s</geometry></collision></link>
            <joint name="to_bad%d" type="fixed"><parent link="base"/><child link="bad%d"/></joint>"""
        extra = "".join(link % (i, geometry, i, i) for i, (geometry, _) in enumerate(bad))
        for i in range(len(bad)):
            self.world.poses["bad%d" % i] = ("base", pt.transform())
        node = self.start(pt.urdf(extra))
        message = node.wait_for(
            lambda m: m.links and pt.link(m, "box_link").state == LinkProximity.NEAR, "the box"
        )
        self.assertEqual(message.status, ProximityArray.MODEL_ERROR)
        self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.2, 5)
        for i, (_, words) in enumerate(bad):
            self.assertRegex(message.status_text, "link 'bad%d'[^;]*%s" % (i, words))
            self.assertEqual(pt.link(message, "bad%d" % i).state, LinkProximity.UNKNOWN)

    def check_soon_ended(self, node):
        begin = time.time()
        self.assertEqual(node.stop(), 0)
        self.assertLess(time.time() - begin, 15.0)  # after which roslaunch sends SIGTERM

    def test_large_mesh_is_told_and_does_not_hold_up_the_end(self):
        """While a mesh is read or packed, the status names it and its link; SIGINT ends the node."""
        path = os.path.join(self.folder, "large.stl")
        write_stl(path, np.random.default_rng(1).uniform(-0.5, 0.5, (1000000, 3, 3)))
        node = self.start(pt.urdf(box='<mesh filename="file://%s"/>' % path))
        words = "reading mesh 'file://%s' of link 'box_link'" % path
        node.wait_for_status(ProximityArray.LOADING, words, start=0)
        node.wait_for_status(ProximityArray.LOADING, "packing link 'box_link'", start=0, timeout=60)
        # A link is answered as soon as it is ready, and no link before that.
        message = node.wait_for(
            lambda m: m.links and pt.link(m, "ball_link").state == LinkProximity.NEAR, "the ball"
        )
        self.assertEqual(message.status, ProximityArray.LOADING)
        self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.2, 5)
        self.assertEqual(pt.link(message, "box_link").state, LinkProximity.UNKNOWN)
        least = rospy.wait_for_message(node.name + "/min_distance", Float64, pt.TIMEOUT)
        self.assertTrue(np.isnan(least.data))
        scale = rospy.wait_for_message(node.name + "/speed_scale", Float64, pt.TIMEOUT)
        self.assertEqual(scale.data, 0.0)
        self.assertEqual(node.messages[-1].status, ProximityArray.LOADING)
        time.sleep(0.5)
        self.check_soon_ended(node)

    def test_large_srdf_does_not_hold_up_the_end(self):
        """400,000 pairs: SIGINT ends the node soon while they are read, and later."""
        pair = '<disable_collisions link1="robot_link_%d" link2="robot_link_%d" reason="Never"/>'
        pairs = [pair % (i, k) for i in range(895) for k in range(i)]
        srdf = '<robot name="tiny">%s</robot>' % "".join(pairs)
        rospy.set_param(self.namespace + "/robot_description_semantic", srdf)
        for condition, what in (
            (lambda m: "reading the SRDF in" in m.status_text, "the reading of the SRDF"),
            (lambda m: m.status != ProximityArray.LOADING and m.links, "the end of loading"),
        ):
            node = self.start(pt.urdf())
            node.wait_for(condition, what, start=0, timeout=60)
            self.check_soon_ended(node)

    def test_mesh_that_appears(self):
        """A mesh is missing at first; ~reload_model reads it once it is there."""
        path = os.path.join(self.folder, "late.stl")
        node = self.start(pt.urdf(box='<mesh filename="file://%s"/>' % path))
        node.wait_for_status(ProximityArray.MODEL_ERROR, "late.stl")
        node.wait_for_diagnostic("model", level=2)
        corners = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (-0.3, 0.3)]
        faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        triangles = [[a, k, d] for a, b, c, d in faces for k, d in ((b, c), (c, d))]
        write_stl(path, np.array(corners)[triangles])
        self.assertTrue(node.reload().success)
        message = node.wait_for_status(ProximityArray.OK)
        truth = pt.distance_to_box(np.array(POINT) - [0, 0.8, 0])[0]
        self.assertAlmostEqual(pt.link(message, "box_link").distance, truth, delta=0.0011)

    def test_unparsable_then_fixed(self):
        node = self.start(None)
        message = node.wait_for(lambda m: True, "the first message", start=0)
        self.assertEqual(message.status, ProximityArray.MODEL_ERROR)
        self.assertFalse(message.links)
        self.assertIn("robot_description", message.status_text)
        # A parameter that comes late, or is changed, is read without a request.
        rospy.set_param(self.namespace + "/robot_description", "<robot name='broken'><link name='a'>")
        message = node.wait_for_status(ProximityArray.MODEL_ERROR, "URDF")
        self.assertFalse(message.links)
        rospy.set_param(self.namespace + "/robot_description", pt.urdf())
        node.wait_for_status(ProximityArray.OK)

        # After a change from good to bad the old model no longer answers.
        for bad in ("", "no XML", "<robot name='r'/>", 42):
            rospy.set_param(self.namespace + "/robot_description", bad)
            self.assertTrue(node.reload().message)
            node.wait_for_unknown(ProximityArray.MODEL_ERROR, "robot_description")
        rospy.delete_param(self.namespace + "/robot_description")
        self.assertFalse(node.reload().success)
        node.wait_for_status(ProximityArray.MODEL_ERROR, "waiting for the parameter")

        # The model comes back, with another link.
        more = """<link name="hat"><collision><geometry><box size="0.1 0.1 0.1"/></geometry>
            </collision></link><joint name="to_hat" type="fixed"><parent link="base"/>
            <child link="hat"/></joint>"""
        self.world.poses["hat"] = ("base", pt.transform((0, 0, 0.45)))
        rospy.set_param(self.namespace + "/robot_description", pt.urdf(more))
        self.assertTrue(node.reload().success)
        message = node.wait_for_status(ProximityArray.OK)
        self.assertEqual([one.link for one in message.links], ["ball_link", "box_link", "hat"])
        self.assertAlmostEqual(pt.link(message, "hat").distance, 0.1, 4)

    def test_robot_without_geometry(self):
        node = self.start('<robot name="ghost"><link name="base"/></robot>')
        message = node.wait_for_status(ProximityArray.MODEL_ERROR, "geometry")
        self.assertFalse(message.links)


if __name__ == "__main__":
    pt.run("bad_input_test", {"clouds": BadCloudTest, "models": BadModelTest})
