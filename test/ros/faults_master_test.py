#!/usr/bin/env python3
"""Faults of the master: it dies, restarts empty, loses parameters; a configured margin stays."""

import os
import socket
import subprocess
import sys
import time

MARGIN = 0.05  # [m]
TIMEOUT = 3.0  # [s] of clouds and poses: a test that sends late on a loaded machine is no fault


def free_port():
    with socket.socket() as s:
        s.bind(("localhost", 0))
        return s.getsockname()[1]


PORT = free_port()
os.environ["ROS_MASTER_URI"] = "http://localhost:%d" % PORT  # before anything of ROS is imported

import faults  # noqa: E402
import proximity_testing as pt  # noqa: E402
import rosgraph  # noqa: E402
import rospy  # noqa: E402
from proximity_testing import ProximityArray  # noqa: E402


class Master:
    def __init__(self):
        self.process = None

    def start(self):
        self.process = subprocess.Popen(
            ["rosmaster", "--core", "-p", str(PORT)], stdout=subprocess.DEVNULL
        )
        pt.wait_until(rosgraph.is_master_online, "the master")

    def kill(self):
        self.process.kill()
        self.process.wait()


MASTER = Master()


class MasterTest(faults.FaultTest):
    def check_distance(self, one, truth, margin=0.0):
        """The margin is in every bound, from the first message on."""
        super().check_distance(one, truth, MARGIN)

    def start(self):
        self.cloud_timeout = TIMEOUT
        return super().start(
            **{"query/margin": MARGIN, "cloud_timeout": TIMEOUT, "pose_timeout": TIMEOUT}
        )

    def watch(self, node, seconds):
        """Every message of some seconds is OK; the bounds are checked at the end."""
        begin, since = len(node.messages), time.monotonic()
        time.sleep(seconds)
        messages = node.messages[begin:]
        self.assertGreater(len(messages), 10)
        for message in messages:
            self.assertEqual(message.status, ProximityArray.OK, message.status_text)
        gap = node.gap(since, time.monotonic())
        self.assertLess(gap, 1.0 + self.stalls.worst(since, time.monotonic()))
        return messages[-1]

    def says(self, node, words):
        """Whether log or diagnostics hold one of the words."""
        texts = [status.message for status in list(node.diagnostics.values())] + [node.log()]
        return any(word in text.lower() for text in texts for word in words)

    def wait_for_word(self, node, words):
        since = time.monotonic()
        node.wait_until(lambda: self.says(node, words), "a word on it, one of %s" % (words,), 10.0)
        return 1e3 * (time.monotonic() - since)


class MasterDiesTest(MasterTest):
    def test_master_dies_and_restarts(self):
        node = self.start()
        node.wait_until(lambda: len(node.diagnostics) >= 4, "diagnostics")
        MASTER.kill()
        told = self.wait_for_word(node, ("does not answer",))
        message = self.watch(node, 3.0)
        self.record("roscore dies", "kill -9; ~query/margin is 50 mm", message, None,
                    "told after %.0f ms, in log and diagnostics" % told, None,
                    said="OK, with the parameters of before: the margin stays")
        MASTER.start()  # which knows no node and no parameter
        message = self.watch(node, 3.0)
        lost = "no longer on the parameter server: ~query/margin (0.05 m)"
        self.assertIn(lost, node.diagnostic("query", "live parameters"))
        self.record("roscore restarts", "with an empty parameter server", message, None,
                    "connections and parameters stay; start the node again to be found by new nodes",
                    None, said="OK, with the parameters of before: the margin stays")
        # Something valid replaces the margin.
        rospy.set_param(node.name + "/query/margin", 2 * MARGIN)
        node.wait_for(
            lambda m: m.status == 0 and m.links[0].distance - m.links[0].lower_bound > 1.9 * MARGIN,
            "the new margin",
        )


class ParametersTest(MasterTest):
    def test_parameters_are_deleted(self):
        node = self.start()
        node.wait_until(lambda: len(node.diagnostics) >= 4, "diagnostics")
        rospy.delete_param(node.name + "/query")
        told = self.wait_for_word(node, ("parameter server",))
        message = self.watch(node, 2.5)
        rospy.set_param(node.name + "/query", "x")
        self.watch(node, 2.5)
        self.record("live parameters are deleted, or replaced by nonsense",
                    "rosparam delete, then set ~query to x", message, None,
                    "told after %.0f ms" % told, None,
                    said="OK, with the parameters of before: the margin stays")


if __name__ == "__main__":
    import rostest

    test = {"dies": MasterDiesTest, "parameters": ParametersTest}[sys.argv[1]]
    MASTER.start()
    try:
        rospy.init_node("faults_master_test", disable_signals=True)
        rostest.rosrun("ist_proximity", "faults_master_" + sys.argv[1], test, sys.argv)
    finally:
        MASTER.kill()
