#!/usr/bin/env python3
"""The contact wrench: zero apart, out of the obstacle in contact, without jumps, NaN where unknown."""

import os

import numpy as np
import proximity_testing as pt
import rospy
from proximity_testing import LinkProximity, ProximityArray

# A wall across x = 0, larger than the box's side.
Y, Z = np.meshgrid(np.arange(-0.3, 0.3, 0.005), np.arange(-0.4, 0.4, 0.005))
WALL = np.column_stack([np.zeros(Y.size), Y.ravel(), Z.ravel()])
TILT = pt.transform((0.4, -0.3, 0.2), axis=(0.6, 0.0, 0.8), angle=0.5)  # of the scene in base


def box_at(depth):
    """The box reaches `depth` through the wall from its +x side, with its middle at y = z = 0."""
    x = pt.BOX_SIZE[0] / 2 - depth - pt.BOX_OFFSET[0]
    return TILT @ pt.transform((x, -pt.BOX_OFFSET[1], -pt.BOX_OFFSET[2]))


def wrench(message, name="box_link"):
    one = pt.link(message, name).penetration
    return np.hstack([pt.vector(one.force), pt.vector(one.torque)])


def nice_of(pid, thread):
    """The nice value of a thread, by its name."""
    for task in os.listdir("/proc/%d/task" % pid):
        with open("/proc/%d/task/%s/stat" % (pid, task)) as f:
            name, rest = f.read().split("(", 1)[1].rsplit(")", 1)
        if name == thread:
            return int(rest.split()[16])
    raise AssertionError("no thread " + thread)


class PenetrationTest(pt.NodeTest):
    CAMERA, BALL, BOX, POINTS = TILT, pt.transform((5, 0, 0)), box_at(-0.1), WALL

    def start(self, **parameters):
        # No deadline: on a busy machine it would end queries to a tolerance of 0.
        parameters = {
            "self_filter": False,
            "query/tolerance": 0.0,
            "query/deadline": 0.0,
            **parameters,
        }
        super().start(**parameters)
        self.world.start_tf()
        self.world.start_clouds()
        return self.node

    def move(self, depth, known=True):
        """The first message with the box there."""
        self.world.poses["box_link"] = ("base", box_at(depth))
        return self.node.wait_for(
            lambda m: m.status == ProximityArray.OK
            and abs(pt.link(m, "box_link").distance + depth) < 1e-4
            and np.isfinite(wrench(m)).all() == known,
            "the box %.3f m in the wall" % depth,
        )

    def test_through_touch_and_back(self):
        node = self.start()
        message = self.move(-0.1)
        self.assertEqual(pt.link(message, "box_link").state, LinkProximity.NEAR)
        self.assertFalse(wrench(message).any())
        self.move(0.03)  # the disjoint packing is there when this is finite
        out = TILT[:3, 0]
        forces = []
        depths = np.arange(-0.0015, 0.0201, 0.001)  # not at touch itself
        for depth in depths:
            message = self.move(depth)
            box = pt.link(message, "box_link")
            self.assertEqual(box.state == LinkProximity.CONTACT, depth > 0)
            found = wrench(message)
            forces.append(found[:3] @ out)
            if depth <= 0:
                self.assertFalse(found.any())
            elif depth >= 0.01:
                self.assertGreater(found[:3] @ out, 0.98 * np.linalg.norm(found[:3]))
                # The wall is the same on all sides of the box's middle, which is off the origin.
                middle = box_at(depth)[:3, :3] @ pt.BOX_OFFSET
                moment = found[3:] - np.cross(middle, found[:3])
                self.assertLess(np.linalg.norm(moment), 0.02 * np.linalg.norm(found[:3]))
        self.assertGreater(forces[-1], 0.0)
        self.assertLess(np.abs(np.diff(forces)).max(), 0.35 * max(forces))

        node.wait_for_value("model", "contact volumes", "^ready$")

    def test_volumes_and_finer_spheres_come_on_first_need(self):
        """Nothing is near: coarse spheres and no volume. Then the box comes near, not in contact."""
        self.world.poses["box_link"] = ("base", box_at(-1.5))
        # A machine that stops for a while makes nothing stale.
        node = self.start(cloud_timeout=8.0, pose_timeout=8.0)
        node.wait_for_status(ProximityArray.OK)
        node.wait_for_value("model", "links with a volume", "^0 of 2")
        self.assertTrue(node.diagnostic("model", "box_link").startswith("coarse, "))
        count = len(node.messages)
        self.move(-0.1)
        node.wait_for_value("model", "links with a volume", "^1 of 2")
        self.assertTrue(node.diagnostic("model", "box_link").startswith("final, "))
        for message in node.messages[count:]:  # the swap loses nothing
            self.assertEqual(message.status, ProximityArray.OK, message.status_text)
        self.assertTrue(np.isfinite(wrench(self.move(0.03))).all())
        # A volume that something in contact waits for does not wait for the rest of the machine.
        pid = node.process.pid
        usual = os.getpriority(os.PRIO_PROCESS, pid)
        self.assertEqual(nice_of(pid, "ist model"), usual)
        self.assertGreater(nice_of(pid, "ist packing"), usual)

    def test_another_robot_while_volumes_are_packed(self):
        """Volumes are those of the newest model: of its links, as large as they are there."""

        def boxes(count, edge):
            return "".join(
                """<link name="part%d"><collision><geometry><box size="%g %g %g"/></geometry>
                </collision></link><joint name="to_part%d" type="fixed"><parent link="base"/>
                <child link="part%d"/></joint>"""
                % (i, edge, edge, edge, i, i)
                for i in range(count)
            )

        node = self.start(**{"penetration/enabled": True})
        for count, edge in ((4, 0.2), (12, 0.3), (12, 0.2), (8, 0.4), (12, 0.5)):
            rospy.set_param(self.namespace + "/robot_description", pt.urdf(boxes(count, edge)))
            self.assertTrue(node.reload().success)
            # Some volumes are there, and others are not.
            node.wait_for_value("model", "links with a volume", "of %d$" % (count + 2))
        node.wait_for_value("model", "links with a volume", "^14 of 14$")
        for i in range(12):
            said = node.diagnostic("model", "volume of part%d" % i)
            self.assertGreater(float(said.split(", ")[1].split()[0]), 60.0, said)  # of 125 litres

    def test_switched_off(self):
        node = self.start(**{"penetration/enabled": False})
        self.assertFalse(wrench(self.move(-0.05)).any())
        message = self.move(0.03, known=False)
        self.assertTrue(np.isnan(wrench(message)).all())
        node.wait_for_value("model", "contact volumes", "penetration/enabled")


if __name__ == "__main__":
    pt.run("penetration_test", PenetrationTest)
