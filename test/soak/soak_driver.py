#!/usr/bin/env python3
"""Sends the soak's inputs: joint states at 1 kHz, clouds at 30 Hz, faults and services at random.

Usage: soak_driver.py NODE SEED EVENTS.csv, in the namespace of the node. Ends with SIGTERM.
EVENTS.csv: a line for each fault and service: time [s], name, seconds or "failed: REASON".
"""

import os
import random
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "ros"))
import proximity_testing as pt  # noqa: E402
from soak_world import (  # noqa: E402
    AHEAD,
    CAMERAS,
    DISTANCE,
    JOINTS,
    MARGIN,
    MAX_DISTANCE,
    POINTS,
    REST,
    TOLERANCE,
    TOOL_RADIUS,
    SoakWorld,
    inverse,
    link_poses,
    rest_left,
)

from ist_proximity.msg import LinkProximity, ProximityArray  # noqa: E402
from ist_proximity.srv import (  # noqa: E402
    AttachObject,
    AttachObjectRequest,
    DetachObject,
    QueryProximity,
)

JOINT_RATE, CLOUD_RATE = 1000.0, 30.0
FAR = np.random.default_rng(0).uniform(-1, 1, (20000, 3)).astype("<f4") + np.float32([0, 0, 6.0])


class Sender(threading.Thread):
    """Sends what `make` gives for a stamp, at `rate` [Hz]; `offset` is added to the stamp, `change` alters
    a message, None drops it."""

    def __init__(self, topic, kind, queue_size, rate, make):
        super().__init__(daemon=True)
        self._publisher = rospy.Publisher(topic, kind, queue_size=queue_size)
        self._make = make
        self.rate, self.offset, self.change = rate, 0.0, None

    def run(self):
        due = time.monotonic()
        while not rospy.is_shutdown():
            message = self._make(rospy.Time.now() + rospy.Duration(self.offset))
            if self.change:
                message = self.change(message)
            try:
                if message:
                    self._publisher.publish(message)
            except rospy.ROSException:  # this program ends
                return
            due = max(due + 1.0 / self.rate, time.monotonic() - 0.1)
            time.sleep(max(0.0, due - time.monotonic()))


def drop(message):
    return None


def frozen():
    """The first message that comes, again and again."""
    first = []

    def change(message):
        first.append(message)
        return first[0]

    return change


def rewritten(dtype="<f4", frame="camera", X=None):
    def change(message):
        points = np.frombuffer(message.data, "<f4").reshape(-1, 3)
        if X is not None:
            points = pt.apply(X, points)
        return pt.cloud(points, frame, message.header.stamp, dtype)

    return change


def without_xyz(message):
    message.fields = [PointField("rgb", 0, PointField.FLOAT32, 1)]
    return message


def contradictory(message):
    message.width = 0
    return message


def cut_off(message):
    message.data = message.data[:-5]
    return message


def in_nowhere(message):
    message.header.frame_id = "nowhere"
    return message


def all_nan(message):
    return pt.cloud(np.full((POINTS, 3), np.nan), "camera", message.header.stamp)


def one_nan(message):
    message.position[2] = np.nan
    return message


def one_missing(message):
    message.name, message.position = message.name[:3], message.position[:3]
    return message


def unequal(message):
    message.position = message.position[:2]
    return message


