#!/usr/bin/env python3
"""Distances, bounds, witnesses, frames, stamps and vectors against truth that is easy to compute."""


import numpy as np
import proximity_testing as pt
import rospy
from proximity_testing import LinkProximity, ProximityArray
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64
from visualization_msgs.msg import Marker, MarkerArray

X_BC = pt.transform((0.3, -0.2, 0.5), axis=(0.6, 0.0, 0.8), angle=0.7)
BALL = pt.transform((0.4, 0.1, 0.2), axis=(0.0, 0.6, 0.8), angle=1.1)
BOX = pt.transform((-0.5, 0.3, 0.1), axis=(1.0, 0.0, 0.0), angle=-0.4)


def cloud_around(rng, n=3000):
    """Points in base with a small gap around ball and box."""
    points = rng.uniform(-1.5, 1.5, (n, 3))
    free = np.ones(n, bool)
    for name, X in (("ball_link", BALL), ("box_link", BOX)):
        free &= pt.DISTANCE[name](pt.apply(pt.inverse(X), points)) > 0.05
    return points[free]


class TruthTest(pt.NodeTest):
    CAMERA, BALL, BOX = X_BC, BALL, BOX

    def start(self, points, **parameters):
        """The node, links in tf and a stream of clouds of points given in base."""
        self.MAX_DISTANCE = parameters.get("max_distance", 1.0)
        self.world.points = pt.apply(pt.inverse(X_BC), points)
        super().start(**parameters)
        self.world.start_tf()
        self.world.start_clouds()
        return self.node

    def check_distances(self, message, points, X, tolerance=0.001):
        """Checks against brute force over points in the message's frame; X: link poses in it."""
        for name, X_FL in X.items():
            one = pt.link(message, name)
            every = pt.DISTANCE[name](pt.apply(pt.inverse(X_FL), points))
            truth = every.min()
            self.assertLessEqual(abs(truth), self.MAX_DISTANCE)
            self.assertGreaterEqual(one.distance, truth - 1e-5)
            self.assertLessEqual(one.distance, truth + tolerance + 1e-5)
            self.assertLessEqual(one.lower_bound, truth + 1e-5)
            self.assertLessEqual(one.distance - one.lower_bound, tolerance + 1e-5)
            # The witness point on the obstacle is a point of the cloud, at that distance.
            witness = pt.vector(one.point_on_obstacle)
            nearest = np.linalg.norm(points - witness, axis=1).argmin()
            np.testing.assert_allclose(points[nearest], witness, atol=1e-5)
            self.assertAlmostEqual(every[nearest], one.distance, 5)
            # The witness point on the link lies on its surface, and is the same in the link's frame.
            local = pt.vector(one.point_on_link_local)
            self.assertAlmostEqual(pt.DISTANCE[name](local)[0], 0.0, 5)
            np.testing.assert_allclose(
                pt.apply(X_FL, local), pt.vector(one.point_on_link), atol=1e-6
            )
            self.assertEqual(one.source, "cloud")

    def test_distances(self):
        points = cloud_around(np.random.default_rng(1))
        node = self.start(points)
        smallest = []
        node.subscribe("min_distance", Float64, lambda m: smallest.append(m.data))
        message = node.wait_for_status(ProximityArray.OK)
        self.assertEqual(message.header.frame_id, "base")
        self.assertEqual([one.link for one in message.links], ["ball_link", "box_link"])
        self.assertEqual(pt.states(message), [LinkProximity.NEAR] * 2)
        self.check_distances(message, points, {"ball_link": BALL, "box_link": BOX})

        source = message.sources[0]
        self.assertEqual((source.name, source.status), ("cloud", ProximityArray.OK))
        self.assertEqual(source.stamp, message.cloud_stamp)
        self.assertAlmostEqual(source.age, (message.header.stamp - source.stamp).to_sec(), 6)
        self.assertLess(abs(source.age), 1.0)
        self.assertEqual(source.points_received, len(points))
        self.assertEqual(source.points_on_robot, 0)
        self.assertGreater(source.points_used, 0)
        self.assertGreater(message.computation_time, 0)

        expected = min(one.lower_bound for one in message.links)
        node.wait_until(
            lambda: smallest and abs(smallest[-1] - expected) < 1e-6, "~min_distance"
        )

    def test_default_deadline(self):
        """Points that are all equally near, asked exactly at 1 kHz: answers come in time, with bounds."""
        rng = np.random.default_rng(7)
        sphere = rng.normal(size=(200000, 3))
        points = BALL[:3, 3] + 0.6 * sphere / np.linalg.norm(sphere, axis=1)[:, None]
        points = points[pt.DISTANCE["box_link"](pt.apply(pt.inverse(BOX), points)) > 0.05]
        node = self.start(points, rate=1000, **{"query/tolerance": 0.0, "self_filter": False})
        node.wait_for(
            lambda m: pt.link(m, "ball_link").state == LinkProximity.NEAR, "the first answer"
        )
        begin = len(node.messages)
        node.wait_until(lambda: len(node.messages) > begin + 1000, "a thousand answers")
        degraded, times = 0, []
        for message in node.messages[begin:]:
            times.append(message.computation_time)
            ball = pt.link(message, "ball_link")
            if ball.state == LinkProximity.UNKNOWN:
                continue
            self.assertLessEqual(ball.lower_bound, 0.5 + 1e-5)
            self.assertGreaterEqual(ball.distance, 0.5 - 1e-5)
            wide = [
                one.distance - one.lower_bound > 1e-5
                for one in message.links
                if one.state != LinkProximity.CLEAR
            ]
            if message.status == ProximityArray.OK:
                self.assertEqual((message.unfinished, sum(wide)), (0, 0), message)
            elif message.status == ProximityArray.DEGRADED:
                degraded += 1
                self.assertGreaterEqual(message.unfinished, sum(wide))
                self.assertIn("~query/deadline", message.status_text)
            parts = message.query_time + message.repulsion_time + message.penetration_time
            self.assertAlmostEqual(parts + message.message_time, message.computation_time, 9)
        # Three quarters of the period, and what the machine takes from the thread now and then.
        self.assertLess(np.median(times), 0.00085)
        node.wait_until(lambda: node.diagnostic("query", "deadline") == "0.750 ms", "the deadline")
        # No deadline: exact, however long it takes.
        rospy.set_param(node.name + "/query/deadline", 0)
        message = node.wait_for(
            lambda m: m.status == ProximityArray.OK and m.unfinished == 0, "exact bounds"
        )
        self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.5, 5)
        node.wait_until(lambda: node.diagnostic("query", "deadline") == "none", "no deadline")

    def test_contact_and_vectors(self):
        """Points inside the box, one of them on its middle plane; self-filter off."""
        deep = pt.apply(BOX, pt.BOX_OFFSET + [[0.06, 0, 0], [-0.04, 0.05, 0.0]])
        points = np.vstack([deep, pt.apply(BALL, [[0.25, 0, 0]])])
        node = self.start(points, self_filter=False)
        message = node.wait_for_status(ProximityArray.OK)
        box, ball = pt.link(message, "box_link"), pt.link(message, "ball_link")
        self.assertEqual(box.state, LinkProximity.CONTACT)
        self.assertAlmostEqual(box.distance, -0.06, 5)
        # The nearest way out for the deepest point is -x of the link; the link goes the other way.
        np.testing.assert_allclose(pt.vector(box.direction), BOX[:3, 0], atol=1e-4)
        # The disjoint packing is made while the node answers; the wrench is NaN until then.
        message = node.wait_for(
            lambda m: np.isfinite(pt.vector(pt.link(m, "box_link").penetration.force)).all(),
            "a contact force",
        )
        force = pt.vector(pt.link(message, "box_link").penetration.force)
        self.assertGreater(np.linalg.norm(force), 0.0)
        self.assertFalse(pt.vector(pt.link(message, "ball_link").penetration.force).any())
        self.assertAlmostEqual(ball.distance, 0.15, 5)
        np.testing.assert_allclose(pt.vector(ball.direction), -BALL[:3, 0], atol=1e-4)

        # The repulsion is along the direction, has the configured length, and changes while running.
        expected = 1.0 - 0.15 / 0.3
        np.testing.assert_allclose(
            pt.vector(ball.repulsion), -expected * BALL[:3, 0], atol=0.02 * expected
        )
        rospy.set_param(node.name + "/repulsion/gain", 3.0)
        node.wait_for(
            lambda m: np.linalg.norm(pt.vector(pt.link(m, "ball_link").repulsion)) > 2.5 * expected,
            "three times the repulsion",
        )

    def test_fixed_frame_and_moving_camera(self):
        """Fixed frame `world`; a camera that moves fast, whose clouds come late."""
        X_WB = pt.transform((10.0, -5.0, 1.0), axis=(0, 0, 1), angle=2.0)

        def X_BM(t):  # turns evenly: what tf interpolates is exact, however rarely it comes
            return pt.transform((0.3, 0.2, 0.0), angle=3 * t)

        self.world.poses["base"] = ("world", X_WB)
        self.world.poses["moving_camera"] = ("base", X_BM)
        points = pt.apply(BALL, [[0.0, 0.0, 0.3]])  # in base, standing still

        def send_late():
            stamp = rospy.Time.now() - rospy.Duration(0.1)
            seen = pt.apply(pt.inverse(X_BM(stamp.to_sec())), points)
            self.world.cloud_publisher.publish(pt.cloud(seen, "moving_camera", stamp))

        node = super().start(fixed_frame="world")
        self.world.start_tf(100)
        self.world.repeat(20, send_late)
        message = node.wait_for_status(ProximityArray.OK)
        self.assertEqual(message.header.frame_id, "world")
        for _ in range(20):
            message = node.wait_for_status(ProximityArray.OK)
            self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.2, 3)
            np.testing.assert_allclose(
                pt.vector(pt.link(message, "ball_link").point_on_obstacle),
                pt.apply(X_WB, points)[0],
                atol=5e-4,
            )

    def test_moving_link(self):
        """The stamp is the instant of the poses; closing speed."""
        speed, turn = 0.1, 4.0

        def X_BL(t):  # to and fro along y, 0.1 m/s
            phase = t % turn
            y = speed * (phase if phase < turn / 2 else turn - phase)
            return pt.transform((0.0, y - 0.1, 0.0))

        self.world.stand(X_BL, pt.transform((5, 5, 5)))
        points = np.array([[0.0, 0.5, 0.0]])
        node = self.start(points)
        node.wait_for_status(ProximityArray.OK)
        checked, unknown_speeds = 0, 0
        while checked < 50:
            message = node.wait_for_status(ProximityArray.OK)
            t = message.header.stamp.to_sec()
            phase = t % (turn / 2)
            if not 0.3 < phase < turn / 2 - 0.1:
                continue  # about the turning points speed is not constant
            one = pt.link(message, "ball_link")
            self.assertAlmostEqual(one.distance, 0.5 - X_BL(t)[1, 3] - pt.BALL_RADIUS, 4)
            newer = [stamp for stamp in self.world.tf_sent if stamp > message.header.stamp]
            self.assertLess(len(newer), 50)  # one second's
            if np.isnan(one.closing_speed):  # the first one, or tf has paused
                unknown_speeds += 1
                self.assertLess(unknown_speeds, 20)
                continue
            checked += 1
            sign = 1 if t % turn < turn / 2 else -1
            self.assertAlmostEqual(one.closing_speed, sign * speed, delta=0.01)
            self.assertAlmostEqual(one.closing_speed_robot, sign * speed, delta=0.01)
            if not one.closing_unknown & LinkProximity.OBSTACLES_UNKNOWN:
                self.assertAlmostEqual(one.closing_speed_obstacles, 0.0, delta=0.01)
            if sign < 0:
                self.assertEqual(one.time_to_contact, np.inf)
            else:
                self.assertAlmostEqual(
                    one.time_to_contact, max(one.lower_bound, 0) / one.closing_speed, 6
                )
        # CLEAR, although it is the same cloud.
        self.assertEqual(pt.link(message, "box_link").state, LinkProximity.CLEAR)

    def test_moving_obstacle(self):
        """The cloud's change adds to the closing speed, measured with the clouds' own stamps.

        A slash before a frame's name is not part of it.
        """
        speed, turn = 0.1, 4.0

        def send():  # to and fro along y, 0.1 m/s
            stamp = rospy.Time.now()
            phase = stamp.to_sec() % turn
            y = 0.5 - speed * (phase if phase < turn / 2 else turn - phase)
            self.world.cloud_publisher.publish(pt.cloud([[0.0, y, 0.0]], "/base", stamp))

        self.world.stand(pt.transform((0, 0, 0)), pt.transform((5, 5, 5)))
        super().start()
        self.world.start_tf()
        self.world.repeat(20, send)
        checked = 0
        while checked < 30:
            message = self.node.wait_for_status(ProximityArray.OK)
            one = pt.link(message, "ball_link")
            phase = message.cloud_stamp.to_sec() % turn
            # The rate is measured from the cloud before, which may be late, within one pass of the motion.
            if not 1.0 < phase % (turn / 2) or np.isnan(one.closing_speed_obstacles):
                continue
            checked += 1
            sign = 1 if phase < turn / 2 else -1
            self.assertAlmostEqual(one.closing_speed_obstacles, sign * speed, delta=0.01)
            if not one.closing_unknown:
                self.assertAlmostEqual(one.closing_speed_robot, 0.0, delta=0.001)

    def test_self_filter(self):
        """Points on the robot, of both links, are dropped; those beyond the padding stay."""
        rng = np.random.default_rng(2)
        shell = rng.normal(size=(500, 3))
        shell *= pt.BALL_RADIUS / np.linalg.norm(shell, axis=1)[:, None]
        box = rng.uniform(-0.5, 0.5, (500, 3)) * pt.BOX_SIZE + pt.BOX_OFFSET
        seen = pt.apply(BALL, [[0.0, 0.0, 0.2], [0.0, 0.25, 0.0]])
        points = np.vstack([pt.apply(BALL, shell), pt.apply(BOX, box), seen])
        # The ball alone is monitored; the box is part of the robot all the same where all links filter.
        clouds = []
        node = self.start(
            points,
            links=["ball_link"],
            self_filter_links="all",
            self_filter_padding=0.03,
            min_range=0.0,
        )
        node.subscribe("filtered_cloud", PointCloud2, clouds.append)
        message = node.wait_for_status(ProximityArray.OK)
        self.assertEqual([one.link for one in message.links], ["ball_link"])
        self.assertEqual(message.sources[0].points_on_robot, 1000)
        self.assertEqual(message.sources[0].points_used, 2)
        self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.1, 5)

        node.wait_until(lambda: clouds, "~filtered_cloud")
        self.assertEqual(clouds[0].header.frame_id, "base")
        self.assertEqual(clouds[0].width * clouds[0].height, 2)
        kept = np.frombuffer(clouds[0].data, "<f4").reshape(2, 3)
        for p in seen:
            self.assertLess(np.linalg.norm(kept - p, axis=1).min(), 1e-5)

    def test_range_and_clear(self):
        """~max_distance, ranges of the source, and the spheres in rviz."""
        spheres = []
        near = pt.apply(BALL, [[0.0, 0.0, 0.35]])
        far_away = pt.apply(X_BC, [[0.0, 0.0, 2.5]])
        node = self.start(np.vstack([near, far_away]), max_distance=0.3, max_range=2.0)
        node.subscribe("spheres", MarkerArray, spheres.append)
        message = node.wait_for_status(ProximityArray.OK)
        self.assertEqual(message.sources[0].points_used, 1)
        self.assertEqual(pt.states(message), [LinkProximity.NEAR, LinkProximity.CLEAR])

        node.wait_until(lambda: spheres, "~spheres")
        first = [m for m in spheres[0].markers if m.ns == "ball_link"]
        self.assertEqual(len(first), 1)  # a ball is one sphere
        self.assertAlmostEqual(first[0].scale.x, 2 * pt.BALL_RADIUS, 4)
        for marker in spheres[0].markers:
            self.assertEqual(marker.header.frame_id, marker.ns)
            self.assertTrue(marker.frame_locked)
            self.assertEqual(marker.type, Marker.SPHERE)
        self.assertLess(len(spheres[0].markers), 400)

        self.world.points = pt.apply(pt.inverse(X_BC), far_away)
        message = node.wait_for(
            lambda m: pt.states(m) == [LinkProximity.CLEAR] * 2 and m.status == 0, "CLEAR"
        )
        self.assertEqual(message.sources[0].points_used, 0)


if __name__ == "__main__":
    pt.run("truth_test", TruthTest)
