#!/usr/bin/env python3
"""Faults of link poses: tf and joint states stop, jump, contradict one another, err about the time."""

import os
import subprocess
import sys
import time

import faults
import numpy as np
import proximity_testing as pt
import rospy
from faults import PERIOD, POSE_TIMEOUT
from joint_states_test import ARM, arm_poses
from proximity_testing import LinkProximity, ProximityArray
from sensor_msgs.msg import JointState

LIMIT = POSE_TIMEOUT + PERIOD
# Without joint states, answers come ten times a second.
IDLE_PERIOD = 0.1
OBSTACLE = np.array([[0.0, 0.0, 0.5]])  # in base, standing still
BOTH = ("ball_link", "box_link")
SECOND_PUBLISHER = """
import sys, time
sys.path.insert(0, %r)
import proximity_testing as pt
import rospy
rospy.init_node('second')
publisher = rospy.Publisher('%s/tf', pt.TFMessage, queue_size=10)
while publisher.get_num_connections() == 0:
    time.sleep(0.01)
print('up', flush=True)
while True:
    X = pt.transform((0, 0.3, 0))
    publisher.publish([pt.transform_message('base', 'ball_link', X, rospy.Time.now())])
    time.sleep(0.02)
"""


class PosesTest(faults.FaultTest):
    """The obstacle stands still, the ball goes up and down; truth belongs to the stamp of the poses."""

    def setUp(self):
        super().setUp()
        self.sensor = None
        self.begin = time.monotonic()
        self.offset, self.ball, self.is_ahead = 0.0, self.moving_ball, False
        self.world.points = OBSTACLE
        self.extra_limit = 0.0

    def moving_ball(self):
        return 0.1 * np.sin(1.3 * (time.monotonic() - self.begin))

    def send_tf(self):
        stamp = rospy.Time.now() + rospy.Duration(self.offset)
        z = self.ball()
        self.poses.add(stamp, OBSTACLE[0, 2] - z - pt.BALL_RADIUS)
        self.world.publish_transforms(
            [
                pt.transform_message("base", "ball_link", pt.transform((0, 0, z)), stamp),
                pt.transform_message("base", "box_link", faults.FAR_BOX, stamp),
            ]
        )

    def start(self, **parameters):
        self.nodes.append(faults.TimedNode(self.namespace, parameters, pt.urdf()))
        self.tf = self.world.repeat(50, self.send_tf)
        self.world.start_clouds(30)
        self.nodes[-1].wait_for_status(ProximityArray.OK)
        return self.nodes[-1]

    def check_message(self, node, received, message):
        """Distances belong to the poses of header.stamp; those were sent a timeout ago at most."""
        if not self.known(message):
            return
        ball = pt.link(message, "ball_link")
        if self.is_ahead:  # at rest: header.stamp is between stamps, or before the first
            found = self.poses.latest(received)
        else:
            found = self.poses.between(message.header.stamp)
        self.assertIsNotNone(found, "poses of an instant that was not sent: %s" % message)
        sent, truth = found
        age, limit = received - sent, POSE_TIMEOUT + PERIOD + self.extra_limit
        if age > limit:
            limit += self.slack(node, sent, received)
        self.assertLess(age, limit, "known although the poses are too old: %s" % message)
        self.check_distance(ball, truth)

    def pause(self, node):
        """Returns the time of the last poses, which are answered; none are sent afterwards."""
        return faults.settle(node, self.tf, self.poses, lambda message: message.header.stamp)

    def halt(self):
        self.tf.paused = True
        time.sleep(0.05)
        return self.poses.newest

    def stop_and_resume(self, node, text, links=BOTH, timeout=POSE_TIMEOUT):
        # Where stamps are ahead, the answers' are not those of what was sent.
        last = self.pause(node) if self.offset == 0 else self.halt()
        message, reaction = self.react(
            node, last, ProximityArray.NO_POSE, text, links, timeout=timeout
        )
        self.offset = 0.0
        since = time.monotonic()
        self.tf.paused = False
        return message, reaction, self.recover(node, since)

    def break_poses(self, node, text, links=BOTH, function=None, offset=0.0):
        """Sends other poses for a while; returns message, reaction [ms] and recovery [ms]."""
        last = self.pause(node)
        whole, self.tf.function = self.tf.function, function or self.tf.function
        self.offset, self.tf.paused = offset, False
        message, reaction = self.react(
            node, last, ProximityArray.NO_POSE, text, links, timeout=POSE_TIMEOUT
        )
        self.halt()
        self.tf.function, self.offset = whole, 0.0
        since = time.monotonic()
        self.tf.paused = False
        return message, reaction, self.recover(node, since)

    def test_tf_stops(self):
        message, reaction, recovery = self.stop_and_resume(self.start(), "ball_link")
        self.record("tf stops", "no link's transform any more", message, reaction,
                    "with the next transforms", recovery, LIMIT)

    def test_tf_ahead_then_stops(self):
        self.offset, self.ball, self.is_ahead = 0.4, lambda: 0.05, True
        message, reaction, recovery = self.stop_and_resume(self.start(), "")
        self.record("tf's clock is ahead, then tf stops", "stamps 0.4 s ahead; then no transform",
                    message, reaction, "with transforms of the present", recovery, LIMIT)

    def test_one_frame_stops(self):
        """The other link goes on, at the present."""
        node = self.start()

        def box_is_missing():
            stamp = rospy.Time.now()
            z = self.ball()
            X = pt.transform((0, 0, z))
            self.world.publish_transforms([pt.transform_message("base", "ball_link", X, stamp)])
            self.poses.add(stamp, OBSTACLE[0, 2] - z - pt.BALL_RADIUS)

        # While the box's pose counts, the instant of all poses is the box's.
        message, reaction, recovery = self.break_poses(node, "box_link", ("box_link",), box_is_missing)
        self.assertTrue(self.known(message))
        self.record("one link's transform stops", "the other links' go on", message, reaction,
                    "the others stay known; with its next transform", recovery, LIMIT)

    def test_tf_jumps(self):
        """A link is suddenly 0.2 m away: the next answer is about the new pose, not between."""
        node = self.start()
        jump = 0.2
        self.pause(node)
        since = time.monotonic()
        self.ball = lambda: self.moving_ball() - jump
        self.tf.paused = False
        recovery = self.recover(
            node, since,
            lambda m: (self.poses.find(m.header.stamp) or (0, 0))[0] >= since
            and pt.link(m, "ball_link").state == LinkProximity.NEAR,
        )
        node.wait_for(lambda m: len(node.messages) > 300, "answers after the jump", start=0)
        message = node.wait_for_status(ProximityArray.OK)
        self.record("tf jumps", "a link is 0.2 m farther at once", message, None,
                    "its next pose is answered", recovery,
                    said="every distance is that of the pose at header.stamp")

    def test_tf_goes_back_in_time(self):
        message, reaction, recovery = self.break_poses(self.start(), "", offset=-5.0)
        self.record("tf's clock goes back", "stamps jump back by 5 s", message, reaction,
                    "with transforms of the present", recovery, LIMIT)

    def test_tf_has_two_publishers(self):
        """A second node publishes one frame, elsewhere: told, and no pose between is current."""
        node = self.start()
        self.check_message = lambda *arguments: None  # no pose is the true one
        program = SECOND_PUBLISHER % (os.path.dirname(os.path.realpath(__file__)), self.namespace)
        second = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE)
        try:
            second.stdout.readline()
            since = time.monotonic()
            message = node.wait_for(lambda m: "publishers" in m.status_text, "a word on it")
            reaction = 1e3 * (time.monotonic() - since)
        finally:
            second.kill()
            second.wait()
            second.stdout.close()
        since = time.monotonic()
        recovery = self.recover(node, since)
        self.record("tf has a second publisher", "two poses of one link, 0.3 m apart, 50 Hz each",
                    message, None, "told after %.0f ms; OK after its end" % reaction, recovery)


