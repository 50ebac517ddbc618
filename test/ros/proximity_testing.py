"""Helpers of the rostests: a small robot whose true distances are easy, clouds, tf, and a node.

Every node runs in a namespace of its own, with its own /tf, so that no test sees another's robot.
Nothing here sleeps and hopes: tests wait for a condition, with a timeout that a busy machine can keep.
"""

import atexit
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import genpy.dynamic
import numpy as np
import roslib.packages
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion, TransformStamped
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from ist_proximity.msg import JointRepulsion, LinkProximity, ProximityArray
from ist_proximity.srv import AttachObject, AttachObjectRequest

TIMEOUT = 30.0  # [s] for anything to happen

BALL_RADIUS = 0.1
BOX_SIZE = np.array([0.2, 0.4, 0.6])
BOX_OFFSET = np.array([0.05, 0.0, 0.1])  # of the box in its link's frame


_add_subtest = unittest.TestResult.addSubTest


def _tell_subtest(result, test, subtest, error):
    """Says which subtest failed and why: rosunit counts it, and calls the test passed."""
    _add_subtest(result, test, subtest, error)
    if error is not None and hasattr(result, "_failure"):  # rosunit's result
        result._failure = error
        print("FAILED: %s\n%s" % (subtest, error[1]), file=sys.__stderr__, flush=True)


unittest.TestResult.addSubTest = _tell_subtest


def urdf(extra="", box='<box size="0.2 0.4 0.6"/>'):
    """base (no geometry) carries ball_link, a sphere, and box_link; `extra` goes before the end."""
    return """<robot name="tiny">
  <link name="base"/>
  <link name="ball_link"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="box_link"><collision><origin xyz="0.05 0 0.1"/><geometry>%s</geometry></collision>
  </link>
  <joint name="to_ball" type="floating"><parent link="base"/><child link="ball_link"/></joint>
  <joint name="to_box" type="floating"><parent link="base"/><child link="box_link"/></joint>
  %s
</robot>""" % (
        box,
        extra,
    )


