#!/usr/bin/env python3
"""The self-filter takes the robot as it was when the sensor saw it: at the cloud's stamp.

A ball flies at 1 m/s. Its cloud arrives 0.3 s late, when the ball is 0.3 m farther. The robot at the
newest transform would leave every point of the ball in the cloud as an obstacle, and would drop the
obstacle that is where the ball has come to.
"""


import re

import numpy as np
import proximity_testing as pt
import rospy
from proximity_testing import LinkProximity, ProximityArray

LATE = 0.3  # [s] of the clouds
SPEED = 1.0  # [m/s]
SHELL = pt.BALL_RADIUS * 0.95
ANGLES = np.linspace(0, 2 * np.pi, 40, endpoint=False)
BALL = SHELL * np.column_stack([np.cos(ANGLES), np.sin(ANGLES), 0 * ANGLES])


class Camera:
    """Sees a wall across the x axis, and the robot's box before it."""

    WIDTH, HEIGHT, FOCAL, WALL = 160, 120, 140.0, 2.0
    X_BO = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]], float)  # looks along x
    RNG = np.random.default_rng(2)

    @classmethod
    def cloud(cls, X_BL, frame):
        u, v = np.meshgrid(np.arange(cls.WIDTH) - cls.WIDTH / 2, np.arange(cls.HEIGHT) - cls.HEIGHT / 2)
        rays = np.column_stack([u.ravel() / cls.FOCAL, v.ravel() / cls.FOCAL, np.ones(u.size)])
        far = cls.WALL / (rays @ cls.X_BO[:3, :3].T)[:, 0]
        X_LO = pt.inverse(X_BL) @ cls.X_BO
        begin, ways = X_LO[:3, 3] - pt.BOX_OFFSET, rays @ X_LO[:3, :3].T
        sides = (np.array([[[-0.5]], [[0.5]]]) * pt.BOX_SIZE - begin) / ways
        near, end = sides.min(0).max(1), sides.max(0).min(1)
        depth = np.where((near < end) & (near > 0), np.minimum(near, far), far)
        depth += cls.RNG.normal(0, 0.001, depth.shape)
        message = pt.cloud(rays * depth[:, None], frame)
        message.width, message.height = cls.WIDTH, cls.HEIGHT
        message.row_step = message.point_step * cls.WIDTH
        return message


