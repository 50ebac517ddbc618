#!/usr/bin/env python3
"""A node under load, faults and services for a long time; every message is checked against truth.

scripts/soak starts it. Writes FOLDER/soak.csv (a line per second), events.csv (faults and services)
and soak.svg. The exit code is 0 only if every promise held; the last line says it all.
"""

import argparse
import collections
import csv
import math
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import rospy

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "ros"))
import proximity_testing as pt  # noqa: E402
import soak_plot  # noqa: E402
from soak_world import (  # noqa: E402
    LINKS,
    MARGIN,
    MAX_DISTANCE,
    TIMEOUT,
    TOLERANCE,
    URDF,
    SoakWorld,
    lagging_truths,
    truth,
)

from ist_proximity.msg import LinkProximity, ProximityArray  # noqa: E402

NAMESPACE = "/soak"
NODE = NAMESPACE + "/proximity"
STATUSES = ("OK", "NO_CLOUD", "STALE_CLOUD", "NO_POSE", "DEGRADED", "MODEL_ERROR", "LOADING")
# [s] A joint that comes at 1 kHz may be older than header.stamp by about twice its spacing.
JOINT_LAG = 0.003
# [s] Older than that, where the message says so: its bound is lower by what the joint may have moved,
# which is at least what its distance is off.
TOLD_LAG = 0.05
LAG_STEP = 1e-4  # [m] between the lags that are tried
MANY = 1000  # links with wrong values
ROUNDING = 1e-5  # [m] of float32 points
IDLE_PERIOD = 0.1  # [s] between answers when no joint states come
# [s] A loaded machine may bring a message this much later to this program than the node sent it.
DELIVERY = 0.25
STALL_MEMORY = 1.0  # [s] for which a time without messages excuses late ones
LONGEST_GAP = 5.0  # [s] without a message: a node that is silent for longer hangs
WARM_UP = 1.0 / 3.0  # of the run, in which memory may grow


