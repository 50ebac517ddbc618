#!/usr/bin/env python3
"""~trajectory: first contact, clearance and cancelling, and what cannot be watched."""

import subprocess
import time

import genpy.dynamic
import numpy as np
import proximity_testing as pt
import rospy
from actionlib_msgs.msg import GoalID
from geometry_msgs.msg import Pose, Quaternion
from joint_states_test import ARM
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from visualization_msgs.msg import Marker, MarkerArray

from ist_proximity.msg import TrajectoryClearance
from ist_proximity.srv import DetachObject, IgnoreLinks, RemoveZone, SetZone, SetZoneRequest

DURATION = 4.0  # [s]
FAR = 0.8  # [m] where the slide goes to
POINT = 0.6  # [m] on the way of the ball, whose radius is 0.1
TOUCH = DURATION * (POINT - pt.BALL_RADIUS) / FAR  # [s]


def trajectory(rows, start, names=("slide",), velocities=None):
    """rows: (time, position, ...)"""
    message = JointTrajectory(joint_names=list(names))
    message.header.stamp = start
    for k, row in enumerate(rows):
        point = JointTrajectoryPoint(positions=list(row[1:]))
        point.time_from_start = rospy.Duration(row[0])
        if velocities is not None:
            point.velocities = list(velocities[k])
        message.points.append(point)
    return message


GOALS = [
    (
        "moveit_msgs/RobotTrajectory",
        "trajectory_msgs/JointTrajectory joint_trajectory",
        lambda message, path: setattr(message, "joint_trajectory", path),
    ),
    (
        "control_msgs/FollowJointTrajectoryActionGoal",
        "std_msgs/Header header\nactionlib_msgs/GoalID goal_id\ncontrol_msgs/Goal goal\n%s\n"
        "MSG: control_msgs/Goal\ntrajectory_msgs/JointTrajectory trajectory" % ("=" * 80),
        lambda message, path: setattr(message.goal, "trajectory", path),
    ),
]


def dynamic_message(kind, definition):
    """A message of a type that is not installed, with JointTrajectory's definition below its own."""
    parts = [definition]
    for one in (JointTrajectory, Header, GoalID):
        parts.append("MSG: %s\n%s" % (one._type, one._full_text))
    text = ("\n" + "=" * 80 + "\n").join(parts)
    return genpy.dynamic.generate_dynamic(kind, text)[kind]()