class SelfFilterTest(pt.NodeTest):
    def test_a_correction_is_of_one_pose(self):
        """What a view has found out about a sensor's pose is forgotten with another frame or calibration."""
        ball = np.array([1.6, 1.4, 0.0])  # out of view
        truth = np.hypot(1.4 - Camera.WALL * 0.5 * Camera.WIDTH / Camera.FOCAL, 0.4) - pt.BALL_RADIUS
        in_view, away = pt.transform((1, 0, 0), (0.6, 0.8, 0), 0.7), pt.transform((-3, 0, 0))
        wrong = pt.transform(angle=0.03) @ Camera.X_BO

        def state(one, other=Camera.X_BO):
            stamp = rospy.Time.now()
            statics = [("one", one), ("other", other)]
            self.world._tf_static.publish([pt.transform_message("base", f, X, stamp) for f, X in statics])

        def move_box(X):
            self.world.stand(ball=pt.transform(ball), box=X)

        def send():
            box = self.world.poses["box_link"][1]
            self.world.cloud_publisher.publish(Camera.cloud(box, self.frame))

        def is_right(message):
            return (
                message.status == ProximityArray.OK
                and abs(pt.link(message, "ball_link").distance - truth) < 0.02
            )

        self.frame = "one"
        state(wrong)
        move_box(in_view)
        self.world.start_tf()
        self.world.repeat(15, send)
        self.start(sources={"eye": {"topic": "cloud", "self_filter_mode": "view"}}, max_distance=2.0)
        for case in ("another frame", "calibrated"):
            with self.subTest(case):
                self.frame = "one"
                state(wrong)
                move_box(in_view)
                self.node.wait_for(
                    lambda m: is_right(m) and m.sources[0].points_on_robot > 0, "a corrected pose"
                )
                move_box(away)
                self.node.wait_for(
                    lambda m: is_right(m) and m.sources[0].points_on_robot == 0, "the robot out of view"
                )
                if case == "calibrated":
                    state(Camera.X_BO)
                else:
                    self.frame = "other"
                sent = rospy.Time.now() + rospy.Duration(0.3)
                self.node.wait_for(lambda m: m.cloud_stamp > sent, "clouds of the new pose")
                for message in self.node.next_messages(20):
                    self.assertTrue(is_right(message), message)

    def ball_at(self, seconds):
        """There and back along x, 2 m in 2 s: so it is never far."""
        phase = (seconds - self.begin) * SPEED % 4.0
        return np.array([phase if phase < 2.0 else 4.0 - phase, 0.0, 0.0])

    def send_late_cloud(self):
        stamp = rospy.Time.now() - rospy.Duration(LATE)
        then, now = self.ball_at(stamp.to_sec()), self.ball_at(stamp.to_sec() + LATE)
        if abs(abs(then - now)[0] - SPEED * LATE) > 1e-6:
            return  # it turns in between
        points = np.vstack([then + BALL, now[None, :]])
        self.world.cloud_publisher.publish(pt.cloud(points, stamp=stamp))

    def test_late_clouds(self):
        self.begin = rospy.Time.now().to_sec()
        self.world.poses = {
            "ball_link": ("base", lambda t: pt.transform(self.ball_at(t))),
            "box_link": ("base", pt.transform((0, 5, 0))),
        }
        self.world.start_tf(100)
        self.start()
        self.world.repeat(20, self.send_late_cloud)
        counts = lambda m: (m.sources[0].points_on_robot, m.sources[0].points_used)  # noqa: E731
        self.node.wait_for(
            lambda m: m.status == ProximityArray.OK and counts(m) == (len(BALL), 1),
            "the ball's points dropped, and the obstacle kept",
        )
        for message in self.node.next_messages(60):
            if message.status == ProximityArray.OK:
                self.assertEqual(counts(message), (len(BALL), 1))

    def check_filter(self, case, robot, srdf="", **parameters):
        """Starts a node, and waits until so many of four points are the robot's."""
        namespace = self.namespace + case
        sphere = "<collision><geometry><sphere radius='%g'/></geometry></collision>"
        links = {"ball_link": 0.1, "hull": 0.18, "tool": 0.05}
        joint = "<joint name='to_%s' type='%s'><parent link='%s'/><child link='%s'/>%s</joint>"
        urdf = "<robot name='r'><link name='base'/>%s%s%s%s</robot>" % (
            "".join("<link name='%s'>%s</link>" % (n, sphere % r) for n, r in links.items()),
            joint % ("ball", "continuous", "base", "ball_link", "<axis xyz='0 1 0'/>"),
            joint % ("hull", "fixed", "ball_link", "hull", ""),
            joint % ("tool", "continuous", "base", "tool", "<origin xyz='0 0.5 0'/>"),
        )
        self.world.stop()
        self.world = pt.World(namespace)
        self.world.poses = {name: ("base", pt.transform()) for name in links}
        self.world.poses["tool"] = ("base", pt.transform((0, 0.5, 0)))
        # On ball_link, between it and the hull, on the tool, and on none.
        self.world.points = np.array([[0.1, 0, 0], [0.15, 0, 0], [0, 0.5, 0.05], [0, -0.5, 0]])
        self.world.start_tf()
        self.world.start_clouds()
        if srdf:
            rospy.set_param(namespace + "/robot_description_semantic", srdf)
        self.node = pt.ProximityNode(namespace, parameters, urdf)
        message = self.node.wait_for(
            lambda m: m.status == ProximityArray.OK
            and (m.sources[0].points_on_robot, m.sources[0].points_used) == (robot, 4 - robot),
            "%d points on the robot" % robot,
        )
        return message

    def test_coarse_hulls(self):
        """What is between a link and a hull about it is an obstacle; the SRDF says what hulls are."""
        srdf = (
            "<robot name='r'><disable_default_collisions link='%s'/>"
            "<enable_collisions link1='hull' link2='tool'/><disable_colisions/></robot>"
        )
        around = "hull (around ball_link)"
        with self.subTest("without an SRDF"):
            message = self.check_filter("alone", 2)
            self.assertEqual(pt.link(message, "hull").state, LinkProximity.CONTACT)
            self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.05, 3)
            self.assertEqual(self.node.log().count(around), 1)
            self.node.wait_for_value("model", "warning", re.escape(around))
            self.assertEqual(self.node.stop(), 0)
        with self.subTest("off in the SRDF"):
            message = self.check_filter("off", 2, srdf % "hull", **{"self_collision/enabled": True})
            self.assertEqual([one.link for one in message.links], ["ball_link", "tool"])
            self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.05, 3)
            self.node.wait_for_value("model", "links left out", re.escape(around))
            told = "<disable_colisions> (line 1)"
            self.assertEqual(self.node.log().count(told), 1)
            self.assertIn(told, self.node.diagnostic("model", "warning"))
            topic = self.node.name + "/self_proximity"
            own = rospy.wait_for_message(topic, ProximityArray, 10)
            self.assertEqual([one.link for one in own.links], ["ball_link", "tool", "hull"])
            self.assertAlmostEqual(pt.link(own, "hull").distance, 0.5 - 0.18 - 0.05, 3)
            self.assertEqual(self.node.stop(), 0)
            # What only informs is in the log when its buffer is written, at the end at the latest.
            self.assertEqual(self.node.log().count(around), 1)
        for case, robot, parameters in (
            ("monitored", 1, {"links": ["ball_link"]}),
            ("all", 3, {"links": ["ball_link"], "self_filter_links": "all"}),
            ("named", 2, {"self_filter_links": ["ball_link", "tool"]}),
            ("padded", 3, {"self_filter_padding": {"default": 0.01, "ball_link": 0.06}}),
        ):
            with self.subTest(case):
                self.check_filter(case, robot, **parameters)
                if case != "padded":
                    self.assertEqual(self.node.stop(), 0)


if __name__ == "__main__":
    pt.run("self_filter_test", SelfFilterTest, anonymous=True)
