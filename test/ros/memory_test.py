#!/usr/bin/env python3
"""What left the view is remembered and forgotten, and what was never seen is told (~unknown_space).

The camera is at the origin of `base` and looks along x. Its clouds are patches of points; a near patch
hides a far one from it.
"""

import os
import tempfile

import genpy.dynamic
import numpy as np
import proximity_testing as pt
import rospy
from proximity_testing import LinkProximity, ProximityArray
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

from ist_proximity.srv import AttachObjectRequest, DetachObject, QueryProximity

VOXEL = 0.02
DECAY = 4.0
LASTING = {"enabled": True, "decay": 1000.0, "resolution": VOXEL}
FADING = dict(LASTING, decay=DECAY)
BALL = (1.5, 0.6, 0.0)
# A ball that turns about the camera: its reach is known, and farther points are dropped.
TURNING_BALL = """<robot name="turning"> <link name="base"/>
  <link name="ball_link"><collision><origin xyz="0.6 0 0"/><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="ball_link"/><axis xyz="0 0 1"/></joint>
</robot>"""
# A ball that slides across the camera's axis, and a joint that moves nothing.
SLIDING_BALL = """<robot name="sliding"> <link name="base"/> <link name="hand"/>
  <link name="ball_link"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="slide" type="prismatic"><parent link="base"/><child link="ball_link"/>
    <origin xyz="2 0 0"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="2" effort="1"/></joint>
  <joint name="grip" type="prismatic"><parent link="base"/><child link="hand"/>
    <limit lower="-1" upper="1" velocity="2" effort="1"/></joint>
</robot>"""

# Three balls above each other, which slide across the camera's axis.
BALLS = "<robot name='balls'> <link name='base'/>%s</robot>" % "".join(
    """<link name="b%d"><collision><geometry><sphere radius="0.08"/></geometry></collision></link>
  <joint name="j%d" type="prismatic"><parent link="base"/><child link="b%d"/>
    <origin xyz="1.5 0 %g"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>"""
    % (i, i, i, 0.25 * i - 0.25)
    for i in range(3)
)


def patch(distance, half, step=0.008):
    """A square across the camera's axis."""
    side = np.arange(-half, half + step / 2, step)
    y, z = np.meshgrid(side, side)
    return np.column_stack([np.full(y.size, distance), y.ravel(), z.ravel()])


FAR = patch(1.5, 0.12)
NEAR = patch(0.4, 0.05)  # hides the far one, and is out of the ball's range
BEHIND = patch(2.6, 0.25, 0.012)  # seen through where the far one was; out of the ball's range


def distance_to(points):
    return np.linalg.norm(points - np.array(BALL), axis=1).min() - pt.BALL_RADIUS