def transform(p=(0, 0, 0), axis=(0, 0, 1), angle=0.0):
    """4x4, a rotation about a unit axis, then a translation."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    X = np.eye(4)
    X[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    X[:3, 3] = p
    return X


def inverse(X):
    Y = np.eye(4)
    Y[:3, :3], Y[:3, 3] = X[:3, :3].T, -X[:3, :3].T @ X[:3, 3]
    return Y


def apply(X, points):
    return np.asarray(points, float) @ X[:3, :3].T + X[:3, 3]


def quaternion(X):
    """(x, y, z, w), from the eigenvector of largest eigenvalue."""
    R = X[:3, :3]
    K = np.zeros((4, 4))
    K[:3, :3] = R + R.T - np.trace(R) * np.eye(3)
    K[:3, 3] = K[3, :3] = [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]
    K[3, 3] = np.trace(R)
    return np.linalg.eigh(K)[1][:, -1]


def distance_to_ball(p_L):
    return np.linalg.norm(np.atleast_2d(p_L), axis=1) - BALL_RADIUS


def distance_to_box(p_L):
    q = abs(np.atleast_2d(p_L) - BOX_OFFSET) - BOX_SIZE / 2
    return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(1), 0)


DISTANCE = {"ball_link": distance_to_ball, "box_link": distance_to_box}


def cloud(points, frame="camera", stamp=None, dtype="<f4"):
    """A PointCloud2 of (n, 3) points, stamped now unless said."""
    points = np.atleast_2d(np.asarray(points, float)).reshape(-1, 3)
    message = PointCloud2(height=1, width=len(points), is_dense=False)
    message.header.frame_id = frame
    message.header.stamp = rospy.Time.now() if stamp is None else stamp
    size = np.dtype(dtype).itemsize
    datatype = PointField.FLOAT32 if size == 4 else PointField.FLOAT64
    message.fields = [PointField(name, i * size, datatype, 1) for i, name in enumerate("xyz")]
    message.is_bigendian = dtype[0] == ">"
    message.point_step = 3 * size
    message.row_step = message.point_step * len(points)
    message.data = points.astype(dtype).tobytes()
    return message


def transform_message(parent, child, X, stamp):
    message = TransformStamped()
    message.header.stamp = stamp
    message.header.frame_id, message.child_frame_id = parent, child
    p, q = message.transform.translation, message.transform.rotation
    p.x, p.y, p.z = X[:3, 3]
    q.x, q.y, q.z, q.w = quaternion(X)
    return message


def joint_state(positions, stamp=None, velocities=()):
    message = JointState(name=list(positions), position=list(positions.values()))
    message.velocity = list(velocities)
    message.header.stamp = rospy.Time.now() if stamp is None else stamp
    return message


class Repeater:
    """Calls a function at a rate, in a thread, until stopped or paused: in a `with`, at its end."""

    def __init__(self, rate, function):
        self._period, self.function = 1.0 / rate, function
        self._stop = threading.Event()
        self.paused = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()

    def _run(self):
        while not self._stop.wait(self._period):
            if not self.paused:
                self.function()

    def stop(self):
        self._stop.set()
        self._thread.join()


class World:
    """The surroundings of a node: moving links in its /tf, a static camera, and a cloud."""

    def __init__(self, namespace, X_BC=np.eye(4), has_cloud=True):
        self.namespace = namespace
        self.poses = {}  # child frame: (parent, X or a function of the time in seconds)
        self.points = np.zeros((0, 3))  # in the camera's frame
        self.clouds_sent = []  # (stamp, points)
        self.tf_sent = []  # stamps
        self._tf = rospy.Publisher(namespace + "/tf", TFMessage, queue_size=100)
        self._tf_static = rospy.Publisher(
            namespace + "/tf_static", TFMessage, queue_size=10, latch=True
        )
        self.cloud_publisher = None
        if has_cloud:
            self.cloud_publisher = rospy.Publisher(namespace + "/cloud", PointCloud2, queue_size=10)
        if X_BC is not None:
            self.state_camera(X_BC)
        self._repeaters = []

    def state_camera(self, X_BC=np.eye(4)):
        stamp = rospy.Time.now()
        self._tf_static.publish([transform_message("base", "camera", X_BC, stamp)])

    def stand(self, ball=transform((0, 0, 0)), box=transform((2, 0, 0))):
        """Both links, standing still."""
        self.poses = {"ball_link": ("base", ball), "box_link": ("base", box)}
        return self

    def send_tf(self, late=0.0):
        stamp = rospy.Time.now() - rospy.Duration(late)
        messages = [
            transform_message(parent, child, X(stamp.to_sec()) if callable(X) else X, stamp)
            for child, (parent, X) in dict(self.poses).items()
        ]
        if messages:
            self.tf_sent.append(stamp)
            self._tf.publish(messages)

    def publish_transforms(self, messages):
        self._tf.publish(messages)

    def send_cloud(self):
        points = self.points
        message = cloud(points)
        self.clouds_sent.append((message.header.stamp, points))
        self.cloud_publisher.publish(message)

    def start_tf(self, rate=50):
        return self.repeat(rate, self.send_tf)

    def start_clouds(self, rate=20):
        return self.repeat(rate, self.send_cloud)

    def start_points(self, points, frame="base", rate=20):
        """Clouds of points, or of those that a function gives."""
        points_of = points if callable(points) else lambda: points
        return self.repeat(rate, lambda: self.cloud_publisher.publish(cloud(points_of(), frame)))

    def start_joints(self, positions, rate=100, velocities=()):
        """Joint states of positions, or of those that a function gives; both arguments may change."""
        publisher = rospy.Publisher(self.namespace + "/joint_states", JointState, queue_size=100)
        positions_of = positions if callable(positions) else lambda: positions
        return self.repeat(
            rate, lambda: publisher.publish(joint_state(positions_of(), velocities=velocities))
        )

    def repeat(self, rate, function):
        self._repeaters.append(Repeater(rate, function))
        return self._repeaters[-1]

    def stop(self):
        for repeater in self._repeaters:
            repeater.stop()
        self._repeaters = []
        for publisher in (self._tf, self._tf_static, self.cloud_publisher):
            if publisher:
                publisher.unregister()


class NodeTest(unittest.TestCase):
    """A world and its nodes, in a namespace of the test's name; each message keeps what holds for all."""

    BALL = transform()
    BOX = transform((0, 0.8, 0))  # beside the ball; None: tf has neither
    CAMERA = np.eye(4)  # its pose in base; None: it is not static
    POINTS = np.zeros((0, 3))
    MAX_DISTANCE = 1.0  # [m] of check_invariants(); None: it does not hold for all messages

    def setUp(self):
        self.namespace = "/" + self._testMethodName
        self.world = World(self.namespace, self.CAMERA)
        if self.BOX is not None:
            self.world.stand(self.BALL, self.BOX)
        self.world.points = np.array(self.POINTS)
        self.node, self.nodes = None, []

    def tearDown(self):
        self.world.stop()
        for node in self.nodes:
            self.finish(node)

    def start(self, urdf_text=urdf(), **parameters):
        self.node = ProximityNode(self.namespace, parameters, urdf_text)
        self.nodes.append(self.node)
        return self.node

    def finish(self, node):
        for message in node.messages if self.MAX_DISTANCE is not None else []:
            check_invariants(self, message, self.MAX_DISTANCE)
        self.assertEqual(node.stop(), 0)


