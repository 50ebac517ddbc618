#!/usr/bin/env python3
"""Known worlds as sources: parameters, a MoveIt scene file, a topic, moving frames, another robot."""

import math
import os
import tempfile
import unittest

import numpy as np
import proximity_testing as pt
import rospy
from proximity_testing import LinkProximity, ProximityArray
from sensor_msgs.msg import JointState

from ist_proximity.msg import WorldObject, WorldObjects
from ist_proximity.srv import QueryProximity

SCENE = """a cell
* shelf
-0.6 0 0
0 0 0 1
1
box
0.2 0.2 0.2
0 0 0
0 0 0 1
0 0 0 0
0
.
"""

TABLE = {"shape": "box", "size": [0.2, 0.2, 0.2], "position": [0.5, 0, 0]}
SLIDER = {"shape": "sphere", "radius": 0.1, "frame_id": "carriage"}

OTHER = """<robot name="other">
  <link name="rail"/>
  <link name="head"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="head"/>
    <axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"""


def scene_file():
    path = os.path.join(tempfile.mkdtemp(), "cell.scene")
    with open(path, "w") as file:
        file.write(SCENE)
    return path


def hill_file(edge=150):
    """A mesh of some tens of thousands of triangles, which takes about a second to read."""
    x, y = np.meshgrid(np.linspace(-1, 1, edge + 1), np.linspace(-1, 1, edge + 1), indexing="ij")
    p = np.stack([x, y, 0.05 * np.sin(9 * x) * np.cos(7 * y)], -1)
    a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
    triangles = np.concatenate([np.stack(t, -2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])
    records = np.zeros(len(triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("end", "<u2")])
    records["corners"] = triangles
    path = os.path.join(tempfile.mkdtemp(), "hill.stl")
    with open(path, "wb") as file:
        file.write(b" " * 80 + np.uint32(len(triangles)).tobytes() + records.tobytes())
    return path


def box(name, x, y=0.0, z=0.0, edge=0.2, operation=WorldObject.ADD, frame=""):
    one = WorldObject(id=name, operation=operation, shape=WorldObject.BOX, dimensions=[edge] * 3)
    one.header.frame_id = frame
    one.pose.position.x, one.pose.position.y, one.pose.position.z = x, y, z
    one.pose.orientation.w = 1.0
    return one


class WorldTest(unittest.TestCase):
    """One node with objects from everywhere; the ball is at the origin, the box link at (0, 0, 2)."""

    @classmethod
    def setUpClass(cls):
        cls.world = pt.World("/known").stand(box=pt.transform((0, 0, 2)))
        cls.world.poses["carriage"] = ("base", pt.transform((0, 3, 0)))
        cls.world.start_tf()
        cls.topic = rospy.Publisher("/known/parts", WorldObjects, queue_size=10, latch=True)
        cls.topic.publish(WorldObjects())
        cls.node = pt.ProximityNode(
            "/known",
            {
                "sources": {
                    "cell": {
                        "type": "world",
                        "file": scene_file(),
                        "objects": {
                            "table": TABLE,
                            "bench": {"shape": "cylinder", "radius": 0.3, "length": 4.0},
                            "slider": SLIDER,
                        },
                        "allowed_contacts": [["ball_link", "bench"], ["box_link", "bench"]],
                    },
                    "parts": {
                        "type": "world",
                        "topic": "parts",
                        "objects": {"stop": {"shape": "sphere", "radius": 0.1, "position": [0, 0, -3]}},
                    },
                },
                "links": ["ball_link"],
            },
            pt.urdf(),
        )

    @classmethod
    def tearDownClass(cls):
        cls.node.stop()
        cls.world.stop()

    def tearDown(self):
        self.send(replace_all=True)
        self.is_at_table()

    def ball(self, condition, what, status=ProximityArray.OK):
        return pt.link(
            self.node.wait_for(
                lambda m: m.status == status and condition(pt.link(m, "ball_link")), what
            ),
            "ball_link",
        )

    def send(self, *objects, replace_all=False):
        message = WorldObjects(objects=objects, replace_all=replace_all)
        message.header.stamp = rospy.Time.now()
        self.topic.publish(message)

    def is_at_table(self):
        """Nothing but the table is near."""
        return self.ball(
            lambda l: l.state == LinkProximity.NEAR and abs(l.distance - 0.3) < 1e-6, "the table"
        )

    def test_1_parameters_and_file(self):
        ball = self.is_at_table()
        self.assertEqual(ball.source, "cell")
        self.assertLessEqual(ball.lower_bound, 0.3)
        self.assertGreaterEqual(ball.lower_bound, 0.3 - 0.0011)
        self.assertAlmostEqual(ball.direction.x, -1.0, places=6)
        self.assertAlmostEqual(ball.point_on_obstacle.x, 0.4, places=6)
        # The shelf of the file is 0.5 - 0.1 away on the other side.
        self.world.poses["ball_link"] = ("base", pt.transform((-0.2, 0, 0)))
        # The repulsion turns to the shelf in ~repulsion/smoothing.
        near_shelf = self.ball(
            lambda l: abs(l.distance - 0.2) < 1e-6 and l.repulsion.x > 0.1, "the shelf"
        )
        self.world.poses["ball_link"] = ("base", pt.transform((0, 0, 0)))
        self.assertGreater(near_shelf.direction.x, 0.99)
        self.assertLess(near_shelf.repulsion.y, 1e-6)

    def test_2_objects_move_with_their_frames(self):
        for y in (0.5, 0.4, 0.35):
            self.world.poses["carriage"] = ("base", pt.transform((0, y, 0)))
            self.node.wait_for_distance(min(y - 0.2, 0.3), "the carriage")
        del self.world.poses["carriage"]
        self.node.wait_for_unknown(ProximityArray.NO_CLOUD, "carriage")
        self.world.poses["carriage"] = ("base", pt.transform((0, 3, 0)))

    def test_2_late_frames(self):
        """What a frame moves in the time that its pose is late is taken off the bound, and told."""
        del self.world.poses["carriage"]
        late, speed, begin = 0.2, 0.5, rospy.Time.now().to_sec() + 1.5

        def y(t):
            return 1.0 - speed * min(max(t - begin, 0.0), 1.4)  # of the slider's centre

        def send():
            stamp = rospy.Time.now() - rospy.Duration(late)
            X = pt.transform((0, y(stamp.to_sec()), 0))
            self.world.publish_transforms([pt.transform_message("base", "carriage", X, stamp)])

        sender = self.world.repeat(50, send)
        first = len(self.node.messages)
        self.node.wait_for(lambda m: m.header.stamp.to_sec() > begin + 2.0, "the slider's way")
        sender.stop()
        self.world.poses["carriage"] = ("base", pt.transform((0, 3, 0)))
        told = 0
        for message in self.node.messages[first:]:
            t = message.header.stamp.to_sec()
            one = pt.link(message, "ball_link")
            if t < begin:
                if t > begin - 0.2:  # its way to where it begins is forgotten
                    self.assertNotIn("'carriage'", message.status_text)
                continue
            if not begin + late + 0.5 < t < begin + 1.35:
                continue
            truth = min(y(t) - 0.2, 0.3)  # the table is there, too
            self.assertLessEqual(one.lower_bound, truth + 1e-3)
            self.assertGreater(one.lower_bound, truth - 1.2 * late * speed - 0.03)
            if message.status == ProximityArray.DEGRADED:
                self.assertIn("the newest pose of frame 'carriage' is 0.", message.status_text)
                told += 1
        self.assertGreater(told, 10)

    def test_3_topic(self):
        self.send(box("part", 0.0, 0.3), box("other", 0.0, 0.0, 0.9))
        self.node.wait_for_distance(0.1, "the part", source="parts")
        self.send(box("part", 0.0, 0.35, operation=WorldObject.MOVE))
        self.node.wait_for_distance(0.15, "the part that was moved")
        self.send(box("part", 0.0, 0.0))
        contact = self.ball(lambda l: l.state == LinkProximity.CONTACT, "contact")
        self.assertLess(contact.distance, 0.0)
        self.assertLessEqual(contact.lower_bound, contact.distance)
        self.assertTrue(math.isnan(contact.penetration.force.x))
        self.send(box("part", 0.0, operation=WorldObject.REMOVE))
        self.is_at_table()

    def test_4_what_cannot_be_used_is_named(self):
        broken = box("wall", 1.0)
        broken.shape, broken.dimensions, broken.mesh = WorldObject.MESH, [], "/no/such/wall.stl"
        self.send(broken, box("part", 0.0, 0.3))
        told = self.node.wait_for_unknown(ProximityArray.NO_CLOUD, "wall.stl")
        self.assertIn("'wall'", told.status_text)
        self.send(box("wall", 0.0, operation=WorldObject.REMOVE))
        self.node.wait_for_distance(0.1, "the part, without the wall")
        # The older description of one message ended the fault of the newer one.
        self.send(box("wall", 1.0), broken)
        self.node.wait_for_status(ProximityArray.NO_CLOUD, "wall.stl")
        self.send(box("wall", 0.0, operation=WorldObject.REMOVE))
        huge = box("huge", 1.0, edge=2e4)
        self.send(huge)
        self.node.wait_for_status(ProximityArray.NO_CLOUD, "'huge'")
        nowhere = box("huge", 1.0, frame="no_such_frame")
        self.send(nowhere)
        self.node.wait_for_status(ProximityArray.NO_CLOUD, "no_such_frame")

    def test_4_an_older_shape_is_not_the_newer_one(self):
        """Moving an object ended the fault that its newer shape could not be used."""
        broken = box("part", 0.0, 0.5)
        broken.shape, broken.dimensions, broken.mesh = WorldObject.MESH, [], "/no/such/part.stl"
        for bad, words in ((broken, "part.stl"), (box("part", 0.0, edge=2e4), "'part'")):
            self.send(box("part", 0.0, 0.5))
            self.is_at_table()
            self.send(bad)
            self.node.wait_for_status(ProximityArray.NO_CLOUD, words)
            self.send(box("part", 0.0, 0.4, operation=WorldObject.MOVE), box("next", 5.0))
            self.node.wait_until(lambda: self.node.messages[-1].sources[1].points_used == 3, "both")
            for message in self.node.next_messages(20):
                self.assertEqual(message.status, ProximityArray.NO_CLOUD, message.status_text)
            self.send(box("part", 0.0, 0.35))
            self.node.wait_for_distance(0.15, "the part with a shape that is used")
            self.send(replace_all=True)
            self.is_at_table()
        # A move that cannot be done says nothing of the shape.
        self.send(box("part", 0.0, 0.5))
        upright = box("part", 0.0, 0.5, operation=WorldObject.MOVE)
        upright.pose.orientation.w = 0.0
        self.send(upright)
        self.node.wait_for_status(ProximityArray.NO_CLOUD, "'part'")
        self.send(box("part", 0.0, 0.35, operation=WorldObject.MOVE))
        self.node.wait_for_distance(0.15, "the part that was moved")

    def test_5_too_many_objects(self):
        self.send(*[box("object %d" % i, 5.0) for i in range(10001)])
        self.node.wait_for_status(
            ProximityArray.NO_CLOUD, "10001 objects; allowed are 10000"
        )
        # They are missing until all objects are sent anew.
        first = len(self.node.messages)
        self.send(box("part", 0.0, 5.0))
        pt.wait_until(lambda: len(self.node.messages) > first + 50, "messages")
        self.assertEqual({m.status for m in self.node.messages[first:]}, {ProximityArray.NO_CLOUD})
        self.send(replace_all=True)
        self.is_at_table()
        # What exceeds a limit is refused as a whole, also where it is to replace all objects.
        self.send(box("part", 0.0, 0.3))
        self.node.wait_for_distance(0.1, "the part")
        self.send(*[box("object %d" % i, 5.0) for i in range(10000)], replace_all=True)
        self.node.wait_for_status(ProximityArray.NO_CLOUD, "would hold 10001 objects")
        self.send(box("part", 0.0, 0.25), replace_all=True)
        self.node.wait_for_distance(0.05, "the part")

    def test_6_query_service(self):
        self.is_at_table()
        service = self.node.service("query", QueryProximity)
        answer = service(states=[JointState(), JointState()], times=[0.0, 1.0])
        self.assertTrue(answer.success, answer.message)
        distances = [pt.link(result, "ball_link").distance for result in answer.results]
        # Links on floating joints are placed by tf, as in the cycles.
        self.assertTrue(all(abs(d - 0.3) < 1e-6 for d in distances), distances)
        # The ball stands still, so that it never touches the table.
        self.assertEqual(answer.impact_times[0], math.inf)
        self.send(box("part", 0.0, 0.0))
        self.ball(lambda l: l.state == LinkProximity.CONTACT, "contact")
        answer = service(states=[JointState(), JointState()], times=[0.0, 1.0])
        self.assertEqual(answer.impact_times[0], 0.0)

    def test_7_replacing_all_leaves_configured_objects(self):
        """One that the topic had sent anew vanished, and nobody would have sent it again."""
        self.send(box("stop", 0.0, 0.3), box("part", 0.0, 0.25))
        self.node.wait_for_distance(0.05, "the part")
        self.send(replace_all=True)
        self.node.wait_for_distance(0.1, "the stop")
        self.send(box("stop", 3.0, operation=WorldObject.MOVE))
        self.is_at_table()


    def test_8_what_is_mended_counts_when_it_is_measured(self):
        """Mended, it was not in the world before all that was sent with it had been read."""
        broken = box("part", 0.0, 0.3)
        broken.dimensions = [0.2, 0.2, 0.0]
        self.send(broken)
        self.node.wait_for_unknown(ProximityArray.NO_CLOUD, "'part'")
        first = len(self.node.messages)
        large = WorldObject(id="hill", shape=WorldObject.MESH, mesh="file://" + hill_file())
        large.pose.orientation.w, large.pose.position.y = 1.0, 50.0
        self.send(box("part", 0.0, 0.3), box("nobody", 0.0, operation=WorldObject.REMOVE), large)
        self.node.wait_for_distance(0.1, "the part")
        for message in self.node.messages[first:]:
            one = pt.link(message, "ball_link")
            self.assertTrue(one.state == LinkProximity.UNKNOWN or one.lower_bound < 0.1 + 1e-6, message)
        self.assertTrue(any("has been read for" in m.status_text for m in self.node.messages[first:]))

    def test_9_frames_that_are_none(self):
        for frame in ("/", "(fixed frame)"):
            self.send(box("part", 0.0, 0.3, frame=frame))
            self.node.wait_for_unknown(ProximityArray.NO_CLOUD, "no frame of tf")
            self.send(replace_all=True)
            self.is_at_table()


class FreshWorldTest(pt.NodeTest):
    """A world with a timeout, whose sender repeats that it is there."""

    BOX = None

    def test_messages_keep_it_fresh(self):
        parts = rospy.Publisher(self.namespace + "/parts", WorldObjects, queue_size=10)
        self.world.stand()
        self.world.start_tf()
        # Without a deadline: on a slow machine it would pass, which is not what this is about.
        parameters = {"query/deadline": 0.0}
        parameters["sources"] = {"parts": {"type": "world", "topic": "parts", "timeout": 1.0}}
        node = self.start(**parameters)
        pt.wait_until(lambda: parts.get_num_connections() > 0, "the node to listen")

        def send(*objects):
            message = WorldObjects(objects=objects)
            message.header.stamp = rospy.Time.now()
            parts.publish(message)

        sender = self.world.repeat(5, send)
        node.wait_for_status(ProximityArray.OK)
        send(box("part", 0.0, 0.3))
        node.wait_for_distance(0.1, "the part")
        first = len(node.messages)
        end = rospy.Time.now() + rospy.Duration(2.0)
        node.wait_for(lambda m: m.header.stamp > end, "two seconds")
        self.assertEqual({m.status for m in node.messages[first:]}, {ProximityArray.OK})
        sender.paused = True
        node.wait_for_unknown(ProximityArray.STALE_CLOUD, "allowed is 1.00 s")

    def test_a_frame_that_turns_far_while_it_is_late(self):
        """Nothing is known of the way to what stands in it, and no bound says otherwise."""
        self.world.stand()
        self.world.start_tf()

        def turn():
            stamp = rospy.Time.now() - rospy.Duration(0.35)
            X_BT = pt.transform((0.3, 0, 0), angle=2.0 * (stamp.to_sec() % 1000))
            self.world.publish_transforms([pt.transform_message("base", "table", X_BT, stamp)])

        self.world.repeat(50, turn)
        far = {"shape": "box", "size": [0.3] * 3, "frame_id": "table", "position": [5.0, 0.0, 0.0]}
        node = self.start(sources={"cell": {"type": "world", "objects": {"far": far}}}, max_distance=1.0)
        is_unknown = lambda link: link.state == LinkProximity.UNKNOWN  # noqa: E731
        node.wait_for(
            lambda m: m.status == ProximityArray.DEGRADED and any(map(is_unknown, m.links)), "a turn"
        )
        # Each message keeps that no bound is finite.


class OtherRobotTest(pt.NodeTest):
    """Another robot, by its joint states and by tf."""

    BOX = pt.transform((2, 0, 0))

    def start(self, **sources):
        self.world.start_tf()
        return super().start(sources=sources, links=["ball_link"])

    def run_with(self, robot, move, stop):
        rospy.set_param(self.namespace + "/other/robot_description", OTHER)
        source = {"type": "world", "robot": dict(robot, description="other/robot_description")}
        self.world.poses["other/rail"] = ("base", pt.transform((1, 0, 0)))
        node = self.start(other=source)
        node.wait_for_status(ProximityArray.NO_CLOUD, "head")
        mover = self.world.repeat(50, lambda: move(-0.4))
        node.wait_for_distance(0.4, "the other robot's head", within=1e-3, source="other")
        mover.function = lambda: move(-0.6)
        node.wait_for_distance(0.2, "its motion", within=1e-3)
        mover.paused = True
        stop()
        node.wait_for_unknown(ProximityArray.NO_CLOUD, "head")

    def test_a_name_that_is_stated_twice(self):
        """A table of the parameters and one of the file: neither vanishes in silence."""
        cell = {"type": "world", "file": scene_file(), "objects": {"shelf": TABLE}}
        self.start(cell=cell).wait_for_unknown(ProximityArray.NO_CLOUD, "'shelf' is stated twice")

    def test_what_can_be_placed_is_left_of_an_optional_world(self):
        """An object whose frame is not known takes no other one with it."""
        self.world.points = [[0, 0, 1.0]]
        self.world.poses["carriage"] = ("base", pt.transform((0, 0.35, 0)))
        self.world.start_clouds()
        cell = {"type": "world", "required": False, "objects": {"box": TABLE, "slider": SLIDER}}
        node = self.start(camera={"topic": "cloud"}, cell=cell)

        node.wait_for_distance(0.15, "the slider")
        begin = len(node.messages)
        del self.world.poses["carriage"]
        left = node.wait_for_distance(0.3, "the box")
        told = next(source for source in left.sources if source.name == "cell")
        self.assertEqual(told.status, ProximityArray.NO_CLOUD)
        node.wait_for_diagnostic("input cell", "some of it is left out")
        for message in node.messages[begin:]:
            self.assertLessEqual(pt.link(message, "ball_link").lower_bound, 0.3)
        self.world.poses["carriage"] = ("base", pt.transform((0, 0.35, 0)))
        node.wait_for_distance(0.15, "the slider again")

    def test_joint_states(self):
        publisher = rospy.Publisher(self.namespace + "/other/joint_states", JointState, queue_size=10)

        def move(q):
            state = JointState(name=["slide"], position=[q])
            state.header.stamp = rospy.Time.now()
            publisher.publish(state)

        self.run_with(
            {"joint_states": "other/joint_states", "tf_prefix": "other/"}, move, lambda: None
        )

    def test_tf(self):
        def move(q):
            self.world.poses["other/head"] = ("other/rail", pt.transform((q, 0, 0)))

        self.run_with({"tf_prefix": "other/"}, move, lambda: self.world.poses.pop("other/head"))


if __name__ == "__main__":
    pt.run("world_test", {"objects": WorldTest, "fresh": FreshWorldTest, "robot": OtherRobotTest})
