#!/usr/bin/env python3
"""launch/demo.launch with the bundled bag, played in a loop: every topic's frame, stamp and rate,
the self-filter and the distances against brute force, and the jump of the clock at the loop's end.
"""

import os
import sys
import threading
import unittest

import numpy as np
import proximity_testing as pt
import rospy
from proximity_testing import LinkProximity, ProximityArray
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Float64
from visualization_msgs.msg import MarkerArray

DEMO = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "demo")
sys.path.insert(0, DEMO)
import arm_model  # noqa: E402
import brute_force  # noqa: E402
import scene  # noqa: E402

TOLERANCE = 0.001  # [m] config/demo.yaml
PADDING = 0.02  # [m] default of the self-filter
MAX_ERROR = 0.005  # [m] of the packing, in config/demo.yaml
POSE_ERROR = 0.0005  # [m] tf interpolates poses between joint states, this test interpolates joints


class DemoTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.lock = threading.Lock()
        cls.answers, cls.clouds, cls.filtered, cls.joints = [], {}, {}, {}
        cls.smallest, cls.markers, cls.spheres = [], [], []
        cls.taken_in = []  # stamps of the clouds, in the order in which the node took them in
        cls.arm = arm_model.ArmModel()
        subscribe = cls.subscribe
        subscribe("/proximity/proximity", ProximityArray, cls.answers.append)
        subscribe("/proximity/min_distance", Float64, cls.smallest.append)
        subscribe("/proximity/markers", MarkerArray, cls.markers.append)
        subscribe("/proximity/spheres", MarkerArray, cls.spheres.append)
        subscribe("/proximity/filtered_cloud", PointCloud2, cls.keep_filtered)
        subscribe("/camera/depth/points", PointCloud2, lambda m: cls.keep(cls.clouds, m))
        subscribe("/joint_states", JointState, lambda m: cls.keep(cls.joints, m))

    @classmethod
    def subscribe(cls, topic, kind, callback):
        def locked(message):
            with cls.lock:
                callback(message)

        rospy.Subscriber(topic, kind, locked, queue_size=1000)

    @staticmethod
    def keep(where, message):
        where[message.header.stamp.to_nsec()] = message

    @classmethod
    def keep_filtered(cls, message):
        cls.keep(cls.filtered, message)
        cls.taken_in.append(message.header.stamp)

    def wait_for_ok(self, start):
        """The first answer from index start on that is OK, and its index."""
        found = []

        def look():
            with self.lock:
                for i in range(start, len(self.answers)):
                    if self.answers[i].status == ProximityArray.OK:
                        found.append(i)
                        return True
            return False

        pt.wait_until(look, "OK; the last is %s" % (self.answers[-1:] or "none"), timeout=60)
        return self.answers[found[0]], found[0]

    def positions(self, stamp):
        """Joint positions at an instant, in URDF order."""
        with self.lock:
            times = np.array(sorted(self.joints))
            after = min(max(int(np.searchsorted(times, stamp.to_nsec())), 1), len(times) - 1)
            a, b = self.joints[times[after - 1]], self.joints[times[after]]
        self.assertLess(times[after] - times[after - 1], 50e6, "joint states are missing")
        share = (stamp - a.header.stamp).to_sec() / (b.header.stamp - a.header.stamp).to_sec()
        q = (1 - share) * np.array(a.position) + share * np.array(b.position)
        return [q[a.name.index(name)] for name in self.arm.joint_names]

    @staticmethod
    def points(message):
        points = np.frombuffer(message.data, "<f4").reshape(-1, message.point_step // 4)[:, :3]
        return points[np.isfinite(points).all(1)].astype(float)

    def distances(self, X_BL, points):
        """By link, from every point to every triangle and primitive; inf without points."""
        if not len(points):
            return {name: np.inf for name, shapes in self.arm.shapes.items() if shapes}
        every = brute_force.distances(self.arm, X_BL, points)
        return {name: distance for name, (distance, _) in every.items()}

    def check_truth(self, answer):
        """Every link that is known against the points that the queries saw: of an answer that is OK
        all links, to the tolerance, of others what they prove.
        """
        stamp = answer.cloud_stamp.to_nsec()
        pt.wait_until(lambda: stamp in self.filtered, "the filtered cloud in use")
        points = self.points(self.filtered[stamp])
        X_BL = self.arm.link_poses(self.positions(answer.header.stamp))
        truth = self.distances(X_BL, points)
        self.assertEqual({one.link for one in answer.links}, set(truth))
        is_ok = answer.status == ProximityArray.OK
        for one in answer.links:
            if one.state == LinkProximity.UNKNOWN and not is_ok:
                continue
            if one.state == LinkProximity.CLEAR:
                self.assertGreater(truth[one.link], 0.5 - POSE_ERROR)
                continue
            self.assertEqual(one.state, LinkProximity.NEAR)
            self.assertGreaterEqual(one.distance, truth[one.link] - POSE_ERROR)
            self.assertLessEqual(one.lower_bound, truth[one.link] + POSE_ERROR)
            if is_ok:
                self.assertAlmostEqual(one.distance, truth[one.link], delta=TOLERANCE + POSE_ERROR)
                self.assertLessEqual(one.distance - one.lower_bound, TOLERANCE + 1e-6)
            X_FL, local = X_BL[one.link], pt.vector(one.point_on_link_local)
            np.testing.assert_allclose(
                pt.apply(X_FL, local), pt.vector(one.point_on_link), atol=POSE_ERROR
            )

    def check_self_filter(self, answer):
        """Of a sample of the raw cloud, points near a link are gone, and no others."""
        stamp = answer.cloud_stamp.to_nsec()
        if stamp not in self.clouds:
            return
        raw = self.points(self.clouds[stamp])
        X_BL = self.arm.link_poses(self.positions(answer.cloud_stamp))
        base = pt.apply(scene.camera().X_BC, raw)
        kept = self.points(self.filtered[stamp])
        rng = np.random.default_rng(stamp % 1000)
        # Half of the sample about the arm, where it matters.
        near = np.flatnonzero(np.linalg.norm(base - [0.2, 0, 0.3], axis=1) < 0.6)
        sample = np.hstack([rng.choice(near, 60), rng.integers(0, len(base), 20)])
        for p in base[sample]:
            truth = min(self.distances(X_BL, p[None]).values())
            is_kept = np.abs(kept - p).max(1).min() < 1e-4
            if truth < PADDING - POSE_ERROR:
                self.assertFalse(is_kept, "a point %.4f m from the robot" % truth)
            if truth > PADDING + MAX_ERROR + POSE_ERROR:
                self.assertTrue(is_kept, "a point %.4f m from the robot" % truth)

    def test_1_topics(self):
        self.wait_for_ok(0)
        begin = len(self.answers)
        start = rospy.Time.now()

        def two_seconds_of_the_bag():
            elapsed = (rospy.Time.now() - start).to_sec()
            return elapsed >= 2.0 or elapsed < 0.0

        pt.wait_until(two_seconds_of_the_bag, "two seconds")
        with self.lock:
            answers = self.answers[begin:]
        self.assertGreater(len(answers), 60)  # 100 Hz when nothing else runs
        good = [m for m in answers if m.status == ProximityArray.OK]
        self.assertGreater(len(good), 0.9 * len(answers), answers[-1].status_text)
        names = [name for name, shapes in self.arm.shapes.items() if shapes]
        for message in answers:
            pt.check_invariants(self, message, max_distance=0.5)
            self.assertEqual(message.header.frame_id, "base_link")
            self.assertEqual([one.link for one in message.links], names)
            self.assertLess(message.computation_time, 0.05)
        for message in good:
            self.assertLess((message.header.stamp - message.cloud_stamp).to_sec(), 0.5)
            self.assertGreater(message.sources[0].points_on_robot, 100)
        backwards = sum(b.header.stamp < a.header.stamp for a, b in zip(answers, answers[1:]))
        self.assertLessEqual(backwards, 1 if rospy.Time.now() < start else 0)

        pt.wait_until(
            lambda: self.markers and self.spheres and self.smallest and self.filtered, "all topics"
        )
        for marker in self.spheres[0].markers:
            self.assertIn(marker.header.frame_id, names)
            self.assertTrue(marker.header.stamp.is_zero())
        self.assertEqual({m.header.frame_id for m in self.spheres[0].markers}, set(names))
        self.assertTrue(any(array.markers for array in self.markers))
        for array in self.markers:
            for marker in array.markers:
                self.assertEqual(marker.header.frame_id, "base_link")
        for message in self.filtered.values():
            self.assertEqual(message.header.frame_id, "base_link")
        self.assertTrue(set(self.filtered) & set(self.clouds))

    def test_2_truth(self):
        _, i = self.wait_for_ok(len(self.answers))
        checked = 0
        while checked < 5:
            answer, i = self.wait_for_ok(i + 40)
            pt.wait_until(
                lambda: max(self.joints) >= answer.header.stamp.to_nsec()
                or min(self.joints) > answer.header.stamp.to_nsec(),
                "joint states",
            )
            self.check_truth(answer)
            self.check_self_filter(answer)
            checked += 1

    def jump(self, stamps):
        """The first index after the clock went back, or None."""
        with self.lock:
            stamps = stamps()
        return next((i for i, (a, b) in enumerate(zip(stamps, stamps[1:]), 1) if (a - b).to_sec() > 5.0), None)

    def test_3_loop(self):
        def jump():
            return self.jump(lambda: [m.header.stamp for m in self.answers])

        def clouds():
            """Those of the second round."""
            i = self.jump(lambda: self.taken_in[:])
            return [] if i is None else self.taken_in[i:]

        pt.wait_until(lambda: jump() is not None, "the bag to begin anew", timeout=90)
        i = jump()
        answer, first = self.wait_for_ok(i)
        # A cloud of this round; which one depends on when a loaded machine has the poses.
        pt.wait_until(lambda: answer.cloud_stamp in clouds(), "the cloud in use")
        self.wait_for_ok(first + 100)
        for message in self.answers[i : first + 100]:
            pt.check_invariants(self, message, max_distance=0.5)
            if not pt.all_unknown(message):
                # Nothing from before the jump. A loaded machine may be late with some links' poses,
                # or with the answer: NO_POSE and DEGRADED tell of the other links what is proven.
                self.assertLess(message.cloud_stamp, message.header.stamp + rospy.Duration(0.2))
        for message in self.answers[i:first]:
            self.assertNotEqual(message.status, ProximityArray.OK)
            if not pt.all_unknown(message):
                self.check_truth(message)
        answer, _ = self.wait_for_ok(len(self.answers))
        self.check_truth(answer)


if __name__ == "__main__":
    pt.run("demo_test", DemoTest)
