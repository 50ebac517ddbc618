#!/usr/bin/env python3
"""ist_proximity/VelocityFilter in the command path: a ball on two slides, a wall, and every fault."""

import subprocess
import tempfile
import threading

import numpy as np
import proximity_testing as pt
import rospy
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from ist_proximity.msg import FilterState
from ist_proximity.srv import IgnoreLinks
from proximity_testing import ProximityArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from visualization_msgs.msg import Marker, MarkerArray

SLIDES = """<robot name="slides">
  <link name="base"/>
  <link name="beam"/>
  <link name="ball"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="along" type="prismatic"><parent link="base"/><child link="beam"/>
    <axis xyz="1 0 0"/><limit lower="-5" upper="5" velocity="2" effort="1"/></joint>
  <joint name="across" type="prismatic"><parent link="beam"/><child link="ball"/>
    <axis xyz="0 1 0"/><limit lower="-5" upper="5" velocity="0.4" effort="1"/></joint>
</robot>"""

# A post beside the ball's way, 0.3 m from it at the start.
POST = """  <link name="post"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="to_post" type="fixed"><parent link="base"/><child link="post"/>
    <origin xyz="0 0.5 0"/></joint>
</robot>"""

# The ball as a mobile base, whose front looks along y.
BASE = """  <link name="base_link"/>
  <joint name="to_front" type="fixed"><parent link="ball"/><child link="base_link"/>
    <origin rpy="0 0 1.5707963267948966"/></joint>
</robot>"""

# Both joints slide along x; the first one alone moves what comes to the wall.
REDUNDANT = SLIDES.replace(
    '<link name="beam"/>',
    '<link name="beam"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>',
).replace('<axis xyz="0 1 0"/>', '<origin xyz="0 1.5 0"/><axis xyz="1 0 0"/>')

WALL = 1.0  # [m] along x
RADIUS = 0.1
STOP = 0.05
PADDING = 0.15  # [m] of the self-filter, where there is one
JOINTS = ["along", "across"]
PERIOD = 0.01


def wall():
    y, z = np.meshgrid(np.arange(-0.6, 0.6, 0.02), np.arange(-0.3, 0.3, 0.02))
    return np.column_stack([np.full(y.size, WALL), y.ravel(), z.ravel()])


class Filter:
    """The node, or another program that has the filter, in a process of its own."""

    program = ("ist_proximity", "velocity_filter_node")
    arguments = []

    def __init__(self, namespace, **parameters):
        self.name = namespace + "/filter"
        self.states, self.given, self.scales = [], [], []
        for name, value in parameters.items():
            rospy.set_param(self.name + "/" + name, value)
        kinds = {kind._type: kind for kind in (Float64MultiArray, JointState, Twist, TwistStamped)}
        self.kind = kinds.get(parameters.get("command_type"), JointTrajectory)
        self._subscribers = [
            rospy.Subscriber(self.name + "/filter_state", FilterState, self.states.append),
            rospy.Subscriber(self.name + "/safe_command", self.kind, self.given.append),
            rospy.Subscriber(self.name + "/speed_scale", Float64, lambda m: self.scales.append(m.data)),
        ]
        self.publisher = rospy.Publisher(self.name + "/command", self.kind, queue_size=1)
        self._log = tempfile.TemporaryFile()
        command = [pt.find_program(*self.program), *self.arguments]
        self.process = pt.start_program(command, namespace, "filter", self._log)
        pt.wait_until(lambda: self.publisher.get_num_connections() == 1, "the filter")

    def is_heard(self):
        return all(subscriber.get_num_connections() > 0 for subscriber in self._subscribers)

    def stop(self):
        for subscriber in self._subscribers:
            subscriber.unregister()
        self.publisher.unregister()
        self.process.terminate()
        return self.process.wait(pt.TIMEOUT)


