#!/usr/bin/env python3
"""~speed_scale and ~min_distance: which links count in them, and what they say."""

import time

import numpy as np
import proximity_testing as pt
import rospy
from ist_proximity.msg import SpeedScaleState
from proximity_testing import LinkProximity, ProximityArray
from std_msgs.msg import Float64

# A bench arm: stand and base are bolted to the bench, which is 2.5 cm away for ever; `arm` turns.
BENCH_ARM = """<robot name="bench_arm">
  <link name="base"/>
  <link name="stand"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="arm"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="tool"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="bolts" type="fixed"><parent link="base"/><child link="stand"/></joint>
  <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/></joint>
  <joint name="flange" type="fixed"><parent link="arm"/><child link="tool"/>
    <origin xyz="0.5 0 0"/></joint>
</robot>"""

# A stand and a hand, with two joints between them.
TWO_JOINTS = """<robot name="two_joints">
  <link name="stand"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="arm"><collision><geometry><sphere radius="0.01"/></geometry></collision></link>
  <link name="hand"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="turn" type="continuous"><parent link="stand"/><child link="arm"/></joint>
  <joint name="tilt" type="continuous"><parent link="arm"/><child link="hand"/>
    <origin xyz="0.5 0 0"/></joint>
</robot>"""


class SpeedScaleTest(pt.NodeTest):
    BOX = None

    def start(self, urdf, wait=True, **parameters):
        node = super().start(urdf, **parameters)
        self.smallest = node.collect("min_distance", Float64, lambda m: m.data)
        self.scales = node.collect("speed_scale_state", SpeedScaleState)
        if wait:
            node.wait_for_status(ProximityArray.OK)
            node.wait_until(lambda: self.scales and self.smallest, "the summary")
        return node

    def start_bench(self):
        """The stand is 2.5 cm from the bench, arm and tool are 0.4 m and 0.25 m from a point each."""
        self.world.poses = {
            "stand": ("base", pt.transform()),
            "arm": ("base", pt.transform((0, 0, 1))),
            "tool": ("base", pt.transform((0.5, 0, 1))),
        }
        self.world.points = np.array([[0.0, 0.0, -0.125], [0.5, 0.35, 1.0], [-0.5, 0.0, 1.0]])
        self.world.start_tf()
        return self.world.start_clouds()

    def wait_for_minimum(self, node, expected):
        same = lambda: self.smallest and abs(self.smallest[-1] - expected) < 0.0011  # noqa: E731
        if np.isnan(expected):
            same = lambda: self.smallest and np.isnan(self.smallest[-1])  # noqa: E731
        try:
            node.wait_until(same, "a ~min_distance of %s" % expected)
        except AssertionError:
            self.fail("~min_distance is %s, not %s" % (self.smallest[-3:], expected))
        # The scale of the same cycle comes on another topic, perhaps later.
        begin, end = len(self.scales), time.monotonic() + 1.0
        while len(self.scales) < begin + 2 and time.monotonic() < end:
            time.sleep(0.002)

    def test_links_that_cannot_move(self):
        self.start_bench()
        node = self.start(BENCH_ARM)
        self.wait_for_minimum(node, 0.25)
        state = self.scales[-1]
        self.assertEqual((state.link, state.rule), ("tool", SpeedScaleState.SLOW))
        self.assertAlmostEqual(state.scale, 0.75, delta=0.01)
        self.assertIn("'tool' is 0.2", state.text)
        self.assertEqual(state.source, "cloud")
        self.assertEqual((state.stop_distance, state.free_distance), (0.1, 0.3))
        # It is in ~proximity all the same, and the diagnostics say why it does not count.
        self.assertAlmostEqual(pt.link(node.messages[-1], "stand").distance, 0.025, 3)
        words = "leave out 'stand', which cannot move in the fixed frame"
        node.wait_until(lambda: words in node.diagnostic("query", "links left out"), words)
        node.wait_until(lambda: "tool" in node.diagnostic("query", "speed_scale"), "the scale")

        node.stop()
        node = self.start(BENCH_ARM, **{"min_distance/fixed_links": True})
        self.wait_for_minimum(node, 0.025)
        self.assertEqual((self.scales[-1].link, self.scales[-1].scale), ("stand", 0.0))
        self.assertEqual(self.scales[-1].rule, SpeedScaleState.STOP)

    def test_fixed_frame_outside_the_urdf(self):
        """What cannot be known counts: base may drive in odom, and a static transform says it does not."""
        self.start_bench()
        self.world.poses["base"] = ("odom", pt.transform())
        node = self.start(BENCH_ARM, fixed_frame="odom")
        self.wait_for_minimum(node, 0.025)
        node.stop()
        del self.world.poses["base"]
        stamp = rospy.Time.now()
        self.world._tf_static.publish(
            [
                pt.transform_message("base", "camera", np.eye(4), stamp),
                pt.transform_message("bench", "base", pt.transform((1, 2, 0)), stamp),
            ]
        )
        node = self.start(BENCH_ARM, fixed_frame="bench")
        self.wait_for_minimum(node, 0.25)

    def test_ignored_links(self):
        clouds = self.start_bench()
        node = self.start(
            BENCH_ARM, ignore_links=["tool", "tol"], **{"speed_scale/links/arm/stop_distance": 0.2}
        )
        self.wait_for_minimum(node, 0.4)
        self.assertEqual((self.scales[-1].link, self.scales[-1].scale), ("arm", 1.0))
        said = "~ignore_links names 'tol', which is no monitored link; did you mean 'tool'?"
        node.wait_until(lambda: said in node.log(), said)
        # An ignored or fixed link that is UNKNOWN makes nothing unknown; the status says it all the same.
        self.world.poses.pop("tool")
        self.world.poses.pop("stand")
        node.wait_for_status(ProximityArray.NO_POSE)
        node.wait_for(
            lambda m: pt.link(m, "tool").state == LinkProximity.UNKNOWN
            and pt.link(m, "arm").state == LinkProximity.NEAR,
            "arm alone",
        )
        begin = len(self.scales)
        node.wait_until(lambda: len(self.scales) > begin + 20, "scales")
        self.assertTrue(all(state.scale == 1.0 for state in self.scales[begin:]))
        self.wait_for_minimum(node, 0.4)
        # A link that counts does, and a cloud that is stale.
        self.world.poses.pop("arm")
        self.wait_for_minimum(node, np.nan)
        node.wait_until(lambda: self.scales[-1].scale == 0.0, "a stop")
        self.assertEqual(self.scales[-1].link, "arm")
        self.world.poses["arm"] = ("base", pt.transform((0, 0, 1)))
        self.wait_for_minimum(node, 0.4)
        clouds.paused = True
        node.wait_until(lambda: self.scales[-1].rule == SpeedScaleState.UNKNOWN, "a stop")
        self.assertIn("driver stopped", self.scales[-1].text)
        self.wait_for_minimum(node, np.nan)

    def test_separation_beyond_what_is_measured(self):
        self.world.stand()
        self.world.start_tf()
        self.world.start_clouds()
        self.start(pt.urdf(), speed_scale={"separation": {"enabled": True}})
        pt.wait_until(lambda: self.scales[-1].rule == SpeedScaleState.SEPARATION, "the separation to decide")
        state = self.scales[-1]
        self.assertAlmostEqual(state.bound, 1.0, places=6)  # ~max_distance
        self.assertTrue(0.0 < state.scale < 1.0, state)
        self.assertIn("raise ~max_distance", state.text)

    def test_link_that_is_not_there(self):
        """Its distance was meant for another link: the scale is 0, and everything else goes on."""
        self.start_bench()
        node = self.start(BENCH_ARM, **{"speed_scale/links/toool/stop_distance": 0.5,
                                        "speed_scale/links/toool/free_distance": 0.6})
        self.wait_for_minimum(node, 0.25)
        self.assertEqual(self.scales[-1].rule, SpeedScaleState.UNKNOWN)
        self.assertIn("~speed_scale/links names toool", self.scales[-1].text)
        said = "~speed_scale/links names 'toool', which is no monitored link: ~speed_scale stays 0"
        node.wait_until(lambda: said in node.log(), said)
        self.assertEqual(node.log().count(said), 1)

    def test_link_against_link(self):
        """With ~self_collision/in_minimum the newest ~self_proximity counts; without one, nothing is known."""
        self.world.poses = {"hand": ("stand", pt.transform((0.35, 0, 0)))}
        self.world.poses["arm"] = ("stand", pt.transform((0, 0, -0.5)))
        self.world.poses["base"] = ("stand", pt.transform())  # carries the camera
        self.world.points = np.array([[0.35, 0.6, 0.0]])  # 0.5 m from the hand
        self.world.start_tf()
        self.world.start_clouds()
        enabled = {"self_collision/enabled": True}
        counts = {"self_collision/in_minimum": True}
        node = self.start(TWO_JOINTS, **enabled)
        self.wait_for_minimum(node, 0.5)
        node.stop()
        node = self.start(TWO_JOINTS, **enabled, **counts)
        self.wait_for_minimum(node, 0.15)
        self.assertEqual(self.scales[-1].scale, 1.0)
        self.world.poses["hand"] = ("stand", pt.transform((0.23, 0, 0)))
        node.wait_until(lambda: abs(self.scales[-1].scale - 0.5) < 0.03, "half the speed")
        state = self.scales[-1]
        self.assertEqual((state.link, state.source), ("hand", "stand"))
        self.assertEqual((state.stop_distance, state.free_distance), (0.01, 0.05))
        self.wait_for_minimum(node, 0.03)
        node.stop()
        node = self.start(TWO_JOINTS, **enabled, **counts, pose_timeout=0.005)  # a quarter of its period
        self.wait_for_minimum(node, np.nan)
        late = "stop: the newest ~self_proximity is too old, or of another model"
        node.wait_until(lambda: any(state.text == late for state in self.scales), late)
        self.assertTrue(all(s.scale == 0.0 for s in self.scales if s.text == late))

    def test_every_cycle(self):
        """Before the model, without clouds and afterwards: a scale at every cycle; disabled: no topic."""
        node = self.start(BENCH_ARM, wait=False)
        node.wait_for_status(ProximityArray.NO_CLOUD)
        node.wait_until(lambda: len(self.scales) > 20, "scales")
        self.assertTrue(all(state.scale == 0.0 for state in self.scales))
        self.start_bench()
        node.wait_for_status(ProximityArray.OK)
        begin, first = len(self.scales), len(node.messages)
        node.wait_until(lambda: len(node.messages) > first + 100, "messages")
        self.assertLess(abs(len(self.scales) - begin - (len(node.messages) - first)), 10)
        node.stop()
        node = self.start(BENCH_ARM, wait=False, **{"speed_scale/enabled": False})
        node.wait_for_status(ProximityArray.OK)
        self.wait_for_minimum(node, 0.25)
        self.assertEqual(self.scales, [])


if __name__ == "__main__":
    pt.run("speed_scale_test", SpeedScaleTest)
