#!/usr/bin/env python3
"""Bad clouds, meshes and URDFs: no crash, no made-up value, and the node recovers."""

import contextlib
import os
import shutil
import sys
import tempfile
import time
import unittest

import numpy as np
import proximity_testing as pt
import rospy
from proximity_testing import LinkProximity, ProximityArray
from sensor_msgs.msg import PointField
from std_msgs.msg import Float64

FAR_BOX = pt.transform((0, 0.8, 0))
POINT = [[0.0, 0.0, 0.3]]  # 0.2 m from the ball at the origin


def changed(points=POINT, **members):
    """Makes clouds with these members, or what functions of the message give for them."""

    def make():
        message = pt.cloud(points)
        for name, value in members.items():
            setattr(message, name, value(message) if callable(value) else value)
        return message

    return make


def with_field(index, **members):
    """The fields of a message, of which one has other members."""

    def fields(message):
        for name, value in members.items():
            setattr(message.fields[index], name, value)
        return message.fields

    return fields


NOTHING = np.zeros((0, 3))
COLOURS = [PointField("rgb", 0, PointField.FLOAT32, 1)]
without_z = changed(fields=lambda m: m.fields[:2])
# What makes a malformed cloud, and words of the text that says what is wrong.
UNUSABLE = [
    (without_z, "z"),
    (changed(fields=with_field(0, datatype=5)), "x"),  # int32
    (changed(data=lambda m: m.data[:8]), "data"),
    (changed(row_step=4), "row_step"),
    (changed(fields=with_field(2, offset=1000)), "z"),
    (changed(width=0xFFFFFFFF, height=0xFFFFFFFF), "malformed"),
    # A cloud that says to be empty was taken for free space: OK and CLEAR.
    (changed(width=0, row_step=0), "no point, but data holds"),
    (changed(height=0), "no point, but data holds"),
    (changed(NOTHING, fields=[]), "field 'x' is missing"),
    (changed(NOTHING, fields=COLOURS), "field 'x' is missing"),
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

    @contextlib.contextmanager
    def stream(self, make, rate=20):
        repeater = self.world.repeat(rate, lambda: self.world.cloud_publisher.publish(make()))
        try:
            yield
        finally:
            repeater.stop()

    def check_recovery(self):
        with self.stream(lambda: pt.cloud(POINT)):
            message = self.node.wait_for(
                lambda m: m.status == 0 and pt.link(m, "ball_link").state == LinkProximity.NEAR,
                "recovery",
            )
        self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.2, 5)

    def test_unusable(self):
        for make, word in UNUSABLE:
            with self.subTest(word):
                with self.stream(make):
                    message = self.node.wait_for(
                        lambda m: m.status != 0 and word in m.status_text and pt.all_unknown(m),
                        word,
                    )
                self.assertIn(
                    message.status, (ProximityArray.NO_CLOUD, ProximityArray.STALE_CLOUD)
                )
                self.assertIn("'cloud'", message.status_text)
                self.check_recovery()

    def test_unusable_beside_good_ones(self):
        """Every other cloud is malformed: the good ones are used."""
        with self.stream(lambda: pt.cloud(POINT)), self.stream(without_z):
            self.node.wait_for_status(ProximityArray.OK)
            begin = len(self.node.messages)
            self.node.wait_for(lambda m: len(self.node.messages) > begin + 100, "100 messages")
            wrong = [m for m in self.node.messages[begin:] if m.status != ProximityArray.OK]
            self.assertLess(len(wrong), 10, wrong[-1].status_text if wrong else "")

    def test_all_nan(self):
        """A sensor that sees nothing at all makes links UNKNOWN, even right after a good cloud."""
        self.check_recovery()
        with self.stream(lambda: pt.cloud(np.full((5, 3), np.nan))):
            message = self.node.wait_for_status(ProximityArray.NO_CLOUD, "NaN")
        self.assertTrue(pt.all_unknown(message))
        self.assertEqual(message.sources[0].status, ProximityArray.NO_CLOUD)
        self.assertEqual(message.sources[0].points_received, 5)
        self.check_recovery()

    def test_nothing_in_range(self):
        """A cloud without points in range makes links CLEAR, with +inf."""
        nothing = {
            "empty": np.zeros((0, 3)),
            "too far": np.array([[0.0, 0.0, 30.0], [np.nan, 0, 0]]),
        }
        for name, points in nothing.items():
            with self.subTest(name):
                stamps = []

                def send(points=points, stamps=stamps):
                    message = pt.cloud(points)
                    stamps.append(message.header.stamp)
                    return message

                with self.stream(send):
                    message = self.node.wait_for(lambda m: m.cloud_stamp in stamps, name)
                self.assertEqual(message.status, ProximityArray.OK)
                self.assertEqual(pt.states(message), [LinkProximity.CLEAR] * 2)
                self.assertEqual(message.sources[0].points_used, 0)
                self.check_recovery()

    def test_some_bad_points(self):
        """NaN, infinite and enormous points among good ones change nothing."""
        points = np.array(POINT + [[np.nan, 0, 0], [np.inf, 0, 0], [1e30, 0, 0], [0, -np.inf, 1]])
        with self.stream(lambda: pt.cloud(points)):
            message = self.node.wait_for(
                lambda m: m.status == 0 and m.sources[0].points_received == 5, "five points"
            )
        self.assertEqual(message.sources[0].points_used, 1)
        self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.2, 5)