def run(name, test, **node):
    """The main program of a rostest: of a TestCase, or of one of several, by the program's first argument."""
    import rostest

    rospy.init_node(name, **node)
    if isinstance(test, dict):
        test = test[sys.argv[1]]
    rostest.rosrun("ist_proximity", name, test, sys.argv)


def find_program(package, name):
    return roslib.packages.find_node(package, name)[0]


def start_program(command, namespace, name, log, **options):
    """Starts a node of this name with the tf of the namespace; it ends with the test at the latest."""
    remappings = ["__ns:=" + namespace, "__name:=" + name]
    remappings += ["/%s:=%s/%s" % (topic, namespace, topic) for topic in ("tf", "tf_static")]
    process = subprocess.Popen(
        [*command, *remappings], stdout=log, stderr=subprocess.STDOUT, **options
    )
    atexit.register(process.kill)
    return process


_classes = {}
_classes_lock = threading.Lock()


def _message_class(header):
    """The class that a connection's header defines: not every distribution has diagnostic_msgs for Python."""
    with _classes_lock:  # genpy's generator has state of its own
        if header["type"] not in _classes:
            _classes.update(genpy.dynamic.generate_dynamic(header["type"], header["message_definition"]))
        return _classes[header["type"]]


class ProximityNode:
    """Runs proximity_node in a namespace as a process of the test, and collects its messages."""

    # Command to run instead of the node, e.g. to load the nodelet.
    command = None

    def __init__(
        self,
        namespace,
        parameters=None,
        urdf_text=None,
        listen=True,
        preexec_fn=None,
        diagnostics=True,
    ):
        self.namespace, self.name = namespace, namespace + "/proximity"
        self.messages, self.diagnostics = [], {}
        self._condition = threading.Condition()
        self._cache = tempfile.mkdtemp()
        if urdf_text is not None:
            rospy.set_param(namespace + "/robot_description", urdf_text)
        parameters = dict(parameters or {})
        parameters.setdefault("cache_directory", self._cache)
        for name, value in parameters.items():
            rospy.set_param(self.name + "/" + name, value)
        self._subscribers = []
        if listen:
            self.subscribe("proximity", ProximityArray, self._on_message)
        if listen and diagnostics:  # genpy makes its classes for one thread at a time
            self._subscribers.append(
                rospy.Subscriber("/diagnostics", rospy.AnyMsg, self._on_diagnostics)
            )
        command = self.command or [find_program("ist_proximity", "proximity_node")]
        self._log = tempfile.TemporaryFile()
        self.process = start_program(
            command,
            namespace,
            "proximity",
            self._log,
            preexec_fn=preexec_fn,
            restore_signals=preexec_fn is None,
        )

    def subscribe(self, topic, kind, callback):
        subscriber = rospy.Subscriber(self.name + "/" + topic, kind, callback, queue_size=200)
        self._subscribers.append(subscriber)
        return subscriber

    def collect(self, topic, kind, of=lambda message: message):
        """A list that grows by what a function makes of each message of a topic."""
        collected = []
        self.subscribe(topic, kind, lambda message: collected.append(of(message)))
        return collected

    def _on_message(self, message):
        with self._condition:
            self.messages.append(message)
            self._condition.notify_all()

    def _on_diagnostics(self, raw):
        message = _message_class(raw._connection_header)().deserialize(raw._buff)
        with self._condition:
            for status in message.status:
                if status.name.startswith(self.name[1:] + ":"):
                    self.diagnostics[status.name.split(": ", 1)[1]] = status
            self._condition.notify_all()

    def wait_for(self, condition, what, timeout=TIMEOUT, start=None):
        """Returns the first message, from now or index `start` on, for which the condition holds."""
        deadline = time.monotonic() + timeout
        with self._condition:
            i = len(self.messages) if start is None else start
            while True:
                while i < len(self.messages):
                    if condition(self.messages[i]):
                        return self.messages[i]
                    i += 1
                if self.process.poll() is not None:
                    raise AssertionError("the node ended: " + self.log())
                if time.monotonic() > deadline:
                    last = self.messages[-1] if self.messages else None
                    raise AssertionError(
                        "waited in vain for %s; the last of %d messages is\n%s\n%s"
                        % (what, len(self.messages), last, self.log())
                    )
                self._condition.wait(0.1)

    def next_messages(self, count):
        """Returns as many messages, from now on."""
        begin = len(self.messages)
        self.wait_for(lambda m: len(self.messages) >= begin + count, "%d messages" % count)
        return self.messages[begin:]

    def wait_for_status(self, status, text="", **kwargs):
        return self.wait_for(
            lambda m: m.status == status and text in m.status_text,
            "status %d with '%s'" % (status, text),
            **kwargs
        )

    def wait_for_unknown(self, status, text=""):
        """Returns the first message from now on with this status and text: no link is known in it."""
        message = self.wait_for_status(status, text)
        assert all_unknown(message), message
        return message

    def wait_for_distance(self, distance, what, name="ball_link", within=1e-6, source=None):
        """Returns the first OK message from now on in which a link is so far away, of the source."""

        def is_it(message):
            if message.status != ProximityArray.OK or not message.links:
                return False
            one = link(message, name)
            return abs(one.distance - distance) < within and source in (None, one.source)

        return self.wait_for(is_it, "%s, %g m away" % (what, distance))

    def diagnostic(self, status, key, default=""):
        """Returns a value of the newest diagnostics; `default` where there is none."""
        if status not in self.diagnostics:
            return default
        return {v.key: v.value for v in self.diagnostics[status].values}.get(key, default)

    def wait_for_value(self, status, key, pattern):
        """Waits until a value of the diagnostics matches."""
        what = "'%s' in '%s' of the diagnostics of %s" % (pattern, key, status)
        self.wait_until(lambda: re.search(pattern, self.diagnostic(status, key)), what)

    def wait_until(self, condition, what, timeout=TIMEOUT):
        """Waits for a condition on anything but a ProximityArray."""
        wait_until(condition, what, timeout, self._condition)

    def wait_for_diagnostic(self, status, words="", level=None):
        """Waits until the message of a status has these words, and it has the level."""

        def is_so():
            found = self.diagnostics.get(status)
            return found and words in found.message and level in (None, found.level)

        self.wait_until(is_so, "'%s' in the diagnostics of %s" % (words, status))

    def service(self, name, kind):
        service = rospy.ServiceProxy(self.name + "/" + name, kind)
        service.wait_for_service(TIMEOUT)
        return service

    def attach(self, link, at, dimensions, shape=AttachObjectRequest.SPHERE, name="tool", angle=0.0):
        """Attaches an object that is turned about z; it has to succeed."""
        pose = Pose(Point(*at), Quaternion(z=np.sin(angle / 2), w=np.cos(angle / 2)))
        answer = self.service("attach_object", AttachObject)(name, link, shape, dimensions, "", pose)
        assert answer.success, answer.message

    def reload(self):
        return self.service("reload_model", Trigger)()

    def log(self):
        self._log.seek(0)
        text = self._log.read().decode(errors="replace")
        return "\n".join(line for line in text.splitlines() if not repeated_tf(line))

    def stop(self):
        for subscriber in self._subscribers:
            subscriber.unregister()
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            code = self.process.wait(TIMEOUT)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise AssertionError("the node does not end: " + self.log())
        finally:
            shutil.rmtree(self._cache, ignore_errors=True)
        if code != 0:  # a sanitizer's report, for example
            print(self.log())
        return code