class SlidesTest(pt.NodeTest):
    """A ball on two slides, which goes as the filter lets it."""

    BOX, POINTS = None, wall()

    def setUp(self):
        super().setUp()
        self.filter = None
        self.clouds = self.world.start_clouds()
        self.q, self.velocity = np.zeros(2), np.zeros(2)
        self.lock = threading.Lock()
        self.joint_publisher = rospy.Publisher(
            self.namespace + "/joint_states", JointState, queue_size=10
        )
        self.nearest, self.way = np.inf, lambda: self.q[0]
        self.count, self.seldom = 0, 1  # periods, and after how many a joint state comes
        self.robot = self.world.repeat(1.0 / PERIOD, self.move)

    def tearDown(self):
        if self.filter:
            self.filter.stop()
        super().tearDown()

    def move(self):
        """One period of the robot, which follows the last velocity that it was given."""
        with self.lock:
            if self.filter and self.filter.given:
                self.velocity = self.given_velocity(self.filter.given[-1])
            self.q = self.q + PERIOD * self.velocity
            self.nearest = min(self.nearest, WALL - RADIUS - self.way())
            self.count += 1
        if self.count % self.seldom == 0:
            self.send_joints(self.q)

    def send_joints(self, q):
        self.joint_publisher.publish(pt.joint_state(dict(zip(JOINTS, q))))

    def given_velocity(self, message):
        if isinstance(message, JointTrajectory):
            return np.array(message.points[0].velocities)
        if isinstance(message, TwistStamped):  # of a ball on two slides
            return np.array([message.twist.linear.x, message.twist.linear.y])
        if isinstance(message, Twist):  # of BASE
            return np.array([-message.linear.y, message.linear.x])
        return np.array(message.data if isinstance(message, Float64MultiArray) else message.velocity)


