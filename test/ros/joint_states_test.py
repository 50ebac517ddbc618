#!/usr/bin/env python3
"""pose_source joint_states: truth by forward kinematics; partial, late and wrong messages."""

import numpy as np
import proximity_testing as pt
import rospy
from proximity_testing import LinkProximity, ProximityArray, joint_state
from sensor_msgs.msg import JointState, PointCloud2
from stall_meter import undisturbed

# A column that turns and carries a slide with the ball; the box follows the slide, the other way.
ARM = """<robot name="arm">
  <link name="base"/> <link name="column"/> <link name="camera"/>
  <link name="ball_link"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="box_link"><collision><origin xyz="0.05 0 0.1"/><geometry>
    <box size="0.2 0.4 0.6"/></geometry></collision></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="column"/>
    <origin xyz="0 0 0.5"/><axis xyz="0 0 1"/></joint>
  <joint name="slide" type="prismatic"><parent link="column"/><child link="ball_link"/>
    <axis xyz="2 0 0"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="follow" type="prismatic"><parent link="column"/><child link="box_link"/>
    <axis xyz="1 0 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/>
    <mimic joint="slide" multiplier="-1.5" offset="-0.5"/></joint>
  <joint name="to_camera" type="fixed"><parent link="ball_link"/><child link="camera"/>
    <origin xyz="0.3 0 0"/></joint>
</robot>"""


def arm_poses(turn, slide, follow=None):
    """Returns X_BL by link; the mimic follows unless it is stated."""
    follow = -1.5 * slide - 0.5 if follow is None else follow
    column = pt.transform((0, 0, 0.5), angle=turn)
    ball = column @ pt.transform((slide, 0, 0))
    return {
        "ball_link": ball,
        "box_link": column @ pt.transform((follow, 0, 0)),
        "camera": ball @ pt.transform((0.3, 0, 0)),
    }


def arm_jacobians(turn, slide):
    """Returns the Jacobians of the links' origins in base, by link; columns turn, slide."""
    out = np.array([np.cos(turn), np.sin(turn), 0.0])  # the way that the slide goes
    left = np.array([-np.sin(turn), np.cos(turn), 0.0])

    def jacobian(reach, factor):
        J = np.zeros((6, 2))
        J[:3, 0], J[5, 0] = reach * left, 1.0
        J[:3, 1] = factor * out
        return J

    return {"ball_link": jacobian(slide, 1.0), "box_link": jacobian(-1.5 * slide - 0.5, -1.5)}


def motion(t):
    """Positions at a time [s]."""
    return {"turn": np.sin(0.7 * t), "slide": 0.4 + 0.2 * np.sin(t)}