def repeated_tf(line):
    """Whether a line is the warning that tf2 repeats while the clock stands still."""
    return "TF_REPEATED_DATA" in line or "tf2/src/buffer_core.cpp" in line


def wait_until(condition, what, timeout=TIMEOUT, lock=None):
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError("waited in vain for " + what)
        if lock is None:
            time.sleep(0.02)
        else:
            with lock:
                lock.wait(0.05)


def first_of(messages, condition, what, begin=None):
    """Waits for the first of the messages in a growing list, from now or `begin` on, with a condition."""
    i = len(messages) if begin is None else begin
    deadline = time.monotonic() + TIMEOUT
    while time.monotonic() < deadline:
        while i < len(messages):
            if condition(messages[i]):
                return messages[i]
            i += 1
        time.sleep(0.005)
    raise AssertionError("waited in vain for %s; the last is %s" % (what, messages[-1:]))


def link(message, name):
    for one in message.links:
        if one.link == name:
            return one
    raise AssertionError("no link %s in %s" % (name, [one.link for one in message.links]))


def vector(v):
    return np.array([v.x, v.y, v.z])


def closing_rates(one):
    """The parts of the closing speed, and the time to contact."""
    return np.array([one.closing_speed_robot, one.closing_speed_obstacles, one.time_to_contact])


