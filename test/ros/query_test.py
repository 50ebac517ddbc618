#!/usr/bin/env python3
"""~query: truth for stated configurations, omitted joints, wrong requests, and the cycle beside it."""

import time

import numpy as np
import proximity_testing as pt
import rospy
from joint_states_test import ARM, arm_poses
from proximity_testing import LinkProximity, ProximityArray
from sensor_msgs.msg import JointState

from ist_proximity.srv import QueryProximity

NOW = {"turn": 0.3, "slide": 0.5}


class QueryTest(pt.NodeTest):
    BOX, MAX_DISTANCE = None, 3.0

    def setUp(self):
        super().setUp()
        self.points = np.random.default_rng(3).uniform(-1.5, 1.5, (400, 3)) + [0, 0, 0.8]

    def start(self, **parameters):
        super().start(ARM, max_distance=3.0, self_filter=False, **parameters)
        self.service = self.node.service("query", QueryProximity)
        self.clouds = self.world.start_points(lambda: self.points)

    def tf(self):
        """The robot as it is now."""
        X = arm_poses(**NOW)
        column = pt.transform((0, 0, 0.5), angle=NOW["turn"])
        self.world.poses = {"column": ("base", column)}
        for name in ("ball_link", "box_link"):
            self.world.poses[name] = ("column", pt.inverse(column) @ X[name])
        self.world.start_tf()

    def ask(self, *configurations, **kwargs):
        states = [JointState(name=list(q), position=list(q.values())) for q in configurations]
        return self.service(states=states, **kwargs)

    def check_refused(self, answer, words):
        self.assertFalse(answer.success)
        self.assertIn(words, answer.message)
        self.assertEqual((list(answer.results), len(answer.impact_times)), ([], 0))

    def check(self, result, q, links=("ball_link", "box_link")):
        self.assertEqual(result.status, ProximityArray.OK, result.status_text)
        pt.check_invariants(self, result, 3.0)
        self.assertEqual([one.link for one in result.links], list(links))
        X = arm_poses(**q)
        for one in result.links:
            every = pt.DISTANCE[one.link](pt.apply(pt.inverse(X[one.link]), self.points))
            self.assertGreaterEqual(one.distance, every.min() - 1e-5)
            self.assertLessEqual(one.distance, every.min() + 0.001 + 1e-5)
            self.assertLessEqual(one.lower_bound, every.min() + 1e-5)
            self.assertTrue(np.isnan(one.closing_speed))

    def check_all(self):
        """Checks what holds with both sources of poses."""
        rng = np.random.default_rng(4)
        asked = [
            {"turn": turn, "slide": slide}
            for turn, slide in zip(rng.uniform(-3, 3, 40), rng.uniform(0, 1, 40))
        ]
        answer = self.ask(*asked)
        self.assertTrue(answer.success)
        self.assertEqual(answer.message, "")
        self.assertEqual(len(answer.results), len(asked))
        for result, q in zip(answer.results, asked):
            self.check(result, q)
            self.assertEqual(result.header.frame_id, "base")
            self.assertEqual(result.sources[0].stamp, result.cloud_stamp)

        # A joint that is left out keeps its present position.
        self.check(self.ask({"turn": 1.0}).results[0], {"turn": 1.0, "slide": NOW["slide"]})
        self.check(self.ask({}).results[0], NOW)
        # A mimic joint is where it is stated, as with joint states.
        for stated in ({"turn": 1.0, "slide": 0.1}, {"turn": 1.0}):
            q = dict(stated, follow=0.3)
            self.check(self.ask(q).results[0], {"slide": NOW["slide"], **q})
        # Some links.
        answer = self.ask(NOW, links=["box_link"])
        self.check(answer.results[0], NOW, ["box_link"])
        # An empty request gets an empty answer.
        answer = self.ask()
        self.assertTrue(answer.success)
        self.assertEqual(answer.results, [])

        # Link against link: 2.5 slide + 0.25 between the ball and the box, apart or in contact.
        self.assertEqual(answer.pairs, [])
        slides = [0.4, 0.0, 0.2, -0.05]
        states = [{"turn": 0.5, "slide": slide} for slide in slides]
        answer = self.ask(*states, self_proximity=True)
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(len(answer.pairs), len(states))
        for pair, slide in zip(answer.pairs, slides):
            self.assertEqual({pair.first, pair.second}, {"ball_link", "box_link"})
            self.assertEqual(pair.state, 2)
            truth = 2.5 * slide + 0.25
            self.assertLessEqual(pair.lower_bound, truth + 1e-9)
            self.assertGreaterEqual(pair.distance, truth - 1e-9)
            self.assertLessEqual(pair.distance - pair.lower_bound, 0.001 + 1e-9)
            apart = pt.vector(pair.point_on_first) - pt.vector(pair.point_on_second)
            np.testing.assert_allclose(
                apart, pair.distance * pt.vector(pair.direction), atol=1e-9
            )
        (pair,) = self.ask({"turn": 0.5, "slide": -0.2}, self_proximity=True).pairs
        self.assertEqual(pair.state, 3)
        self.assertLess(pair.distance, 0.0)

        for bad, words in (
            ({"turn": np.nan}, "states[1]: the position of joint 'turn' is NaN"),
            ({"trun": 1.0}, "states[1]: joint 'trun' is not in the URDF"),
        ):
            self.check_refused(self.ask(NOW, bad), words)
        answer = self.service(states=[JointState(name=["turn", "slide"], position=[1.0])])
        self.check_refused(answer, "2 names and 1 positions")
        self.check_refused(self.ask(NOW, links=["ball"]), "'ball' is not monitored")

    def check_motion(self):
        """Times of impact along straight motions: at that time, and not before, a link is touched."""
        states = [{"turn": 0.3, "slide": 0.5}, {"turn": 2.5, "slide": 0.9}, {"turn": 0.0, "slide": 0.2}]
        times = [1.0, 3.0, 6.0]

        def at(t):
            q = {name: np.interp(t, times, [q[name] for q in states]) for name in NOW}
            return arm_poses(**q)

        answer = self.ask(*states, times=times)
        self.assertTrue(answer.success)
        self.assertEqual(answer.message, "")
        self.assertEqual(len(answer.results), 3)
        self.assertEqual(answer.impact_links, ["ball_link", "box_link"])
        for name, impact in zip(answer.impact_links, answer.impact_times):
            samples = np.arange(1.0, 6.0, 0.002)
            every = np.array(
                [
                    pt.DISTANCE[name](pt.apply(pt.inverse(at(t)[name]), self.points)).min()
                    for t in samples
                ]
            )
            self.assertTrue((every <= 0).any(), "a motion that touches something")
            first = samples[np.argmax(every <= 0)]
            self.assertLessEqual(impact, first)
            self.assertGreater(impact, first - 0.007)
        answer = self.ask(*states, times=times, links=["box_link"])
        self.assertEqual(answer.impact_links, ["box_link"])
        # Link against link along a motion: in touch at slide = -0.1, 5/6 of the second part.
        motion = [{"turn": 0.3, "slide": 0.1}, {"turn": 0.5, "slide": 0.4}, {"turn": 2.0, "slide": -0.2}]
        answer = self.ask(*motion, times=[1.0, 2.0, 4.0], self_proximity=True)
        self.assertEqual(len(answer.pairs), 3)
        (impact,) = answer.pair_impact_times
        self.assertLessEqual(impact, 2.0 + 2.0 * 5 / 6)
        self.assertGreater(impact, 2.0 + 2.0 * 5 / 6 - 0.005)
        answer = self.ask(*motion[:2], times=[1.0, 2.0], self_proximity=True)
        self.assertEqual(list(answer.pair_impact_times), [np.inf])
        # Nothing moves: in contact, or never.
        answer = self.ask(states[0], states[0], times=[5.0, 6.0])
        for name, impact in zip(answer.impact_links, answer.impact_times):
            every = pt.DISTANCE[name](pt.apply(pt.inverse(at(1.0)[name]), self.points))
            self.assertEqual(impact, 5.0 if every.min() <= 0 else np.inf)

        for times, words in (
            ([1.0], "1 times and 2 states"),
            ([1.0, 1.0], "times[1] is 1.000000: times have to be finite and to rise"),
            ([np.nan, 1.0], "times[0] is nan"),
        ):
            self.check_refused(self.ask(NOW, NOW, times=times), words)
        answer = self.ask(NOW, {"turn": 1.0}, times=[0.0, 1.0])
        self.check_refused(answer, "joint 'slide' is stated in one of states[0] and states[1]")

    def test_tf(self):
        self.start()
        self.tf()
        self.node.wait_for_status(ProximityArray.OK)
        self.check_all()
        self.check_motion()

        # A planner's batch does not hold up the cycle.
        begin, start = len(self.node.messages), time.monotonic()
        batch = [{"turn": t, "slide": 0.5} for t in np.linspace(-3, 3, 3000)]
        self.assertEqual(len(self.ask(*batch).results), len(batch))
        took = time.monotonic() - start
        answered = len(self.node.messages) - begin
        self.assertGreater(answered, 0.5 * 100 * took)
        self.assertEqual({m.status for m in self.node.messages[begin:]}, {ProximityArray.OK})

        # Without obstacles each result says so, and nothing looks free.
        self.clouds.paused = True
        self.node.wait_for_status(ProximityArray.STALE_CLOUD)
        answer = self.ask(NOW)
        self.assertTrue(answer.success)
        self.assertEqual(answer.results[0].status, ProximityArray.STALE_CLOUD)
        self.assertTrue(pt.all_unknown(answer.results[0]))
        self.assertIn("results[0]: source 'cloud'", answer.message)
        answer = self.ask(NOW, {"turn": 1.0, "slide": 0.5}, times=[0.0, 1.0])
        self.assertTrue(np.isnan(answer.impact_times).all())

    # What a state leaves out is where it was at the answer's stamp, however late tf is.
    def test_what_is_left_out_is_of_the_stamp(self):
        begin = rospy.Time.now().to_sec()
        column = lambda t: pt.transform((0, 0, 0.5), angle=begin - t)  # noqa: E731: it turns
        self.world.poses = {"column": ("base", column)}
        for name, X in arm_poses(0.0, NOW["slide"]).items():
            self.world.poses[name] = ("column", pt.inverse(pt.transform((0, 0, 0.5))) @ X)
        tf = self.world.start_tf()
        self.start()
        self.node.wait_for_status(ProximityArray.OK)
        for _ in range(5):
            rospy.sleep(0.3)
            tf.paused = True
            rospy.sleep(0.25)
            (result,) = self.ask({"slide": NOW["slide"]}).results
            tf.paused = False
            stamp = result.header.stamp
            self.assertIn(stamp, self.world.tf_sent)
            self.check(result, {"turn": begin - stamp.to_sec(), "slide": NOW["slide"]})

    def check_astray(self):
        """The mimic joint is 0.5 m from where its formula puts it."""
        now = dict(NOW, follow=-1.5 * NOW["slide"] - 1.0)
        self.check(self.ask({"turn": 1.0}).results[0], dict(now, turn=1.0))
        q = {"slide": 0.2, "follow": -1.0}
        self.check(self.ask(q).results[0], dict(now, **q))
        for q in (NOW, {"slide": 0.2}):  # states alone what leads it
            answer = self.ask(q, self_proximity=True)
            (result,) = answer.results
            self.assertEqual(result.status, ProximityArray.NO_POSE)
            self.assertIn("as a mimic of joint 'slide'", result.status_text)
            pt.check_invariants(self, result, 3.0)
            self.assertEqual(pt.link(result, "box_link").state, LinkProximity.UNKNOWN)
            self.assertNotEqual(pt.link(result, "ball_link").state, LinkProximity.UNKNOWN)
            self.assertEqual([pair.state for pair in answer.pairs], [LinkProximity.UNKNOWN])
        answer = self.ask(q, {"slide": 0.4}, times=[0.0, 1.0], self_proximity=True)
        times = list(answer.impact_times) + list(answer.pair_impact_times)
        self.assertTrue(np.isnan(times).all(), times)

    def test_a_mimic_joint_elsewhere_in_tf(self):
        self.start()
        self.tf()
        to_column = pt.inverse(pt.transform((0, 0, 0.5)))
        place = lambda off: to_column @ arm_poses(0, 0, -1.5 * NOW["slide"] - 0.5 + off)["box_link"]  # noqa: E731
        self.world.poses["box_link"] = ("column", place(-0.5))
        self.node.wait_for_status(ProximityArray.OK)
        pt.wait_until(lambda: self.ask({}).results[0].status == 0, "an answer")
        self.check_astray()
        self.world.poses["box_link"] = ("column", place(-0.02))  # within the tolerance
        pt.wait_until(lambda: self.ask({"slide": 0.2}).results[0].status == 0, "a known box")

    def test_a_mimic_joint_elsewhere_in_joint_states(self):
        self.start(pose_source="joint_states")
        self.world.start_joints(dict(NOW, follow=-1.5 * NOW["slide"] - 1.0))
        self.node.wait_for_status(ProximityArray.OK)
        self.check_astray()

    def test_joint_states(self):
        self.start(pose_source="joint_states")
        self.node.wait_for(
            lambda m: m.status == ProximityArray.NO_POSE and m.sources[0].status == 0, "the cloud"
        )
        # Nothing is known now, but the request states everything that is needed.
        self.check(self.ask(NOW).results[0], NOW)
        answer = self.ask({"slide": 0.2})
        self.assertEqual(answer.results[0].status, ProximityArray.NO_POSE)
        self.assertTrue(pt.all_unknown(answer.results[0]))
        self.assertIn("joint 'turn' is not stated, and not known now", answer.message)
        self.world.start_joints(NOW)
        self.node.wait_for_status(ProximityArray.OK)
        self.check_all()

    def test_motion_without_root(self):
        """A motion is not known while the root link's pose is not: NaN, neither free nor a crash."""
        self.start(fixed_frame="world")
        self.points = np.array([[0.0, 3.0, 0.5]])  # out of the robot's way
        self.world.start_points(self.points, "world")
        self.clouds.paused = True
        self.node.wait_for(
            lambda m: m.status == ProximityArray.NO_POSE and m.sources[0].status == 0, "the cloud"
        )
        motion = [{"turn": 0.0, "slide": 0.2}, {"turn": 0.5, "slide": 0.4}]

        def check_unknown(words):
            answer = self.ask(*motion, times=[0.0, 1.0])
            self.assertTrue(answer.success, answer.message)
            self.assertIn(words, answer.message)
            self.assertEqual(answer.impact_links, ["ball_link", "box_link"])
            self.assertTrue(np.isnan(answer.impact_times).all(), answer.impact_times)
            for result in answer.results:
                pt.check_invariants(self, result, 3.0)
                self.assertTrue(pt.all_unknown(result))

        # Neither has the root link ever had a pose, nor the service an earlier answer.
        check_unknown("no transform from 'base' to 'world'")
        self.world.poses = {"base": ("world", pt.transform())}
        tf = self.world.start_tf()

        def known():
            answer = self.ask(*motion, times=[0.0, 1.0])
            return not np.isnan(answer.impact_times).any()

        pt.wait_until(known, "a known motion")
        self.assertEqual(list(self.ask(*motion, times=[0.0, 1.0]).impact_times), [np.inf] * 2)
        # After a good answer, the root link's pose grows too old.
        tf.stop()
        pt.wait_until(lambda: not known(), "an unknown motion")
        check_unknown("allowed is 0.50 s (~pose_timeout)")
        # Differences of times that overflow are refused.
        self.check_refused(self.ask(*motion, times=[-1.7e308, 1.7e308]), "times[1]")

    def test_limits(self):
        """Requests are bounded, and the memory of a large answer is returned."""
        self.start()
        self.tf()
        self.node.wait_for_status(ProximityArray.OK)

        def memory(name):
            """Returns VmRSS, or VmHWM, the largest that it has been [kB]."""
            with open("/proc/%d/status" % self.node.process.pid) as f:
                return [int(line.split()[1]) for line in f if line.startswith(name)][0]

        self.assertTrue(self.ask(NOW).success)
        before = 0
        while memory("VmRSS") > before:  # packing in the background ends
            before = memory("VmRSS")
            time.sleep(1.0)
        many = self.ask(*[NOW] * 50001)
        self.check_refused(many, "50001 states for 2 links are more than 100000 answers")
        self.assertEqual(len(self.ask(*[NOW] * 10000).results), 10000)
        allowed = before + 0.6 * (memory("VmHWM") - before)
        pt.wait_until(lambda: memory("VmRSS") < allowed, "the memory of the answers", 10.0)

        for bad, words in (
            (JointState(name=["turn", "turn"], position=[0.1, 0.2]), "'turn' is stated twice"),
            (JointState(name=["slide"], position=[1e300]), "'slide' is 1e+300 m: allowed is up to"),
        ):
            self.check_refused(self.service(states=[bad]), words)

    def test_no_model(self):
        super().start(None)
        service = self.node.service("query", QueryProximity)
        self.node.wait_for_status(ProximityArray.MODEL_ERROR)
        self.check_refused(service(states=[JointState()]), "robot_description")


if __name__ == "__main__":
    pt.run("query_test", QueryTest)