class JointStatesTest(pt.NodeTest):
    CAMERA = BOX = None  # the arm's URDF has the camera

    def setUp(self):
        super().setUp()
        self.publisher = self.joint_publisher(self.namespace)
        self.still = None

    @staticmethod
    def joint_publisher(namespace):
        return rospy.Publisher(namespace + "/joint_states", JointState, queue_size=100)

    def start(self, urdf=ARM, **parameters):
        parameters.setdefault("pose_source", "joint_states")
        return super().start(urdf, **parameters)

    def send(self, *joints):
        """Publishes some joints, in motion or standing still at `self.still`."""
        stamp = rospy.Time.now()
        q = self.still or motion(stamp.to_sec())
        self.publisher.publish(joint_state({name: q[name] for name in joints}, stamp))
        return stamp

    def send_until_told(self, message, words):
        """Sends messages until the diagnostics have the words; returns the answers meanwhile."""
        node = self.node
        node.diagnostics.pop("pose", None)
        begin = len(node.messages)
        repeater = self.world.repeat(10, lambda: self.publisher.publish(message()))
        node.wait_for_diagnostic("pose", words)
        repeater.stop()
        return node.messages[begin:]

    def test_parts(self):
        """Several publishers, of which one is missing or wrong."""
        node = self.start(pose_timeout=0.4, max_distance=2.0)
        still = {"turn": 0.3, "slide": 0.5}
        X, points = arm_poses(**still), np.array([[0.6, 0.6, 0.6]])  # in base
        self.world.points = pt.apply(pt.inverse(X["camera"]), points)
        self.world.start_clouds()
        node.wait_for_status(ProximityArray.NO_POSE, "joint 'turn' has not come")
        sent = []
        self.world.repeat(100, lambda: sent.append(self.send("turn")))
        message = node.wait_for_status(ProximityArray.NO_POSE, "joint 'slide' has not come")
        self.assertIn("ball_link", message.status_text)
        self.assertIn("box_link", message.status_text)  # by way of its mimic
        self.assertTrue(pt.all_unknown(message))
        self.still = still
        self.world.repeat(20, lambda: self.send("slide"))
        node.wait_for_status(ProximityArray.OK)

        # Distances are those of the positions; every joint state is answered.
        begin, first = len(node.messages), len(sent)
        message = node.wait_for(
            lambda m: len(sent) > first + 100 and m.header.stamp >= sent[first + 95],
            "a second of joint states",
        )
        for name in ("ball_link", "box_link"):
            truth = pt.DISTANCE[name](pt.apply(pt.inverse(X[name]), points)).min()
            one = pt.link(message, name)
            self.assertLessEqual(one.lower_bound, truth + 1e-5)
            self.assertLessEqual(abs(one.distance - truth), 0.001 + 1e-5)
        answered = {m.header.stamp for m in node.messages[begin:]}
        stamps = sent[first + 5 : first + 95]
        self.assertGreater(len([s for s in stamps if s in answered]), 0.9 * len(stamps))

        truth_of_ball = pt.link(message, "ball_link").distance

        # Wrong messages are reported and change nothing that is known.
        wrong = {
            "1 names and 2 positions": lambda: JointState(name=["turn"], position=[1.0, 2.0]),
            "'turn' is NaN": lambda: joint_state({"turn": np.nan}),
            "'trun' is not in the URDF": lambda: joint_state({"trun": 1.0}),
            "no stamp": lambda: joint_state({"turn": 9.0}, rospy.Time(0)),
            "in the future": lambda: joint_state({"turn": 9.0}, rospy.Time.from_sec(4e9)),
            "outside its limits of 0 to 1": lambda: joint_state({"slide": -0.3}),
        }
        for words, bad in wrong.items():
            for m in undisturbed(lambda words=words, bad=bad: self.send_until_told(bad, words)):
                self.assertEqual(m.status, ProximityArray.OK, m.status_text)
                if "limits" not in words:  # that one is used all the same
                    self.assertAlmostEqual(pt.link(m, "ball_link").distance, truth_of_ball, 5)

        # A message with efforts alone holds no positions.
        self.publisher.publish(JointState(name=["turn"], effort=[1.0]))

        self.assertEqual(node.diagnostic("pose", "topic"), self.namespace + "/joint_states")
        self.assertGreater(int(node.diagnostic("pose", "joint states used")), 100)

    def test_stated_mimic(self):
        """A mimic joint is where it is stated, as with robot_state_publisher, or else follows."""
        node = self.start(max_distance=3.0)
        points = np.array([[0.6, 0.6, 0.6]])  # in base
        self.world.start_points(points)
        stated = {"turn": 0.3, "slide": 0.5, "follow": -1.0}  # it would be at -1.25
        self.world.repeat(100, lambda: self.publisher.publish(joint_state(stated)))

        def check(name, message):
            one = pt.link(message, name)
            X = arm_poses(**{"slide": np.nan, **stated})[name]
            truth = pt.DISTANCE[name](pt.apply(pt.inverse(X), points)).min()
            self.assertAlmostEqual(one.distance, truth, delta=0.001)
            self.assertLessEqual(one.lower_bound, truth + 1e-5)

        check("box_link", node.wait_for_status(ProximityArray.OK))
        node.wait_until(lambda: "pose" in node.diagnostics, "diagnostics")
        log = "joint 'follow' is stated at -1.000, but would be at -1.250 as a mimic of joint 'slide'"
        node._log.seek(0)
        self.assertEqual(node._log.read().decode().count(log), 1)

        # The mimic alone: its leader is not known.
        del stated["slide"]
        message = node.wait_for_status(ProximityArray.NO_POSE, "joint 'slide'")
        check("box_link", message)
        self.assertEqual(pt.link(message, "ball_link").state, LinkProximity.UNKNOWN)

        # A mimic that was not where its leader puts it is not known without a statement.
        stated["slide"] = 0.5
        node.wait_for_status(ProximityArray.OK)
        del stated["follow"]
        message = node.wait_for_status(ProximityArray.NO_POSE, "joint 'follow'")
        self.assertEqual(pt.link(message, "box_link").state, LinkProximity.UNKNOWN)
        check("ball_link", message)
        for message in node.next_messages(120):
            self.assertEqual(message.status, ProximityArray.NO_POSE)

        # One that was follows again.
        stated["follow"] = -1.25
        check("box_link", node.wait_for_status(ProximityArray.OK))
        del stated["follow"]
        node.wait_for_status(ProximityArray.NO_POSE)
        node.wait_for_status(ProximityArray.OK)
        stated["slide"] = 0.3
        check("box_link", node.next_messages(20)[-1])

    def test_outside_region_of_interest(self):
        """Points that no link can come near are dropped; a joint outside its limits misses them."""
        node = self.start(max_range=9.0, self_filter=False)
        seen = np.array([[0.6, 0.6, 0.6], [4.9, 0.0, 0.5]])  # in base, from which the box gets 2.8 m

        def stand(slide):
            self.still = {"turn": 0.0, "slide": slide}
            X = arm_poses(**self.still)
            self.world.points = pt.apply(pt.inverse(X["camera"]), seen)

        stand(0.5)
        self.world.repeat(50, lambda: self.send("turn", "slide"))
        self.world.start_clouds()
        message = node.wait_for_status(ProximityArray.OK)
        self.assertEqual(message.sources[0].points_used, 2)
        node.wait_for_value("input cloud", "points outside the region of interest", "^1$")
        self.assertEqual(pt.link(message, "ball_link").state, LinkProximity.NEAR)

        stand(3.4)  # at the far point, but for 1.4 m
        message = node.wait_for_status(ProximityArray.DEGRADED, "farther out than the limits")
        node.wait_for(lambda m: pt.all_unknown(m), "nothing known")

        # While somebody subscribes to the cloud, neither it nor the links' view is cropped.
        clouds = node.collect("filtered_cloud", PointCloud2)
        message = node.wait_for_status(ProximityArray.OK)
        node.wait_until(lambda: clouds and clouds[-1].width == 2, "both points")
        self.assertTrue(all(s == LinkProximity.CLEAR for s in pt.states(message)), message)
        stand(4.4)
        # The first cloud may be one that was made before the arm stood there.
        node.wait_for(
            lambda m: pt.link(m, "ball_link").state == LinkProximity.NEAR
            and abs(pt.link(m, "ball_link").distance - 0.4) < 5e-6,
            "0.4 m",
        )

    def test_limits_without_a_range(self):
        """Exporters write 0 to 0; the joints move all the same, and that is told once."""
        arm = ARM.replace('lower="0" upper="1"', 'lower="0" upper="0"').replace(
            '<joint name="turn" type="continuous">',
            '<joint name="turn" type="revolute"><limit effort="1" velocity="0"/>',
        )
        node = self.start(arm, max_range=9.0, self_filter=False)
        self.still = {"turn": 1.2, "slide": 4.4}
        X = arm_poses(**self.still)
        seen = pt.apply(X["ball_link"], np.array([[0.5, 0.0, 0.0]]))
        self.world.points = pt.apply(pt.inverse(X["camera"]), seen)
        self.world.repeat(50, lambda: self.send("turn", "slide"))
        self.world.start_clouds()
        message = node.wait_for_status(ProximityArray.OK)
        self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.4, 5)
        self.assertEqual(pt.link(message, "box_link").state, LinkProximity.CLEAR)
        messages = undisturbed(lambda: node.next_messages(50))
        self.assertTrue(all(m.status == ProximityArray.OK for m in messages))
        told = "taken to have none: 'slide', 'turn'"
        self.assertEqual(node.log().count(told), 1)
        node.wait_for_value("model", "warning", told)

    def test_moving(self):
        """Poses belong to the stamp; clouds of a camera on a link, late, with the robot in view;
        the robot on a base that tf moves and that is behind the joint states."""
        obstacle = np.array([[1.0, 1.0, 1.1]])  # in world; 0.2 m above all that moves

        def X_WB(t):
            return pt.transform((0.2, 0.1, 0.0), angle=0.4 * t)  # tf interpolates this exactly

        def send_late():
            """The obstacle, and the ball's surface as the camera on it sees it."""
            stamp = rospy.Time.now() - rospy.Duration(0.1)
            t = stamp.to_sec()
            X_WC = X_WB(t) @ arm_poses(**motion(t))["camera"]
            seen = np.vstack([pt.apply(pt.inverse(X_WC), obstacle), [[-0.2, 0, 0], [-0.3, 0.1, 0]]])
            self.world.cloud_publisher.publish(pt.cloud(seen, "camera", stamp))

        node = self.start(fixed_frame="world", max_distance=3.0, min_range=0.0)
        self.world.poses["base"] = ("world", lambda t: X_WB(t))
        # Transforms from elsewhere of a frame that is computed here are ignored.
        self.world.poses["ball_link"] = ("column", pt.transform((7, 7, 7)))
        self.world.start_tf(40)
        sent = []
        self.world.repeat(100, lambda: sent.append(self.send("turn", "slide")))
        self.world.repeat(20, send_late)
        node.wait_for_status(ProximityArray.OK)
        speeds = []
        for _ in range(60):
            message = node.wait_for_status(ProximityArray.OK)
            self.assertEqual(message.header.frame_id, "world")
            t = message.header.stamp.to_sec()
            self.assertLess(len([s for s in sent if s > message.header.stamp]), 100)
            X = arm_poses(**motion(t))
            for name in ("ball_link", "box_link"):
                X_WL = X_WB(t) @ X[name]
                truth = pt.DISTANCE[name](pt.apply(pt.inverse(X_WL), obstacle)).min()
                # The camera's pose lies between joint states, whose motion is not even.
                self.assertAlmostEqual(pt.link(message, name).distance, truth, delta=0.003)
            self.assertEqual(message.sources[0].points_on_robot, 2)
            speeds.append(pt.link(message, "ball_link").closing_speed)
        self.assertGreater(np.isfinite(speeds).mean(), 0.8)

    def test_joints_by_turns(self):
        """A joint that came before the other may have moved since: bounds hold at the stamp."""
        obstacle = np.array([[0.9, 0.6, 0.6]])  # in base
        node = self.start(max_distance=3.0, min_range=0.0, self_filter=False)
        turns = []

        def send_one():
            turns.append(self.send("slide" if len(turns) % 2 else "turn"))

        self.world.repeat(60, send_one)
        self.world.start_points(obstacle)
        node.wait_for_status(ProximityArray.OK)
        beyond, below = [], []
        for message in node.next_messages(200):
            X = arm_poses(**motion(message.header.stamp.to_sec()))
            for one in message.links:
                if one.state == LinkProximity.UNKNOWN:
                    continue
                truth = pt.DISTANCE[one.link](pt.apply(pt.inverse(X[one.link]), obstacle)).min()
                self.assertLessEqual(one.lower_bound, truth + 5e-4)
                beyond.append(one.distance - truth)
                below.append(truth - one.lower_bound)
        self.assertGreater(len(beyond), 300)
        self.assertGreater(max(beyond), 0.002)  # the joint that is late matters
        self.assertLess(np.median(below), 0.05)

    def test_a_joint_that_has_just_come(self):
        """Two of its positions do not tell how it speeds up, so its limit counts until the third."""
        begin, sent = [], []
        node = self.start(max_distance=3.0, self_filter=False)
        q = lambda t: 0.1 + 0.2 * min(t - begin[0], 1.5) ** 2  # noqa: E731: at 0.4 m/s^2

        def send_slide():
            stamp = rospy.Time.now()
            begin.append(stamp.to_sec())
            self.publisher.publish(joint_state({"slide": q(stamp.to_sec())}, stamp))
            sent.append(stamp)

        self.world.start_joints({"turn": 0.0})
        self.world.start_points(np.array([[0.9, 0.0, 0.5]]))
        node.wait_for(lambda m: m.sources and m.sources[0].status == ProximityArray.OK, "a cloud")
        self.world.repeat(4, send_slide)
        node.wait_until(lambda: len(sent) > 5, "some positions")
        after_two = 0
        for message in node.messages:
            one = pt.link(message, "ball_link")
            if one is None or one.state == LinkProximity.UNKNOWN:
                continue
            truth = 0.8 - q(message.header.stamp.to_sec())
            self.assertLessEqual(one.lower_bound, truth + 5e-4)
            after_two += sent[1] < message.header.stamp < sent[2]
        self.assertGreater(after_two, 5)

    def check_late_joint(self, place, period, part, is_silent=lambda phase: False, rate=100):
        """Bounds hold at the stamps of a joint that comes all the time, where the last positions of the
        other are of one `part` of its motion.
        """
        sent = []
        node = self.start(max_distance=3.0, self_filter=False)

        def send_slide():
            stamp = rospy.Time.now()
            if not is_silent(stamp.to_sec() % period):
                self.publisher.publish(joint_state({"slide": place(stamp.to_sec() % period)}, stamp))
                sent.append(stamp)

        self.world.start_joints({"turn": 0.0})
        self.world.start_points(np.array([[1.2, 0.0, 0.5]]))
        self.world.repeat(rate, send_slide)
        node.wait_for_status(ProximityArray.OK)
        sent.clear()  # it may have heard none of those
        over = []
        for message in node.next_messages(800):
            one, t = pt.link(message, "ball_link"), message.header.stamp.to_sec()
            last = [stamp.to_sec() for stamp in sent if stamp <= message.header.stamp][-4:]
            is_part = len(last) == 4 and part(t) and {part(s) for s in last} == {part(t)}
            if one.state == LinkProximity.UNKNOWN or not is_part:
                continue
            over.append(one.lower_bound - (1.1 - place(t % period)))
        self.assertGreater(len(over), 50)
        self.assertLess(max(over), 5e-4)

    def test_a_joint_that_is_faster_than_its_limit(self):
        """To and fro at 2 m/s; its URDF says 1 m/s."""
        self.check_late_joint(
            lambda t: 0.1 + 2.0 * min(t, 0.8 - t), 0.8, lambda t: 1 + t // 0.4, rate=40
        )

    def test_a_joint_that_is_silent_while_it_speeds_up(self):
        """At 8 m/s^2 for 0.3 s of each 1.2 s, and silent for 0.06 s of it."""
        place = lambda t: 0.1 + (4.0 * t * t if t < 0.3 else 0.36)  # noqa: E731
        begun = lambda t: t % 1.2 < 0.3 and 1 + t // 1.2  # noqa: E731
        self.check_late_joint(place, 1.2, begun, lambda t: 0.18 < t < 0.24)

    def test_burst(self):
        """Joint states that come all at once are answered one by one, in their order."""
        node = self.start(pose_timeout=5.0)
        self.world.points = np.array([[0.6, 0.6, 0.6]])
        self.world.start_clouds()
        steady = self.world.repeat(20, lambda: self.send("turn", "slide"))
        node.wait_for_status(ProximityArray.OK)
        steady.stop()
        begin = len(node.messages)
        stamp, sent = rospy.Time.now(), []
        for i in range(8):
            stamp += rospy.Duration(0.001)
            sent.append(stamp)
            self.publisher.publish(joint_state(motion(stamp.to_sec()), stamp))
        node.wait_for(lambda m: m.header.stamp == sent[-1], "the last answer", start=begin)
        stamps = [m.header.stamp for m in node.messages[begin:]]
        self.assertEqual([s for s in stamps if s in sent][:8], sent)
        self.assertEqual(stamps, sorted(stamps))

    def test_joint_repulsion(self):
        """Efforts of moving joints, a mimic among them; unknown efforts are NaN, with a reason."""
        node = self.start(max_distance=2.0)
        node.wait_for_status(ProximityArray.NO_CLOUD)
        self.world.start_points([[0.75, 0.1, 0.5], [-1.2, 0.1, 0.5], [-1.3, 0.05, 0.9]])
        joints = self.world.repeat(100, lambda: self.send("turn", "slide"))
        node.wait_for_status(ProximityArray.OK)
        check = pt.check_joint_repulsion(self, node, lambda t: arm_jacobians(**motion(t)))
        self.assertEqual(check.joints, ["turn", "slide"])

        # The efforts of joints that move unknown links are unknown.
        received = node.collect("joint_repulsion", pt.JointRepulsion)
        joints.stop()
        node.wait_until(lambda: received and np.isnan(received[-1].effort).all(), "NaN efforts")
        self.assertEqual(received[-1].status, ProximityArray.NO_POSE)
        self.assertNotEqual(received[-1].status_text, "")

    def test_joint_repulsion_from_tf(self):
        """The same from link poses alone; the effort of a joint whose axis is not in tf is NaN."""
        self.world.state_camera()
        node = self.start(max_distance=2.0, pose_source="tf")
        still = {"turn": 0.3, "slide": 0.5}
        X = arm_poses(**still)
        self.world.start_points([[0.75, 0.1, 0.5], [-1.2, 0.1, 0.5], [-1.3, 0.05, 0.9]])
        for name in ("ball_link", "box_link"):
            self.world.poses[name] = ("base", X[name])
        self.world.start_tf()
        node.wait_for_status(ProximityArray.OK)
        received = node.collect("joint_repulsion", pt.JointRepulsion)
        node.wait_until(lambda: received and received[-1].status != ProximityArray.OK, "a reason")
        self.assertEqual(received[-1].status, ProximityArray.NO_POSE)
        self.assertIn("the pose of link 'column' is not known", received[-1].status_text)
        self.assertTrue(np.isnan(received[-1].effort).all())

        self.world.poses["column"] = ("base", pt.transform((0, 0, 0.5), angle=still["turn"]))
        node.wait_until(lambda: received[-1].status == ProximityArray.OK, "the column")
        pt.check_joint_repulsion(self, node, lambda t: arm_jacobians(**still))

    def test_floating(self):
        """A floating joint's pose comes from tf, and is reported when it is missing."""
        self.world.state_camera()
        node = self.start(pt.urdf())
        self.world.points = np.array([[0.0, 0.0, 0.3]])
        self.world.start_clouds()
        node.wait_for_status(ProximityArray.NO_POSE, "'ball_link'")
        self.world.stand(box=pt.transform((0, 0.8, 0))).start_tf()
        message = node.wait_for_status(ProximityArray.OK)
        self.assertAlmostEqual(pt.link(message, "ball_link").distance, 0.2, 5)

    def test_another_axis(self):
        """After a reload, nothing is placed by where the joints had the links of the robot before."""
        slide = (
            '<robot name="slide"><link name="base"/><link name="ball"><collision><geometry>'
            '<sphere radius="0.1"/></geometry></collision></link><joint name="slide" '
            'type="prismatic"><parent link="base"/><child link="ball"/><axis xyz="%d 0 0"/>'
            '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>'
        )
        node = self.start(slide % 1, max_distance=3.0)
        stamps = []

        def state():
            stamps.append(rospy.Time.now())
            self.publisher.publish(joint_state({"slide": 0.4}, stamps[-1]))

        robot = self.world.repeat(100, state)
        points = [[0.4, 0.0, 0.0], [1.6, 0.0, 0.0]]  # the first one on the ball
        clouds = self.world.start_points(points)
        node.wait_for(lambda m: m.links and m.links[0].distance > 1.0, "the point on the ball dropped")
        clouds.stop()
        rospy.sleep(0.1)  # the next cloud is later than all of these
        robot.paused = True
        rospy.sleep(0.05)
        rospy.set_param(self.namespace + "/robot_description", slide % -1)
        self.assertTrue(node.reload().success)
        begin = len(node.messages)
        before = stamps[-1]
        robot.paused = False
        node.wait_for_status(ProximityArray.NO_CLOUD, start=begin)
        self.world.cloud_publisher.publish(pt.cloud(points, "base", before))
        for message in node.next_messages(30):
            for link in message.links:  # 0.8 m from the ball's middle
                known = message.status == ProximityArray.OK
                self.assertFalse(known and link.lower_bound > 0.7 + 1e-3, link.lower_bound)
        self.world.start_points(points)
        node.wait_for(
            lambda m: m.status == 0 and abs(m.links[0].distance - 0.7) < 1e-3, "0.7 m", start=begin
        )

    def test_faulty_mimic(self):
        """Impossible kinematics are reported, and nothing is known."""
        node = self.start(ARM.replace('mimic joint="slide"', 'mimic joint="silde"'))
        self.world.points = np.array([[0.6, 0.6, 0.6]])
        self.world.start_clouds()
        node.wait_for_unknown(ProximityArray.NO_POSE, "mimics joint 'silde'")


if __name__ == "__main__":
    pt.run("joint_states_test", JointStatesTest)