class Checker:
    """Takes messages as they come; compares them in batches with the truth of their stamps."""

    def __init__(self, seed, report):
        self._world, self._report = SoakWorld(seed), report
        self._lock, self._waiting = threading.Lock(), []
        self._last = None
        self._gaps = collections.deque()  # (time of a message, time without one before it)
        self.second = Second()
        self.wrong = {"false bounds": 0, "wrong distances": 0, "stale shown as fresh": 0,
                      "clear or near where unknown": 0, "gaps": 0}
        self.checked = 0  # links whose values were compared
        self.lagging = 0  # of these, where a joint was a little older than header.stamp
        self.messages = 0

    def receive(self, message):
        """Notes the longest time without a message of late: what waited then comes all at once.

        The message is read by take(): reading a thousand a second here would make all of them late.
        """
        now = time.time()
        gap = now - self._last if self._last else 0.0
        self._last = now
        if gap > 0.01:
            self._gaps.append((now, gap))
        while self._gaps and self._gaps[0][0] < now - STALL_MEMORY:
            self._gaps.popleft()
        with self._lock:
            self._waiting.append((now, max([gap] + [gap for _, gap in self._gaps]), message._buff))

    def take(self):
        """Checks what has come since the last call; returns the statistics of that time."""
        with self._lock:
            waiting, self._waiting = self._waiting, []
        batch = [(now, gap, ProximityArray().deserialize(data)) for now, gap, data in waiting]
        second, self.second = self.second, Second()
        for now, gap, message in batch:
            second.add(now, message)
            self.check_form(now, gap, message)
        known = [
            (now, gap, m) for now, gap, m in batch
            if any(one.state != LinkProximity.UNKNOWN for one in m.links)
        ]
        if known:
            self.check_values(known)
        self.messages += len(batch)
        return second

    def complain(self, kind, text):
        self.wrong[kind] += 1
        if self.wrong[kind] <= 10:
            self._report("%s: %s" % (kind, text))

    def check_form(self, now, gap, message):
        if gap > LONGEST_GAP:
            self.complain("gaps", "no message for %.1f s" % gap)
        states = [one.state for one in message.links]
        if message.status == ProximityArray.OK and LinkProximity.UNKNOWN in states:
            self.complain("clear or near where unknown", "status OK with an UNKNOWN link")
        if message.status == ProximityArray.OK and message.unfinished > 0:
            self.complain("wrong distances", "status OK with %d unfinished" % message.unfinished)
        # Half a view is no view: without clouds or model no link is known.
        blind = (ProximityArray.NO_CLOUD, ProximityArray.STALE_CLOUD)
        if message.status in blind and any(states):
            self.complain("clear or near where unknown", message.status_text)
        if not any(states):
            return
        # Stamps may be ahead of the clock, by a fault; the age counts from receipt then.
        for what, stamp in (("cloud", message.cloud_stamp), ("poses", message.header.stamp)):
            age = now - stamp.to_sec()
            if age > TIMEOUT + max(gap, IDLE_PERIOD) + DELIVERY:
                self.complain("stale shown as fresh", "%s %.3f s old, header.stamp %.3f s" % (
                    what, age, now - message.header.stamp.to_sec()))

    def check_values(self, known):
        poses_at = np.array([m.header.stamp.to_sec() for _, _, m in known])
        clouds_at = np.array([m.cloud_stamp.to_sec() for _, _, m in known])
        true = truth(self._world, poses_at, clouds_at)
        for i, (_, _, message) in enumerate(known):
            for one in message.links:
                if one.state != LinkProximity.UNKNOWN:
                    self.check_link(one, true[one.link][i], message)
                    self.checked += 1

    def check_link(self, one, true, message):
        where = "%s at %.3f, cloud %.3f: bound %.6f, distance %.6f, truth %.6f" % (
            one.link, message.header.stamp.to_sec(), message.cloud_stamp.to_sec(), one.lower_bound,
            one.distance, true)
        # A deadline that passed leaves some link with wide bounds, and says so.
        width = math.inf if message.unfinished > 0 else TOLERANCE
        if self.is_right(one, true, true, width):
            return
        # Where a joint's positions come late or not at all, for up to some of its periods. A run that
        # is wrong anyway is not looked at that closely.
        if self.wrong["false bounds"] + self.wrong["wrong distances"] < MANY:
            off = abs(one.distance - true)
            is_told = one.lower_bound <= one.distance - MARGIN - off + ROUNDING
            lagging = lagging_truths(self._world, message.header.stamp.to_sec(),
                                     message.cloud_stamp.to_sec(), one.link,
                                     TOLD_LAG if is_told else JOINT_LAG)
            if self.is_right(one, lagging.min() - LAG_STEP, lagging.max() + LAG_STEP, width):
                self.lagging += 1
                return
        self.complain("false bounds" if self.is_false(one, true) else "wrong distances", where)

    @staticmethod
    def is_false(one, truth_at_most):
        if one.state == LinkProximity.CLEAR:
            return truth_at_most < MAX_DISTANCE - ROUNDING
        return one.lower_bound > truth_at_most - MARGIN + ROUNDING

    @staticmethod
    def is_right(one, least, greatest, width):
        """Whether bound and distance fit to some truth between these, and the distance is at most
        `width` above it."""
        if Checker.is_false(one, greatest):
            return False
        is_clear = one.state == LinkProximity.CLEAR
        return is_clear or least - ROUNDING <= one.distance <= greatest + width + ROUNDING


class Second:
    """Statistics of the messages of about a second."""

    def __init__(self):
        self.statuses = dict.fromkeys(STATUSES, 0)
        self.computation, self.latency = [], []

    def add(self, now, message):
        self.statuses[STATUSES[message.status]] += 1
        self.computation.append(message.computation_time)
        if message.status == ProximityArray.OK:
            self.latency.append(now - message.header.stamp.to_sec())

    def row(self):
        def p99(values):
            return np.percentile(values, 99) if values else float("nan")

        return [p99(self.computation), p99(self.latency)] + list(self.statuses.values())