def check_joint_repulsion(test, node, jacobians, count=20):
    """Checks ~joint_repulsion against J^T times the repulsion in ~proximity with the same stamp.

    jacobians(stamp): by link the 6 x n Jacobian of its origin, columns as the message's joints.
    """
    received, largest = {}, [0.0]
    subscriber = node.subscribe(
        "joint_repulsion", JointRepulsion, lambda m: received.setdefault(m.header.stamp, m)
    )
    begin, checked = len(node.messages), set()

    def check_new():
        for message in list(node.messages[begin:]):
            stamp = message.header.stamp
            efforts = received.get(stamp)
            if efforts is None or stamp in checked or message.status != ProximityArray.OK:
                continue
            J = jacobians(stamp.to_sec())
            expected = sum(
                J[one.link].T @ np.hstack([vector(one.repulsion), vector(one.repulsion_torque)])
                for one in message.links
            )
            test.assertEqual(efforts.status, ProximityArray.OK, efforts.status_text)
            np.testing.assert_allclose(efforts.effort, expected, atol=1e-6)
            largest[0] = max(largest[0], abs(expected).max())
            checked.add(stamp)
        return len(checked) >= count and largest[0] > 0.05

    node.wait_until(check_new, "%d efforts with the poses of a ~proximity" % count)
    subscriber.unregister()
    return received[max(received)]


def states(message):
    return [one.state for one in message.links]


