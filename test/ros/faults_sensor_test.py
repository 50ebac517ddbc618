#!/usr/bin/env python3
"""Faults of a sensor: it stops, freezes, floods, errs about the time, changes frame or layout."""

import subprocess
import sys
import time

import faults
import numpy as np
import proximity_testing as pt
import rospy
from faults import CLOUD_TIMEOUT, PERIOD
from proximity_testing import ProximityArray
from sensor_msgs.msg import PointField

LIMIT = CLOUD_TIMEOUT + PERIOD
# Share of messages that are OK while nothing is wrong with what the node gets; this program's own
# clouds are late now and then on a loaded machine.
MOST = 0.7
AGAIN = "with the next cloud"
NEIGHBOR = np.array([[0.0, 0.0, 0.48]])  # the noise filter keeps the obstacle for its sake


class FaultsSensorTest(faults.FaultTest):
    def break_sensor(self, node, status, text, change=None, offset=0.0, is_usable=False):
        """Changes what the sensor sends; returns message, reaction [ms] and recovery [ms]."""
        last = self.sensor.pause(node)
        self.sensor.change, self.sensor.offset, self.sensor.is_usable = change, offset, is_usable
        self.sensor.resume()
        message, reaction = self.react(node, last, status, text)
        self.sensor.halt()
        self.sensor.change, self.sensor.offset, self.sensor.is_usable = None, 0.0, True
        since = time.monotonic()
        self.sensor.resume()
        return message, reaction, self.recover(node, since)

    def test_stops(self):
        node = self.start()
        last = self.sensor.pause(node)
        message, reaction = self.react(node, last, ProximityArray.STALE_CLOUD, "driver stopped")
        since = time.monotonic()
        self.sensor.resume()
        recovery = self.recover(node, since)
        self.record(
            "sensor stops", "no cloud any more", message, reaction, AGAIN, recovery, LIMIT
        )

    def test_freezes(self):
        """The driver sends its last cloud again and again, with the same stamp."""
        node = self.start()
        last = self.sensor.pause(node)
        frozen = self.sensor.last
        result = self.break_sensor_frozen(node, frozen, last)
        self.record("sensor freezes", "the same cloud, same stamp, at 30 Hz", *result, LIMIT)

    def break_sensor_frozen(self, node, frozen, last):
        self.sensor.change = lambda message: frozen
        self.sensor.is_usable = False
        self.sensor.resume()
        message, reaction = self.react(node, last, ProximityArray.STALE_CLOUD)
        self.sensor.halt()
        self.sensor.change, self.sensor.is_usable = None, True
        since = time.monotonic()
        self.sensor.resume()
        return message, reaction, AGAIN, self.recover(node, since)

    def test_floods(self):
        """Ten times the rate, of clouds of 5000 points: the newest is used, and none piles up."""
        self.sensor.extra = np.random.default_rng(1).uniform(-0.5, 0.5, (5000, 3)) + [0, 0, 2]
        node = self.start()
        memory = faults_memory(node.process.pid)
        flood = self.world.repeat(9 * self.sensor.RATE, self.sensor.send)
        begin = len(node.messages)
        time.sleep(4.0)
        flood.stop()
        messages = list(zip(node.times, node.messages))[begin:]
        ages = []
        good = [(t, m) for t, m in messages if m.status == ProximityArray.OK]
        self.assertGreater(len(good), MOST * len(messages), messages[-1][1].status_text)
        for received, message in good:
            ages.append(received - self.sensor.sent.find(message.cloud_stamp)[0])
        growth = faults_memory(node.process.pid) - memory
        self.assertLess(growth, 64e6, "bytes during the flood")
        self.assertLess(np.median(ages), 0.2, "age of the cloud in use [s]")
        said = "the cloud in use is %.0f ms old (median); memory grew by %.1f MB" % (
            1e3 * np.median(ages),
            max(growth, 0) / 1e6,
        )
        self.record("sensor floods", "300 Hz in place of 30 Hz, for 4 s", good[-1][1], None,
                    "nothing to recover from", None, said=said)

    def test_goes_back_in_time(self):
        node = self.start()
        result = self.break_sensor(node, ProximityArray.STALE_CLOUD, "", offset=-5.0)
        message, reaction, recovery = result
        self.record("sensor's clock goes back", "stamps jump back by 5 s", message, reaction,
                    AGAIN + " of the right time", recovery, LIMIT)

    def test_stamps_ahead_then_stops(self):
        """Stamps that are ahead of the clock do not lengthen the timeout."""
        self.sensor.offset = 0.4
        node = self.start()
        last = self.sensor.pause(node)
        message, reaction = self.react(node, last, ProximityArray.STALE_CLOUD)
        self.sensor.offset = 0.0
        since = time.monotonic() + 0.4  # until then, stamps would go back
        self.sensor.resume()
        recovery = self.recover(node, since - 0.4)
        self.record("sensor's clock is ahead, then it stops", "stamps 0.4 s ahead; no cloud any more",
                    message, reaction, AGAIN, recovery, LIMIT)

    def test_changes_frame(self):
        """To one that tf does not know; and to one that it knows, which is followed."""
        node = self.start()

        def to_nowhere(message):
            message.header.frame_id = "nowhere"

        message, reaction, recovery = self.break_sensor(
            node, ProximityArray.STALE_CLOUD, "nowhere", to_nowhere
        )
        self.record("sensor changes its frame", "a frame_id that tf does not know", message,
                    reaction, AGAIN + " in a known frame", recovery, LIMIT)

        X = pt.transform((0.2, -0.3, 0.1), axis=(0.6, 0, 0.8), angle=1.2)
        self.world.poses["other_camera"] = ("base", X)

        def to_other(message):
            z = np.frombuffer(message.data, "<f4")[2]
            moved = pt.apply(pt.inverse(X), [[0, 0, z]])
            return pt.cloud(moved, "other_camera", message.header.stamp)

        self.sensor.pause(node)
        self.sensor.change = to_other
        begin = len(node.messages)
        self.sensor.resume()
        node.wait_for(lambda m: len(node.messages) > begin + 60, "answers")
        for message in node.messages[begin + 30 : begin + 60]:
            self.assertEqual(message.status, ProximityArray.OK, message.status_text)

    def test_changes_layout(self):
        """To float64 of the other byte order, which is read; to clouds that no one can read."""
        node = self.start()

        def to_float64(message):
            points = np.frombuffer(message.data, "<f4").reshape(-1, 3)
            return pt.cloud(points, stamp=message.header.stamp, dtype=">f8")

        self.sensor.pause(node)
        self.sensor.change = to_float64
        begin = len(node.messages)
        self.sensor.resume()
        node.wait_for(lambda m: len(node.messages) > begin + 60, "answers")
        for message in node.messages[begin + 30 : begin + 60]:
            self.assertEqual(message.status, ProximityArray.OK, message.status_text)

        def to_colours(message):
            message.fields = [PointField("rgb", 0, PointField.FLOAT32, 1)]

        message, reaction, recovery = self.break_sensor(
            node, ProximityArray.STALE_CLOUD, "", to_colours
        )
        self.record("sensor changes its layout", "clouds without x, y, z", message, reaction, AGAIN,
                    recovery, LIMIT)

        def to_size_zero(message):
            message.width = 0

        message, reaction, recovery = self.break_sensor(
            node, ProximityArray.STALE_CLOUD, "", to_size_zero
        )
        self.record("sensor contradicts itself", "clouds of width 0 with data", message, reaction,
                    AGAIN, recovery, LIMIT)

        def to_short(message):
            message.data = message.data[:-1]

        message, reaction, recovery = self.break_sensor(
            node, ProximityArray.STALE_CLOUD, "", to_short
        )
        self.record("sensor's clouds are cut off", "clouds with a byte less than they say", message,
                    reaction, AGAIN, recovery, LIMIT)

    def test_sees_nothing(self):
        node = self.start()

        def to_nan(message):
            return pt.cloud(np.full((1, 3), np.nan), stamp=message.header.stamp)

        message, reaction, recovery = self.break_sensor(node, ProximityArray.NO_CLOUD, "NaN", to_nan)
        self.record("sensor is covered", "every point is NaN", message, reaction, AGAIN, recovery,
                    LIMIT)

    def test_ingest_slower_than_its_timeout(self):
        """A cloud whose noise filter takes longer than the timeout; the reason is not the driver."""
        self.sensor.extra = NEIGHBOR
        node = self.start(**{"noise_filter": {"radius": 0.2, "neighbors": 1}})
        if "noise" in node.log() and "PCL" in node.log():
            self.skipTest("built without PCL: no noise filter")
        # Each point has every other one as a neighbor: the time grows with the square.
        crowd = np.random.default_rng(2).uniform(-0.014, 0.014, (14000, 3)) + [0, 0, 1.5]
        last = self.sensor.pause(node)
        self.sensor.extra = np.vstack([NEIGHBOR, crowd])
        self.sensor.resume()
        _, reaction = self.react(node, last, ProximityArray.STALE_CLOUD)
        # Clouds keep coming: the reason is not that they do not.
        message = node.wait_for_status(ProximityArray.STALE_CLOUD, "last usable")
        for other in node.messages:
            self.assertNotIn("driver stopped", other.status_text)
        self.sensor.halt()
        self.sensor.extra = NEIGHBOR
        since = time.monotonic()
        self.sensor.resume()
        recovery = self.recover(node, since)
        self.record("ingest is slower than the timeout", "14,000 points in 28 mm, noise filter on",
                    message, reaction, "when the last such cloud has been read", recovery, LIMIT)

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
            memory, begin, since = faults_memory(node.process.pid), len(node.messages), time.monotonic()
            time.sleep(4.0)
            growth = faults_memory(node.process.pid) - memory
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
                len(messages) / 4.0,
                max(growth, 0) / 1e6,
            )
            self.record("a subscriber is too slow", "one of ~proximity and ~filtered_cloud stands "
                        "still for 5 s", good[-1], None,
                        "it has a message of now after going on", recovery, said=said)
        finally:
            slow.kill()
            slow.wait()
            slow.stdout.close()


def faults_memory(pid):
    """[bytes] resident"""
    with open("/proc/%d/statm" % pid, encoding="ascii") as file:
        return int(file.read().split()[1]) * 4096


if __name__ == "__main__":
    import rostest

    rospy.init_node("faults_sensor_test")
    rostest.rosrun("ist_proximity", "faults_sensor_test", FaultsSensorTest, sys.argv)
