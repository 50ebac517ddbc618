#!/usr/bin/env python3
"""Faults of a sensor: it stops, freezes, errs about the time, changes frame or layout."""

import itertools
import time

import faults
import numpy as np
import proximity_testing as pt
from faults import CLOUD_TIMEOUT, PERIOD
from proximity_testing import ProximityArray
from sensor_msgs.msg import PointField

LIMIT = CLOUD_TIMEOUT + PERIOD
AGAIN = "with the next cloud"


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

    def test_goes_back_in_time(self):
        node = self.start()
        result = self.break_sensor(node, ProximityArray.STALE_CLOUD, "", offset=-5.0)
        message, reaction, recovery = result
        self.record("sensor's clock goes back", "stamps jump back by 5 s", message, reaction,
                    AGAIN + " of the right time", recovery, LIMIT)

    def test_stamps_ahead_then_stops(self):
        """Stamps that are ahead of the clock do not lengthen the timeout."""
        self.sensor.offset = 0.28  # its clouds wait for tf, ten at most
        node = self.start()
        last = self.sensor.pause(node)
        message, reaction = self.react(node, last, ProximityArray.STALE_CLOUD)
        self.sensor.offset = 0.0
        since = time.monotonic()
        self.sensor.resume()
        recovery = self.recover(node, since)
        self.record("sensor's clock is ahead, then it stops", "stamps 0.28 s ahead; no cloud any more",
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
        self.sensor.resume()
        for message in node.next_messages(60)[30:60]:
            self.assertEqual(message.status, ProximityArray.OK, message.status_text)

    def test_sensors_on_one_topic(self):
        """Each cloud would hide what the other sensors see."""
        frames = ["camera", "other_camera", "third_camera"]
        X = [np.eye(4), pt.transform((0.2, -0.3, 0.1)), pt.transform((-0.2, 0.3, 0.1))]
        for frame, X_camera in zip(frames[1:], X[1:]):
            self.world.poses[frame] = ("base", X_camera)
        node = self.start()
        turn = itertools.count()

        def by_turns(message, sensors):
            i = next(turn) % sensors
            z = np.frombuffer(message.data, "<f4")[2]
            moved = pt.apply(pt.inverse(X[i]), [[0, 0, z]])
            return pt.cloud(moved, frames[i], message.header.stamp)

        for sensors in (2, 3):
            with self.subTest(sensors):
                self.sensor.change = lambda message, n=sensors: by_turns(message, n)
                node.wait_for_status(ProximityArray.STALE_CLOUD, "by turns in the frames")
                self.sensor.change = None
                node.wait_for_status(ProximityArray.OK)

    def test_changes_layout(self):
        """To float64 of the other byte order, which is read; to clouds that no one can read."""
        node = self.start()

        def to_float64(message):
            points = np.frombuffer(message.data, "<f4").reshape(-1, 3)
            return pt.cloud(points, stamp=message.header.stamp, dtype=">f8")

        self.sensor.pause(node)
        self.sensor.change = to_float64
        self.sensor.resume()
        for message in node.next_messages(60)[30:60]:
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


if __name__ == "__main__":
    pt.run("faults_sensor_test", FaultsSensorTest)