class Process:
    """Memory, threads and descriptors of a process, from /proc."""

    def __init__(self, pid):
        self._proc = "/proc/%d/" % pid

    def row(self):
        with open(self._proc + "status", encoding="ascii", errors="replace") as file:
            fields = dict(line.split(":", 1) for line in file if ":" in line)
        return [int(fields["VmRSS"].split()[0]) / 1024.0, int(fields["Threads"]),
                len(os.listdir(self._proc + "fd"))]


class Node:
    """proximity_node, or a nodelet manager with the nodelet, as processes of the soak."""

    REMAP = ["__ns:=" + NAMESPACE, "/tf:=" + NAMESPACE + "/tf",
             "/tf_static:=" + NAMESPACE + "/tf_static"]

    def __init__(self, nodelet, folder, wrapper, manager):
        self._log = open(os.path.join(folder, "node.log"), "wb")
        self._processes = []
        if nodelet:
            program = pt.find_program("nodelet", "nodelet")
            command = [manager] if manager else [program, "manager"]
            # As proximity.launch starts a manager.
            self.start(wrapper + command + ["__name:=manager"], MALLOC_ARENA_MAX="2")
            self.start([program, "load", "ist_proximity/Proximity", "manager", "__name:=proximity"])
        else:
            program = pt.find_program("ist_proximity", "proximity_node")
            self.start(wrapper + [program, "__name:=proximity"])
        self.main = self._processes[0]

    def start(self, command, **variables):
        self._processes.append(subprocess.Popen(
            command + self.REMAP, env=dict(os.environ, **variables), stdout=self._log,
            stderr=subprocess.STDOUT))

    def stop(self):
        """Returns the exit code; None when it does not end."""
        for process in reversed(self._processes):
            process.send_signal(signal.SIGINT)
            try:
                process.wait(30)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                return None
        return self.main.returncode


HEADER = ["seconds", "rss_mb", "threads", "descriptors", "computation_p99_s", "latency_p99_s"]


def set_parameters(folder, arguments):
    rospy.set_param(NAMESPACE + "/robot_description", URDF)
    rospy.set_param(NODE, {
        "pose_source": "joint_states", "cache_directory": os.path.join(folder, "cache"),
        "max_distance": MAX_DISTANCE, "self_filter": False, "min_range": 0.0, "max_range": 20.0,
        "query": {"margin": MARGIN, "tolerance": TOLERANCE},
        "self_collision": {"enabled": True},
    })


