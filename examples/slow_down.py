#!/usr/bin/env python3
"""Passes joint velocities on, slowed down near obstacles.

    rosrun ist_proximity slow_down.py wanted:=task/velocities allowed:=velocity_controller/command

wanted:  subscribed, std_msgs/Float64MultiArray, the task's joint velocities
allowed: published at 100 Hz, the same times the speed scale; 0 where either is missing or old
"""

import rospy
from ist_proximity.msg import SpeedScaleState
from std_msgs.msg import Float64MultiArray

RATE = 100.0  # [Hz]
MAX_AGE = 0.1  # [s] Five messages of a node at 50 Hz may be lost; then the robot stops.


class SlowDown:
    def __init__(self):
        self.state, self.wanted, self.wanted_at = None, [], rospy.Time()
        self.allowed = rospy.Publisher("allowed", Float64MultiArray, queue_size=1)
        rospy.Subscriber("proximity/speed_scale_state", SpeedScaleState, self.on_state, queue_size=1)
        rospy.Subscriber("wanted", Float64MultiArray, self.on_wanted, queue_size=1)
        rospy.Timer(rospy.Duration(1.0 / RATE), self.send)

    def on_state(self, state):
        self.state = state

    def on_wanted(self, message):
        self.wanted, self.wanted_at = message.data, rospy.Time.now()

    def send(self, _):
        state, scale, text = self.state, 0.0, "no fresh speed scale, or no fresh velocities"
        oldest = min(self.wanted_at, state.header.stamp) if state else rospy.Time()
        if state and (rospy.Time.now() - oldest).to_sec() <= MAX_AGE:
            scale, text = state.scale, state.text
        if scale < 1.0:
            rospy.loginfo_throttle(1.0, "%.0f %% of the speed: %s" % (100 * scale, text))
        self.allowed.publish(data=[scale * velocity for velocity in self.wanted])


if __name__ == "__main__":
    rospy.init_node("slow_down")
    SlowDown()
    rospy.spin()
