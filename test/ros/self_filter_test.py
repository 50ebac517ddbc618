#!/usr/bin/env python3
"""The self-filter takes the robot as it was when the sensor saw it: at the cloud's stamp.

A ball flies at 1 m/s. Its cloud arrives 0.3 s late, when the ball is 0.3 m farther. The robot at the
newest transform would leave every point of the ball in the cloud as an obstacle, and would drop the
obstacle that is where the ball has come to.
"""

import sys

import numpy as np
import proximity_testing as pt
import rospy
from proximity_testing import ProximityArray

LATE = 0.3  # [s] of the clouds
SPEED = 1.0  # [m/s]
SHELL = pt.BALL_RADIUS * 0.95
ANGLES = np.linspace(0, 2 * np.pi, 40, endpoint=False)
BALL = SHELL * np.column_stack([np.cos(ANGLES), np.sin(ANGLES), 0 * ANGLES])


class SelfFilterTest(pt.NodeTest):
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
        begin = len(self.node.messages)
        self.node.wait_for(lambda m: len(self.node.messages) > begin + 60, "60 more answers")
        for message in self.node.messages[begin:]:
            if message.status == ProximityArray.OK:
                self.assertEqual(counts(message), (len(BALL), 1))


if __name__ == "__main__":
    import rostest

    rospy.init_node("self_filter_test", anonymous=True)
    rostest.rosrun("ist_proximity", "self_filter", SelfFilterTest, sys.argv)