class Driver:
    def __init__(self, node, seed, events):
        self._node, self._random = node, random.Random(seed)
        self._world = SoakWorld(seed)
        self._events = open(events, "w", buffering=1, encoding="utf-8")
        self._tf = rospy.Publisher("tf_static", TFMessage, queue_size=1, latch=True)
        self._joints = Sender("joint_states", JointState, 1000, JOINT_RATE, self._joint_state)
        self._clouds = Sender("cloud", PointCloud2, 10, CLOUD_RATE, self._cloud)
        self.false_answers = 0

    def _joint_state(self, stamp):
        return pt.joint_state(dict(zip(JOINTS, self._world.joints(stamp.to_sec()))), stamp)

    def _cloud(self, stamp):
        return pt.cloud(np.vstack([self._world.points(stamp.to_sec()), FAR]), "camera", stamp)

    def send_cameras(self):
        now, messages = rospy.Time.now(), []
        for frame, X in CAMERAS.items():
            messages.append(pt.transform_message("base", frame, X, now))
        self._tf.publish(TFMessage(messages))

    def note(self, name, result):
        self._events.write("%.3f,%s,%s\n" % (time.time(), name, result))

    def run(self):
        self.send_cameras()
        self._joints.start()
        self._clouds.start()
        rospy.wait_for_service(self._node + "/query", 60)
        time.sleep(3.0)
        faults = self.faults()
        services = self.services()
        while not rospy.is_shutdown():
            time.sleep(self._random.uniform(0.3, 1.5))
            if self._random.random() < 0.5:
                name = self._random.choice(sorted(faults))
                seconds = self._random.uniform(0.2, 1.2)
                self.note(name, "%.2f" % seconds)
                faults[name](seconds)
            else:
                name = self._random.choice(sorted(services))
                begin = time.monotonic()
                try:
                    services[name]()
                    self.note(name, "%.3f" % (time.monotonic() - begin))
                except (rospy.ServiceException, rospy.ROSException) as error:
                    self.note(name, "failed: %s" % str(error).replace("\n", " "))

    # Faults: each ends after some seconds.

    def faults(self):
        X = inverse(CAMERAS["other_camera"]) @ CAMERAS["camera"]
        clouds = {
            "clouds stop": drop,
            "clouds freeze": frozen,
            "clouds in float64, other byte order": rewritten(">f8"),
            "clouds in another frame": rewritten("<f8", "other_camera", X),
            "clouds in an unknown frame": in_nowhere,
            "clouds without x, y, z": without_xyz,
            "clouds of width 0 with data": contradictory,
            "clouds cut off": cut_off,
            "clouds of NaN": all_nan,
        }
        joints = {
            "joint states stop": drop,
            "joint states freeze": frozen,
            "one joint is NaN": one_nan,
            "one joint is missing": one_missing,
            "joint states contradict themselves": unequal,
        }
        faults = {}
        for sender, changes in ((self._clouds, clouds), (self._joints, joints)):
            for name, change in changes.items():
                faults[name] = self._changing(sender, change)
        for name, sender in (("clouds", self._clouds), ("joint states", self._joints)):
            faults[name + " go back 2 s"] = self._shifting(sender, -2.0)
            faults[name + " are ahead"] = self._ahead(sender)
        faults["clouds flood"] = self._flood
        faults["a subscriber stands still"] = self._slow_subscriber
        faults["parameters are deleted"] = self._delete_parameters
        return faults

    def _changing(self, sender, change):
        def fault(seconds):
            sender.change = change() if change is frozen else change
            time.sleep(seconds)
            sender.change = None

        return fault

    def _shifting(self, sender, offset):
        def fault(seconds):
            sender.offset = offset
            time.sleep(seconds)
            sender.offset = 0.0

        return fault

    def _ahead(self, sender):
        """Within one rest of the robot, before, after and with the stamps that are ahead."""
        def fault(seconds):
            while not 2 * AHEAD + 0.8 < rest_left(time.time()) < REST - 0.05:
                time.sleep(0.005)
            sender.offset = AHEAD
            time.sleep(min(seconds, 0.7))
            sender.offset = 0.0

        return fault

    def _flood(self, seconds):
        self._clouds.rate = 10 * CLOUD_RATE
        time.sleep(seconds)
        self._clouds.rate = CLOUD_RATE

    def _slow_subscriber(self, seconds):
        program = (
            "import rospy\n"
            "from ist_proximity.msg import ProximityArray\n"
            "from sensor_msgs.msg import PointCloud2\n"
            "rospy.init_node('slow', anonymous=True)\n"
            "rospy.Subscriber('%s/proximity', ProximityArray, lambda m: None, queue_size=1)\n"
            "rospy.Subscriber('%s/filtered_cloud', PointCloud2, lambda m: None, queue_size=1)\n"
            "rospy.spin()\n"
        ) % (self._node, self._node)
        process = subprocess.Popen([sys.executable, "-c", program])
        time.sleep(1.0)
        process.send_signal(signal.SIGSTOP)
        time.sleep(seconds)
        process.kill()
        process.wait()

    def _delete_parameters(self, seconds):
        """The margin of before stays, which the check of every bound shows."""
        rospy.delete_param(self._node + "/query")
        time.sleep(seconds)
        rospy.set_param(self._node + "/query", "x")
        time.sleep(seconds)
        rospy.set_param(self._node + "/query", {"margin": MARGIN, "tolerance": TOLERANCE})

    # Services: an exception is a failure, which the event says.

    def services(self):
        self._attached = False
        return {
            "query": self._query,
            "query of a motion": self._query_motion,
            "attach or detach": self._attach_or_detach,
            "reload": self._reload,
            "wrong requests": self._wrong_requests,
        }

    def _call(self, service, kind, **request):
        return rospy.ServiceProxy(self._node + "/" + service, kind)(**request)

    def _states(self, count):
        q = self._world.joints(np.array([self._random.uniform(0, 1e4) for _ in range(count)]))
        return q, [JointState(name=JOINTS, position=list(row)) for row in q]

    def _query(self):
        q, states = self._states(20)
        answer = self._call("query", QueryProximity, states=states)
        poses = link_poses(q)
        for i, result in enumerate(answer.results):
            if result.status != ProximityArray.OK:
                continue
            points = self._world.points(result.cloud_stamp.to_sec()).astype(float)
            points = pt.apply(CAMERAS["camera"], points)
            for one in result.links:
                truth = DISTANCE[one.link](pt.apply(inverse(poses[one.link][i]), points)).min()
                known = one.state != LinkProximity.UNKNOWN
                if known and one.lower_bound > min(truth, MAX_DISTANCE) - MARGIN + 1e-5:
                    self.false_answers += 1
                    self.note("query", "FALSE bound %.6f of %s, truth %.6f" % (
                        one.lower_bound, one.link, truth))

    def _query_motion(self):
        q, states = self._states(3)
        self._call("query", QueryProximity, states=states, times=[0.0, 0.5, 1.0])

    def _attach_or_detach(self):
        if self._attached:
            answer = self._call("detach_object", DetachObject, name="tool")
        else:
            answer = self._call("attach_object", AttachObject, name="tool", link="tool0",
                                shape=AttachObjectRequest.SPHERE, dimensions=[TOOL_RADIUS],
                                pose=Pose(Point(), Quaternion(w=1.0)))
        if not answer.success:
            raise rospy.ServiceException(answer.message)
        self._attached = not self._attached

    def _reload(self):
        self._call("reload_model", Trigger)

    def _wrong_requests(self):
        """Each is refused with a reason."""
        requests = (
            ("attach_object", AttachObject,
             dict(name="x", link="nobody", shape=1, dimensions=[1, 1, 1])),
            ("attach_object", AttachObject,
             dict(name="x", link="hand", shape=1, dimensions=[float("nan"), 1, 1])),
            ("attach_object", AttachObject,
             dict(name="x", link="hand", shape=0, mesh="file:///nowhere.stl")),
            ("detach_object", DetachObject, dict(name="nothing")),
            ("query", QueryProximity,
             dict(states=[JointState(name=["nobody"], position=[1.0])])),
        )
        for name, kind, request in requests:
            answer = self._call(name, kind, **request)
            if answer.success or not answer.message:
                self.false_answers += 1
                self.note(name, "FALSE success of a wrong request %s" % request)


def main():
    node, seed, events = sys.argv[1:4]
    rospy.init_node("soak_driver", anonymous=True)
    driver = Driver(node, int(seed), events)
    try:
        driver.run()
    except rospy.ROSInterruptException:
        pass


if __name__ == "__main__":
    main()
