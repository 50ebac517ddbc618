#!/usr/bin/env python3
"""The nodelet: loads, measures, refuses wrong parameters without harm to its manager, unloads."""

import unittest

import numpy as np
import proximity_testing as pt
import rosgraph
from proximity_testing import ProximityArray

FAR_BOX = pt.transform((0, 0.8, 0))


class ProximityNodelet(pt.ProximityNode):
    def __init__(self, *args, **kwargs):
        self.command = [
            pt.find_program("nodelet", "nodelet"),
            "load",
            "ist_proximity/Proximity",
            "/manager",
        ]
        super().__init__(*args, **kwargs)


def publishers(topic):
    """Nodes that publish a topic; the manager's name for a nodelet."""
    return dict(rosgraph.Master("/nodelet_test").getSystemState()[0]).get(topic, [])


class NodeletTest(unittest.TestCase):
    def test_nodelet(self):
        world = pt.World("/in_manager").stand(box=FAR_BOX)
        world.points = np.array([[0.0, 0.0, 0.3]])
        world.start_tf()
        world.start_clouds()
        nodelet = ProximityNodelet("/in_manager", {"links": ["ball_link"]}, pt.urdf())
        message = nodelet.wait_for_status(ProximityArray.OK)
        pt.check_invariants(self, message)
        self.assertEqual(message.header.frame_id, "base")
        self.assertEqual([one.link for one in message.links], ["ball_link"])
        self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.2, 5)
        self.assertTrue(nodelet.reload().success)
        nodelet.wait_for_status(ProximityArray.OK)
        nodelet.wait_until(lambda: len(nodelet.diagnostics) >= 4, "diagnostics")

        # A second nodelet with wrong parameters is refused and does no harm.
        wrong = ProximityNodelet("/wrong", {"rate": "fast"}, pt.urdf(), listen=False)
        self.assertNotEqual(wrong.process.wait(pt.TIMEOUT), 0)
        wrong.stop()
        self.assertEqual(publishers("/wrong/proximity/proximity"), [])
        self.assertEqual(publishers("/in_manager/proximity/proximity"), ["/manager"])
        nodelet.wait_for_status(ProximityArray.OK)

        nodelet.stop()  # the loader unloads it
        pt.wait_until(
            lambda: not publishers("/in_manager/proximity/proximity"), "the nodelet to be unloaded"
        )
        # The manager has survived that too.
        again = ProximityNodelet("/in_manager", {}, pt.urdf())
        again.wait_for_status(ProximityArray.OK)
        again.stop()
        world.stop()


if __name__ == "__main__":
    pt.run("nodelet_test", NodeletTest)