class BadModelTest(pt.NodeTest):
    POINTS = POINT

    def setUp(self):
        super().setUp()
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        self.world.start_tf()
        self.world.start_clouds()

    def check_one_bad_link(self, geometry, words):
        """box_link has no usable geometry; ball_link is measured all the same."""
        node = self.start(pt.urdf(box=geometry))
        message = node.wait_for(
            lambda m: m.links and pt.link(m, "ball_link").state == LinkProximity.NEAR, "the ball"
        )
        self.assertEqual(message.status, ProximityArray.MODEL_ERROR)
        for word in ["box_link"] + words:
            self.assertIn(word, message.status_text)
        self.assertEqual(pt.link(message, "box_link").state, LinkProximity.UNKNOWN)
        self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.2, 5)
        node.wait_until(
            lambda: "model" in node.diagnostics and node.diagnostics["model"].level == 2,
            "model diagnostics ERROR",
        )

    def test_bad_geometry(self):
        """Each link of geometry that cannot be used says why; the others are measured."""

        def path(name):
            return os.path.join(self.folder, name)

        def mesh(name, more=""):
            return '<mesh filename="file://%s"%s/>' % (path(name), more)

        open(path("empty.stl"), "w").close()
        with open(path("triangle.stl"), "w") as f:
            f.write(
                "solid t\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                "vertex 0 1 0\nendloop\nendfacet\nendsolid t\n"
            )
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

    def test_large_mesh_is_told_and_does_not_hold_up_the_end(self):
        """While a mesh is read or packed, the status names it and its link; SIGINT ends the node."""
        path = os.path.join(self.folder, "large.stl")
        count = 1000000
        facets = np.zeros(count, [("numbers", "<f4", 12), ("spare", "<u2")])
        facets["numbers"][:, 3:] = np.random.default_rng(1).uniform(-0.5, 0.5, (count, 9))
        with open(path, "wb") as f:
            f.write(b" " * 80 + np.uint32(count).tobytes() + facets.tobytes())
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
        begin = time.time()
        self.assertEqual(node.stop(), 0)
        self.assertLess(time.time() - begin, 3.0)

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
            begin = time.time()
            self.assertEqual(node.stop(), 0)
            self.assertLess(time.time() - begin, 3.0)

    def test_mesh_that_appears(self):
        """A mesh is missing at first; ~reload_model reads it once it is there."""
        path = os.path.join(self.folder, "late.stl")
        self.check_one_bad_link('<mesh filename="file://%s"/>' % path, ["late.stl"])
        corners = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (-0.3, 0.3)]
        faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        with open(path, "w") as f:
            f.write("solid box\n")
            for a, b, c, d in faces:
                for triangle in ((a, b, c), (a, c, d)):
                    f.write("facet normal 0 0 0\nouter loop\n")
                    for i in triangle:
                        f.write("vertex %g %g %g\n" % corners[i])
                    f.write("endloop\nendfacet\n")
            f.write("endsolid box\n")
        self.assertTrue(self.node.reload().success)
        message = self.node.wait_for_status(ProximityArray.OK)
        truth = pt.distance_to_box(np.array(POINT) - [0, 0.8, 0])[0]
        self.assertAlmostEqual(pt.link(message, "box_link").distance, truth, delta=0.0011)

    def test_link_without_geometry(self):
        node = self.start(pt.urdf(), links=["base", "ball_link", "nobody"])
        message = node.wait_for(
            lambda m: m.links and pt.link(m, "ball_link").state == LinkProximity.NEAR, "the ball"
        )
        self.assertEqual(message.status, ProximityArray.MODEL_ERROR)
        self.assertEqual({one.link for one in message.links}, {"base", "ball_link", "nobody"})
        for name in ("base", "nobody"):
            self.assertIn(name, message.status_text)
            self.assertEqual(pt.link(message, name).state, LinkProximity.UNKNOWN)

    def test_unparsable_then_fixed(self):
        node = self.start("<robot name='broken'><link name='a'>")
        message = node.wait_for_status(ProximityArray.MODEL_ERROR, "URDF")
        self.assertFalse(message.links)
        # A changed parameter is read without a request.
        rospy.set_param(self.namespace + "/robot_description", pt.urdf())
        node.wait_for_status(ProximityArray.OK)

        # After a change from good to bad the old model no longer answers.
        for bad in ("", "no XML", "<robot name='r'/>", 42):
            rospy.set_param(self.namespace + "/robot_description", bad)
            self.assertTrue(node.reload().message)
            message = node.wait_for_status(ProximityArray.MODEL_ERROR, "robot_description")
            self.assertTrue(pt.all_unknown(message))
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

    def test_late_description(self):
        node = self.start(None)
        message = node.wait_for(lambda m: True, "the first message", start=0)
        self.assertEqual(message.status, ProximityArray.MODEL_ERROR)
        self.assertFalse(message.links)
        self.assertIn("robot_description", message.status_text)
        rospy.set_param(self.namespace + "/robot_description", pt.urdf())
        message = node.wait_for_status(ProximityArray.OK)
        self.assertEqual(message.header.frame_id, "base")

    def test_robot_without_geometry(self):
        node = self.start('<robot name="ghost"><link name="base"/></robot>')
        message = node.wait_for_status(ProximityArray.MODEL_ERROR, "geometry")
        self.assertFalse(message.links)


if __name__ == "__main__":
    import rostest

    rospy.init_node("bad_input_test")
    suite = sys.argv[1] if len(sys.argv) > 1 else ""
    kinds = {"clouds": BadCloudTest, "models": BadModelTest}
    rostest.rosrun("ist_proximity", "bad_" + suite, kinds[suite], sys.argv)
