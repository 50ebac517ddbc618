#!/usr/bin/env python3
"""Names of frames, links, sources and namespaces: each is found, and each has a status of its own."""


import proximity_testing as pt
import rospy
from proximity_testing import ProximityArray
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import MarkerArray

POINT = [[0.0, 0.0, 0.3]]  # 0.2 m from the ball at the origin


class NamesTest(pt.NodeTest):
    POINTS = POINT

    def test_frames_with_a_prefix(self):
        """A tf_prefix is not followed, and the text says so."""
        node = self.start()
        self.world.poses = {
            "left/" + child: ("left/" + parent, X) for child, (parent, X) in self.world.poses.items()
        }
        self.world.start_tf()
        self.world.start_clouds()
        message = node.wait_for_status(ProximityArray.NO_POSE, "tf_prefix")
        self.assertIn("tf has 'left/ball_link'", message.status_text)

    def test_links_with_slashes(self):
        """A slash before a link's name is not part of its frame; a slash elsewhere is."""
        urdf = pt.urdf().replace("ball_link", "/ball_link").replace("box_link", "box/link")
        urdf = urdf.replace('"base"', '"/base"')
        self.world.poses["box/link"] = self.world.poses.pop("box_link")
        self.world.start_tf()
        self.world.start_clouds()
        for pose_source in ("tf", "joint_states"):
            with self.subTest(pose_source):
                parameters = {"pose_source": pose_source}
                node = self.start(urdf, **parameters)
                spheres = node.collect("spheres", MarkerArray)
                message = node.wait_for_status(ProximityArray.OK)
                self.assertEqual([one.link for one in message.links], ["/ball_link", "box/link"])
                self.assertEqual(message.header.frame_id, "base")
                self.assertAlmostEqual(pt.link(message, "/ball_link").distance, 0.2, 5)
                node.wait_until(lambda spheres=spheres: spheres, "~spheres")
                frames = {marker.header.frame_id for marker in spheres[-1].markers}
                self.assertEqual(frames, {"ball_link", "box/link"})
                self.finish(self.nodes.pop())

    def test_optional_and_required_sources(self):
        """A required source without clouds makes links UNKNOWN; an optional one is left out."""
        sources = {
            "front": {"topic": "front/points"},
            "rear": {"topic": "rear/points", "timeout": 0.3},
            "side": {"topic": "side/points", "required": False},
        }
        node = self.start(sources=sources)
        self.world.start_tf()
        message = node.wait_for_status(ProximityArray.NO_CLOUD, "'front'")
        self.assertEqual([s.name for s in message.sources], ["front", "rear", "side"])
        self.assertNotIn("'side'", message.status_text)

        publishers = {
            name: rospy.Publisher(self.namespace + "/%s/points" % name, PointCloud2, queue_size=5)
            for name in sources
        }
        positions = {"front": [[0, 0, 0.3]], "rear": [[0, 0, -0.25]], "side": [[0.2, 0, 0]]}

        def start(name):
            return self.world.repeat(
                20, lambda: publishers[name].publish(pt.cloud(positions[name]))
            )

        start("front")
        message = node.wait_for(
            lambda m: m.status == ProximityArray.NO_CLOUD and "'front'" not in m.status_text,
            "clouds from the front",
        )
        self.assertIn("'rear'", message.status_text)
        self.assertTrue(pt.all_unknown(message))

        rear = start("rear")
        message = node.wait_for_status(ProximityArray.OK)
        ball = pt.link(message, "ball_link")
        self.assertEqual((ball.source, round(ball.distance, 4)), ("rear", 0.15))
        by_name = {s.name: s for s in message.sources}
        self.assertEqual(by_name["side"].status, ProximityArray.NO_CLOUD)
        used = [s.stamp for s in message.sources if s.status == ProximityArray.OK]
        self.assertEqual(message.cloud_stamp, min(used))

        side = start("side")
        node.wait_for(
            lambda m: m.status == 0 and pt.link(m, "ball_link").source == "side", "the side"
        )
        side.stop()
        message = node.wait_for(
            lambda m: m.status == 0 and pt.link(m, "ball_link").source == "rear", "the rear"
        )
        by_name = {s.name: s for s in message.sources}
        self.assertEqual(by_name["side"].status, ProximityArray.STALE_CLOUD)

        rear.stop()
        node.wait_for_unknown(ProximityArray.STALE_CLOUD, "'rear'")
        for publisher in publishers.values():
            publisher.unregister()


if __name__ == "__main__":
    pt.run("names_test", NamesTest)
