"""Faults: what was done to a node, what it said, after how many milliseconds, how it recovered.

Three promises are checked at every message of every test, whatever its status:
  - A link is known only if the input that it rests on was sent at most its timeout, and one period
    of the messages, before. The time of sending counts, not the stamp.
  - Distance and bound are those of the cloud and of the poses that the message names by their stamps.
  - ~speed_scale is 0 in the very cycle in which a link is not known.

The period is the one that was kept: the largest time between two messages received. A loaded machine
lengthens it; a test that counted on 10 ms would measure the machine. An absolute limit on that time
finds a node that hangs.
"""

import bisect
import json
import os
import re
import sys
import time
import unittest

import fault_table
import numpy as np
import proximity_testing as pt
import rospy
from ist_proximity.msg import SpeedScaleState
from proximity_testing import LinkProximity, ProximityArray
from stall_meter import StallMeter

STATUS = {
    getattr(ProximityArray, name): name
    for name in ("OK", "NO_CLOUD", "STALE_CLOUD", "NO_POSE", "DEGRADED", "MODEL_ERROR", "LOADING")
}

CLOUD_TIMEOUT = POSE_TIMEOUT = 0.5  # [s] the node's defaults
RATE = 100.0  # [Hz] likewise
PERIOD = 1.0 / RATE
TRANSPORT = 0.2  # [s] from publish() here to the node, and back, on a loaded machine
LONGEST_GAP = 3.0  # [s] between two messages: a node that is silent for longer hangs
FAR_BOX = pt.transform((0, 0.8, 0))


class TimedNode(pt.ProximityNode):
    """A node whose messages have the time at which they were received."""

    def __init__(self, *args, **kwargs):
        self.times = []  # [s] of time.monotonic(), one per message
        self.scales = []  # SpeedScaleState, one per cycle
        super().__init__(*args, **kwargs)
        self.subscribe("speed_scale_state", SpeedScaleState, self.scales.append)

    def _on_message(self, message):
        self.times.append(time.monotonic())
        super()._on_message(message)

    def gap(self, begin, end):
        """[s] The longest time without a message between two times, to which both ends count."""
        inside = [t for t in list(self.times) if begin < t < end]
        edges = [begin] + inside + [end]
        return max(b - a for a, b in zip(edges, edges[1:]))


class Sent:
    """Inputs that were sent: by stamp, the time of time.monotonic() and what is true with it.

    An input that is sent again counts from the first time.
    """

    def __init__(self):
        self._by_stamp = {}
        self.newest = None  # [s] time of the last new input
        self.stamp = None

    def add(self, stamp, truth):
        if stamp.to_nsec() not in self._by_stamp:
            self.newest, self.stamp = time.monotonic(), stamp
            self._by_stamp[stamp.to_nsec()] = (self.newest, truth)

    def find(self, stamp):
        """(time of sending, truth) of a stamp; None where nothing was sent with it."""
        return self._by_stamp.get(stamp.to_nsec())

    def latest(self, t):
        """The same of what was sent last before a time of time.monotonic()."""
        return max((sent for sent in self._by_stamp.values() if sent[0] <= t), default=None)

    def between(self, stamp):
        """The same for an instant between two stamps, where tf interpolates."""
        t = stamp.to_nsec()
        if t in self._by_stamp:
            return self._by_stamp[t]
        stamps = sorted(self._by_stamp)
        i = bisect.bisect(stamps, t)
        if i in (0, len(stamps)):
            return None
        a, b = stamps[i - 1], stamps[i]
        (_, first), (sent, second) = self._by_stamp[a], self._by_stamp[b]
        return sent, first + (second - first) * (t - a) / (b - a)