def run(folder, arguments, report):
    """Returns (rows of soak.csv, checker, exit code of the node, exit code of the driver)."""
    set_parameters(folder, arguments)
    checker = Checker(arguments.seed, report)
    rospy.Subscriber(NODE + "/proximity", rospy.AnyMsg, checker.receive, queue_size=10000,
                     tcp_nodelay=True, buff_size=1 << 18)
    node = Node(arguments.nodelet, folder, arguments.wrapper.split(), arguments.manager)
    driver = subprocess.Popen(
        [sys.executable, os.path.join(os.path.dirname(os.path.realpath(__file__)), "soak_driver.py"),
         NODE, str(arguments.seed), os.path.join(folder, "events.csv"), "__ns:=" + NAMESPACE,
         "tf_static:=" + NAMESPACE + "/tf_static"])
    rows, code = [], None
    try:
        process, begin = Process(node.main.pid), time.monotonic()
        with open(os.path.join(folder, "soak.csv"), "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(HEADER + list(STATUSES))
            while time.monotonic() - begin < 60 * arguments.minutes:
                time.sleep(1.0)
                if node.main.poll() is not None or driver.poll() is not None:
                    report("the node or the driver ended by itself")
                    break
                rows.append([time.monotonic() - begin] + process.row() + checker.take().row())
                writer.writerow("%.6g" % value for value in rows[-1])
    finally:
        driver.terminate()
        driver.wait()
        code = node.stop()
    return np.array(rows), checker, code


def judge(rows, checker, code, folder, arguments, report):
    """Reports what was broken, and a summary line; returns whether every promise held."""
    with open(os.path.join(folder, "events.csv"), encoding="utf-8") as file:
        events = file.read().splitlines()
    failures = ["%d %s" % (n, kind) for kind, n in checker.wrong.items() if n]
    false = [line for line in events if "FALSE" in line]
    failures += ["%d false answers of services" % len(false)] if false else []
    for line in false[:10]:
        report(line)
    if code != 0:
        failures.append("exit code of the node: %s" % code)
    if not checker.checked:
        failures.append("nothing was compared")
    later = rows[rows[:, 0] > WARM_UP * 60 * arguments.minutes]
    growth = threads = descriptors = float("nan")
    if len(later) < 6:
        failures.append("too short to say how memory grows")
    else:
        # What is left when nothing is going on, in the first and in the last third of that time:
        # messages that wait for a slow subscriber, and queries, come and go.
        first, last = later[: len(later) // 3], later[-(len(later) // 3):]
        threads, descriptors = last[:, 2:4].min(0) - first[:, 2:4].min(0)
        # The least memory of a thousand seconds is one lucky second.
        growth = np.percentile(last[:, 1], 10) - np.percentile(first[:, 1], 10)
        if growth > arguments.max_growth:
            failures.append("memory grew by %.1f MB, allowed is %g" % (growth, arguments.max_growth))
        if threads > 0:
            failures.append("%d threads more" % threads)
        if descriptors > 2:
            failures.append("%d descriptors more" % descriptors)
    totals = ", ".join("%s %d" % (name, rows[:, len(HEADER) + i].sum())
                       for i, name in enumerate(STATUSES) if len(rows))
    report("soak of %.1f min, seed %d, %s: %d messages (%s), %d links compared (%d with a joint "
           "that lags), %d faults and services; over the last %.1f min memory %+.2f MB, threads %+g, descriptors %+g; p99 of "
           "computation_time %.2f ms, of latency %.1f ms: %s" % (
               arguments.minutes, arguments.seed, "nodelet" if arguments.nodelet else "node",
               checker.messages, totals, checker.checked, checker.lagging, len(events),
               (1 - WARM_UP) * arguments.minutes, growth, threads, descriptors,
               1e3 * np.nanmedian(rows[:, 4]), 1e3 * np.nanmedian(rows[:, 5]),
               "BROKEN: " + "; ".join(failures) if failures else "every promise held"))
    return not failures


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--nodelet", action="store_true")
    parser.add_argument("--max-growth", type=float, help="[MB] over the last two thirds")
    parser.add_argument("--wrapper", default="", help="command in front of the node's")
    parser.add_argument("--manager", help="program of the nodelet's manager")
    parser.add_argument("folder")
    arguments = parser.parse_args(rospy.myargv()[1:])
    if arguments.max_growth is None:
        # Short runs see allocators warm up, each thread its own. What the allocator holds goes up and down
        # by 1.5 MB while the blocks in use do not.
        arguments.max_growth = 2.0 if arguments.minutes >= 20 else 16.0
    os.makedirs(arguments.folder, exist_ok=True)
    rospy.init_node("soak", disable_signals=True)
    # Messages are received beside the checks: at each read of the socket the receiver may wait this
    # long for the interpreter, 5 ms by default, which makes all of them late.
    sys.setswitchinterval(1e-4)

    def report(text):
        print(text, flush=True)

    rows, checker, code = run(arguments.folder, arguments, report)
    good = len(rows) > 0 and judge(rows, checker, code, arguments.folder, arguments, report)
    if len(rows) > 1:
        soak_plot.write(os.path.join(arguments.folder, "soak.svg"), rows, HEADER + list(STATUSES))
    rospy.signal_shutdown("done")
    os._exit(0 if good else 1)  # rospy's threads may wait for a master that is gone


if __name__ == "__main__":
    main()
