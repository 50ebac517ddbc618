#!/usr/bin/env python3
"""Faults of joint states, tf and clocks: what the node says, how soon, and how it recovers.

Run with other arguments, this program is a second publisher: two nodes cannot be in one process.
"""

import subprocess
import sys
import time

import numpy as np
import proximity_testing as pt
import rospy
from joint_states_test import ARM, JointStatesTest, motion
from proximity_testing import LinkProximity, ProximityArray, joint_state
from sensor_msgs.msg import JointState

STILL = {"turn": 0.3, "slide": 0.5}
PERIOD = 0.01  # [s] of the joint states
SLACK = 0.3  # [s] that a busy machine may add


def run_rival(kind, namespace):
    """Publishes once the node listens, until it is killed."""
    rospy.init_node("rival")
    publisher = rospy.Publisher(namespace + "/joint_states", JointState, queue_size=10)
    pt.wait_until(lambda: publisher.get_num_connections() > 0, "the node")
    if kind == "names":
        names = ["joint_%d" % i for i in range(1000000)]
        publisher.publish(JointState(name=names, position=[0.0] * len(names)))
        time.sleep(30.0)  # the node reads on
    rate = rospy.Rate(50)
    while not rospy.is_shutdown():
        publisher.publish(joint_state({"turn": 1.0}))
        rate.sleep()