class Sensor:
    """One obstacle point above the ball that goes up and down, on a cloud topic, at 30 Hz.

    `offset` [s] is added to stamps; `change` may alter a message before it is sent; `is_usable` says
    whether the node can use what is sent: else it counts as no input.
    """

    RATE = 30.0

    def __init__(self, world, topic_publisher=None):
        self.world, self.sent = world, Sent()
        self.offset, self.change, self.is_usable, self.extra = 0.0, None, True, None
        self.last = None  # the message that was sent last
        self._publisher = topic_publisher or world.cloud_publisher
        self._begin = time.monotonic()
        self.repeater = None

    def height(self):
        return 0.38 + 0.1 * np.sin(1.3 * (time.monotonic() - self._begin))

    def make(self):
        z = np.float32(self.height())
        points = np.array([[0.0, 0.0, z]])
        if self.extra is not None:
            points = np.vstack([points, self.extra])
        stamp = rospy.Time.now() + rospy.Duration(self.offset)
        message = pt.cloud(points, "camera", stamp)
        if self.change:
            message = self.change(message) or message
        if self.is_usable:
            self.sent.add(message.header.stamp, float(z) - pt.BALL_RADIUS)
        return message

    def send(self):
        self.last = self.make()
        self._publisher.publish(self.last)

    def halt(self):
        """Sends nothing from now on, whatever the node says."""
        self.repeater.paused = True
        time.sleep(2.0 / self.RATE)

    def start(self, rate=None):
        self.repeater = self.world.repeat(rate or self.RATE, self.send)
        return self.repeater

    def pause(self, node):
        """Returns the time of the last input, which the node uses and which is answered."""
        # Clouds with a stamp ahead of the clock wait until transforms have come that far.
        wait = 0.25 + max(self.offset, 0.0)
        return settle(node, self.repeater, self.sent, lambda message: message.cloud_stamp, wait)

    def resume(self):
        self.repeater.paused = False


def settle(node, repeater, sent, stamp_of, wait=0.25):
    """Pauses a repeater and waits until the node's newest answer rests on what was sent last.

    A loaded machine may take longer than the node's timeout: then it sends again.
    """
    for _ in range(50):
        repeater.paused = True
        time.sleep(0.02)  # a call under way ends
        end = time.monotonic() + wait
        while time.monotonic() < end:
            newest = node.messages[-1] if node.messages else None
            if newest and newest.status == ProximityArray.OK and stamp_of(newest) == sent.stamp:
                return sent.newest
            time.sleep(0.002)
        repeater.paused = False
        time.sleep(0.1)
    raise AssertionError("the last input is not answered: %s" % node.messages[-1:])


