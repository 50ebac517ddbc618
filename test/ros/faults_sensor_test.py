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


STALE, NOTHING = ProximityArray.STALE_CLOUD, ProximityArray.NO_CLOUD


def seen_from(X, frame, message):
    """The sensor's point in the frame of a camera that is elsewhere."""
    z = np.frombuffer(message.data, "<f4")[2]
    return pt.cloud(pt.apply(pt.inverse(X), [[0, 0, z]]), frame, message.header.stamp)


def set_to(name, value):
    return lambda message, last: setattr(message, name, value)


# The fault, what was done, status and words of the message, what is sent in place of a message (and of
# the last one before), the offset of stamps [s], and after what the node recovers.
UNUSABLE = [
    ("sensor freezes", "the same cloud, same stamp, at 30 Hz", STALE, "",
     lambda message, last: last, 0.0, AGAIN),
    ("sensor's clock goes back", "stamps jump back by 5 s", STALE, "",
     lambda message, last: None, -5.0, AGAIN + " of the right time"),
    ("sensor changes its frame", "a frame_id that tf does not know", STALE, "nowhere",
     lambda message, last: setattr(message.header, "frame_id", "nowhere"), 0.0, AGAIN + " in a known frame"),
    ("sensor changes its layout", "clouds without x, y, z", STALE, "",
     set_to("fields", [PointField("rgb", 0, PointField.FLOAT32, 1)]), 0.0, AGAIN),
    ("sensor contradicts itself", "clouds of width 0 with data", STALE, "", set_to("width", 0), 0.0, AGAIN),
    ("sensor's clouds are cut off", "clouds with a byte less than they say", STALE, "",
     lambda message, last: setattr(message, "data", message.data[:-1]), 0.0, AGAIN),
    ("sensor is covered", "every point is NaN", NOTHING, "NaN",
     lambda message, last: pt.cloud(np.full((1, 3), np.nan), stamp=message.header.stamp), 0.0, AGAIN),
]


class FaultsSensorTest(faults.FaultTest):
    def break_sensor(self, node, status, text, change, offset):
        """Changes what the sensor sends; returns message, reaction [ms] and recovery [ms]."""
        last = self.sensor.pause(node)
        frozen = self.sensor.last
        self.sensor.change = lambda message: change(message, frozen)
        self.sensor.offset, self.sensor.is_usable = offset, False
        self.sensor.resume()
        message, reaction = self.react(node, last, status, text)
        self.sensor.halt()
        self.sensor.change, self.sensor.offset, self.sensor.is_usable = None, 0.0, True
        since = time.monotonic()
        self.sensor.resume()
        return message, reaction, self.recover(node, since)

    def test_what_cannot_be_used(self):
        node = self.start()
        for fault, done, status, text, change, offset, again in UNUSABLE:
            with self.subTest(fault):
                message, reaction, recovery = self.break_sensor(node, status, text, change, offset)
                self.record(fault, done, message, reaction, again, recovery, LIMIT)

    def test_stops(self):
        """Stamps that were ahead of the clock do not lengthen the timeout."""
        node = self.start()
        for fault, done, offset, text in (
            ("sensor stops", "no cloud any more", 0.0, "driver stopped"),
            # Its clouds wait for tf, ten at most.
            ("sensor's clock is ahead, then it stops", "stamps 0.28 s ahead; no cloud any more", 0.28, ""),
        ):
            with self.subTest(fault):
                self.sensor.offset = offset
                last = self.sensor.pause(node)
                message, reaction = self.react(node, last, STALE, text)
                self.sensor.offset = 0.0
                since = time.monotonic()
                self.sensor.resume()
                recovery = self.recover(node, since)
                self.record(fault, done, message, reaction, AGAIN, recovery, LIMIT)

    def test_what_else_can_be_used(self):
        """A frame that tf knows is followed; float64 of the other byte order is read."""
        node = self.start()
        X = pt.transform((0.2, -0.3, 0.1), axis=(0.6, 0, 0.8), angle=1.2)
        self.world.poses["other_camera"] = ("base", X)

        def to_float64(message):
            points = np.frombuffer(message.data, "<f4").reshape(-1, 3)
            return pt.cloud(points, stamp=message.header.stamp, dtype=">f8")

        for change in (lambda message: seen_from(X, "other_camera", message), to_float64):
            self.sensor.pause(node)
            self.sensor.change = change
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
            return seen_from(X[i], frames[i], message)

        for sensors in (2, 3):
            with self.subTest(sensors):
                self.sensor.change = lambda message, n=sensors: by_turns(message, n)
                node.wait_for_status(STALE, "by turns in the frames")
                for message in node.next_messages(100):  # for as long as they come
                    self.assertIn("by turns in the frames", message.status_text)
                self.sensor.change = None
                node.wait_for_status(ProximityArray.OK)

    def test_another_sensor_that_comes_seldom(self):
        """It hides what the first one sees once at most, and until that one comes again."""
        self.world.poses["other_camera"] = ("base", np.eye(4))
        node = self.start()
        count = itertools.count(1)
        seldom = []

        def at_times(message):
            if next(count) % 25 > 0:
                return None
            seldom.append(message.header.stamp)
            return seen_from(np.eye(4), "other_camera", message)

        begin = len(node.messages)
        self.sensor.change = at_times
        node.wait_until(lambda: len(seldom) > 4, "clouds of the other one")
        self.sensor.change = None
        known = [m for m in node.messages[begin:] if m.status == ProximityArray.OK]
        self.assertGreater(len(known), 50)
        by_other = [m for m in known if m.cloud_stamp in seldom]
        self.assertEqual({m.cloud_stamp for m in by_other} - set(seldom[:1]), set())
        for message in by_other:
            self.assertLess((message.header.stamp - seldom[0]).to_sec(), 0.9 * CLOUD_TIMEOUT)


if __name__ == "__main__":
    pt.run("faults_sensor_test", FaultsSensorTest)
