#!/usr/bin/env python3
"""Status, text and states when clouds or poses are missing, late, or come back."""

import collections

import numpy as np
import proximity_testing as pt
import rospy
from proximity_testing import LinkProximity, ProximityArray
from stall_meter import undisturbed
from std_msgs.msg import Float64

POINT = [[0.0, 0.0, 0.3]]  # 0.2 m from the ball at the origin


class StatusTest(pt.NodeTest):
    POINTS = POINT

    def test_no_cloud_stale_cloud_recovery(self):
        node = self.start()
        smallest = node.collect("min_distance", Float64, lambda m: m.data)
        self.world.start_tf()
        message = node.wait_for_status(ProximityArray.NO_CLOUD, "'cloud'")
        self.assertIn(self.namespace + "/cloud", message.status_text)
        self.assertEqual([one.link for one in message.links], ["ball_link", "box_link"])
        self.assertTrue(pt.all_unknown(message))
        self.assertTrue(message.cloud_stamp.is_zero())
        source = message.sources[0]
        self.assertEqual(source.status, ProximityArray.NO_CLOUD)
        self.assertTrue(source.stamp.is_zero() and np.isnan(source.age))
        node.wait_until(lambda: smallest and np.isnan(smallest[-1]), "NaN on ~min_distance")
        node.wait_until(lambda: "nothing received yet" in node.log(), "the reason in the log")

        clouds = self.world.start_clouds()
        message = node.wait_for_status(ProximityArray.OK)
        self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.2, 5)
        node.wait_until(lambda: not np.isnan(smallest[-1]), "a value on ~min_distance")

        # The last cloud is used until the timeout, not a moment longer.
        clouds.paused = True
        begin = len(node.messages)
        message = node.wait_for_status(ProximityArray.STALE_CLOUD, "'cloud'")
        self.assertIn("allowed is 0.50 s (~cloud_timeout)", message.status_text)
        self.assertTrue(pt.all_unknown(message))
        self.assertEqual(message.sources[0].status, ProximityArray.STALE_CLOUD)
        self.assertFalse(message.sources[0].stamp.is_zero())
        for m in node.messages[begin:]:
            if m.status == ProximityArray.OK:
                self.assertLess((m.header.stamp - m.cloud_stamp).to_sec(), 0.5)
        node.wait_until(lambda: np.isnan(smallest[-1]), "NaN on ~min_distance")
        node.wait_for_diagnostic("input cloud", level=3)  # STALE

        clouds.paused = False
        message = node.wait_for_status(ProximityArray.OK)
        self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.2, 5)
        node.wait_until(lambda: node.diagnostics["query"].level < 2, "no error in the diagnostics")
        self.finish(self.nodes.pop())  # which writes out what is left of the log
        self.assertIn("the status is OK again", node.log())

    def test_old_future_and_unordered_stamps(self):
        node = self.start()
        self.world.start_tf()
        node.wait_for_status(ProximityArray.NO_CLOUD)

        sent = collections.defaultdict(list)  # stamps, by their offset

        def send(offset):
            stamp = rospy.Time.now() + rospy.Duration(offset)
            sent[offset].append(stamp)
            self.world.cloud_publisher.publish(pt.cloud(POINT, stamp=stamp))

        for offset, text in ((-5.0, "old"), (3600.0, "in the future")):
            repeater = self.world.repeat(20, lambda offset=offset: send(offset))
            node.wait_for_unknown(ProximityArray.STALE_CLOUD, text)
            node.wait_for_status(ProximityArray.STALE_CLOUD, "clocks of sensor and node")
            repeater.stop()
        # A cloud of the far future does not shut out those of now.
        repeater = self.world.repeat(20, lambda: send(0))
        node.wait_for_status(ProximityArray.OK)
        # A cloud without a stamp does not either, and neither does one that is overtaken.
        begin = len(node.messages)
        unstamped = pt.cloud([[0, 0, 0.15]], stamp=rospy.Time(0))
        self.world.cloud_publisher.publish(unstamped)
        other = self.world.repeat(20, lambda: send(-0.3))
        node.wait_until(
            lambda: int(node.diagnostic("input cloud", "dropped: out of order", 0)) > 5,
            "clouds out of order in the diagnostics",
        )
        node.wait_for_status(ProximityArray.OK)
        for m in node.messages[begin:]:
            if m.status == ProximityArray.OK:
                self.assertIn(m.cloud_stamp, sent[0])
        other.stop()
        repeater.stop()

    def test_no_pose(self):
        node = self.start()
        clouds = self.world.start_clouds()
        message = node.wait_for_unknown(ProximityArray.NO_POSE, "ball_link")
        self.assertIn("base", message.status_text)

        # One link: the other goes on.
        self.world.poses = {"ball_link": ("base", pt.transform())}
        self.world.start_tf()
        message = node.wait_for(
            lambda m: m.status == ProximityArray.NO_POSE
            and pt.link(m, "ball_link").state == LinkProximity.NEAR,
            "ball_link alone",
        )
        self.assertIn("box_link", message.status_text)
        self.assertNotIn("'ball_link'", message.status_text)
        self.assertEqual(pt.link(message, "box_link").state, LinkProximity.UNKNOWN)
        self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.2, 5)

        # The last cloud is older than the other's first pose: the self-filter could not know it.
        clouds.stop()
        self.world.stand(box=self.BOX)
        message = node.wait_for_status(
            ProximityArray.NO_POSE, "so that its own points are still in it: 'box_link'"
        )
        self.assertEqual(pt.link(message, "box_link").state, LinkProximity.UNKNOWN)
        self.world.start_clouds()
        node.wait_for_status(ProximityArray.OK)
        node.wait_for_diagnostic("pose", level=0)

    def test_transforms_of_the_future_beside_good_ones(self):
        """They are told, whoever else gives their frame a pose, and are not used."""
        node = self.start()
        self.world.poses["wrist"] = ("base", pt.transform())
        self.world.start_tf()
        self.world.start_points(POINT, "wrist")
        for frame, begins in (("ball_link", "the"), ("wrist", "source 'cloud': the")):
            node.wait_for_status(ProximityArray.OK)

            def send(frame=frame):
                stamp = rospy.Time.now() + rospy.Duration(2.0)
                X = pt.transform((0, 0, 0.1))
                self.world.publish_transforms([pt.transform_message("base", frame, X, stamp)])

            ahead = self.world.repeat(100, send)
            message = node.wait_for_status(ProximityArray.DEGRADED, "compare the clocks")
            self.assertRegex(
                message.status_text,
                "^%s transform from '%s' to 'base' of %s is stamped (2.0|1.9). s in the future and "
                "not used" % (begins, frame, rospy.get_name()),
            )
            messages = undisturbed(lambda: node.next_messages(100))
            told = [m for m in messages if m.status == ProximityArray.DEGRADED]
            self.assertGreater(len(told), 80)
            ahead.stop()
        node.wait_for_status(ProximityArray.OK)
        known = [m for m in node.messages if not pt.all_unknown(m)]
        for distance in {pt.link(m, "ball_link").distance for m in known}:
            self.assertAlmostEqual(distance, 0.2, 5)

    def test_late_tf(self):
        """Clouds that are 0.15 s ahead of tf are used as soon as tf has caught up."""
        node = self.start()
        self.world.repeat(50, lambda: self.world.send_tf(late=0.15))
        self.world.start_clouds()
        node.wait_for_status(ProximityArray.OK)
        messages = undisturbed(lambda: node.next_messages(150))
        late = [m for m in messages if m.status != ProximityArray.OK]
        self.assertLess(len(late), 15, late[-1].status_text if late else "")
        # The wait is no reason for a warning.
        node.diagnostics.pop("input cloud", None)
        node.wait_until(
            lambda: "input cloud" in node.diagnostics
            and "not in use" not in node.diagnostics["input cloud"].message,
            "diagnostics without a word on the wait",
        )

    def test_rate(self):
        """Every cycle is published, whatever is missing."""
        node = self.start(rate=50)
        first = node.wait_for(lambda m: True, "the first message", start=0)
        self.assertNotEqual(first.status, ProximityArray.OK)
        for prepare in (lambda: None, self.world.start_tf, self.world.start_clouds):
            prepare()
            messages = undisturbed(lambda: node.next_messages(100))
            took = messages[-1].header.stamp - messages[0].header.stamp
            self.assertLess(took.to_sec(), 4.0)


if __name__ == "__main__":
    pt.run("status_test", StatusTest)
