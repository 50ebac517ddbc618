#!/usr/bin/env python3
"""The ROS master dies and comes back empty: the safety margin stays, and the loss is told.

The node and its robot run with a master of their own, which this test ends. Run with the argument
"robot", this program is that robot: it publishes, and prints what it receives.
"""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import numpy as np
import proximity_testing as pt
import rospy
from proximity_testing import ProximityArray

MARGIN = 0.05
DISTANCE = 0.2  # [m] of the point from the ball
NAMESPACE = "/lost"


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def run_robot():
    """Prints one line of JSON for each ~proximity and for each diagnostics of the query."""
    rospy.init_node("robot")
    world = pt.World(NAMESPACE).stand(box=pt.transform((0, 5, 0)))
    world.points = np.array([[pt.BALL_RADIUS + DISTANCE, 0.0, 0.0]])
    world.start_tf()
    world.start_clouds()
    lock = threading.Lock()

    def say(**what):
        with lock:
            print(json.dumps(what), flush=True)

    def on_message(message):
        if message.status == ProximityArray.OK:
            say(bound=pt.link(message, "ball_link").lower_bound)

    def on_diagnostics(raw):
        import genpy.dynamic

        header = raw._connection_header
        kinds = genpy.dynamic.generate_dynamic(header["type"], header["message_definition"])
        for status in kinds[header["type"]]().deserialize(raw._buff).status:
            if status.name.endswith(": query"):
                say(live={v.key: v.value for v in status.values}["live parameters"])

    rospy.Subscriber(NAMESPACE + "/proximity/proximity", ProximityArray, on_message)
    rospy.Subscriber("/diagnostics", rospy.AnyMsg, on_diagnostics)
    threading.Event().wait()


class LostMasterTest(unittest.TestCase):
    def setUp(self):
        self.port = free_port()
        self.uri = "http://127.0.0.1:%d/" % self.port
        self.env = dict(os.environ, ROS_MASTER_URI=self.uri, ROS_IP="127.0.0.1")
        self.processes, self.lines = [], []
        self.log = tempfile.TemporaryFile()
        self.master = self.start_master()

    def tearDown(self):
        for process in self.processes:
            if process.poll() is None:
                process.kill()
            process.wait()

    def run_process(self, command, **kwargs):
        self.processes.append(subprocess.Popen(command, env=self.env, **kwargs))
        return self.processes[-1]

    def start_master(self):
        process = self.run_process(
            ["rosmaster", "--core", "-p", str(self.port)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self.parameters = rospy.msproxy.MasterProxy(self.uri)

        def is_up():
            try:
                return self.parameters.getPid()[0] == 1
            except OSError:
                return False

        pt.wait_until(is_up, "the master")
        return process

    def start_robot(self):
        robot = self.run_process(
            [sys.executable, os.path.realpath(__file__), "robot"], stdout=subprocess.PIPE, text=True
        )

        def read():
            for line in robot.stdout:
                self.lines.append(json.loads(line))

        threading.Thread(target=read, daemon=True).start()

    def start_node(self):
        command = [pt.find_program("ist_proximity", "proximity_node")]
        remapped = ["%s:=%s%s" % (name, NAMESPACE, name) for name in ("/tf", "/tf_static")]
        return self.run_process(
            command + ["__ns:=" + NAMESPACE, "__name:=proximity"] + remapped,
            stdout=self.log,
            stderr=subprocess.STDOUT,
        )

    def wait_for_live(self, words):
        begin = len(self.lines)
        pt.wait_until(
            lambda: any(words in line.get("live", "") for line in self.lines[begin:]), words
        )
        return begin

    def check_bounds(self, begin, margin):
        bounds = [line["bound"] for line in self.lines[begin:] if "bound" in line]
        self.assertGreater(len(bounds), 50)
        self.assertLess(max(bounds), DISTANCE - margin + 1e-6)

    def test_margin(self):
        with tempfile.TemporaryDirectory() as cache:
            self.parameters[NAMESPACE + "/robot_description"] = pt.urdf()
            self.parameters[NAMESPACE + "/proximity"] = {
                "query": {"margin": MARGIN},
                "max_distance": 0.6,
                "cache_directory": cache,
            }
            node = self.start_node()
            self.start_robot()
            self.wait_for_live("as on the server")
            pt.wait_until(lambda: any("bound" in line for line in self.lines), "a bound")

            killed = time.monotonic()
            self.master.kill()
            self.master.wait()
            begin = self.wait_for_live("does not answer")
            self.assertLess(time.monotonic() - killed, 10.0)
            time.sleep(2.0)  # two more readings of the server
            self.check_bounds(begin, MARGIN)

            # The master is back, and empty.
            self.master = self.start_master()
            begin = self.wait_for_live("no longer on the parameter server: ~query/margin (0.05 m)")
            time.sleep(1.0)
            self.check_bounds(begin, MARGIN)
            # Something valid replaces the margin.
            self.parameters[NAMESPACE + "/proximity/query/margin"] = 0.1
            self.wait_for_live("as on the server")
            begin = len(self.lines)
            time.sleep(1.0)
            self.check_bounds(begin, 0.1)
            self.assertIsNone(node.poll())
            self.log.seek(0)
            self.assertIn("does not answer", self.log.read().decode())
            node.send_signal(signal.SIGINT)
            self.assertEqual(node.wait(pt.TIMEOUT), 0)

    def test_start_without_master(self):
        """A node that is told to end while it waits for the master ends, without a word of a crash."""
        self.master.kill()
        self.master.wait()
        node = self.start_node()

        def log():
            self.log.seek(0)
            return self.log.read().decode()

        pt.wait_until(lambda: "Failed to contact master" in log(), "the wait for the master")
        node.send_signal(signal.SIGINT)
        self.assertEqual(node.wait(pt.TIMEOUT), 0, log())
        self.assertNotIn("ASSERTION", log())


if __name__ == "__main__":
    if "robot" in sys.argv:
        run_robot()
    import rostest

    rospy.init_node("lost_master_test")
    rostest.rosrun("ist_proximity", "lost_master_test", LostMasterTest, sys.argv)
