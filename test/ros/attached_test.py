#!/usr/bin/env python3
"""Attached objects: in their link's distances and out of the cloud, until they are detached."""

import contextlib
import os
import tempfile
import threading
import time

import numpy as np
import proximity_testing as pt
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion
from proximity_testing import ProximityArray

from ist_proximity.srv import AttachObject, AttachObjectRequest, DetachObject

TOOL = (0.5, 0.0, 0.0)  # its middle on the ball's link
TOOL_RADIUS = 0.05


class AttachedTest(pt.NodeTest):
    BOX = pt.transform((0, 1.5, 0))

    def start(self, **parameters):
        # Points on the tool, as the camera sees it, and an obstacle beside it.
        shell = np.random.default_rng(1).normal(size=(200, 3))
        shell *= TOOL_RADIUS / np.linalg.norm(shell, axis=1)[:, None]
        self.world.points = np.vstack([shell + TOOL, [[0.5, 0.0, 0.2]]])
        self.world.start_tf()
        self.world.start_clouds()
        super().start(**parameters)
        self.attach_object = self.node.service("attach_object", AttachObject)
        self.detach_object = self.node.service("detach_object", DetachObject)
        return self.node

    def attach(self, name="tool", link="ball_link", at=TOOL, **fields):
        fields.setdefault("shape", AttachObjectRequest.SPHERE)
        if fields["shape"] == AttachObjectRequest.SPHERE:
            fields.setdefault("dimensions", [TOOL_RADIUS])
        pose = Pose(Point(*at), fields.pop("orientation", Quaternion(w=1.0)))
        return self.attach_object(name=name, link=link, pose=pose, **fields)

    def attach_well(self, **fields):
        answer = self.attach(**fields)
        self.assertTrue(answer.success, answer.message)

    def detach_well(self, name):
        answer = self.detach_object(name)
        self.assertTrue(answer.success, answer.message)

    def wait_for_ball(self, distance, on_robot):
        def is_so(m):
            return (
                m.status == ProximityArray.OK
                and abs(pt.link(m, "ball_link").distance - distance) < 0.0011
                and m.sources[0].points_on_robot == on_robot
            )

        return self.node.wait_for(is_so, "%.3f m and %d points on the robot" % (distance, on_robot))

    def test_attach_and_detach(self):
        node = self.start()
        without = np.linalg.norm(self.world.points, axis=1).min() - pt.BALL_RADIUS
        self.wait_for_ball(without, 0)
        begin = len(node.messages)
        self.attach_well()
        message = self.wait_for_ball(0.2 - TOOL_RADIUS, 200)
        np.testing.assert_allclose(
            pt.vector(pt.link(message, "ball_link").point_on_link), [0.5, 0, TOOL_RADIUS], atol=1e-5
        )
        # The status is OK all the time, or NO_CLOUD until the next cloud.
        for m in node.messages[begin:]:
            self.assertIn(m.status, (ProximityArray.OK, ProximityArray.NO_CLOUD))
        node.wait_for_value("model", "attached object", "'tool' on 'ball_link'")

        # The tool stays attached when the model is loaded again.
        begin = len(node.messages)
        self.assertTrue(node.reload().success)
        # Loading from the cache may take less than a cycle; then no message tells of it.
        node.wait_for(
            lambda m: m.status == ProximityArray.LOADING or len(node.messages) > begin + 200,
            "the model loaded again",
            start=begin,
        )
        self.wait_for_ball(0.2 - TOOL_RADIUS, 200)
        for m in node.messages[begin:]:
            self.assertEqual([one.link for one in m.links], ["ball_link", "box_link"], m.status_text)
        self.detach_well("tool")
        self.wait_for_ball(without, 0)

        # A link without geometry has the tool's while it carries it.
        self.attach_well(link="base", name="on_base")
        message = node.wait_for(
            lambda m: m.status == 0 and len(m.links) == 3 and m.sources[0].points_on_robot == 200,
            "the base among the links",
        )
        self.assertEqual([one.link for one in message.links], ["base", "ball_link", "box_link"])
        self.assertAlmostEqual(message.links[0].distance, 0.2 - TOOL_RADIUS, delta=0.0011)
        self.detach_well("on_base")
        node.wait_for(lambda m: m.status == 0 and len(m.links) == 2, "the base gone")

    def test_object_whose_link_is_gone(self):
        """An object that another URDF cannot carry is told for as long as that is in use."""
        node = self.start()
        node.wait_for_status(ProximityArray.OK)
        self.attach_well()
        rospy.set_param(self.namespace + "/robot_description", pt.urdf().replace("ball_link", "other_link"))
        self.assertTrue(node.reload().success)
        node.wait_for_value("model", "warning", "no longer attached")

    def test_shapes_and_faults(self):
        node = self.start(links=["box_link"])
        node.wait_for_status(ProximityArray.OK)
        for words, fields in {
            "name is empty": {"name": ""},
            "link 'hand' is not in the URDF": {"link": "hand"},
            "needed are 3": {"shape": AttachObjectRequest.BOX, "dimensions": [0.1]},
            "dimensions holds -1 m": {"dimensions": [-1.0]},
            "shape is 9": {"shape": 9},
            "dimensions holds 1e+300 m; allowed is more than 0 and at most 10000 m": {
                "shape": AttachObjectRequest.BOX,
                "dimensions": [0.1, 0.1, 1e300],
            },
            "dimensions holds 1e+39 m": {"dimensions": [1e39]},
            "pose: it is at (1e+160, 0, 0) m": {"at": (1e160, 0, 0)},
            "has the scale (1 1 1e+06)": {
                "shape": AttachObjectRequest.MESH,
                "mesh": "package://ist_proximity/demo/meshes/shoulder_fork.stl",
                "dimensions": [1, 1, 1e6],
            },
            "leads out of package 'ist_proximity'": {
                "shape": AttachObjectRequest.MESH,
                "mesh": "package://ist_proximity/%2e%2e/../etc/passwd",
            },
            "holds the control character 10": {"name": "a\nb"},
            "its quaternion has length 0": {"orientation": Quaternion()},
            "it holds NaN": {"at": (np.nan, 0, 0)},
            "missing.stl": {"shape": AttachObjectRequest.MESH, "mesh": "/missing.stl"},
            "no_such_package": {
                "shape": AttachObjectRequest.MESH,
                "mesh": "package://no_such_package/a.stl",
            },
        }.items():
            answer = self.attach(**fields)
            self.assertFalse(answer.success)
            self.assertIn(words, answer.message)
        with tempfile.TemporaryDirectory() as folder:  # opening it would wait for a writer for good
            path = os.path.join(folder, "pipe.stl")
            os.mkfifo(path)
            answer = self.attach(shape=AttachObjectRequest.MESH, mesh=path)
        self.assertIn("is no regular file but a FIFO", answer.message)
        answer = self.detach_object("tool")
        self.assertFalse(answer.success)
        self.assertIn("no object 'tool' is attached; there is none", answer.message)
        self.assertEqual(len(node.messages[-1].links), 1)

        # A mesh of millimetres, on a link that was not monitored and is now.
        self.attach_well(
            shape=AttachObjectRequest.MESH,
            mesh="package://ist_proximity/demo/meshes/shoulder_fork.stl",
            dimensions=[0.001] * 3,
        )
        message = node.wait_for(lambda m: m.status == 0 and len(m.links) == 2, "the ball's link")
        self.assertEqual([one.link for one in message.links], ["ball_link", "box_link"])
        answer = self.attach(link="box_link")
        self.assertFalse(answer.success)
        self.assertIn("attached to link 'ball_link' already", answer.message)
        self.attach_well(name="can", shape=AttachObjectRequest.CYLINDER, dimensions=[0.05, 0.1])
        self.assertIn("there is tool, can", self.detach_object("tin").message)
        self.detach_well("can")
        self.detach_well("tool")
        node.wait_for(lambda m: m.status == 0 and len(m.links) == 1, "the ball's link gone")

    def attach_slowly(self):
        """Its packing takes minutes."""
        return self.attach(shape=AttachObjectRequest.CYLINDER, dimensions=[0.5, 1.0])

    def start_to_pack_finely(self):
        # The ball is packed at once, because it is a sphere; a self-filter would need the box, too.
        packing = {"max_error": 0.0001, "max_spheres": 1000000}
        node = self.start(links=["ball_link"], self_filter=False, packing=packing)
        node.wait_for_status(ProximityArray.OK)

    def start_long_attaching(self):
        """Its answer will be in self.answer."""
        self.start_to_pack_finely()
        self.answer = None

        def attach():
            with contextlib.suppress(rospy.ServiceException):  # the node ends meanwhile
                self.answer = self.attach_slowly()

        thread = threading.Thread(target=attach, daemon=True)
        thread.start()
        time.sleep(2.0)
        self.assertTrue(thread.is_alive(), self.answer)
        return thread

    def test_detaching_and_reloading_cancel_attaching(self):
        thread = self.start_long_attaching()
        count = len(self.node.messages)
        time.sleep(0.5)
        self.assertGreater(len(self.node.messages), count + 10, "the cycle goes on")
        begin = time.time()
        self.detach_well("tool")
        thread.join(2.0)
        self.assertLess(time.time() - begin, 2.0)
        self.assertFalse(self.answer.success)
        self.assertIn("was detached while it was being attached", self.answer.message)
        self.attach_well(name="ball")  # the service is free again
        self.detach_well("ball")

    def test_detaching_works_while_the_model_is_loaded(self):
        """It was refused right after ~reload_model: the object came back with the new model."""
        node = self.start()
        without = np.linalg.norm(self.world.points, axis=1).min() - pt.BALL_RADIUS
        for _ in range(5):
            self.wait_for_ball(without, 0)
            self.attach_well()
            self.assertTrue(node.reload().success)
            self.detach_well("tool")
            self.assertIn("there is none at all", self.detach_object("tool").message)
            begin = len(node.messages)
            node.wait_for_status(ProximityArray.OK, start=begin)
        self.wait_for_ball(without, 0)

    def test_time_is_limited(self):
        self.start_to_pack_finely()
        begin = time.time()
        answer = self.attach_slowly()
        self.assertFalse(answer.success)
        self.assertIn("it takes longer than 30 s", answer.message)
        self.assertLess(time.time() - begin, 33.0)

    def test_shutdown_cancels_attaching(self):
        thread = self.start_long_attaching()
        begin = time.time()
        self.assertEqual(self.node.stop(), 0)
        self.assertLess(time.time() - begin, 3.0)
        thread.join(5.0)
        self.assertFalse(thread.is_alive())


if __name__ == "__main__":
    pt.run("attached_test", AttachedTest)
