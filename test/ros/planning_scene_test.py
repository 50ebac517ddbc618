#!/usr/bin/env python3
"""moveit_msgs/PlanningScene as a known world: of Noetic and of Melodic, as genpy writes them."""

import itertools
import math
import struct
import sys
import tempfile
import unittest

import proximity_testing as pt
import rospy
from geometry_msgs.msg import Pose
from planning_scene_messages import get_planning_scene_type, planning_scene_types
from proximity_testing import ProximityArray

ADD, REMOVE, APPEND, MOVE = range(4)
# A binary OcTree with one occupied leaf, which begins at (0, 0, 0): 16 levels of inner nodes above it.
ONE_LEAF = struct.pack("<16H", 3 << 14, *[3] * 14, 2)

# A program in whose publishing a signal comes for sure: a lock that rospy holds there for microseconds is
# held for longer.
SLOW_PUBLISHING = """
import runpy, sys, time
from rospy.impl.tcpros_pubsub import QueuedConnection
write = QueuedConnection.write_data

def write_slowly(self, data):
    with self._lock:
        time.sleep(0.3)
    return write(self, data)

QueuedConnection.write_data = write_slowly
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def pose(x=0.0, y=0.0, z=0.0):
    result = Pose()
    result.position.x, result.position.y, result.position.z = x, y, z
    result.orientation.w = 1.0
    return result


class Bridge:
    """Runs planning_scene_bridge in a namespace, as a process of the test.

    Each has a name of its own: the master shuts down whoever listens where a killed node of the same
    name did, be it a node of another test.
    """

    numbers = itertools.count()

    def __init__(self, namespace, scenes, objects, *arguments, wrapper=()):
        command = [*wrapper, pt.find_program("ist_proximity", "planning_scene_bridge"), *arguments]
        command += ["planning_scene:=" + scenes, "world_objects:=" + objects]
        name = "bridge_%d_of_%s" % (next(self.numbers), objects)
        self.log = tempfile.TemporaryFile()
        self.process = pt.start_program(command, namespace, name, self.log)

    def stop(self):
        self.process.terminate()
        self.process.wait(pt.TIMEOUT)

    def kill(self):
        self.process.kill()
        self.process.wait()

    def errors(self):
        """What it has printed of scenes that cannot be used, and of its own end."""
        self.log.seek(0)
        lines = self.log.read().decode().splitlines()
        return [line for line in lines if "no planning scene" in line or "Traceback" in line]


class Publisher:
    """Planning scenes of one layout."""

    def __init__(self, topic, is_noetic):
        types = planning_scene_types(is_noetic)
        self.types, self.topic = types, topic
        self.Scene = types["moveit_msgs/PlanningScene"]
        self.Object = types["moveit_msgs/CollisionObject"]
        self.Primitive = types["shape_msgs/SolidPrimitive"]
        self.Entry = types["moveit_msgs/AllowedCollisionEntry"]
        self.Attached = types["moveit_msgs/AttachedCollisionObject"]
        self.publisher = None
        self.start()

    def start(self):
        self.publisher = rospy.Publisher(self.topic, self.Scene, queue_size=10, latch=True)

    def stop(self):
        self.publisher.unregister()

    def serve(self, name, *objects):
        """A service that gives these objects as the full scene; its requests are counted."""
        service = get_planning_scene_type(self.types)
        requests = []

        def answer(request):
            requests.append(request.components)
            scene = service._response_class()
            scene.world.collision_objects = list(objects)
            return scene

        return rospy.Service(name, service, answer), requests

    def box(self, name, at=None, operation=ADD, edge=0.2, frame="base"):
        """A box whose pose is that of its shape."""
        one = self.Object(id=name, operation=operation)
        one.header.frame_id = frame
        if at is not None and operation != REMOVE:
            one.primitive_poses = [pose(*at)]
            if operation != MOVE:
                one.primitives = [self.Primitive(type=1, dimensions=[edge] * 3)]
        return one

    def octomap(self, at, data=ONE_LEAF, frame="base", kind="OcTree"):
        """An octomap of one leaf of 0.2 m, whose lower corner is at its origin."""
        one = self.types["octomap_msgs/OctomapWithPose"](origin=pose(*at))
        one.header.frame_id = frame
        one.octomap.binary, one.octomap.id, one.octomap.resolution = True, kind, 0.2
        one.octomap.data = list(struct.unpack("%db" % len(data), data))
        return one

    def attached(self, link, one, touch_links=()):
        """An object of box() that is attached to a link, or detached where its operation is REMOVE."""
        return self.Attached(link_name=link, object=one, touch_links=list(touch_links))

    def send(self, *objects, is_diff=True, allowed=None, octomap=None, attached=(), is_state_diff=True):
        scene = self.Scene(is_diff=is_diff, name="scene")
        scene.world.collision_objects = list(objects)
        scene.robot_state.is_diff = is_state_diff
        if octomap is not None:
            scene.world.octomap = octomap
        scene.robot_state.attached_collision_objects = list(attached)
        if allowed is not None:
            matrix = scene.allowed_collision_matrix
            matrix.entry_names = list(allowed)
            count = len(matrix.entry_names)
            matrix.entry_values = [self.Entry(enabled=[True] * count) for _ in range(count)]
        self.publisher.publish(scene)


class PlanningSceneTest(unittest.TestCase):
    """One node with a source of each layout; the ball of radius 0.1 m is at the origin."""

    @classmethod
    def setUpClass(cls):
        cls.world = pt.World("/scenes").stand(box=pt.transform((0, 0, 2)))
        cls.world.start_tf()
        cls.noetic = Publisher("/scenes/monitored_planning_scene", True)
        cls.melodic = Publisher("/scenes/old_planning_scene", False)
        cls.noetic.send(is_diff=False)
        cls.melodic.send()
        post = {"shape": "box", "size": [0.2, 0.2, 0.2], "position": [0.5, 0, 0]}
        cls.node = pt.ProximityNode(
            "/scenes",
            {
                "sources": {
                    "noetic": {
                        "type": "world",
                        "topic": "objects",
                        "objects": {"post": post},
                    },
                    "melodic": {
                        "type": "world",
                        "topic": "old_objects",
                    },
                },
                "links": ["ball_link"],
            },
            pt.urdf(),
        )
        cls.bridges = [
            Bridge("/scenes", "monitored_planning_scene", "objects"),
            Bridge("/scenes", "old_planning_scene", "old_objects", "_starts_empty:=true"),
        ]

    @classmethod
    def tearDownClass(cls):
        for bridge in cls.bridges:
            bridge.stop()
        cls.node.stop()
        cls.world.stop()

    def tearDown(self):
        self.noetic.send(is_diff=False)
        self.at_post()

    def distance(self, expected, what, source=None):
        ball = pt.link(self.node.wait_for_distance(expected, what, source=source), "ball_link")
        self.assertLessEqual(ball.lower_bound, ball.distance)

    def at_post(self):
        """Nothing but the configured post is near."""
        self.distance(0.3, "the post", "noetic")

    def test_1_objects_come_move_and_go(self):
        self.at_post()
        for publisher, source in ((self.noetic, "noetic"), (self.melodic, "melodic")):
            box = publisher.box
            publisher.send(box("part", (0, 0.35, 0)), box("other", (0, 0, 0.9)))
            self.distance(0.15, "the part", source)
            publisher.send(box("part", (0, 0.4, 0), MOVE))
            self.distance(0.2, "the part that was moved", source)
            publisher.send(box("other", (0, 0, 0.3), MOVE), box("part", None, REMOVE))
            self.distance(0.1, "the other", source)
            # Of a full scene only its own objects remain.
            publisher.send(box("third", (0, -0.45, 0)), is_diff=False)
            self.distance(0.25, "the third", source)
            publisher.send(box("", None, REMOVE))
            self.at_post()

    def test_2_poses_of_objects_in_noetic(self):
        box = self.noetic.box("pair", (0, 0.05, 0))
        box.pose = pose(0, 0.4, 0)
        self.noetic.send(box)
        self.distance(0.25, "a shape in the pose of its object")
        more = self.noetic.box("pair", (0, -0.05, 0), APPEND)
        more.pose = pose(0, 0.4, 0)
        self.noetic.send(more)
        self.distance(0.15, "the shape that was appended")
        moved = self.noetic.box("pair", None, MOVE)
        moved.pose = pose(0, 0.45, 0)
        self.noetic.send(moved)
        self.distance(0.2, "the pair that was moved")
        more.pose = pose(0, 0.2, 0)
        self.noetic.send(more)
        self.node.wait_for_status(ProximityArray.NO_CLOUD, "'pair'")
        self.noetic.send(box)
        self.distance(0.25, "the object that was sent anew")

    def test_3_allowed_collisions(self):
        self.noetic.send(self.noetic.box("table", (0, 0.25, 0)))
        self.distance(0.05, "the table", "noetic")
        self.noetic.send(allowed=["ball_link", "box_link", "table"])
        self.at_post()
        # The object may be touched as well when it is sent anew, and after the matrix has changed
        # it may not.
        self.noetic.send(self.noetic.box("table", (0, 0.3, 0)), self.noetic.box("wall", (0, -0.4, 0)))
        self.distance(0.2, "the wall", "noetic")
        self.noetic.send(allowed=["box_link", "table"])
        self.distance(0.1, "the table, which may not be touched any more", "noetic")

    def test_4_what_cannot_be_used_is_named(self):
        bad = self.noetic.box("bad", (0, 0.5, 0), edge=math.nan)
        self.noetic.send(self.noetic.box("good", (0, 0.35, 0)), bad)
        self.node.wait_for_unknown(ProximityArray.NO_CLOUD, "'bad'")
        self.noetic.send(self.noetic.box("bad", None, REMOVE))
        self.distance(0.15, "the good one, without the bad one")
        # A description that cannot be used after one of the same name that can.
        self.noetic.send(self.noetic.box("bad", (0, 0.9, 0)), bad)
        self.node.wait_for_status(ProximityArray.NO_CLOUD, "'bad'")
        # A name of a configured object: neither vanishes in silence.
        self.noetic.send(self.noetic.box("post", (0, 0.5, 0)), is_diff=False)
        self.node.wait_for_status(ProximityArray.NO_CLOUD, "'post'")
        self.noetic.send(self.noetic.box("post", None, REMOVE))
        self.at_post()
        # Names are no keys of other faults.
        self.noetic.send(bad, self.noetic.box("nowhere", (0, 3, 0), frame="no_such_frame"))
        self.node.wait_for_status(ProximityArray.NO_CLOUD, "'bad'")

    def test_5_a_difference_that_is_lost_needs_a_full_scene(self):
        self.noetic.send(*[self.noetic.box("object %d" % i, (0, 3, 0)) for i in range(10001)])
        self.node.wait_for_status(ProximityArray.NO_CLOUD, "10001 objects; allowed are 10000")
        self.noetic.send(self.noetic.box("(full scene)", (0, 3, 0)))
        self.node.wait_for_unknown(ProximityArray.NO_CLOUD, "a full scene")
        self.noetic.send(self.noetic.box("part", (0, 0.35, 0)), is_diff=False)
        self.distance(0.15, "the part of the full scene")

    def test_5b_the_octomap_is_an_obstacle(self):
        for publisher, source in ((self.noetic, "noetic"), (self.melodic, "melodic")):
            octomap, cleared = publisher.octomap, publisher.octomap((0, 0, 0), b"", kind="cleared")
            # Its leaf begins 0.15 m above the ball, in a frame with an origin.
            publisher.send(octomap=octomap((-0.1, 0.25, -0.1)))
            self.distance(0.15, "the octomap", source)
            # A difference that says nothing of it leaves it; one with another replaces it.
            publisher.send(publisher.box("part", (0, 0, 0.9)))
            self.distance(0.15, "the octomap that stays", source)
            publisher.send(octomap=octomap((-0.1, -0.1, 0.3)))
            self.distance(0.2, "the next octomap", source)
            # In the frame of a link, which stands at a height of 2 m; objects count beside it.
            publisher.send(octomap=octomap((-0.1, -0.1, -1.8), frame="box_link"))
            self.distance(0.1, "the octomap in another frame", source)
            publisher.send(publisher.box("part", (0, 0.25, 0)))
            self.distance(0.05, "an object nearer than the octomap", source)
            publisher.send(publisher.box("part", None, REMOVE), octomap=cleared)
            self.at_post()
            publisher.send(octomap=octomap((-0.1, 0.25, -0.1)))
            self.distance(0.15, "the octomap once more", source)
            publisher.send(is_diff=False)  # a full scene without one
            self.at_post()

    def test_5c_an_octomap_that_cannot_be_used(self):
        octomap = self.noetic.octomap
        for bad, told in (
            (octomap((0, 0, 0), ONE_LEAF[:-1]), "ends in the middle of the tree"),
            (octomap((0, 0, 0), kind="ColorOcTree"), "ColorOcTree"),
            (octomap((math.nan, 0, 0)), "its origin"),
            (octomap((1, 0, 0), frame=""), "no frame_id"),
            (octomap((0, 0, 0), frame="no_such_frame"), "no_such_frame"),
        ):
            self.noetic.send(octomap=bad)
            self.node.wait_for_unknown(ProximityArray.NO_CLOUD, told)
            self.noetic.send(octomap=octomap((-0.1, 0.25, -0.1)))
            self.distance(0.15, "the octomap that was sent anew", "noetic")

    def test_6_only_differences(self):
        # Only differences: a source of its own would do the same after a restart of the node.
        late = Publisher("/scenes/late", True)
        world = pt.World("/late").stand()
        world.start_tf()
        node = pt.ProximityNode(
            "/late",
            {"sources": {"late": {"type": "world", "topic": "objects"}}, "links": ["ball_link"]},
            pt.urdf(),
        )
        bridge = Bridge("/late", "/scenes/late", "objects")
        try:
            node.wait_for_status(ProximityArray.NO_CLOUD)
            late.send(late.box("part", (0, 0.35, 0)))
            node.wait_for_status(ProximityArray.NO_CLOUD, "only differences (is_diff) have come")
            late.send(late.box("part", (0, 0.4, 0)), is_diff=False)
            node.wait_for_distance(0.2, "the part")
            # Another publisher, whose difference changes what nobody knows, until the service tells.
            late.stop()
            late.start()
            late.send(late.box("other", (0, 0, 0.9)))
            node.wait_for_unknown(ProximityArray.NO_CLOUD, "has another publisher than before")
            service, requests = late.serve("/late/get_planning_scene", late.box("part", (0, 0.35, 0)))
            node.wait_for_distance(0.15, "the part of the service's scene")
            self.assertEqual(set(requests), {4 | 16 | 32 | 64 | 128})
            late.send(late.box("part", (0, 0.3, 0), MOVE))
            node.wait_for_distance(0.1, "its move")
            service.shutdown()
            # A publisher of the older layout: a service of the one md5sum refuses the other.
            late.stop()
            old = Publisher("/scenes/late", False)
            service, requests = old.serve("/late/get_planning_scene", old.box("part", (0, 0.45, 0)))
            old.send(old.box("other", (0, 0, 0.9)))
            node.wait_for_distance(0.25, "the part of the older layout")
            self.assertTrue(requests)
            service.shutdown()
        finally:
            bridge.stop()
            node.stop()
            world.stop()

    def test_7_a_malformed_scene_is_told_once_and_loses_nothing(self):
        self.noetic.send(self.noetic.box("part", (0, 0.35, 0)), is_diff=False)
        self.distance(0.15, "the part", "noetic")
        Malformed = type("Malformed", (rospy.AnyMsg,), {})
        Malformed._type, Malformed._md5sum = self.noetic.Scene._type, self.noetic.Scene._md5sum
        Malformed._full_text = self.noetic.Scene._full_text
        publisher = rospy.Publisher("/scenes/monitored_planning_scene", Malformed, queue_size=30)
        lines = len(self.bridges[0].errors())
        for size in range(20):
            message = Malformed()
            message._buff = b"\xff" * size
            publisher.publish(message)
        self.node.wait_for_unknown(ProximityArray.NO_CLOUD, "no planning scene that can be read")
        self.node.wait_for_status(ProximityArray.NO_CLOUD, "a full scene")
        self.noetic.send(is_diff=False)
        self.at_post()
        self.assertLessEqual(len(self.bridges[0].errors()), lines + 1, self.bridges[0].errors())
        publisher.unregister()

    def test_8_objects_stay_when_the_bridge_has_ended(self):
        self.noetic.send(self.noetic.box("part", (0, 0.35, 0)), is_diff=False)
        self.distance(0.15, "the part", "noetic")
        self.bridges[0].kill()
        told = self.node.wait_for_status(ProximityArray.DEGRADED, "planning_scene_bridge")
        ball = pt.link(told, "ball_link")
        self.assertAlmostEqual(ball.distance, 0.15, 6)
        self.assertEqual(ball.source, "noetic")
        # The next one begins with what is latched.
        self.bridges[0] = Bridge("/scenes", "monitored_planning_scene", "objects")
        self.distance(0.15, "the part, from the next bridge", "noetic")

    def test_8b_a_signal_while_it_publishes(self):
        came = []
        rospy.Subscriber("/scenes/slow", rospy.AnyMsg, came.append)
        wrapper = (sys.executable, "-c", SLOW_PUBLISHING)
        bridge = Bridge("/scenes", "monitored_planning_scene", "slow", wrapper=wrapper)
        pt.wait_until(lambda: came, "a message")
        for _ in range(10):
            self.noetic.send(is_diff=False)
        pt.wait_until(lambda: len(came) > 2, "what is sent again and again")
        bridge.stop()
        self.assertEqual(bridge.process.returncode, 0)

    def test_9_a_connection_that_is_lost_and_a_publisher_that_is_gone(self):
        self.noetic.send(self.noetic.box("part", (0, 0.35, 0)), is_diff=False)
        self.distance(0.15, "the part", "noetic")
        self.noetic.send(self.noetic.box("other", (0, 0, 0.9)))
        # The master says nothing of it: so rospy leaves a publisher that ends and begins too fast.
        for connection in list(self.noetic.publisher.impl.connections):
            connection.close()
        self.node.wait_for_unknown(ProximityArray.NO_CLOUD, "has another publisher than before")
        self.noetic.send(self.noetic.box("part", (0, 0.4, 0)), is_diff=False)
        self.distance(0.2, "the part of the full scene", "noetic")
        self.noetic.stop()
        told = self.node.wait_for_status(ProximityArray.DEGRADED, "objects are held as they were")
        self.assertAlmostEqual(pt.link(told, "ball_link").distance, 0.2, 6)
        self.noetic.start()
        self.noetic.send(self.noetic.box("part", (0, 0.35, 0)), is_diff=False)
        self.distance(0.15, "the part of the next publisher", "noetic")


if __name__ == "__main__":
    pt.run("planning_scene_test", PlanningSceneTest)