class PoseFaultsTest(pt.NodeTest):
    BOX, MAX_DISTANCE = None, 2.0

    def setUp(self):
        super().setUp()
        self.publisher = JointStatesTest.joint_publisher(self.namespace)
        self.rival = None
        self.change = lambda message: message  # of each joint state before it is sent
        self.received = []  # (time of receipt, message)
        self.good = rospy.Time(0)  # stamp of the last joint state that is as it should be

    def tearDown(self):
        if self.rival:
            self.rival.kill()
            self.rival.wait()
        super().tearDown()
        stamps = [message.header.stamp for _, message in self.received]
        self.assertEqual(stamps, sorted(stamps))

    def start(self, urdf=ARM, pose_source="joint_states", **parameters):
        super().start(urdf, pose_source=pose_source, max_distance=2.0, self_filter=False, **parameters)
        self.node.subscribe(
            "proximity", ProximityArray, lambda m: self.received.append((rospy.Time.now(), m))
        )
        self.clouds = self.world.start_points([[0.6, 0.6, 0.6]])
        return self.node

    def start_joints(self, moving=True):
        def send():
            stamp = rospy.Time.now()
            message = joint_state(motion(stamp.to_sec()) if moving else STILL, stamp)
            changed = self.change(message)
            if changed is not None:
                if changed is message:
                    self.good = stamp
                self.publisher.publish(changed)

        return self.world.repeat(1.0 / PERIOD, send)

    def start_rival(self, kind):
        self.rival = subprocess.Popen(
            [sys.executable, __file__, "rival", kind, self.namespace, "__name:=rival_" + kind]
        )

    def first(self, status, after):
        """Returns the time at which the first message with a status came after another time."""

        def times():
            return [t for t, m in list(self.received) if m.status == status and t > after]

        pt.wait_until(times, "status %d" % status)
        return min(times())

    def disturb(self, change, words, limit):
        """Changes the joint states; returns the messages until the node names the fault.

        No message after that of `limit` [s] says OK, and none before is about a later instant than
        the last good joint state.
        """
        self.node.wait_for_status(ProximityArray.OK)
        begin = len(self.node.messages)
        self.change = change
        pt.wait_until(lambda: rospy.Time.now() > self.good + rospy.Duration(2 * PERIOD), "a change")
        good = self.good
        message = self.node.wait_for_status(ProximityArray.NO_POSE, words, start=begin)
        told = self.first(ProximityArray.NO_POSE, good)
        print("%s: %.0f ms" % (words, 1e3 * (told - good).to_sec()))
        self.assertLess((told - good).to_sec(), limit + SLACK)
        self.node.next_messages(6)
        for t, m in self.received:
            if m.status == ProximityArray.OK and t > good:
                self.assertLessEqual(m.header.stamp, good + rospy.Duration(limit))
        return message

    def recover(self):
        self.change = lambda message: message
        self.node.wait_for_status(ProximityArray.OK)

    def test_refused_joint(self):
        """A joint whose newest sample is refused while the others move is told at once."""
        node = self.start()
        self.start_joints()

        def change_turn(q):
            def change(message):
                message.position = [q if n == "turn" else p for n, p in zip(message.name, message.position)]
                return JointState(message.header, message.name, message.position, [], [])

            return change

        message = self.disturb(change_turn(np.nan), "joint 'turn' is NaN", PERIOD)
        self.assertNotIn("does everything that moves joints publish", message.status_text)
        self.assertIn("older than that of joint 'slide'", message.status_text)
        self.recover()
        self.disturb(change_turn(1e12), "'turn' is 1e+12 rad: allowed is up to", PERIOD)
        self.recover()

        def twice(message):
            header, name, position = message.header, message.name, message.position
            return JointState(header, name + ["turn"], position + [position[0] + 1.0], [], [])

        self.disturb(twice, "joint 'turn' is stated twice in a message", PERIOD)
        self.recover()

        def without_slide(message):
            keep = message.name.index("turn")
            return JointState(message.header, ["turn"], [message.position[keep]], [], [])

        # One and a half times the usual spacing is allowed, and the spacing is not even.
        message = self.disturb(without_slide, "joint 'slide'", 4 * PERIOD)
        self.assertIn("older than that of joint 'turn'; its samples come every", message.status_text)
        self.recover()

        # Far outside its limits, by a wrong unit.
        def in_millimetres(message):
            position = [500.0 if n == "slide" else p for n, p in zip(message.name, message.position)]
            return JointState(message.header, message.name, position, [], [])

        self.change = in_millimetres
        node.wait_for_status(ProximityArray.DEGRADED, "joint 'slide' is at 500, far outside")
        self.recover()

    def test_refused_messages(self):
        """Joint states that come and cannot be used: the text has the reason, not a dead publisher."""
        self.start(pose_timeout=0.2)
        self.start_joints(moving=False)

        def changed(**fields):
            def change(message):
                copy = JointState(message.header, message.name, message.position, [], [])
                if "stamp" in fields:
                    copy.header.stamp = fields["stamp"]()
                copy.position = fields.get("position", copy.position)
                return copy

            return change

        for words, change in (
            ("2 names and 1 positions", changed(position=[1.0])),
            ("has no stamp (0)", changed(stamp=lambda: rospy.Time(0))),
            ("100.00 s in the future", changed(stamp=lambda: rospy.Time.now() + rospy.Duration(100))),
            ("is NaN or infinite", changed(position=[np.nan, np.nan])),
        ):
            message = self.disturb(change, words, 0.2)
            self.assertNotIn("does everything that moves joints publish", message.status_text)
            self.recover()
        message = self.disturb(lambda message: None, "is 0.2", 0.2)
        self.assertIn("does everything that moves joints publish", message.status_text)

    def check_ahead(self, stop, status, timeout):
        """Stamps lie in no future, and ages count from receipt."""
        node = self.node
        node.wait_for_status(ProximityArray.OK)
        begin = len(self.received)
        node.wait_for(lambda m: len(self.received) > begin + 50, "messages")
        for t, m in self.received:
            self.assertLess((m.header.stamp - t).to_sec(), 0.0, m.status_text)
            for source in m.sources:
                counted = m.header.stamp.to_sec() - source.age  # NaN before the first cloud
                self.assertFalse(counted > t.to_sec() + 0.001, source)
        stop()
        stopped = rospy.Time.now()
        node.wait_for_status(status)
        told = self.first(status, stopped)
        print("%d: %.0f ms after the last input" % (status, 1e3 * (told - stopped).to_sec()))
        self.assertLess((told - stopped).to_sec(), timeout + SLACK)

    def test_joint_states_ahead(self):
        node = self.start(pose_timeout=0.3)

        def ahead(message):
            message.header.stamp += rospy.Duration(0.8)
            return message

        self.change = ahead
        joints = self.start_joints()
        node.wait_for_status(ProximityArray.OK)
        node.wait_for_diagnostic("pose", "ahead of the clock")
        self.check_ahead(joints.stop, ProximityArray.NO_POSE, 0.3)
        self.assertIn("ahead of the clock", node.log())
        # A clock that is right again is no old one.
        self.change = lambda message: message
        self.start_joints()
        started = rospy.Time.now()
        node.wait_for_status(ProximityArray.OK)
        self.assertLess((rospy.Time.now() - started).to_sec(), SLACK)

    def test_clouds_ahead(self):
        """Joint states are ahead too, as tf has to know the robot when a cloud was taken."""
        node = self.start(cloud_timeout=0.4)
        self.clouds.stop()
        publisher = self.world.cloud_publisher

        def send():
            stamp = rospy.Time.now() + rospy.Duration(0.25)
            publisher.publish(pt.cloud([[0.6, 0.6, 0.6]], "base", stamp))

        clouds = self.world.repeat(20, send)
        self.start_joints()
        node.wait_for_status(ProximityArray.OK)
        node.wait_for_diagnostic("input cloud", "ahead of the clock")
        self.check_ahead(clouds.stop, ProximityArray.STALE_CLOUD, 0.4)

    def test_refused_transforms(self):
        """The text has the reason, and the log one line in five seconds."""
        node = self.start(pt.urdf(), pose_source="tf", pose_timeout=0.2)
        self.world.stand(box=pt.transform((0, 0.8, 0)))
        tf = self.world.start_tf()
        node.wait_for_status(ProximityArray.OK)

        def send(change):
            message = pt.transform_message("base", "ball_link", pt.transform(), rospy.Time.now())
            change(message)
            self.world.publish_transforms([message])

        def not_finite(message):
            message.transform.translation.x = np.nan

        def not_unit(message):
            message.transform.rotation.w = 1.1

        for change, words in (
            (not_finite, "it holds NaN or infinity"),
            (not_unit, "its quaternion has length 1.1"),
            (lambda m: setattr(m.header, "stamp", rospy.Time(0)), "has no stamp (0)"),
        ):
            tf.paused = True
            repeater = self.world.repeat(100, lambda change=change: send(change))
            message = node.wait_for_status(ProximityArray.NO_POSE, words)
            self.assertIn("the transform from 'ball_link' to 'base'", message.status_text)
            self.assertNotIn("is robot_state_publisher running", message.status_text)
            node.next_messages(50)
            repeater.stop()
            tf.paused = False
            node.wait_for_status(ProximityArray.OK)
        node._log.seek(0)
        lines = node._log.read().decode().splitlines()
        about_tf = [line for line in lines if "ball_link" in line or "TF_" in line or "tf2" in line]
        self.assertLess(len(about_tf), 10, "\n".join(about_tf))

    def test_a_fixed_joint_that_moves_in_another_urdf(self):
        """The sensor on it would be where the newest joint state has it, whatever its clouds' stamps."""
        node = self.start(ARM.replace('"turn" type="continuous"', '"turn" type="fixed"'))
        self.start_joints(moving=False)
        node.wait_for_status(ProximityArray.OK)
        rospy.set_param(self.namespace + "/robot_description", ARM)
        self.assertTrue(node.reload().success)
        message = node.wait_for_status(ProximityArray.NO_POSE, "'column' to 'base' was static, and ")
        self.assertTrue(pt.all_unknown(message))

    def test_a_sensor_that_turns_while_tf_is_silent(self):
        """tf2 interpolates its pose evenly over the silence, in which it stood still at first."""
        begin = [np.inf]
        eye = lambda t: pt.transform(angle=np.clip(t - begin[0], 0.0, 1.5))  # noqa: E731
        self.world.stand(ball=pt.transform((1, 0, 0)), box=pt.transform((0, 5, 0)))
        self.world.poses["eye"] = ("base", eye)
        tf = self.world.start_tf()
        obstacle = np.array([[1.0, 0.5, 0.0]])

        def send():
            stamp = rospy.Time.now()
            seen = pt.apply(pt.inverse(eye(stamp.to_sec())), obstacle)
            self.world.cloud_publisher.publish(pt.cloud(seen, "eye", stamp=stamp))

        node = self.start(pt.urdf(), pose_source="tf", cloud_timeout=1.0)
        self.clouds.stop()
        self.world.repeat(3, send)
        for _ in range(3):
            node.wait_for_status(ProximityArray.OK)
            tf.paused, begin[0] = True, rospy.Time.now().to_sec() + 0.5
            rospy.sleep(1.5)
            tf.paused, first = False, len(node.messages)
            ok = node.wait_for_status(ProximityArray.OK, start=first)
            node.wait_for(lambda m: m.cloud_stamp > ok.cloud_stamp, "the next cloud")
            for message in node.messages[first:]:
                ball = pt.link(message, "ball_link")
                if ball.state != LinkProximity.UNKNOWN:
                    # Where it begins and ends to turn, the transforms 20 ms apart are not on a line.
                    self.assertAlmostEqual(ball.distance, 0.4, delta=0.01)
            begin[0] = np.inf
            node.wait_for(lambda m, last=ok.cloud_stamp: (m.cloud_stamp - last).to_sec() > 1.0, "it to stand")

    def test_rival_of_joint_states(self):
        node = self.start()
        self.start_joints(moving=False)
        node.wait_for_status(ProximityArray.OK)
        self.start_rival("joints")
        message = node.wait_for_status(ProximityArray.NO_POSE, "has two publishers that disagree")
        self.assertIn("joint 'turn'", message.status_text)
        self.assertIn("/rival_joints", message.status_text)
        self.assertEqual({m.status for m in node.next_messages(100)}, {ProximityArray.NO_POSE})
        self.rival.kill()
        node.wait_for_status(ProximityArray.OK)

    def test_many_names(self):
        """A message with a million names does not stop the output."""
        node = self.start()
        self.start_joints(moving=False)
        node.wait_for_status(ProximityArray.OK)
        begin = len(self.received)
        self.start_rival("names")
        node.wait_for_value("pose", "positions that cannot be used", "^1000000$")
        node.wait_for(lambda m: len(self.received) > begin + 100, "messages after it")
        times = [t.to_sec() for t, _ in self.received[begin:]]
        print("the longest pause: %.0f ms" % (1e3 * np.diff(times).max()))
        self.assertLess(np.diff(times).max(), 0.1 + SLACK)
        self.assertEqual({m.status for _, m in self.received[begin:]}, {ProximityArray.OK})


if __name__ == "__main__":
    if "rival" in sys.argv:
        run_rival(*sys.argv[2:4])
        sys.exit()
    pt.run("pose_faults_test", PoseFaultsTest)