class VelocityFilterTest(SlidesTest):
    def setUp(self):
        super().setUp()
        has_post = "post" in self._testMethodName
        has_padding = "padding" in self._testMethodName
        robot = REDUNDANT if "redundant" in self._testMethodName else SLIDES
        if "apart" in self._testMethodName and "seldom" in self._testMethodName:  # both joints slide along x, as fast
            robot = SLIDES.replace('"0 1 0"', '"1 0 0"').replace("0.4", "2")
        if "mimic" in self._testMethodName:  # the ball hangs on one that follows the other
            robot = robot.replace('link="beam"/><child link="ball"', 'link="base"/><child link="ball"')
            robot = robot.replace('<child link="ball"/>', '<child link="ball"/><mimic joint="along"/>')
        if "limit" in self._testMethodName:
            robot = SLIDES.replace('upper="5" velocity="2"', 'upper="0.6" velocity="2"')
        if "slid_to" in self._testMethodName:
            robot = SLIDES.replace('upper="5" velocity="0.4"', 'upper="0.3" velocity="2"')
        if "base" in self._testMethodName:
            robot = robot.replace("</robot>", BASE)
        super().start(
            robot.replace("</robot>", POST) if has_post else robot,
            pose_source="joint_states",
            self_filter=has_padding,
            self_filter_padding=PADDING,
            cloud_timeout=3.0 if "clouds" in self._testMethodName else 0.5,
            **{"self_collision/enabled": has_post},
        )
        self.node.wait_for_status(ProximityArray.OK)

    def command(self, *velocity):
        if self.filter.kind is JointTrajectory:
            point = JointTrajectoryPoint(velocities=velocity, positions=[0.0] * len(velocity))
            point.time_from_start = rospy.Duration(PERIOD)
            message = JointTrajectory(joint_names=JOINTS, points=[point])
        elif self.filter.kind is JointState:
            message = JointState(name=JOINTS, velocity=velocity)
        elif self.filter.kind is TwistStamped:
            message = TwistStamped()
            message.header.frame_id, message.header.stamp = "ball", rospy.Time.now()
            message.twist.linear = Vector3(*velocity, *[0.0] * (3 - len(velocity)))
        elif self.filter.kind is Twist:
            message = Twist(Vector3(*velocity[:2], 0.0), Vector3(0.0, 0.0, sum(velocity[2:])))
        else:
            message = Float64MultiArray(data=velocity)
        self.filter.publisher.publish(message)

    def start(self, *velocity, **parameters):
        """Starts the filter, and commands that go on until they are changed."""
        self.filter = Filter(self.namespace, **parameters)
        self.wanted = velocity
        self.commands = self.world.repeat(1.0 / PERIOD, lambda: self.command(*self.wanted))

    def wait_for(self, status, text=""):
        """The first state from now on that says so."""
        return pt.first_of(
            self.filter.states,
            lambda s: s.status == status and text in s.status_text,
            "status %d with '%s'" % (status, text),
        )

    def check_stopped(self, distance):
        """It has not come nearer to the wall."""
        pt.wait_until(lambda: abs(self.velocity[0]) < 0.01, "the ball to stand")
        self.assertGreaterEqual(self.nearest, distance - 0.005)

    def stand_at_wall(self, away):
        self.q = np.array([WALL - RADIUS - away, 0.0])
        self.node.wait_for(lambda m: m.links[0].distance < away + 0.01, "the robot at the wall")

    def check_fault(self, text):
        state = self.wait_for(FilterState.FAULT, text)
        self.assertFalse(np.any(state.velocity), state)
        self.assertEqual(state.links, [])
        return state

    def test_stops_before_a_wall_and_leaves(self):
        self.start(0.5, 0.1)
        limited = self.wait_for(FilterState.LIMITED)
        self.assertEqual(list(limited.joints), JOINTS)
        self.assertEqual(limited.links, ["ball"])
        self.assertEqual(limited.sources, ["cloud"])
        self.assertEqual(list(limited.command), [0.5, 0.1])
        self.check_stopped(STOP)
        self.assertLess(WALL - RADIUS - self.q[0], STOP + 0.15)
        pt.wait_until(lambda: self.velocity[1] > 0.05, "the ball to go along the wall")
        # The row that binds is drawn.
        drawn = []
        listener = rospy.Subscriber(
            self.filter.name + "/filter_markers", MarkerArray, lambda m: drawn.append(m.markers)
        )
        pt.wait_until(lambda: len(drawn) > 2, "markers")
        listener.unregister()
        self.assertEqual(
            [(m.type, m.action) for m in drawn[-1]],
            [
                (Marker.ARROW, Marker.DELETEALL),
                (Marker.LINE_LIST, Marker.ADD),
                (Marker.TEXT_VIEW_FACING, Marker.ADD),
            ],
        )
        wall_point, ball_point = drawn[-1][1].points
        self.assertAlmostEqual(wall_point.x, WALL, 3)
        self.assertAlmostEqual(ball_point.x, self.q[0] + RADIUS, 2)
        self.assertIn("'ball' is 0.0", drawn[-1][2].text)
        # Away from it as commanded, at once.
        self.wanted = (-0.3, 0.0)
        free = self.wait_for(FilterState.FREE)
        self.assertEqual(list(free.velocity), [-0.3, 0.0])
        self.assertEqual(free.status_text, "")
        # The URDF's speed limit holds, and is named.
        self.wanted = (0.0, 1.0)
        state = self.wait_for(FilterState.LIMITED, "across")
        self.assertEqual(state.limited_joints, ["across"])
        self.assertAlmostEqual(state.velocity[1], 0.4, 9)
        # Positions follow the given velocity.
        given = self.filter.given[-1].points[0]
        self.assertLess(abs(given.positions[1] - self.q[1]), 0.2)

    def test_stops_before_the_padding_hides_the_wall(self):
        """Points within the padding are taken for the robot: nothing would be near there."""
        self.start(0.5, 0.0)
        self.wait_for(FilterState.LIMITED)
        self.check_stopped(STOP + PADDING)
        self.assertEqual([s.blind_skin for s in self.node.wait_for_status(ProximityArray.OK).sources], [PADDING])

    def test_stops_where_what_hides_may_have_come(self):
        self.start(0.5, 0.0, obstacle_speed=0.4, obstacle_age=0.5)
        self.wait_for(FilterState.LIMITED)
        self.check_stopped(STOP + 0.4 * 0.5)

    def test_stops_before_a_post_of_its_own(self):
        self.start(0.0, 0.4, self_proximity=True)
        limited = self.wait_for(FilterState.LIMITED)
        self.assertEqual(set(limited.links + limited.sources), {"ball", "post"})
        pt.wait_until(lambda: abs(self.velocity[1]) < 0.01, "the ball to stand")
        apart = np.hypot(self.q[0], self.q[1] - 0.5) - 0.2
        self.assertGreater(apart, 0.005)
        self.assertLess(apart, 0.02)
        self.wanted = (0.0, -0.3)
        free = self.wait_for(FilterState.FREE)
        self.assertEqual(list(free.velocity), [0.0, -0.3])

    def test_object_that_is_attached_near_a_post(self):
        """Distances from link to link are without it for a while after that."""
        self.start(0.0, 0.0, self_proximity=True)
        self.wait_for(FilterState.FREE)
        self.node.attach("ball", (0.0, 0.25, 0.0), [0.1])  # 0.05 m from the post
        self.nearest, self.way = np.inf, lambda: WALL - RADIUS - (0.05 - self.q[1])
        self.wanted = (0.0, 0.4)
        limited = self.wait_for(FilterState.LIMITED)
        self.assertEqual(set(limited.links + limited.sources), {"ball", "post"})
        pt.wait_until(lambda: abs(self.velocity[1]) < 0.01, "the ball to stand")
        self.assertGreater(self.nearest, 0.005)

    def test_distances_from_link_to_link_that_do_not_come(self):
        self.start(0.1, 0.0, self_proximity=True)
        self.check_fault("no distances have come on '%s/proximity/self_proximity'" % self.namespace)

    def test_ignored_links(self):
        """The robot stands near the wall, and is to touch it."""
        self.stand_at_wall(0.02)
        self.robot.function = lambda: self.send_joints(self.q)
        self.start(0.2, 0.0)
        self.wait_for(FilterState.LIMITED)
        ignore = self.node.service("ignore_links", IgnoreLinks)
        self.assertTrue(ignore(["ball"], 2.0).success)
        free = self.wait_for(FilterState.FREE)
        self.assertEqual(free.ignored_links, ["ball"])
        self.assertEqual(list(free.velocity), [0.2, 0.0])
        self.assertEqual(self.wait_for(FilterState.LIMITED).ignored_links, [])

    def test_twist_of_the_ball(self):
        self.start(0.5, 0.1, command_type="geometry_msgs/TwistStamped")
        limited = self.wait_for(FilterState.LIMITED)
        self.assertEqual(list(limited.joints), JOINTS)
        self.assertEqual(limited.links, ["ball"])
        np.testing.assert_allclose(limited.command, [0.5, 0.1], atol=1e-9)
        self.check_stopped(STOP)
        self.assertGreater(self.velocity[1], 0.05)
        self.assertEqual(self.filter.given[-1].header.frame_id, "ball")
        self.wanted = (-0.3, 0.0)
        self.wait_for(FilterState.FREE)
        # A joint that is too slow slows the ball down and does not turn its way.
        self.wanted = (-0.2, 0.8)
        state = self.wait_for(FilterState.SCALED, "across")
        np.testing.assert_allclose(state.velocity, [-0.1, 0.4], atol=1e-6)
        self.wanted = (0.0, 0.0, 0.1)
        self.check_fault("'ball' cannot move so where it is")
        self.wanted = (np.nan, 0.0)
        self.check_fault("not a finite number")
        pt.wait_until(lambda: not np.any(self.velocity), "the ball to stand")

    def test_twist_of_a_redundant_robot(self):
        """The second slide could make the twist, but who receives it may take both."""
        self.stand_at_wall(0.03)  # with its beam, which is the first link
        self.robot.function = lambda: self.send_joints(self.q)
        self.start(0.1, 0.0, command_type="geometry_msgs/TwistStamped")
        state = self.wait_for(FilterState.STOPPED, "'beam'")
        self.assertFalse(np.any(state.velocity))
        self.wanted = (-0.1, 0.0)
        state = self.wait_for(FilterState.FREE)
        np.testing.assert_allclose(state.velocity, [-0.05, -0.05], atol=1e-9)
        pt.wait_until(lambda: abs(self.filter.given[-1].twist.linear.x + 0.1) < 1e-9, "the twist")

    def test_twist_of_a_base(self):
        """What is commanded to the wall at a slant is slowed down to 0 and goes not along it."""
        self.start(0.1, -0.5, command_type="geometry_msgs/Twist", tool="base_link")
        state = self.wait_for(FilterState.SCALED)
        self.assertEqual(state.links, ["ball"])
        np.testing.assert_allclose(state.command, [0.5, 0.1], atol=1e-9)
        begin = len(self.filter.given)
        pt.wait_until(lambda: np.linalg.norm(self.velocity) < 0.01, "the base to stand")
        self.assertGreaterEqual(self.nearest, STOP - 0.005)
        for given in self.filter.given[begin:]:
            self.assertAlmostEqual(given.linear.y, -5.0 * given.linear.x, 9)
            self.assertFalse(np.any([given.linear.z, given.angular.z]))
        self.wanted = (0.0, 0.3)
        self.wait_for(FilterState.FREE)
        pt.wait_until(lambda: np.allclose(self.velocity, [-0.3, 0.0], atol=1e-9), "the retreat")
        self.wanted = (0.0, 0.3, 0.1)
        self.check_fault("'base_link' cannot move so")
        self.wanted = (np.nan, 0.0)
        self.check_fault("not a finite number")
        self.commands.paused = True
        self.check_fault("the last command came")
        pt.wait_until(lambda: not np.any(self.velocity), "0 after a timeout")

    def test_started_inside_the_stop_distance(self):
        self.stand_at_wall(0.02)
        self.start(0.5, 0.0)
        state = self.wait_for(FilterState.LIMITED)
        self.assertLessEqual(state.velocity[0], 0.0)
        self.wanted = (-0.2, 0.0)
        state = self.wait_for(FilterState.FREE)
        self.assertEqual(list(state.velocity), [-0.2, 0.0])
        # A filter that ends gives 0 once more.
        given = self.filter.given
        self.assertTrue(np.any(self.given_velocity(given[-1])))
        self.filter.process.terminate()
        pt.wait_until(lambda: not np.any(self.given_velocity(given[-1])), "0 at the end")

    def wait_for_scale(self, low, high, what):
        what = "a scale of %g to %g: %s" % (low, high, what)
        pt.first_of(self.filter.scales, lambda s: low <= s <= high, what)

    def test_speed_scale_of_a_command(self):
        """The robot stands where it is: the scale is for others to use."""
        self.stand_at_wall(0.02)
        self.robot.function = lambda: self.send_joints(self.q)
        self.start(0.2, 0.0)
        self.wait_for_scale(0.0, 0.0, "an approach within the stop distance")
        self.wanted = (-0.2, 0.0)
        self.wait_for_scale(1.0, 1.0, "the retreat")
        # The node's own scale does not let it leave; without a command it is passed on.
        self.commands.paused = True
        self.wait_for_scale(0.0, 0.0, "no command")
        self.commands.paused = False
        self.wait_for_scale(1.0, 1.0, "the retreat again")
        # A joint's speed limit is a bound, too: 0.4 m/s of 0.8.
        self.wanted = (0.0, 0.8)
        self.wait_for_scale(0.0, 0.5, "a joint that is too fast")
        # An approach from farther away, in part.
        self.q = np.array([WALL - RADIUS - STOP - 0.1, 0.0])
        self.wanted = (1.0, 0.0)
        self.wait_for_scale(0.1, 0.9, "an approach from 0.1 m before the stop distance")
        self.q = np.array([0.0, 0.0])
        self.commands.paused = True
        self.wait_for_scale(1.0, 1.0, "the node's own, far away")
        self.commands.paused = False
        # Bad input, and what is not known.
        for wanted in ((np.nan, 0.0), (np.inf, 0.0)):
            self.wanted = (0.1, 0.0)
            self.wait_for_scale(1.0, 1.0, "a command that can be used")
            self.wanted = wanted
            self.wait_for_scale(0.0, 0.0, str(wanted))
        self.wanted = (0.1, 0.0)
        self.wait_for_scale(1.0, 1.0, "a command that can be used")
        self.clouds.paused = True
        self.wait_for_scale(0.0, 0.0, "a camera that is gone")
        begin = len(self.filter.scales)
        self.wanted = (-0.1, 0.0)
        pt.wait_until(lambda: len(self.filter.scales) > begin + 30, "30 more scales")
        self.assertFalse(np.any(self.filter.scales[begin + 5 :]))
        self.clouds.paused = False
        self.wait_for_scale(1.0, 1.0, "a camera that is there")
        begin = len(self.filter.scales)
        self.filter.process.terminate()
        pt.wait_until(lambda: 0.0 in self.filter.scales[begin:], "0 at the end")

    def answer(self, message, ahead):
        """Publishes it in place of the node, with stamps ahead of the clock."""
        answers = rospy.Publisher(self.namespace + "/proximity/proximity", ProximityArray, queue_size=1)

        def send():
            message.header.stamp = rospy.Time.now() + ahead
            answers.publish(message)

        return self.world.repeat(50, send)

    def test_faults(self):
        self.start(0.1, 0.0, command_type="std_msgs/Float64MultiArray")
        self.wait_for(FilterState.FREE)
        self.wanted = (np.nan, 0.0)
        self.check_fault("velocity of joint 'along' is not a finite number")
        self.wanted = (0.1,)
        self.check_fault("has 1 velocities for 2 joints")
        self.wanted = (0.1, 0.0)
        self.wait_for(FilterState.FREE)

        self.commands.paused = True
        self.check_fault("the last command came")
        self.commands.paused = False
        self.wait_for(FilterState.FREE)

        other = subprocess.Popen(
            [pt.find_program("rostopic", "rostopic"), "pub", "-r", "10"]
            + [self.filter.name + "/command", "std_msgs/Float64MultiArray", "{data: [0.1, 0.0]}"],
            stdout=subprocess.DEVNULL,
        )
        self.check_fault("only one may command")
        other.terminate()
        other.wait()
        self.wait_for(FilterState.FREE)

        self.robot.paused = True
        self.check_fault("~joint_timeout is 0.1 s")
        self.robot.paused = False
        self.wait_for(FilterState.FREE)

        # A camera that is gone: what is near is not known, and the ball stands.
        self.clouds.paused = True
        state = self.wait_for(FilterState.LIMITED, "is not known")
        self.assertFalse(np.any(state.velocity))
        self.clouds.paused = False
        self.wait_for(FilterState.FREE)

        self.assertEqual(self.node.stop(), 0)
        self.check_fault("s old; ~proximity_timeout is 0.2 s")
        self.assertFalse(np.any(self.given_velocity(self.filter.given[-1])))

        # Before a robot's URDF is known, a node watches no link.
        nothing = ProximityArray(status=ProximityArray.LOADING, status_text="no URDF yet")
        nothing.header.frame_id = "base"
        self.answer(nothing, rospy.Duration(0.0))
        self.check_fault("of no link: no URDF yet")

    def test_joints_that_are_commanded_apart(self):
        """What is not commanded any more stands, also while other joints go on."""
        self.robot.function = lambda: self.send_joints(np.zeros(2))
        self.start(0.1, 0.1, command_type="sensor_msgs/JointState")
        self.wait_for(FilterState.FREE)
        names = list(JOINTS)

        def command_each():
            for name in list(names):
                self.filter.publisher.publish(JointState(name=[name], velocity=[0.1]))

        def speeds():
            return {n: v for m in list(self.filter.given) for n, v in zip(m.name, m.velocity)}

        self.filter.given.clear()
        self.commands.function = command_each
        pt.wait_until(lambda: speeds() == {"along": 0.1, "across": 0.1}, "both joints to go")
        names.remove("along")
        pt.wait_until(lambda: speeds() == {"along": 0.0, "across": 0.1}, "one joint to stand")
        # It is told so for a while.
        pt.wait_until(
            lambda: all(s.status == FilterState.FREE for s in self.filter.states[-30:]), "the end of it"
        )
        self.commands.paused = True
        pt.wait_until(lambda: speeds() == {"along": 0.0, "across": 0.0}, "the other one to stand")

    def test_robot_that_is_read_again(self):
        self.robot.function = lambda: self.send_joints(np.zeros(2))
        self.world.points = wall() - [0.7, 0.0, 0.0]  # 0.2 m from the ball
        self.start(2.0, 0.0)
        self.wait_for(FilterState.LIMITED)
        turned = SLIDES.replace('<axis xyz="1 0 0"/>', '<axis xyz="-1 0 0"/>')
        rospy.set_param(self.namespace + "/robot_description", turned)
        self.assertTrue(self.node.reload().success)
        self.wait_for(FilterState.FREE)
        self.wanted = (-2.0, 0.0)
        state = self.wait_for(FilterState.LIMITED)
        self.assertEqual(list(state.command), [-2.0, 0.0])
        self.assertGreater(state.velocity[0], -2.0)

    def test_stamps_that_are_ahead(self):
        """As long as they lie ahead, nobody could tell that no more come."""
        ahead = rospy.Duration(0.8)

        def send_ahead():
            state = dict.fromkeys(JOINTS, 0.0)
            self.joint_publisher.publish(pt.joint_state(state, rospy.Time.now() + ahead))

        self.start(0.1, 0.0)
        self.wait_for(FilterState.FREE)
        self.robot.function = send_ahead
        self.wait_for(FilterState.FREE)
        self.robot.paused = True
        last = rospy.Time.now()
        state = self.check_fault("~joint_timeout is 0.1 s")
        self.assertLess((state.header.stamp - last).to_sec(), 0.5)
        self.robot.function, self.robot.paused = self.move, False
        self.wait_for(FilterState.FREE)

        newest = self.node.messages[-1]
        self.assertEqual(self.node.stop(), 0)
        answers = self.answer(newest, ahead)
        self.check_fault("ahead of the clock")

        # What else no node says: a skin that is no length.
        answers.stop()
        self.answer(newest, rospy.Duration(0.0))
        for skin in (-0.1, np.inf, -np.inf):
            newest.sources[0].blind_skin = skin
            self.check_fault("blind_skin of source 'cloud' is %g m" % skin)
        newest.sources[0].blind_skin = np.nan
        self.wait_for(FilterState.FREE)

    def check_seldom_states(self, *velocity, least=0.0, **parameters):
        """Between joint states, the robot has moved by all that was given."""
        self.start(
            *velocity,
            **{"joint_timeout": 0.3, "proximity_timeout": 0.5, "approach_time": 0.02},
            **{"margin": 0.03, "stop_distance": 0.03},
            **parameters
        )
        self.seldom = 12
        pt.wait_until(lambda: self.nearest < 0.1, "the ball to come near")
        rospy.sleep(1.0)
        print("seldom joint states: nearest %.1f mm" % (1e3 * self.nearest))
        self.assertGreater(self.nearest, least)

    def test_joint_states_that_come_seldom(self):
        self.check_seldom_states(2.0, 0.0)

    def test_a_mimic_that_is_stated_apart_and_seldom(self):
        """The ball hangs on it, and goes as fast as the joint that is commanded."""
        self.send_joints = lambda q: self.joint_publisher.publish(pt.joint_state({"across": q[0]}))
        self.world.repeat(
            100, lambda: self.joint_publisher.publish(pt.joint_state({"along": self.q[0]}))
        )
        self.given_velocity = lambda message: np.array([message.velocity[0], message.velocity[0]])
        self.command = lambda *velocity: self.filter.publisher.publish(
            JointState(name=JOINTS[:1], velocity=velocity[:1])
        )
        seldom = {"joint_timeout": 0.3, "proximity_timeout": 0.5, "approach_time": 0.02}
        near = {"margin": 0.03, "stop_distance": 0.03}
        self.start(0.0, 0.0, command_type="sensor_msgs/JointState", **seldom, **near)
        self.seldom = 12
        for _ in range(6):  # where it is told counts most when it has just begun to move
            self.wanted = (0.0, 0.0)
            rospy.sleep(0.3)
            with self.lock:
                self.q = np.array([0.65, 0.65])
            rospy.sleep(1.1)
            self.nearest, self.wanted = np.inf, (2.0, 2.0)
            rospy.sleep(0.6)
            print("a mimic stated seldom: nearest %.1f mm" % (1e3 * self.nearest))
            self.assertGreater(self.nearest, 0.015)

    def test_a_limit_between_seldom_states(self):
        """What was given since the joints were stated counts for their limits, too."""
        self.clouds.stop()
        self.world.points = wall() + [3.0, 0, 0]
        self.clouds = self.world.start_clouds()
        self.seldom = 9
        self.start(2.0, 0.0)
        pt.wait_until(lambda: self.q[0] > 0.55, "the ball to come near its limit")
        rospy.sleep(0.5)
        self.assertLess(self.q[0], 0.6 + 0.02)

    def test_a_limit_slid_to_between_seldom_states(self):
        """A wall across the way pushes the ball along itself, by a joint that is commanded to stand."""
        along, up = np.meshgrid(np.arange(-1.0, 1.0, 0.02), np.arange(-0.3, 0.3, 0.02))
        self.world.points = np.column_stack([0.5 + along.ravel(), along.ravel(), up.ravel()])
        self.seldom = 25
        seldom = {"joint_timeout": 0.3, "proximity_timeout": 0.5, "approach_time": 1.0}
        self.start(0.0, 0.0, command_type="std_msgs/Float64MultiArray", **seldom)
        self.wait_for(FilterState.FREE)
        for rest in np.linspace(0.02, 0.1, 8):  # where states come counts
            self.wanted = (0.0, 0.0)
            rospy.sleep(0.4)
            with self.lock:
                self.q = np.array([0.1, 0.3 - rest])
            rospy.sleep(0.6)
            self.wanted = (1.5, 0.0)
            rospy.sleep(0.8)
            print("slid to its limit: %.1f mm past it" % (1e3 * (self.q[1] - 0.3)))
            self.assertLess(self.q[1], 0.3 + 0.008)

    def test_clouds_stamped_ahead(self):
        """Obstacles may have come since the cloud was received, though its stamp is still ahead."""
        self.robot.function = lambda: self.send_joints(np.zeros(2))
        self.clouds.stop()
        near = {"margin": 0.01, "stop_distance": 0.01, "approach_time": 0.02}
        self.start(0.6, 0.0, obstacle_speed=0.8, **near)
        received = rospy.Time.now()
        points = wall() - [0.5, 0.0, 0.0]  # 0.4 m from the ball
        self.world.cloud_publisher.publish(pt.cloud(points, "base", received + rospy.Duration(0.9)))
        self.wait_for(FilterState.FREE)
        rospy.sleep(0.85)
        after = [s for s in self.filter.states if 0.6 < (s.header.stamp - received).to_sec() < 0.85]
        self.assertGreater(len(after), 5)
        for state in after:
            self.assertLess(state.velocity[0], 1e-3, (state.header.stamp - received).to_sec())

    def test_joints_commanded_apart_seldom_stated(self):
        """Each command counts with what the other joint was told to do."""
        self.way = lambda: self.q.sum()

        def given_to_each(_):
            given = {n: v for m in self.filter.given[-50:] for n, v in zip(m.name, m.velocity)}
            return np.array([given.get(name, 0.0) for name in JOINTS])

        def command_each(*velocity):
            for one in zip(JOINTS, velocity):
                self.filter.publisher.publish(JointState(name=one[:1], velocity=one[1:]))

        self.given_velocity, self.command = given_to_each, command_each
        # What is given late, where the machine is busy, takes some of the margin.
        self.check_seldom_states(2.0, 2.0, least=0.02, command_type="sensor_msgs/JointState")

    def test_trajectories_that_cannot_be_used(self):
        self.start(0.1, 0.0)
        moving = JointTrajectoryPoint(velocities=[0.1, 0.1])
        for message, text in (
            (JointTrajectory(joint_names=JOINTS), "has 0 points"),
            (JointTrajectory(points=[JointTrajectoryPoint()]), "has no joints"),
            (JointTrajectory(joint_names=["along", "neck"], points=[moving]), "no joint 'neck'"),
            (JointTrajectory(joint_names=["along", "along"], points=[moving]), "twice"),
            (
                JointTrajectory(
                    joint_names=JOINTS, points=[JointTrajectoryPoint(positions=[0.1, 0.1])]
                ),
                "time_from_start above 0",
            ),
        ):
            self.commands.paused = False
            self.wait_for(FilterState.FREE)
            self.commands.paused = True
            publish = self.world.repeat(20, lambda message=message: self.filter.publisher.publish(message))
            # Whoever keeps the last velocity of each joint has 0 for all that moved.
            self.assertEqual(list(self.check_fault(text).joints), JOINTS)
            publish.stop()

    def test_wrong_parameters_are_refused(self):
        self.check_refused({"margin": -1.0, "command_type": "Twist"}, ["~margin", "~command_type"])
        self.check_refused({"margin": 0.01, "command_type": "geometry_msgs/Twist"}, ["~tool is empty"])
        for age in (float("nan"), float("inf"), -1.0, "0.5", [0.5]):
            self.check_refused({"obstacle_age": age}, ["~obstacle_age is "])

    def check_refused(self, parameters, texts):
        for name, value in parameters.items():
            rospy.set_param(self.namespace + "/filter/" + name, value)
        command = [pt.find_program("nodelet", "nodelet"), "standalone", "ist_proximity/VelocityFilter"]
        process = pt.start_program(command, self.namespace, "filter", subprocess.PIPE)
        pt.wait_until(lambda: process.poll() is not None, "the nodelet to be refused")
        text = process.stdout.read().decode()
        for expected in texts:
            self.assertIn(expected, text)


if __name__ == "__main__":
    pt.run("velocity_filter_test", VelocityFilterTest)
