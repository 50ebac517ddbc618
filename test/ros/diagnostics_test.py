#!/usr/bin/env python3
"""/diagnostics: counts and doubts; topics without subscribers are not computed."""


import numpy as np
import proximity_testing as pt
from proximity_testing import ProximityArray
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import MarkerArray

ON_BALL = [[0.0, 0.0, 0.1]]
BESIDE = [[0.0, 0.0, 0.3]]
OK, WARN = 0, 1
SKIN = "blind skin about the robot"


def spread(points, count):
    """So many points next to each other: rays do not end at one place."""
    return [[x + 1e-4 * i, y, z] for x, y, z in points for i in range(count)]


class DiagnosticsTest(pt.NodeTest):
    def start(self, points, status=ProximityArray.OK, **parameters):
        self.world.points = np.array(points)
        super().start(**parameters)
        self.world.start_tf()
        self.world.start_clouds()
        self.node.wait_for_status(status)

    def count(self, status, key):
        return int(self.node.diagnostic(status, key, 0))

    def wait_for_input(self, level, words):
        self.node.wait_for_diagnostic("input cloud", words, level)

    def test_idle_topics(self):
        """~markers and ~filtered_cloud are not computed without subscribers."""
        self.start(ON_BALL + BESIDE)
        markers = lambda: self.count("query", "markers drawn")  # noqa: E731
        clouds = lambda: self.count("input cloud", "shown on ~filtered_cloud")  # noqa: E731
        received = lambda: self.count("input cloud", "messages received")  # noqa: E731
        self.node.wait_until(lambda: received() > 20, "clouds")
        self.assertEqual((markers(), clouds()), (0, 0))

        seen = []
        subscribers = [
            self.node.subscribe("markers", MarkerArray, seen.append),
            self.node.subscribe("filtered_cloud", PointCloud2, seen.append),
        ]
        self.node.wait_until(lambda: markers() > 3 and clouds() > 3 and seen, "both topics")
        for subscriber in subscribers:
            subscriber.unregister()
        # Once the node has noticed, the counts stand still while clouds go on.
        last = [None, 0]

        def stands_still():
            now = (markers(), clouds())
            if now != last[0]:
                last[:] = [now, received()]
            return received() > last[1] + 20

        self.node.wait_until(stands_still, "no markers and no clouds")

    def test_values(self):
        short = {"query/deadline": 1e-9, "query/tolerance": 0.0}
        self.start(ON_BALL + BESIDE, ProximityArray.DEGRADED, **short)
        self.node.wait_until(lambda: self.count("query", "deadlines missed") > 10, "deadlines")
        self.assertEqual(self.node.diagnostic("input cloud", SKIN), "20.00 mm")
        self.node.wait_until(
            lambda: self.node.diagnostic("input cloud", "rate", "0").split()[0] > "0", "a rate"
        )
        # Two links, of about 85 kB each; two points.
        number, unit = self.node.diagnostic("query", "memory of the query").split()
        self.assertTrue(0.1 < float(number) < 0.5 and unit == "MB", number)
        number, unit = self.node.diagnostic("input cloud", "memory of the cloud's index").split()
        self.assertTrue(0.0 <= float(number) < 1.0 and unit == "MB", number)

    def test_doubts_of_the_self_filter(self):
        self.start(ON_BALL + BESIDE)
        self.wait_for_input(OK, "OK")
        self.world.points = np.array(spread(BESIDE, 10))
        self.wait_for_input(WARN, "no point of the cloud is on the robot")
        self.world.points = np.array(spread(ON_BALL, 99) + BESIDE)
        self.wait_for_input(WARN, "99.0 % of the cloud are on the robot")
        self.world.points = np.array(ON_BALL + BESIDE)
        self.wait_for_input(OK, "OK")
        # Nothing in range is no reason for doubt.
        self.world.points = np.array([[50.0, 0.0, 0.0]])
        self.node.wait_for(lambda m: m.sources[0].points_used == 0, "the empty cloud")
        self.wait_for_input(OK, "OK")

    def test_without_self_filter(self):
        self.start(BESIDE, self_filter=False)
        self.wait_for_input(OK, "OK")
        self.assertIsNone(self.node.diagnostic("input cloud", SKIN, None))


if __name__ == "__main__":
    pt.run("diagnostics_test", DiagnosticsTest)