class JointsTest(PosesTest):
    """The same with pose_source joint_states: a slide that carries the ball."""

    OBSTACLE_B = np.array([[0.0, 0.0, 0.9]])

    def slide(self):
        return 0.4 + 0.1 * np.sin(1.3 * (time.monotonic() - self.begin))

    def setUp(self):
        super().setUp()
        self.publisher = rospy.Publisher(self.namespace + "/joint_states", JointState, queue_size=100)
        self.extra_limit = IDLE_PERIOD

    def send_joints(self):
        stamp = rospy.Time.now() + rospy.Duration(self.offset)
        q = {"turn": 0.3, "slide": self.slide()}
        message = JointState(name=list(q), position=list(q.values()))
        message.header.stamp = stamp
        X = arm_poses(**q)["ball_link"]
        p = pt.apply(pt.inverse(X), self.OBSTACLE_B)
        self.poses.add(stamp, float(pt.distance_to_ball(p)[0]))
        self.publisher.publish(message)

    def start(self, **parameters):
        parameters.update(pose_source="joint_states")
        self.nodes.append(faults.TimedNode(self.namespace, parameters, ARM))
        self.tf = self.world.repeat(100, self.send_joints)
        self.world.start_points(self.OBSTACLE_B, rate=30)
        self.nodes[-1].wait_for_status(ProximityArray.OK)
        return self.nodes[-1]

    def test_joints_stop(self):
        message, reaction, recovery = self.stop_and_resume(
            self.start(), "joint", timeout=POSE_TIMEOUT + IDLE_PERIOD
        )
        self.record("joint states stop", "none any more (then 10 answers a second)", message,
                    reaction, "with the next joint state", recovery, LIMIT + IDLE_PERIOD)

    def test_joints_ahead_then_stop(self):
        self.offset, self.slide, self.is_ahead = 0.4, lambda: 0.45, True
        message, reaction, recovery = self.stop_and_resume(
            self.start(), "", timeout=POSE_TIMEOUT + IDLE_PERIOD
        )
        self.record("joint states' clock is ahead, then they stop", "stamps 0.4 s ahead; then none",
                    message, reaction, "with joint states of the present", recovery,
                    LIMIT + IDLE_PERIOD)

    def test_one_joint_is_refused(self):
        """One joint is NaN while the other goes on: its links are not called current."""
        node = self.start()

        def send_with_nan():
            message = JointState(name=["turn", "slide"], position=[0.3, np.nan])
            message.header.stamp = rospy.Time.now()
            self.publisher.publish(message)

        message, reaction, recovery = self.break_poses(node, "slide", function=send_with_nan)
        self.record("one joint is NaN", "the other joints of the message are right", message,
                    reaction, "with its next position", recovery, LIMIT)


# Each test of the base class belongs to tf.
for name in [name for name in dir(PosesTest) if name.startswith("test_")]:
    setattr(JointsTest, name, None)


if __name__ == "__main__":
    pt.run("faults_poses_test", {"tf": PosesTest, "joints": JointsTest})