class TrajectoryTest(pt.NodeTest):
    CAMERA = BOX = MAX_DISTANCE = None

    def setUp(self):
        super().setUp()
        self.points = np.array([[POINT, 0.0, 0.5]])
        self.cancelled = []
        self.start_time = rospy.Time.now() + rospy.Duration(1e6)
        self.at_rest = self.turn = 0.0
        self.speeds = [0.0, 0.0]
        self.astray = None  # [m] from where the mimic joint would be; None: nobody states it

    def slide(self):
        """Where the robot is: it follows its trajectory."""
        time_now = (rospy.Time.now() - self.start_time).to_sec()
        return FAR * min(max(time_now / DURATION, 0.0), 1.0) + self.at_rest

    def follow(self):
        return {} if self.astray is None else {"follow": -1.5 * self.slide() - 0.5 + self.astray}

    def positions(self):
        """Of all joints that are told often."""
        turned = {} if self.turn is None else {"turn": self.turn}
        return {**turned, "slide": self.slide(), **self.follow()}

    def start(self, urdf=ARM, **parameters):
        super().start(urdf, pose_source="joint_states", self_filter=False, **parameters)
        self.heard = self.node.collect("trajectory_clearance", TrajectoryClearance)
        cancel = self.namespace + "/arm/cancel"
        self.subscriber = rospy.Subscriber(
            cancel, GoalID, lambda _: self.cancelled.append(rospy.Time.now())
        )
        self.sender = rospy.Publisher(self.node.name + "/trajectory", JointTrajectory, queue_size=1)
        self.world.start_joints(lambda: self.positions(), velocities=self.speeds)
        self.clouds = self.world.start_points(lambda: self.points)
        self.node.wait_for_status(0)
        pt.wait_until(lambda: self.sender.get_num_connections() > 0, "the node to listen")

    def wait(self, condition, what, begin=None):
        return pt.first_of(self.heard, condition, what, begin)

    def check_touch(self, told, touch=TOUCH):
        """A contact is told shortly before it is true, [s] after the start."""
        contact = (told.contact - told.start).to_sec()
        self.assertTrue(touch - 0.02 < contact <= touch, (contact, touch))

    def send(self, velocities=None):
        self.start_time = rospy.Time.now() + rospy.Duration(0.3)
        self.sender.publish(
            trajectory([(0.0, 0.0), (DURATION, FAR)], self.start_time, velocities=velocities)
        )

    def test_contact_is_told_and_cancelled_in_time(self):
        self.start(joint_deceleration=0.4, trajectory={"cancel_topic": "arm/cancel"})
        self.assertEqual(self.heard, [], "nobody has sent a trajectory")
        self.send()
        first = self.wait(lambda m: m.state == m.CONTACT, "a contact", 0)
        self.assertEqual(first.first.link, "ball_link")
        self.assertEqual(set(first.links), {"ball_link", "box_link"})
        self.assertEqual(first.header.frame_id, "base")
        self.assertEqual(first.start, self.start_time)
        self.assertAlmostEqual((first.end - first.start).to_sec(), DURATION, places=6)
        self.check_touch(first)
        self.assertAlmostEqual(
            first.time_to_contact, (first.contact - first.header.stamp).to_sec(), places=6
        )
        self.assertAlmostEqual(first.first.point_on_obstacle.x, POINT, places=4)
        # It goes at 0.2 m/s, and stops within 0.5 s and 0.25 s of the trajectory.
        self.assertAlmostEqual((first.contact - first.brake).to_sec(), 0.25, places=3)
        # Every answer is right, until the goal is cancelled.
        pt.wait_until(lambda: self.cancelled, "the goal to be cancelled")
        late = (self.cancelled[0] - first.brake).to_sec()
        slowest = max(m.computation_time for m in self.heard)
        self.assertGreater(late, -0.06 - slowest, "too early")
        self.assertLess(late, 0.05, "too late")
        told = [m for m in self.heard if m.state == m.CONTACT]
        self.assertGreater(len(told), 10)
        for message in told:
            self.check_touch(message)
        self.assertLess(np.median([m.computation_time for m in told]), 0.1)

    def test_clear_until_it_is_over(self):
        self.points = np.array([[0.0, 0.6, 0.5]])
        self.start()
        self.send(velocities=[[0.0], [0.0]])
        clear = self.wait(lambda m: m.state == m.CLEAR, "a clear way", 0)
        self.assertEqual(clear.time_to_contact, float("inf"))
        self.assertEqual(clear.contact, rospy.Time())
        self.assertEqual(clear.brake, rospy.Time())
        self.assertEqual(len(clear.links), len(clear.lower_bounds))
        self.assertEqual(clear.lower_bound, min(clear.lower_bounds))
        # The ball is nearest where it begins: 0.5 m. The box, 0.2 m wide to each side, later.
        self.assertLessEqual(clear.lower_bound, 0.5)
        self.assertGreater(clear.lower_bound, 0.7 * 0.4)
        # A velocity of 0 at both ends makes it a cubic, which the robot of this test lags behind
        # and runs ahead of by less than the tolerance.
        over = self.wait(lambda m: m.state == m.NONE, "its end")
        self.assertIn("over", over.text)
        self.assertTrue(np.isnan(over.time_to_contact))
        time.sleep(0.5)
        self.assertIs(self.heard[-1], over, "no more is said")
        after = self.heard[self.heard.index(clear) : -1]
        self.assertEqual({m.state for m in after}, {clear.CLEAR})

    def test_a_new_cloud_counts_at_once(self):
        self.points = np.array([[0.0, 0.9, 0.5]])
        self.start(trajectory={"obstacle_speed": 0.0})
        self.send()
        self.wait(lambda m: m.state == m.CLEAR, "a clear way", 0)
        begin = rospy.Time.now()
        self.points = np.array([[POINT, 0.0, 0.5]])
        told = self.wait(lambda m: m.state == m.CONTACT, "the new obstacle")
        self.assertLess((told.header.stamp - begin).to_sec(), 0.3)
        self.points = np.array([[0.0, 0.9, 0.5]])
        self.wait(lambda m: m.state == m.CLEAR, "that it has gone")

    def test_zones_and_ignored_links_count_as_in_the_cycle(self):
        self.points = np.array([[POINT, 0.0, 0.5], [0.0, 0.9, 0.5]])
        self.start()
        ignore = self.node.service("ignore_links", IgnoreLinks)
        remove = self.node.service("remove_zone", RemoveZone)
        set_zone = self.node.service("set_zone", SetZone)
        pose = Pose(orientation=Quaternion(w=1.0))
        pose.position.x, pose.position.z = POINT, 0.5
        zone = SetZoneRequest(
            name="target", frame_id="base", shape=SetZoneRequest.SPHERE, dimensions=[0.05], pose=pose
        )

        def is_contact(message):
            return message.state == message.CONTACT and message.first.link == "ball_link"

        self.sender.publish(trajectory([(0.0, 0.0), (60.0, FAR)], rospy.Time()))
        self.wait(is_contact, "the point")
        # The other link is watched on.
        self.assertTrue(ignore(["ball_link"], 100.0).success)
        told = self.wait(lambda m: m.state == m.CLEAR, "no contact of a link that does not count")
        self.assertEqual(told.links, ["box_link"])
        self.assertTrue(ignore(["ball_link"], 0.0).success)
        self.wait(is_contact, "the link to count again")
        # A zone of the other link, of this one, of all.
        for links, is_seen in ([["box_link"], True], [["ball_link"], False], [[], False]):
            zone.links = links
            self.assertTrue(set_zone(zone).success)
            self.node.wait_for(lambda m: m.zones == ["target"], "the zone")
            told = self.wait(lambda m: is_contact(m) == is_seen, "the zone of %s" % links)
            self.assertEqual(told.state == told.CONTACT, is_seen)
            self.assertEqual(set(told.links), {"ball_link", "box_link"})
            self.assertTrue(remove("target").success)
            self.node.wait_for(lambda m: not m.zones, "no zone")
            self.wait(is_contact, "the point again")

    def test_what_is_carried_touches_links_that_stand(self):
        post = """<link name="post"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>
            <joint name="to_post" type="fixed"><parent link="base"/><child link="post"/>
            <origin xyz="1 0 0.5"/></joint></robot>"""
        tool = {"shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.3, 0, 0], "frame_id": "ball_link"}
        self.start(
            ARM.replace("</robot>", post),
            sources={"held": {"type": "world", "objects": {"tool": tool}}},

        )
        self.send()
        told = self.wait(lambda m: m.state == m.CONTACT, "the tool at the post", 0)
        self.assertEqual(told.first.link, "post")
        self.check_touch(told, DURATION * 0.6 / FAR)

    # Obstacles stand still from now on, and are where they are now, not where tf saw them last.
    def test_objects_in_late_frames_are_nearer(self):
        late, speed, begin = 0.3, 0.3, np.inf
        middle = lambda t: np.clip(2.2 - speed * (t - begin), 0.9, 2.2)  # noqa: E731: of the box, along x

        def send():
            stamp = rospy.Time.now() - rospy.Duration(late)
            X = pt.transform((middle(stamp.to_sec()), 0, 0.5))
            self.world.publish_transforms([pt.transform_message("base", "carriage", X, stamp)])

        self.world.repeat(50, send)
        box = {"shape": "box", "size": [0.1, 0.1, 0.1], "frame_id": "carriage"}
        cell = {"type": "world", "objects": {"box": box}}
        self.points = np.array([[0.0, 3.0, 0.5]])
        self.start(sources={"cloud": {"topic": "cloud"}, "cell": cell}, max_distance=5.0)
        begin = rospy.Time.now().to_sec()
        # As seen it has to have moved for longer than tf is late, also where a loaded machine sends later.
        pt.wait_until(lambda: rospy.Time.now().to_sec() > begin + 3 * late, "the box, as seen, to move")
        self.send()
        self.wait(lambda m: m.state == m.NONE, "its end", 0)
        known = [m for m in self.heard if m.state in (m.CLEAR, m.CONTACT)]
        self.assertGreater(len(known), 20)
        self.assertEqual({m.state for m in known}, {TrajectoryClearance.CLEAR, TrajectoryClearance.CONTACT})
        for message in known:
            stamp = message.header.stamp.to_sec()
            room = middle(stamp) - 0.05 - pt.BALL_RADIUS - FAR  # at the end
            if message.state == message.CLEAR:
                self.assertLessEqual(message.lower_bound, room + 1e-3)
            else:
                touch = max(DURATION * (1 + room / FAR), stamp - message.start.to_sec())
                self.assertLessEqual((message.contact - message.start).to_sec(), touch + 0.01)

    def test_an_object_on_a_base_that_drives(self):
        begin, speed = rospy.Time.now(), 0.3
        X_BT = pt.transform((POINT + 0.05, 0, 0.5))

        def drive():
            now = rospy.Time.now()
            X_OB = pt.transform((speed * (now - begin).to_sec(), 0, 0))
            self.world.publish_transforms(
                [
                    pt.transform_message("odom", "base", X_OB, now),
                    pt.transform_message("base", "tray", X_BT, now),
                ]
            )

        self.world.repeat(50, drive)
        # A joint that the trajectory leaves out, and that is told seldom.
        self.world.start_joints({"turn": self.turn}, rate=4)
        self.turn, self.speeds = None, [0.0]
        box = {"shape": "box", "size": [0.1, 0.1, 0.1], "frame_id": "tray"}
        cell = {"type": "world", "objects": {"box": box}}
        self.points = np.array([[0.0, 3.0, 0.5]])
        self.start(sources={"cloud": {"topic": "cloud"}, "cell": cell}, fixed_frame="odom")
        self.send()
        self.wait(lambda m: m.state == m.NONE, "its end", 0)
        told = [m for m in self.heard if m.state == m.CONTACT]
        self.assertGreater(len(told), 20)
        for message in told:
            self.assertEqual(message.header.frame_id, "odom")
            # The tray is as late as tf is; a base at another instant than it would be 0.1 m off.
            if (message.header.stamp - message.start).to_sec() < TOUCH - 0.3:
                contact = (message.contact - message.start).to_sec()
                self.assertTrue(TOUCH - 0.2 < contact <= TOUCH, (contact, TOUCH))

    def test_a_base_whose_poses_are_stamped_ahead(self):
        begin, speed, ahead = rospy.Time.now(), -0.3, 0.5
        X_BT = pt.transform((POINT + 0.05, 0, 0.5))

        def drive():
            stamp = rospy.Time.now() + rospy.Duration(ahead)
            X_OB = pt.transform((speed * (stamp - begin).to_sec(), 0, 0))
            frames = [("odom", "base", X_OB), ("base", "tray", X_BT)]
            self.world.publish_transforms([pt.transform_message(*frame, stamp) for frame in frames])

        self.world.repeat(50, drive)
        box = {"shape": "box", "size": [0.1, 0.1, 0.1], "frame_id": "tray"}
        cell = {"type": "world", "objects": {"box": box}}
        self.points = np.array([[0.0, 3.0, 0.5]])
        self.start(sources={"cloud": {"topic": "cloud"}, "cell": cell}, fixed_frame="odom")
        self.send()
        told = self.wait(lambda m: m.state == m.CONTACT, "the tray", 0)
        self.check_touch(told)

    def test_obstacles_come_while_the_robot_waits_and_brakes(self):
        speed, wait, deceleration = 0.1, 3.0, 0.4
        self.start(
            query={"max_distance": 3.0},
            joint_deceleration=deceleration,
            trajectory={"obstacle_speed": speed},
        )
        start = rospy.Time.now() + rospy.Duration(wait)
        self.sender.publish(trajectory([(0.0, 0.0), (DURATION, FAR)], start))
        told = self.wait(lambda m: m.state == m.CONTACT, "a contact", 0)
        # It goes at 0.2 m/s, and braking delays it by 0.25 s.
        room = POINT - pt.BALL_RADIUS - speed * ((told.start - told.header.stamp).to_sec() + 0.25)
        contact = (told.contact - told.start).to_sec()
        self.assertLessEqual(contact, room / (speed + FAR / DURATION))
        self.assertGreater(contact, room / (speed + FAR / DURATION) - 0.15)
        self.assertAlmostEqual((told.contact - told.brake).to_sec(), 0.25, places=3)

    def test_clouds_stamped_ahead(self):
        """Obstacles come from when a cloud was received, though its stamp is still ahead."""
        speed = 0.5
        self.start(
            query={"max_distance": 3.0}, trajectory={"obstacle_speed": speed}, cloud_timeout=3.0
        )
        self.clouds.stop()
        received = rospy.Time.now()
        self.world.cloud_publisher.publish(
            pt.cloud(self.points, "base", received + rospy.Duration(0.9))
        )
        self.send()
        rospy.sleep(0.8)
        told = [m for m in self.heard if 0.5 < (m.header.stamp - received).to_sec() < 0.85]
        self.assertTrue(told)
        waits, pace = (self.start_time - received).to_sec(), FAR / DURATION
        touch = (POINT - pt.BALL_RADIUS + pace * waits) / (speed + pace)
        for message in told:
            self.assertEqual(message.state, message.CONTACT)
            self.assertLessEqual((message.contact - received).to_sec(), touch + 0.02)

    def test_what_touches_before_it_begins(self):
        self.points = np.array([[0.5 * pt.BALL_RADIUS, 0.0, 0.5]])
        self.start(joint_deceleration=0.4)
        for rows in ([(0.0, 0.0), (DURATION, FAR)], [(0.0, 0.0)]):  # one that stays has one point
            begin = len(self.heard)
            self.start_time = rospy.Time.now() + rospy.Duration(3.0 + len(rows))
            self.sender.publish(trajectory(rows, self.start_time))
            is_it = lambda m: m.start == self.start_time and m.state == m.CONTACT  # noqa: E731
            told = self.wait(is_it, "the contact", begin)
            self.assertEqual(told.first.link, "ball_link")
            self.assertEqual((told.contact, told.brake), (told.header.stamp, told.header.stamp))
            self.assertEqual(told.time_to_contact, 0.0)

    def test_a_trajectory_that_replaces_another_one_later(self):
        self.start()
        self.send()
        self.wait(lambda m: m.state == m.CONTACT, "a contact", 0)
        later = self.start_time + rospy.Duration(2.0)  # the slide is at 0.4 m then
        self.sender.publish(trajectory([(0.0, 0.4), (1.0, 0.4)], later))
        self.wait(lambda m: m.start == later or m.state == m.UNKNOWN, "the other one")
        self.wait(lambda m: m.state == m.CLEAR, "its clear way")
        for message in self.heard:
            if message.start == later and message.state == message.CLEAR:
                self.assertGreaterEqual(message.header.stamp, later)
        self.assertTrue(any("until this trajectory begins" in m.text for m in self.heard))

    def test_an_object_is_attached_meanwhile(self):
        self.points = np.array([[-1.5, 0.0, 0.6]])
        self.start(max_distance=3.0)
        self.send()
        self.wait(lambda m: m.state == m.CONTACT, "a contact", 0)
        attach = lambda: self.node.attach("column", (0, 0, 0.9), [0.02])  # noqa: E731
        detach = self.node.service("detach_object", DetachObject)
        for change in (attach, lambda: detach("tool")):
            change()
            begin = len(self.heard)
            pt.wait_until(lambda: len(self.heard) > begin + 5, "answers")  # noqa: B023
            for message in self.heard[begin:]:
                self.assertIn(message.state, (message.CONTACT, message.UNKNOWN), message.text)
                if message.state == message.CONTACT:
                    self.assertEqual(message.first.link, "box_link")
                    self.check_touch(message, (1.5 - 0.55) / (1.5 * FAR / DURATION))

    def test_mimics_of_mimics_and_of_whole_turns(self):
        # `far` mimics `near`, which mimics `lead`; `rack` mimics `wheel`, which turns without end.
        ball = "<collision><geometry><sphere radius='0.1'/></geometry></collision>"
        slide = "<axis xyz='1 0 0'/><limit lower='-3' upper='3' effort='1' velocity='1'/>"
        urdf = "<robot name='arm'><link name='base'/>"
        for name, y, mimic in (
            ("lead", 1.0, ""), ("near", 0.5, "lead' multiplier='-1"), ("far", 0.0, "near' multiplier='-2"),
            ("rack", -1.0, "wheel' multiplier='0.1"),
        ):
            mimic = mimic and "<mimic joint='%s'/>" % mimic
            urdf += f"<link name='{name}_link'>{ball}</link><joint name='{name}' type='prismatic'>"
            urdf += f"<parent link='base'/><child link='{name}_link'/><origin xyz='0 {y} 0.5'/>"
            urdf += slide + mimic + "</joint>"
        urdf += "<link name='disc'/><joint name='wheel' type='continuous'><parent link='base'/>"
        urdf += "<child link='disc'/><axis xyz='0 0 1'/></joint></robot>"
        turns = 2 * np.pi
        self.positions = lambda: {"lead": -0.15 * self.slide(), "near": 0.15 * self.slide(), "wheel": turns}
        self.speeds = []
        self.points = np.array([[-0.3, 0.0, 0.5], [0.9, -1.0, 0.5]])
        self.start(urdf)
        # The far ball goes to -0.24 m, and touches the point at -0.2 m.
        self.start_time = rospy.Time.now() + rospy.Duration(0.3)
        self.sender.publish(trajectory([(0, 0.0), (DURATION, 0.15 * FAR)], self.start_time, ["near"]))
        told = self.wait(lambda m: m.state == m.CONTACT, "the far ball", 0)
        self.assertEqual(told.first.link, "far_link")
        self.check_touch(told, DURATION * 0.2 / 0.24)
        # The rack is at 0.63 m and goes on to 0.83 m: it touches at 0.8 m.
        self.start_time = rospy.Time.now() + rospy.Duration(0.3)
        self.positions = lambda: {"wheel": turns + 2.0 / FAR * self.slide(), "lead": 0.0, "near": 0.0}
        self.sender.publish(trajectory([(0, 0.0), (DURATION, 2.0)], self.start_time, ["wheel"]))
        told = self.wait(lambda m: m.start == self.start_time and m.state == m.CONTACT, "the rack")
        self.assertEqual(told.first.link, "rack_link")
        self.check_touch(told, DURATION * (8.0 - turns) / 2.0)

    def test_the_ghost_of_the_first_contact(self):
        self.start()
        drawn = self.node.collect("trajectory_markers", MarkerArray)
        self.send()
        told = self.wait(lambda m: m.state == m.CONTACT, "a contact", 0)
        pt.wait_until(lambda: drawn, "the ghost")
        ghost = [m for m in drawn[0].markers if m.ns == "ghost"]
        self.assertEqual({m.type for m in ghost}, {Marker.SPHERE})
        self.assertEqual({m.header.frame_id for m in ghost}, {"base"})
        # The ball's sphere is where it touches the point, and not where it is now.
        touching = [m.pose.position.x + 0.5 * m.scale.x for m in ghost]
        self.assertAlmostEqual(max(touching), POINT, delta=0.01)
        number = [m for m in drawn[0].markers if m.type == Marker.TEXT_VIEW_FACING]
        self.assertEqual(len(number), 1)
        self.assertAlmostEqual(float(number[0].text.split(" s")[0]), told.time_to_contact, delta=0.5)
        self.assertGreater(number[0].lifetime.to_sec(), 0.0)

    def test_what_cannot_be_watched_is_unknown(self):
        self.start(joint_deceleration=1.0, trajectory={"cancel_topic": "arm/cancel"})
        soon = rospy.Time.now() + rospy.Duration(100.0)
        nan = float("nan")
        cases = [
            (trajectory([(0, 0.1)], soon, ["nobody"]), "has no joint 'nobody'"),
            (trajectory([(0, 0.1, 0.1)], soon, ["slide", "slide"]), "twice"),
            (trajectory([(0, 0.1)], soon, []), "names no joints"),
            (trajectory([(0, 0.1)], soon, ["to_camera"]), "no position of its own"),
            (trajectory([(0, 0.1), (1, 0.1, 0.2)], soon), "2 positions for 1 joints"),
            (trajectory([(0, 0.1)], soon, ["slide", "turn"]), "1 positions for 2 joints"),
            (trajectory([(0, 0.1), (1, nan)], soon), "nan among the positions"),
            (trajectory([(0, 0.1), (1, 1e300)], soon), "among the positions"),
            (trajectory([(1, 0.1), (1, 0.2)], soon), "does not rise"),
            (trajectory([(2, 0.1), (1, 0.2)], soon), "does not rise"),
            (trajectory([(1, 0.1), (1 - 1e-9, 0.2)], soon), "does not rise"),
            (trajectory([(0, 0.1), (1e6, 0.2)], soon), "more than a day"),
            (trajectory([(0, 0.1), (1, 0.2)], soon, velocities=[[0.1], []]), "the other way round"),
            (trajectory([(0, 0.1), (1, 0.2)], soon, velocities=[[0.1], [nan]]), "velocities"),
            (trajectory([(k, 0.1) for k in range(10001)], soon), "10001 points"),
            (trajectory([(k, k % 2) for k in range(1000)], soon, velocities=[[9]] * 1000), "pieces"),
            (trajectory([(0, 0.1), (1, 0.2)], rospy.Time(2**32 - 1)), "more than a day"),
            (trajectory([(0, 0.5), (1, 0.6)], soon), "joint 'slide' is at"),
        ]
        for message, text in cases:
            begin = len(self.heard)
            self.cancelled.clear()
            self.sender.publish(message)
            told = self.wait(lambda m: text in m.text, text, begin)
            self.assertEqual(told.state, told.UNKNOWN, text)
            self.assertTrue(np.isnan(told.time_to_contact) and np.isnan(told.lower_bound))
            self.wait(lambda m: text in m.text, "that it is told again")
            pt.wait_until(lambda: self.cancelled, "what is not known to be cancelled")
        # A good one ends it.
        self.send()
        self.wait(lambda m: m.state == m.CONTACT, "a contact")
        # The robot leaves its trajectory; its joint states end; its clouds end.
        self.at_rest = 0.2
        told = self.wait(lambda m: m.state == m.UNKNOWN, "a robot elsewhere")
        self.assertIn("more than 0.1 away", told.text)
        self.at_rest = 0.0
        self.wait(lambda m: m.state == m.CONTACT, "a robot that is back")
        # A message without points ends the watch.
        begin = len(self.heard)
        self.sender.publish(JointTrajectory())
        self.wait(lambda m: m.state == m.NONE, "the end of the watch", begin)
        self.assertEqual(self.heard[-1].text, "no trajectory is watched")

    def test_a_mimic_joint_elsewhere_is_unknown(self):
        self.points = np.array([[0.0, 0.9, 0.5]])
        self.speeds, self.astray = [], 0.05
        self.start()
        self.send()
        self.wait(lambda m: m.state == m.CLEAR, "a mimic joint within the tolerance", 0)
        self.astray = 0.3
        told = self.wait(lambda m: m.state != m.CLEAR, "a mimic joint elsewhere")
        self.assertEqual(told.state, told.UNKNOWN)
        self.assertIn("as a mimic of joint 'slide'", told.text)
        self.astray = 0.0
        self.wait(lambda m: m.state == m.CLEAR, "one that follows")

    def test_without_clouds_nothing_is_known(self):
        self.start()
        self.send()
        self.wait(lambda m: m.state == m.CONTACT, "a contact", 0)
        self.points = np.full((5, 3), np.nan)
        told = self.wait(lambda m: m.state == m.UNKNOWN, "a blind camera")
        self.assertIn("source", told.text)

    def test_joints_begin_where_they_are(self):
        """A first point that is not at time 0 is reached from the present position."""
        self.start()
        self.sender.publish(trajectory([(DURATION, FAR)], rospy.Time()))
        told = self.wait(lambda m: m.state == m.CONTACT, "a contact", 0)
        self.check_touch(told)
        # With velocities it goes on as fast as it moves now.
        for speed in (0.0, 0.4):
            self.speeds[:] = [speed] * 2
            rospy.sleep(0.2)
            sent = rospy.Time.now()
            self.sender.publish(trajectory([(DURATION, FAR)], rospy.Time(), velocities=[[0.0]]))
            told = self.wait(lambda m, sent=sent: m.state == m.CONTACT and m.start >= sent, "a contact")
            self.check_touch(told, self.touch_of_cubic(speed))

    def touch_of_cubic(self, speed):
        """When the slide touches that begins at 0 with this speed and stands at its end."""
        t = np.linspace(0.0, DURATION, 100001)
        u = t / DURATION
        path = DURATION * speed * (u**3 - 2 * u**2 + u) + FAR * (3 * u**2 - 2 * u**3)
        return t[np.argmax(path >= POINT - pt.BALL_RADIUS)]

    def test_whole_turns_do_not_count(self):
        """The column has turned three times; controllers do not turn it back."""
        self.turn = 6 * np.pi
        self.start()
        for begin in ([(0.0, 0.0, 0.0)], []):
            self.start_time = rospy.Time.now() + rospy.Duration(0.3)
            rospy.sleep(0.05)
            path = trajectory(begin + [(DURATION, FAR, 0.0)], self.start_time, ["slide", "turn"])
            at = len(self.heard)
            self.sender.publish(path)
            told = self.wait(lambda m: m.state == m.CONTACT, "a contact", at)
            self.check_touch(told)

    def test_goals_of_controllers_and_planners(self):
        """The bridge reads whatever definition a publisher sends."""
        self.start()
        bridge = subprocess.Popen(
            [
                pt.find_program("ist_proximity", "trajectory_bridge"),
                "__ns:=" + self.namespace,
                "trajectory:=proximity/trajectory",
            ]
        )
        try:
            path = trajectory([(0.0, 0.0), (DURATION, FAR)], rospy.Time())
            for kind, definition, fill in GOALS:
                message = dynamic_message(kind, definition)
                publisher = rospy.Publisher(self.namespace + "/goal", type(message), queue_size=1)
                pt.wait_until(lambda: publisher.get_num_connections() > 0, "the bridge")
                fill(message, path)
                begin = len(self.heard)
                publisher.publish(message)
                self.wait(lambda m: m.state == m.CONTACT, kind, begin)
                cancel = rospy.Publisher(self.namespace + "/cancel", GoalID, queue_size=1)
                pt.wait_until(lambda: cancel.get_num_connections() > 0, "the bridge")
                begin = len(self.heard)
                cancel.publish(GoalID())
                self.wait(lambda m: m.state == m.NONE, "the end of " + kind, begin)
                publisher.unregister()
            # A connection that ends without the master's word is made again.
            publisher = rospy.Publisher(self.namespace + "/goal", type(message), queue_size=1)
            pt.wait_until(lambda: publisher.get_num_connections() > 0, "the bridge")
            for connection in list(publisher.impl.connections):
                connection.close()
            publisher.impl.connections.clear()
            pt.wait_until(lambda: publisher.get_num_connections() > 0, "the bridge, once more")
            publisher.unregister()
            message = dynamic_message("other_msgs/Thing", "int32 number")
            publisher = rospy.Publisher(self.namespace + "/goal", type(message), queue_size=1)
            pt.wait_until(lambda: publisher.get_num_connections() > 0, "the bridge")
            publisher.publish(message)
            self.wait(lambda m: m.state == m.UNKNOWN, "a goal that cannot be read")
        finally:
            bridge.terminate()
            bridge.wait()


if __name__ == "__main__":
    pt.run("trajectory_test", TrajectoryTest)