class FaultTest(unittest.TestCase):
    """A node with the small robot in tf, and a sensor. Subclasses do something to it."""

    def setUp(self):
        self.namespace = "/" + self._testMethodName
        self.stalls = StallMeter()
        self.world = pt.World(self.namespace).stand(box=FAR_BOX)
        self.sensor = Sensor(self.world)
        self.poses = Sent()
        self.nodes, self.cloud_timeout = [], CLOUD_TIMEOUT

    def tearDown(self):
        self.world.stop()
        try:
            for node in self.nodes:
                self.check_all(node)
                self.assertEqual(node.stop(), 0, node.log())
        finally:
            self.stalls.stop()
            for node in self.nodes:
                node.process.kill()

    def start(self, **parameters):
        """A node with the default timeouts, to which sensor and tf send; waits for OK."""
        self.nodes.append(TimedNode(self.namespace, parameters, pt.urdf()))
        self.tf = self.world.start_tf()
        self.sensor.start()
        self.nodes[-1].wait_for_status(ProximityArray.OK)
        return self.nodes[-1]

    def slack(self, node, begin, end):
        """[s] What the machine added to a reaction between two times: late messages, late wakes."""
        gap = node.gap(begin, end)
        self.assertLess(gap, LONGEST_GAP, "no message for %.1f s: " % gap + node.log())
        return max(gap - PERIOD, 0.0) + self.stalls.worst(begin, end) + TRANSPORT

    def check_all(self, node):
        """Every message that was received: invariants, truth, and age of what it rests on."""
        messages = list(zip(list(node.times), list(node.messages)))
        for received, message in messages:
            pt.check_invariants(self, message)
            self.check_message(node, received, message)
        self.check_scales(node)

    def check_scales(self, node):
        """The scale is above 0 only in cycles that knew every link; the header says which."""
        known = {}  # by stamp: whether a message of it knew all links
        for message in list(node.messages):
            all_known = bool(message.links) and all(
                one.state != LinkProximity.UNKNOWN for one in message.links
            )
            stamp = message.header.stamp.to_nsec()
            known[stamp] = known.get(stamp, False) or all_known
        compared = 0
        for state in list(node.scales):
            self.assertTrue(0.0 <= state.scale <= 1.0, state)
            self.assertEqual(state.scale == 0.0, state.rule <= SpeedScaleState.STOP, state)
            stamp = state.header.stamp.to_nsec()
            if stamp not in known:
                continue
            compared += 1
            if not known[stamp]:
                self.assertEqual(state.scale, 0.0, state)
                self.assertEqual(state.rule, SpeedScaleState.UNKNOWN, state)
                self.assertNotEqual(state.text, "")
        self.assertGreater(compared, 0)

    def check_message(self, node, received, message):
        known = [one for one in message.links if one.state != LinkProximity.UNKNOWN]
        if not known or self.sensor is None:
            return
        cloud = self.sensor.sent.find(message.cloud_stamp)
        self.assertIsNotNone(cloud, "a cloud that was not sent, or not usable: %s" % message)
        sent, truth = cloud
        age, limit = received - sent, self.cloud_timeout + PERIOD
        if age > limit:
            limit += self.slack(node, sent, received)
        self.assertLess(age, limit, "known although the cloud is too old: %s" % message)
        ball = pt.link(message, "ball_link")
        if ball in known:
            self.check_distance(ball, truth)

    def check_distance(self, one, truth, margin=0.0):
        self.assertEqual(one.state, LinkProximity.NEAR, one)
        self.assertLessEqual(one.lower_bound, truth - margin + 1e-5)
        self.assertAlmostEqual(one.distance, truth, delta=0.001 + 1e-5)

    def known(self, message, links=("ball_link",)):
        """Whether one of the links is known; before the model is read there are none."""
        states = {one.link: one.state for one in message.links}
        return any(states.get(name, LinkProximity.UNKNOWN) != LinkProximity.UNKNOWN for name in links)

    def react(self, node, last_input, status, text="", links=("ball_link",), timeout=CLOUD_TIMEOUT):
        """Waits until the links are unknown, with this status and text.

        last_input: time of an input that was answered already, see settle(). Returns the message,
        and the time [ms] from the last input to the first message without these links; what the
        machine added beyond the limit is not counted.
        """
        begin = next(
            (i for i, m in enumerate(node.messages)
             if node.times[i] >= last_input and self.known(m, links)),
            len(node.messages),
        )
        message = node.wait_for(
            lambda m: m.status == status and text in m.status_text and not self.known(m, links),
            "%s without %s, '%s'" % (STATUS[status], ", ".join(links), text),
            start=begin,
        )
        messages = list(zip(node.times, node.messages))[begin:]
        first = next(t for t, m in messages if not self.known(m, links))
        reaction, limit = first - last_input, timeout + PERIOD
        if reaction > limit:
            slack = self.slack(node, last_input, first)
            self.assertLess(reaction, limit + slack)
            reaction = max(limit, reaction - slack)
        return message, 1e3 * reaction

    def recover(self, node, since, condition=lambda m: True):
        """Waits for OK; returns the time [ms] since `since` of time.monotonic()."""
        begin = len([t for t in list(node.times) if t <= since])
        message = node.wait_for(
            lambda m: m.status == ProximityArray.OK and condition(m), "OK again", start=begin
        )
        index = next(i for i in range(begin, len(node.messages)) if node.messages[i] is message)
        return 1e3 * (node.times[index] - since)

    def record(self, fault, done, message, reaction, recovery, recovery_ms, limit=None, said=None):
        """Notes a fault, and compares it with the row of the document.

        limit: [s] from the last input to nothing known; None where nothing has to become unknown.
        """
        text = said if said is not None else message.status_text
        entry = {
            "fault": fault,
            "done": done,
            "status": STATUS[message.status],
            "said": shorten(text.replace(self.namespace + "/", "")),
            "limit_ms": None if limit is None else 1e3 * limit,
            "reaction_ms": reaction,
            "recovery": recovery,
            "recovery_ms": recovery_ms,
        }
        write_record(entry)
        if "IST_PROXIMITY_UPDATE_DOC" in os.environ:
            fault_table.update([entry])
        rows = fault_table.read_rows(fault_table.DOCUMENT.read_text(encoding="utf-8"))
        self.assertIn(fault, rows, "IST_PROXIMITY_UPDATE_DOC=1 writes doc/safety.md")
        documented = fault_table.limit_ms(rows[fault])
        self.assertEqual(STATUS[message.status], rows[fault][2], fault)
        if limit is None:
            self.assertIsNone(documented, fault)
        else:
            self.assertLessEqual(reaction, documented, fault)


def shorten(text, length=200):
    text = re.sub(r"\s+", " ", text).strip()
    return text if len(text) <= length else text[: length - 3] + "..."


_records = []


def write_record(entry):
    """Adds to the file of this test's records, beside its results."""
    _records.append(entry)
    print("%(fault)s: %(status)s, %(reaction_ms)s ms, %(recovery)s %(recovery_ms)s ms" % entry)
    flag = "--gtest_output=xml:"
    results = [a[len(flag) :] for a in sys.argv if a.startswith(flag)]
    if results:
        os.makedirs(os.path.dirname(results[0]), exist_ok=True)
        path = os.path.splitext(results[0])[0] + ".json"
        with open(path, "w", encoding="utf-8") as file:
            json.dump(_records, file, indent=1)
