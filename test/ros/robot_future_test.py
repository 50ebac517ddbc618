#!/usr/bin/env python3
"""What links can still reach until they stand: robot_future, and the separation distance of ~speed_scale."""


import numpy as np
import proximity_testing as pt
from ist_proximity.msg import SpeedScaleState
from joint_states_test import ARM
from memory_test import LASTING, VOXEL
from proximity_testing import LinkProximity, ProximityArray

# The arm with its camera at the column, which looks along x of `base`.
STILL_CAMERA = ARM.replace(
    '<parent link="ball_link"/><child link="camera"/>\n    <origin xyz="0.3 0 0"/>',
    '<parent link="base"/><child link="camera"/>\n    <origin xyz="0 0 0.5"/>',
)
# The arm whose joints all have a limit of speed.
LIMITED = ARM.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><limit velocity="0.8" effort="1"/>')


class RobotFutureTest(pt.NodeTest):
    CAMERA = BOX = None  # the arm's URDF has the camera
    MAX_DISTANCE = 2.0

    def start(self, urdf=ARM, **parameters):
        super().start(urdf, pose_source="joint_states", **parameters)
        self.scales = self.node.collect("speed_scale_state", SpeedScaleState)
        return self.node

    def test_comes_off_the_bounds(self):
        """What links can still sweep comes off their bounds; without velocities it is not known."""
        deceleration = {"default": 0.5, "slide": 2.0}
        node = self.start(max_distance=3.0, joint_deceleration=deceleration)
        self.world.start_points([[0.6, 0.6, 0.6]])
        q, velocities = {"turn": 0.3, "slide": 0.5}, [-0.4, 0.6]
        self.world.start_joints(q, velocities=velocities)
        message = node.wait_for_status(ProximityArray.OK)
        turned, slid = 0.4**2 / (2 * 0.5), 0.6**2 / (2 * 2.0)  # [rad, m]
        lever = {  # [m] of the farthest point of the link's box from the column's axis
            "ball_link": np.hypot(0.5 + 0.1, 0.1),
            "box_link": np.hypot(-1.5 * 0.5 - 0.5 + 0.05 - 0.1, 0.2),
        }
        for name, way in (("ball_link", slid), ("box_link", 1.5 * slid)):
            one = pt.link(message, name)
            reach = lever[name] * turned + way
            self.assertAlmostEqual(one.lower_bound - one.robot_future, reach, delta=1e-4)

        velocities[:] = [0.0, 0.0]  # the robot stands
        node.wait_for(
            lambda m: pt.link(m, "ball_link").robot_future == pt.link(m, "ball_link").lower_bound,
            "a robot that stands",
        )
        for unknown in ([np.nan, 0.0], []):
            velocities[:] = unknown
            node.wait_for(
                lambda m: pt.link(m, "ball_link").robot_future == -np.inf
                and pt.link(m, "ball_link").state == LinkProximity.NEAR,
                "an unknown velocity",
            )
            velocities[:] = [0.1, 0.0]
            node.wait_for(
                lambda m: pt.link(m, "ball_link").robot_future > -1.0, "a velocity that is known"
            )

        # Where a joint is stated that the URDF lacks, another one has not its deceleration.
        self.assertEqual(node.stop(), 0)
        node = self.start(
            max_distance=3.0,
            joint_deceleration={**deceleration, "glide": 1.0},
            speed_scale={"separation": {"enabled": True}},
        )
        message = node.wait_for_status(ProximityArray.DEGRADED, "joint_deceleration names 'glide'")
        ball = pt.link(message, "ball_link")
        self.assertEqual((ball.state, ball.robot_future), (LinkProximity.NEAR, -np.inf))
        told = "how far a link goes until it stands is not known"
        pt.wait_until(lambda: self.scales and told in self.scales[-1].text, "the scale's reason")
        self.assertEqual(self.scales[-1].scale, 0.0)

    def test_unknown_space_counts(self):
        """The ball swings towards the side of the cone that the camera sees, of half width 0.3 x."""
        slope = np.linspace(-0.3, 0.3, 97)
        y, z = np.meshgrid(2.4 * slope, 2.4 * slope)
        self.world.points = np.column_stack([np.full(y.size, 2.4), y.ravel(), z.ravel()])
        self.world.start_clouds()
        deceleration = {"turn": 0.5, "slide": 2.0}
        node = self.start(
            STILL_CAMERA,
            links=["ball_link"],
            max_distance=2.0,
            joint_deceleration=deceleration,
            unknown_space="obstacle",
            memory=LASTING,
        )
        q, velocities = {"turn": 0.0, "slide": 0.9}, [-0.3, 0.4]
        self.world.start_joints(q, velocities=velocities)
        turned, slid = 0.3**2 / (2 * 0.5), 0.4**2 / (2 * 2.0)  # [rad, m]

        def is_at(turn, slide):
            to_side = (0.3 * np.cos(turn) - abs(np.sin(turn))) * slide / np.hypot(1.0, 0.3) - 0.1
            return lambda m: (
                m.status == ProximityArray.OK
                and -3 * VOXEL < m.links[0].unseen_distance - to_side < 2 * VOXEL
            )

        now = node.wait_for(is_at(0.0, 0.9), "the ball in seen space").links[0]
        self.assertEqual(now.state, LinkProximity.NEAR)
        self.assertAlmostEqual(now.lower_bound, now.unseen_distance, places=9)
        self.assertGreater(now.distance, now.lower_bound + 0.5)
        reach = np.hypot(1.0, 0.1) * turned + slid
        self.assertAlmostEqual(now.lower_bound - now.robot_future, reach, delta=1e-4)
        # Where it stands in the end, unknown space is not nearer than was told.
        q.update(turn=-turned, slide=0.9 + slid)
        velocities[:] = [0.0, 0.0]
        end = node.wait_for(is_at(-turned, 0.9 + slid), "the ball at its end").links[0]
        self.assertGreaterEqual(end.unseen_distance, now.robot_future)
        self.assertLess(end.unseen_distance, now.lower_bound)

    def test_separation_distance(self):
        """The scale is what solves the separation distance with the reach of the ball at full speed."""
        turn, reaction, obstacle_speed = 0.3, 0.1, 1.6
        node = self.start(
            LIMITED,
            max_distance=3.0,
            joint_deceleration={"default": 4.0, "slide": 2.0},
            speed_scale={"separation": {"enabled": True, "reaction_time": reaction}},
        )
        away = 0.5 + 0.1 + 1.2  # from the column's axis, by where the ball is
        self.world.start_points([[away * np.cos(turn), away * np.sin(turn), 0.5]])
        self.world.start_joints({"turn": turn, "slide": 0.5}, velocities=[0.0, 0.0])
        node.wait_for_status(ProximityArray.OK)
        lever = np.hypot(0.5 + 0.1, 0.1)
        speed = lever * 0.8 + 1.0
        way = lever * 0.8**2 / (2 * 4.0) + 1.0**2 / (2 * 2.0)
        standing = max(0.8 / 4.0, 1.0 / 2.0)  # [s] after
        late, begin = [], len(self.scales)
        pt.wait_until(lambda: len(self.scales) > begin + 100, "scales")
        answers = [m for m in list(node.messages) if m.status == ProximityArray.OK]
        ages = {m.header.stamp: max(s.age for s in m.sources) for m in answers}
        for state in self.scales[begin:]:
            if state.header.stamp not in ages:
                continue
            self.assertEqual((state.link, state.rule), ("ball_link", SpeedScaleState.SEPARATION))
            self.assertAlmostEqual(state.bound, 1.2, delta=0.01)
            k = state.scale
            self.assertLess(k, 0.95)
            if k == 0.0:  # a busy machine, whose clouds are late
                continue
            # The reaction time that solves the equation: the stated one and the cloud's age then.
            left = state.bound - k * obstacle_speed * standing - k**2 * way
            late.append(left / (obstacle_speed + k * speed) - reaction - ages[state.header.stamp])
        self.assertGreater(len(late), 50)
        self.assertGreater(min(late), -1e-6)
        self.assertLess(min(late), 0.02)


if __name__ == "__main__":
    pt.run("robot_future_test", RobotFutureTest)
