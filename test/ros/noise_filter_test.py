#!/usr/bin/env python3
"""The noise filter drops lone points and keeps surfaces; a cloud of noise is no clear view."""


import numpy as np
import proximity_testing as pt
from proximity_testing import LinkProximity, ProximityArray

LONE = np.array([[0.0, 0.0, 0.3]])  # 0.2 m from the ball at the origin
SIDE = 0.005 * np.arange(-5, 6)
PATCH = np.array([[x, y, 0.5] for x in SIDE for y in SIDE])  # 0.4 m from it


class NoiseFilterTest(pt.NodeTest):
    def start(self, dtype="<f4", **parameters):
        super().start(**parameters)
        self.world.start_tf()
        self.world.repeat(
            20,
            lambda: self.world.cloud_publisher.publish(pt.cloud(self.world.points, dtype=dtype)),
        )

    def check(self, distance, used):
        message = self.node.wait_for(
            lambda m: m.status == ProximityArray.OK and m.sources[0].points_used == used, "the cloud"
        )
        self.assertAlmostEqual(pt.link(message, "ball_link").distance, distance, 4)

    def check_all(self, **parameters):
        nan = np.full((3, 3), np.nan)
        self.world.points = np.vstack([LONE, PATCH, nan, [[0.0, 0.0, 1e6]]])
        self.start(**parameters)
        self.check(0.4, len(PATCH))
        self.node.wait_for_value("input cloud", "points taken for noise", "^1$")
        # Points with enough neighbors are no noise.
        self.world.points = LONE + 0.002 * np.arange(5)[:, None]
        message = self.node.wait_for(lambda m: m.sources[0].points_used == 5, "five points")
        self.assertEqual(pt.link(message, "ball_link").state, LinkProximity.NEAR)
        # A cloud of noise alone: nothing is known.
        self.world.points = np.vstack([LONE, nan])
        self.node.wait_for_unknown(ProximityArray.NO_CLOUD)

    def test_single_source(self):
        self.check_all(**{"noise_filter/radius": 0.02})

    def test_other_layouts(self):
        source = {"topic": "cloud", "noise_filter": {"radius": 0.02}}
        self.check_all(dtype=">f8", sources={"camera": source, "cloud": dict(source)})


if __name__ == "__main__":
    pt.run("noise_filter_test", NoiseFilterTest)