def all_unknown(message):
    return all(one.state == LinkProximity.UNKNOWN for one in message.links)


def check_invariants(test, message, max_distance=1.0):
    """Checks what holds for every ProximityArray, whatever is missing."""
    for one in message.links:
        p_link, p_obstacle = vector(one.point_on_link), vector(one.point_on_obstacle)
        direction, local = vector(one.direction), vector(one.point_on_link_local)
        wrench = np.hstack([vector(one.penetration.force), vector(one.penetration.torque)])
        repulsion = vector(one.repulsion)
        torque, rates = vector(one.repulsion_torque), closing_rates(one)
        test.assertEqual(bool(one.closing_unknown & one.ROBOT_UNKNOWN), np.isnan(rates[0]))
        test.assertEqual(bool(one.closing_unknown & one.OBSTACLES_UNKNOWN), np.isnan(rates[1]))
        if np.isfinite(rates[:2]).all():
            test.assertAlmostEqual(one.closing_speed, sum(rates[:2]), 9)
        test.assertFalse(one.time_to_contact < 0)
        test.assertFalse(one.robot_future > one.lower_bound)
        parts = [one.interval_model, one.interval_tolerance, one.interval_sensor]
        if one.state in (LinkProximity.NEAR, LinkProximity.CONTACT):
            test.assertGreaterEqual(min(parts), 0.0)
            test.assertAlmostEqual(sum(parts), one.distance - one.lower_bound, 6)
        else:
            test.assertTrue(np.isnan(parts).all())
        if one.state == LinkProximity.UNKNOWN:
            test.assertTrue(np.isnan(one.distance))
            test.assertEqual(one.lower_bound, -np.inf)
            test.assertTrue(np.isnan(one.closing_speed))
            for v in (p_link, p_obstacle, direction, local, repulsion, torque, wrench, rates):
                test.assertTrue(np.isnan(v).all(), one)
            test.assertEqual(one.source, "")
        elif one.state == LinkProximity.CLEAR:
            test.assertEqual(one.distance, np.inf)
            test.assertGreaterEqual(one.lower_bound, max_distance)
            test.assertTrue(np.isnan(one.closing_speed))
            for v in (p_link, p_obstacle, direction, local, rates):
                test.assertTrue(np.isnan(v).all(), one)
            test.assertFalse(repulsion.any() or torque.any() or wrench.any(), one)
            test.assertEqual(one.source, "")
        else:
            test.assertTrue(np.isfinite(one.distance))
            test.assertLessEqual(one.lower_bound, one.distance)
            test.assertAlmostEqual(np.linalg.norm(direction), 1.0, 6)
            np.testing.assert_allclose(p_link - p_obstacle, one.distance * direction, atol=1e-6)
            let_go = message.status == ProximityArray.DEGRADED and np.isnan(repulsion).all()
            test.assertTrue(let_go or np.isfinite(repulsion).all() and np.isfinite(torque).all())
            test.assertNotEqual(one.source, "")
            if one.state == LinkProximity.NEAR:
                test.assertGreaterEqual(one.distance, 0.0)
                # The wrench is unknown where the query left open whether they overlap.
                left_open = one.lower_bound + one.interval_sensor < 0 and np.isnan(wrench).all()
                test.assertTrue(left_open or not wrench.any())
            else:  # all or nothing is known
                test.assertIn(np.isfinite(wrench).sum(), (0, 6))
    if message.status == ProximityArray.OK:
        test.assertEqual(message.status_text, "")
        test.assertFalse(all_unknown(message) and message.links)
    else:
        test.assertNotEqual(message.status_text, "")
    if message.status in (ProximityArray.NO_CLOUD, ProximityArray.STALE_CLOUD):
        test.assertTrue(all_unknown(message))
    fresh = [s.name for s in message.sources if s.status == ProximityArray.OK and not s.name.endswith("/memory")]
    test.assertTrue(fresh or not message.sources or all_unknown(message), "nobody vouches for what is free")
