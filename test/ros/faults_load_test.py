#!/usr/bin/env python3
"""Faults of load: a sensor that floods, an ingest slower than its timeout, a slow subscriber."""

import os
import subprocess
import sys
import time

import faults
import numpy as np
import proximity_testing as pt
import rospy
from faults import PERIOD
from proximity_testing import ProximityArray

# Share of messages that are OK while nothing is wrong with what the node gets; this program's own
# clouds are late now and then on a loaded machine.
MOST = 0.7
# [s] that a flood lasts, and that a subscriber stands still; longer with IST_PROXIMITY_LONG_TESTS set.
SECONDS = 60.0 if "IST_PROXIMITY_LONG_TESTS" in os.environ else 4.0
# The noise filter keeps the obstacle for their sake.
NEIGHBORS = np.array([[0.001 * i, 0.0, 0.48] for i in range(4)])


def resident_memory(pid):
    """[bytes]"""
    with open("/proc/%d/statm" % pid, encoding="ascii") as file:
        return int(file.read().split()[1]) * 4096


class FaultsLoadTest(faults.FaultTest):
    def test_floods(self):
        """Ten times the rate, of clouds of 5000 points: the newest is used, and none piles up."""
        self.sensor.extra = np.random.default_rng(1).uniform(-0.5, 0.5, (5000, 3)) + [0, 0, 2]
        node = self.start()
        memory = resident_memory(node.process.pid)
        flood = self.world.repeat(9 * self.sensor.RATE, self.sensor.send)
        begin = len(node.messages)
        time.sleep(SECONDS)
        flood.stop()
        messages = list(zip(node.times, node.messages))[begin:]
        ages = []
        good = [(t, m) for t, m in messages if m.status == ProximityArray.OK]
        self.assertGreater(len(good), MOST * len(messages), messages[-1][1].status_text)
        for received, message in good:
            ages.append(received - self.sensor.sent.find(message.cloud_stamp)[0])
        growth = resident_memory(node.process.pid) - memory
        self.assertLess(growth, 64e6, "bytes during the flood")
        self.assertLess(np.median(ages), 0.2, "age of the cloud in use [s]")
        said = "the cloud in use is %.0f ms old (median); memory grew by %.1f MB" % (
            1e3 * np.median(ages),
            max(growth, 0) / 1e6,
        )
        self.record("sensor floods", "300 Hz in place of 30 Hz, for %g s" % SECONDS, good[-1][1], None,
                    "nothing to recover from", None, said=said)

    def test_ingest_slower_than_its_timeout(self):
        """A cloud whose noise filter takes longer than the timeout; the reason is not the driver."""
        self.sensor.extra, self.cloud_timeout = NEIGHBORS, 0.1
        node = self.start(
            noise_filter={"radius": 0.2}, cloud_timeout=self.cloud_timeout
        )
        last = self.sensor.pause(node)
        rng = np.random.default_rng(2)
        self.sensor.extra = np.vstack([NEIGHBORS, rng.uniform(-1, 1, (300000, 3)) + [0, 0, 2.5]])
        self.sensor.resume()
        _, reaction = self.react(
            node, last, ProximityArray.STALE_CLOUD, timeout=self.cloud_timeout
        )
        message = node.wait_for_status(ProximityArray.STALE_CLOUD, "too long for its timeout")
        self.assertIn("noise filter", message.status_text)
        # From here on such clouds keep coming: the reason is not that they do not.
        begin = node.messages.index(message)
        node.wait_for(lambda m: len(node.messages) > begin + 100, "answers")
        texts = [other.status_text for other in node.messages[begin:]]
        # A reason follows in every message, also while such a cloud has just begun to be read.
        for text in texts:
            self.assertFalse(text.endswith("(~cloud_timeout)"), text)
            self.assertNotIn("driver stopped", text)
        self.sensor.halt()
        self.sensor.extra = NEIGHBORS
        since = time.monotonic()
        self.sensor.resume()
        recovery = self.recover(node, since)
        self.record("ingest is slower than the timeout",
                    "300,000 points with the noise filter; the timeout is 0.1 s", message, reaction,
                    "when the last such cloud has been read", recovery,
                    self.cloud_timeout + PERIOD)

    def test_slow_subscriber(self):
        """A subscriber that is stopped delays nobody and costs no memory."""
        rng = np.random.default_rng(3)
        self.sensor.extra = rng.uniform(-1.0, 1.0, (40000, 3)) + [0, 0, 2.0]
        node = self.start()
        program = (
            "import rospy\n"
            "from ist_proximity.msg import ProximityArray\n"
            "from sensor_msgs.msg import PointCloud2\n"
            "rospy.init_node('slow', anonymous=True)\n"
            "print('up', flush=True)\n"
            "age = lambda m: print((rospy.Time.now() - m.header.stamp).to_sec(), flush=True)\n"
            "rospy.Subscriber('%s/proximity', ProximityArray, age, queue_size=1)\n"
            "rospy.Subscriber('%s/filtered_cloud', PointCloud2, lambda m: None, queue_size=1)\n"
            "rospy.spin()\n"
        ) % (node.name, node.name)
        slow = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
        try:
            for _ in range(3):
                slow.stdout.readline()
            slow.send_signal(subprocess.signal.SIGSTOP)
            time.sleep(1.0)  # buffers of the system fill up
            memory, begin, since = resident_memory(node.process.pid), len(node.messages), time.monotonic()
            time.sleep(SECONDS)
            growth = resident_memory(node.process.pid) - memory
            messages = list(zip(node.times, node.messages))[begin:]
            gap = node.gap(since, messages[-1][0])
            self.assertLess(gap, 0.3 + self.stalls.worst(since, messages[-1][0]))
            good = [m for _, m in messages if m.status == ProximityArray.OK]
            self.assertGreater(len(good), MOST * len(messages), messages[-1][1].status_text)
            self.assertLess(growth, 64e6, "bytes while the subscriber stood still")
            since = time.monotonic()
            slow.send_signal(subprocess.signal.SIGCONT)
            while float(slow.stdout.readline()) > 0.5:
                self.assertLess(time.monotonic() - since, pt.TIMEOUT, "old messages")
            recovery = 1e3 * (time.monotonic() - since)
            said = "other subscribers: %.0f Hz; memory grew by %.1f MB" % (
                len(messages) / SECONDS,
                max(growth, 0) / 1e6,
            )
            self.record("a subscriber is too slow", "one of ~proximity and ~filtered_cloud stands "
                        "still for %g s" % SECONDS, good[-1], None,
                        "it has a message of now after going on", recovery, said=said)
        finally:
            slow.kill()
            slow.wait()
            slow.stdout.close()


if __name__ == "__main__":
    pt.run("faults_load_test", FaultsLoadTest)