class MemoryTest(pt.NodeTest):
    BALL, BOX = pt.transform(BALL), pt.transform((0, 0, 5))
    MAX_DISTANCE = None  # unknown space is nearer than a link is CLEAR

    def setUp(self):
        super().setUp()
        self.world.start_tf()
        self.world.points = FAR
        self.clouds = self.world.start_clouds()

    def start(self, **parameters):
        super().start(**{"links": ["ball_link"], "max_distance": 0.8, **parameters})

    def ball(self, message):
        return pt.link(message, "ball_link")

    def remember(self, count):
        """Waits until the memory has taken as many more clouds."""
        stamps = set()

        def has_taken(message):
            stamps.update(source.stamp for source in message.sources[1:])
            return len(stamps) > count

        self.node.wait_for(has_taken, "%d clouds in the memory" % count)

    def is_from(self, source):
        return lambda m: m.status == ProximityArray.OK and self.ball(m).source == source

    def is_clear(self, message):
        ok = message.status == ProximityArray.OK
        return ok and self.ball(message).state == LinkProximity.CLEAR

    def test_hidden_is_remembered_and_forgotten(self):
        self.start(memory=FADING)
        seen = self.node.wait_for(self.is_from("cloud"), "the far patch in view")
        self.assertAlmostEqual(self.ball(seen).distance, distance_to(FAR), delta=2e-3)
        self.assertEqual([s.name for s in seen.sources], ["cloud", "cloud/memory"])
        ball = self.ball(seen)  # ~unknown_space is free
        self.assertTrue(np.isnan([ball.seen_share, ball.seen_age, ball.unseen_distance]).all())

        self.world.points = NEAR
        first = len(self.node.messages)
        hidden = self.node.wait_for(self.is_from("cloud/memory"), "the far patch remembered")
        for message in self.node.messages[first:]:  # no gap while it is handed over
            self.assertEqual(self.ball(message).state, LinkProximity.NEAR)
        self.assertAlmostEqual(self.ball(hidden).distance, distance_to(FAR), delta=2 * VOXEL)
        self.assertLessEqual(self.ball(hidden).lower_bound, distance_to(FAR))
        memory_status = hidden.sources[1]
        self.assertEqual(memory_status.status, ProximityArray.OK)
        self.assertGreater(memory_status.points_used, 0)
        self.assertGreater(memory_status.stamp, rospy.Time(0))

        forgotten = self.node.wait_for(self.is_clear, "the far patch forgotten")
        seen_last = max(stamp for stamp, points in self.world.clouds_sent if points is FAR)
        took = (forgotten.sources[1].stamp - seen_last).to_sec()
        self.assertGreater(took, DECAY - 0.5)
        self.assertLess(took, DECAY + 1.0)

        # What the camera sees through is answered by the cloud at once, and cleared soon.
        self.world.points = FAR
        self.node.wait_for(self.is_from("cloud"), "the far patch again")
        self.remember(20)  # until it is as occupied as can be
        self.world.points = BEHIND
        self.node.wait_for(self.is_clear, "nothing near where the camera sees through")
        self.remember(15)
        self.world.points = NEAR
        for message in self.node.next_messages(50):
            self.assertTrue(self.is_clear(message), message)
        self.node.wait_for_value("input cloud/memory", "voxels in memory", "^[^0]")

    def test_saved_read_and_shown(self):
        path = os.path.join(tempfile.mkdtemp(), "memory.bt")
        memory = dict(LASTING, decay=float("inf"), file=path)
        self.start(memory=memory)
        maps = []
        subscriber = rospy.Subscriber(
            self.node.name + "/memory/cloud", rospy.AnyMsg, maps.append, queue_size=2
        )
        self.node.wait_for(self.is_from("cloud"), "the far patch in view")
        self.node.wait_until(lambda: maps, "a map for rviz")
        header = maps[0]._connection_header
        self.assertEqual(header["type"], "octomap_msgs/Octomap")
        kinds = genpy.dynamic.generate_dynamic(header["type"], header["message_definition"])
        shown = kinds[header["type"]]().deserialize(maps[0]._buff)
        self.assertEqual((shown.id, shown.binary, shown.resolution), ("OcTree", True, VOXEL))
        self.assertEqual(shown.header.frame_id, "base")
        subscriber.unregister()
        save = self.node.service("save_memory", Trigger)
        answer = save()
        self.assertTrue(answer.success, answer.message)
        self.assertTrue(os.path.getsize(path) > 100)
        self.assertEqual(self.node.stop(), 0)

        self.world.points = NEAR  # the far patch is never seen by the next node
        self.start(memory=memory)
        message = self.node.wait_for(self.is_from("cloud/memory"), "the patch of the file")
        self.assertAlmostEqual(self.ball(message).distance, distance_to(FAR), delta=2 * VOXEL)
        self.assertEqual(self.node.stop(), 0)

        with open(path, "r+b") as file:  # cut off
            file.truncate(os.path.getsize(path) - 5)
        self.start(memory=memory)
        self.node.wait_for(self.is_clear, "answers of the camera alone")
        self.node.wait_for_diagnostic("input cloud/memory", path)
        # It is not overwritten: nobody knows what it held.
        with open(path, "rb") as file:
            held = file.read()
        save.wait_for_service(pt.TIMEOUT)
        answer = save()
        self.assertFalse(answer.success)
        self.assertIn("not overwritten", answer.message)
        with open(path, "rb") as file:
            self.assertEqual(file.read(), held)
        os.rename(path, path + ".old")
        answer = save()
        self.assertTrue(answer.success, answer.message)
        self.assertTrue(save().success)

    # While a pose is unknown, clouds are not remembered. What left the view with the first of them
    # is an obstacle all the same.
    def test_hidden_while_a_pose_is_unknown(self):
        self.start(memory=LASTING, self_filter_links="all")
        self.node.wait_for(self.is_from("cloud"), "the far patch in view")
        self.remember(10)
        del self.world.poses["box_link"]
        count = len(self.world.clouds_sent)
        pt.wait_until(lambda: len(self.world.clouds_sent) > count + 4, "clouds without the pose")
        self.world.points = NEAR
        self.node.wait_for_diagnostic("input cloud/memory", "'box_link' was not known")
        for message in self.node.next_messages(20):
            self.assertEqual(self.ball(message).source, "cloud/memory")
            self.assertAlmostEqual(self.ball(message).distance, distance_to(FAR), delta=2 * VOXEL)

    def attach_box(self, size, middle, angle=0.0):
        self.node.attach("ball_link", middle, size, AttachObjectRequest.BOX, "box", angle)

    # The robot reaches farther with an object than where it was remembered what is there.
    def test_what_was_beyond_reach_is_not_known_within_it(self):
        far, turn = patch(1.9, 0.12), 0.5
        self.world.start_joints({"turn": turn})
        self.world.points = far
        self.start(urdf_text=TURNING_BALL, memory=FADING, pose_source="joint_states")
        self.node.wait_for(self.is_clear, "the far patch out of reach")
        self.remember(10)
        self.world.points = patch(5.0, 0.12) * [-1, 1, 1]  # the camera turns to the wall behind it
        self.node.wait_for(self.is_clear, "the wall behind the camera")
        seen_last = max(stamp for stamp, points in self.world.clouds_sent if points is far)
        end = pt.inverse(pt.transform(angle=turn))[:3, :3] @ [1.9, 0.0, 0.0]  # in the ball's frame
        way = end - [0.6, 0.0, 0.0]
        first = len(self.node.messages)
        # It pierces the far patch.
        self.attach_box([2.2, 0.05, 0.05], [0.6, 0, 0] + way / 2, np.arctan2(way[1], way[0]))
        told = self.node.wait_for_status(ProximityArray.DEGRADED, "a memory was made for a smaller robot", start=first)
        self.assertEqual(self.ball(told).state, LinkProximity.UNKNOWN)
        begin = self.node.messages.index(told)
        known = self.node.wait_for(self.is_clear, "all of what was remembered is forgotten", start=begin)
        self.assertGreater((known.header.stamp - seen_last).to_sec(), DECAY - 0.1)

    # What was remembered is somewhere, and nobody knows where the robot is.
    def test_its_frame_is_lost(self):
        in_odom = ("odom", pt.transform((3.0, 0.0, 0.0)))
        self.world.poses["base"] = in_odom
        self.start(memory=LASTING, fixed_frame="odom")
        self.node.wait_for(self.is_from("cloud"), "the far patch in view")
        self.world.points = NEAR
        self.node.wait_for(self.is_from("cloud/memory"), "the far patch remembered")
        begin = len(self.node.messages)
        del self.world.poses["base"]
        lost = self.node.wait_for(pt.all_unknown, "nothing is known")
        self.assertIn("odom", lost.status_text)
        for message in self.node.messages[begin:]:
            if message.status == ProximityArray.OK:
                self.assertEqual(self.ball(message).source, "cloud/memory")
            else:
                self.assertTrue(pt.all_unknown(message))
        self.world.poses["base"] = in_odom
        self.node.wait_for(self.is_from("cloud/memory"), "the far patch remembered again")

    def test_a_calibration_moves_what_was_seen(self):
        self.start(memory=dict(LASTING, decay=3.0), cloud_timeout=2.0)
        self.node.wait_for(self.is_from("cloud"), "the far patch in view")
        self.world.points = NEAR
        self.node.wait_for(self.is_from("cloud/memory"), "the far patch remembered")
        self.remember(2)
        self.world.state_camera(pt.transform((0.0, 0.05, 0.0)))
        begin = len(self.node.messages)
        text = "its memory is lost: a static transform to 'camera' is another one now"
        self.node.wait_for_status(ProximityArray.NO_CLOUD, text)
        self.world.points = FAR
        self.node.wait_for(self.is_from("cloud"), "what is lost would be forgotten", start=begin)
        # Nor is a cloud where it was placed.
        self.clouds.stop()
        rospy.sleep(0.15)  # for the last one
        self.world.state_camera()
        text = "the static transform from 'camera' to 'base' is another one since the last cloud"
        self.node.wait_for_status(ProximityArray.NO_CLOUD, text)

    # Obstacles that there was no place for are known as long as they are in view, and lost then.
    def test_too_little_memory_is_told(self):
        self.start(memory={"enabled": True, "resolution": 0.005, "max_nodes": 5000})
        message = self.node.wait_for_status(ProximityArray.NO_CLOUD, "voxels of obstacles are lost")
        self.assertIn("max_nodes", message.status_text)
        self.assertTrue(pt.all_unknown(message))
        self.node.wait_for_diagnostic("input cloud/memory", "max_nodes")

    # The camera sees a cone of half width 0.3 x; the ball moves in it towards its side.
    def move_in_cone(self, unknown_space):
        self.world.points = patch(2.4, 0.72, 0.015)
        middle, side = (1.0, 0.0, 0.0), (1.0, 0.12, 0.0)
        self.world.stand(pt.transform(middle), pt.transform((0, 0, 5)))
        self.start(memory=LASTING, unknown_space=unknown_space, max_distance=2.0)
        is_in_middle = lambda m: (  # noqa: E731
            self.is_from("cloud")(m)
            and self.ball(m).unseen_distance > 0.17
            and self.ball(m).seen_share > 0.75
        )
        before = self.ball(self.node.wait_for(is_in_middle, "the ball in seen space"))
        self.world.stand(pt.transform(side), pt.transform((0, 0, 5)))
        is_at_side = lambda m: (  # noqa: E731
            self.is_from("cloud")(m)
            and abs(self.ball(m).point_on_link.y) > 0.1
            and self.ball(m).unseen_distance < before.unseen_distance - 0.06
            and self.ball(m).seen_share < before.seen_share - 0.02
        )
        after = self.ball(self.node.wait_for(is_at_side, "the ball near unseen space"))
        # The side of the cone is as much nearer as its slope says.
        for ball, y in ((before, 0.0), (after, 0.12)):
            to_side = (0.3 - y) / np.hypot(1.0, 0.3) - pt.BALL_RADIUS
            self.assertLess(ball.unseen_distance, to_side + 2 * VOXEL)
            self.assertGreater(ball.unseen_distance, to_side - 3 * VOXEL)
            self.assertAlmostEqual(ball.distance, 2.4 - 1.0 - pt.BALL_RADIUS, delta=0.01)
            self.assertTrue(0.0 < ball.seen_share < 1.0)
            self.assertTrue(0.0 <= ball.seen_age < 1000.0)
        direction = pt.vector(after.unseen_direction)
        self.assertAlmostEqual(np.linalg.norm(direction), 1.0, places=6)
        self.assertGreater(direction[1], 0.8)
        return before, after

    def test_unknown_space_is_an_obstacle(self):
        for ball in self.move_in_cone("obstacle"):
            self.assertEqual(ball.state, LinkProximity.NEAR)
            self.assertAlmostEqual(ball.lower_bound, ball.unseen_distance, places=9)

    # Each configuration that is asked about has its own answers, for all links.
    def test_what_is_seen_about_other_configurations(self):
        self.world.points = patch(2.6, 0.9, 0.02)
        self.world.start_joints({"j0": 0.0, "j1": 0.0, "j2": 0.0})
        settings = {"memory": dict(LASTING, resolution=0.03), "unknown_space": "report", "max_distance": 1.0}
        pt.NodeTest.start(self, BALLS, pose_source="joint_states", **settings)
        self.node.wait_for(lambda m: m.status == 0 and all(one.seen_share > 0.8 for one in m.links), "the view")
        query = self.node.service("query", QueryProximity)
        names = ["j0", "j1", "j2"]
        places = [0.0, 1.3, 0.0, 1.3]  # in view, and not
        answer = query(states=[JointState(name=names, position=[y] * 3) for y in places])
        for y, result in zip(places, answer.results):
            for one in result.links:
                if y == 0.0:
                    self.assertGreater(one.seen_share, 0.8, one.link)
                else:
                    self.assertEqual(one.seen_share, 0.0, one.link)

    # The space that the robot took up is known. An object that it has let go of is still there.
    def test_what_the_robot_lets_go_of_is_not_known(self):
        self.world.points = patch(2.4, 0.72, 0.015)
        self.world.stand(pt.transform((1.0, 0.15, 0.0)), pt.transform((0, 0, 5)))
        self.start(memory=LASTING, unknown_space="obstacle", max_distance=2.0)
        # From the side of the cone of half width 0.3 x on, where the camera does not look.
        to_side = (0.3 - 0.15) / np.hypot(1.0, 0.3) - pt.BALL_RADIUS
        near_side = lambda m: (  # noqa: E731
            self.is_from("cloud")(m) and abs(self.ball(m).unseen_distance - to_side) < 2 * VOXEL
        )
        self.node.wait_for(near_side, "the side of what is seen")
        self.attach_box([0.6, 0.3, 0.8], [0.0, 0.3, 0.0])
        self.node.wait_for(
            lambda m: self.is_from("cloud")(m) and self.ball(m).box_size.z > 0.7, "the box, attached"
        )
        self.remember(10)
        first = len(self.node.messages)
        self.assertTrue(self.node.service("detach_object", DetachObject)("box").success)
        is_alone = lambda m: self.is_from("cloud")(m) and self.ball(m).box_size.z < 0.7  # noqa: E731
        begin = self.node.messages.index(self.node.wait_for(is_alone, "the box, detached", start=first))
        self.node.wait_for(near_side, "the side of what is seen, again", start=begin)
        self.remember(10)
        for message in self.node.messages[begin:]:
            self.assertLess(self.ball(message).lower_bound, to_side + 2 * VOXEL)

    # What is known about one link is no more for another one's padding.
    def test_unknown_space_beside_a_padding_of_another_link(self):
        self.world.points = patch(2.4, 0.72, 0.015)
        self.world.stand(pt.transform((0.5, 1.2, 0)), pt.transform((0, 0, 5)))  # the camera sees neither
        padding = {"default": 0.02, "box_link": 0.5}
        self.start(memory=LASTING, unknown_space="obstacle", max_distance=2.0, self_filter_padding=padding)
        told = self.node.wait_for(
            lambda m: m.status == ProximityArray.OK and self.ball(m).unseen_distance > -0.05, "a skin"
        )
        self.assertLess(self.ball(told).unseen_distance, 0.02 + VOXEL)

    # What a joint may have moved since its last sample comes off the distance from unseen space, too.
    def test_unknown_space_beside_a_joint_that_is_late(self):
        place = lambda t: abs(t % 1.2 - 0.6) - 0.3  # 1 m/s to and fro
        joints = rospy.Publisher(self.namespace + "/joint_states", pt.JointState, queue_size=10)
        stated = set()

        def send_slide():
            stamp = rospy.Time.now()
            stated.add(stamp)
            joints.publish(pt.joint_state({"slide": place(stamp.to_sec())}, stamp))

        self.world.points = patch(2.4, 0.72, 0.015)
        self.world.repeat(10, send_slide)
        self.world.start_joints({"grip": 0.0})
        parameters = {"pose_source": "joint_states", "unknown_space": "obstacle", "memory": LASTING}
        parameters.update({"max_distance": 2.0, "links": ["ball_link"]})
        self.node = pt.ProximityNode(self.namespace, parameters, SLIDING_BALL)
        is_seen = lambda m: m.links and self.ball(m).unseen_distance > 0.1  # noqa: E731
        self.node.wait_for(is_seen, "seen space about the ball")
        compared = 0
        for _ in range(10):  # a busy machine answers fewer of the stamps
            begin = len(self.node.messages)
            self.node.wait_until(lambda: len(self.node.messages) > begin + 500, "500 messages")
            known = [m for m in self.node.messages[begin:] if self.ball(m).state != LinkProximity.UNKNOWN]
            for fresh, late in ((m, l) for m in known if m.header.stamp in stated for l in known):
                t, t_late = fresh.header.stamp.to_sec(), late.header.stamp.to_sec()
                if late.header.stamp in stated or not 0.0 < t - t_late < 0.1:
                    continue
                if not place(t) / place(t_late) > 1.0 or (t - 0.3) // 0.6 != (t - 0.6) // 0.6:
                    continue  # only on the way out, and not where it has just turned
                compared += 1
                way = 1.1 * self.ball(fresh).unseen_distance + 0.02 + t - t_late
                self.assertLess(self.ball(late).unseen_distance, way)
            if compared > 20:
                break
        self.assertGreater(compared, 20)

    # The memory is in a frame in which the robot drives. No cloud comes while it does.
    def test_unknown_space_stands_still_while_the_robot_drives(self):
        self.world.points = patch(2.4, 0.72, 0.015)
        links = {"ball_link": ("base", pt.transform((1.0, 0.0, 0.0))), "box_link": ("base", pt.transform((0, 0, 5)))}

        def drive(y):
            self.world.poses = dict(links, base=("odom", pt.transform((3.0, y, 0.0), angle=0.0)))

        drive(-1.0)
        self.start(
            memory=LASTING,
            fixed_frame="odom",
            unknown_space="obstacle",
            max_distance=2.0,
            cloud_timeout=float("inf"),
        )

        def unseen(y):
            """Waits for the distance to the side of the cone that was seen at first."""
            to_side = (0.3 - abs(y)) / np.hypot(1.0, 0.3) - pt.BALL_RADIUS
            low, high = to_side - 3 * VOXEL, to_side + 2 * VOXEL
            message = self.node.wait_for(
                lambda m: self.is_from("cloud")(m) and low < self.ball(m).unseen_distance < high,
                "unknown space %g m away" % to_side,
            )
            self.assertAlmostEqual(self.ball(message).lower_bound, self.ball(message).unseen_distance, places=9)
            return self.ball(message)

        unseen(0.0)
        self.clouds.paused = True
        rospy.sleep(1.0)  # until the last cloud is in unknown space
        for y in (0.13, 0.0, -0.13):
            drive(y - 1.0)
            ball = unseen(y)
            if y != 0.0:
                self.assertGreater(pt.vector(ball.unseen_direction)[1] * np.sign(y), 0.8)
        drive(-1.0)
        unseen(0.0)
        self.world.poses = links  # odom is lost
        lost = self.node.wait_for_status(ProximityArray.NO_POSE, "odom")
        self.assertTrue(np.isnan(self.ball(lost).seen_share))
        drive(-1.0)
        unseen(0.0)

    # The grey dots and lines in rviz are where unknown space is.
    def test_unknown_space_is_drawn(self):
        dots, lines = [], []
        name = self.namespace + "/proximity"
        subscribers = [
            rospy.Subscriber(name + "/unseen_space", MarkerArray, dots.append, queue_size=1),
            rospy.Subscriber(name + "/markers", MarkerArray, lines.append, queue_size=1),
        ]
        before, after = self.move_in_cone("report")
        self.assertLess(after.unseen_distance, before.unseen_distance)
        for ball in (before, after):  # reported, and no obstacle
            self.assertAlmostEqual(ball.lower_bound, ball.distance, delta=0.002)
        last = len(dots)
        self.node.wait_until(lambda: len(dots) > last + 1, "the unknown space drawn")
        for subscriber in subscribers:
            subscriber.unregister()
        drawn = [m for m in dots[-1].markers if m.type == Marker.CUBE_LIST]
        centers = np.array([[p.x, p.y, p.z] for m in drawn for p in m.points])
        self.assertEqual({m.header.frame_id for m in drawn}, {"base"})
        self.assertGreater(len(centers), 100)
        # The cone of the view, out of which a voxel may reach by its diagonal.
        self.assertTrue((np.abs(centers[:, 1:]).max(axis=1) > 0.3 * centers[:, 0] - 2 * VOXEL).all())
        ends = [m for m in lines[-1].markers if m.ns == "unseen" and m.action == Marker.ADD]
        self.assertEqual([m.id for m in ends], [0])
        start, end = pt.vector(ends[0].points[1]), pt.vector(ends[0].points[0])
        self.assertAlmostEqual(np.linalg.norm(start - end), after.unseen_distance, delta=0.02)


if __name__ == "__main__":
    pt.run("memory_test", MemoryTest, anonymous=True)
