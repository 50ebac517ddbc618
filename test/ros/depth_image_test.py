#!/usr/bin/env python3
"""Depth images as a source: the distances of their points, what is malformed, and silence."""

import re

import numpy as np
import proximity_testing as pt
import rospy
from proximity_testing import ProximityArray
from sensor_msgs.msg import CameraInfo, Image, PointCloud2

X_BASE_CAMERA = pt.transform((0.0, 0.0, -0.9), axis=(0, 0, 1), angle=0.2)
WIDTH, HEIGHT = 64, 48
FOCAL_LENGTH, CX, CY = 60.0, 31.0, 24.5
NUMPY = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}


def depths():
    """A tilted wall, 0.6 m in front of the camera, with pixels that saw nothing [m]."""
    image = 0.6 + 0.002 * np.arange(WIDTH)[None, :] + 0.001 * np.arange(HEIGHT)[:, None]
    image[::7, ::5] = 0.0
    return np.round(image, 3)


def points(image):
    """The cloud that is made of the image, in the camera's frame."""
    v, u = np.mgrid[0 : image.shape[0], 0 : image.shape[1]]
    cloud = np.stack([(u - CX) * image, (v - CY) * image, FOCAL_LENGTH * image], axis=-1)
    return (cloud / FOCAL_LENGTH)[image > 0.0]


def camera_info(frame="camera", **members):
    f = FOCAL_LENGTH
    info = CameraInfo(width=WIDTH, height=HEIGHT, distortion_model="plumb_bob", D=[0.0] * 5)
    info.P = [f, 0, CX, 0, 0, f, CY, 0, 0, 0, 1, 0]
    info.header.frame_id = frame
    for name, value in members.items():
        setattr(info, name, value)
    return info


def image(values, encoding="16UC1", big=False, padding=0, frame="camera"):
    kind = np.dtype((">" if big else "<") + NUMPY[encoding])
    scaled = values if encoding == "32FC1" else np.round(1000.0 * values)
    rows = [row.tobytes() + b"\xab" * padding for row in scaled.astype(kind)]
    message = Image(width=values.shape[1], height=values.shape[0], encoding=encoding)
    message.header.frame_id, message.header.stamp = frame, rospy.Time.now()
    message.is_bigendian, message.step, message.data = big, len(rows[0]), b"".join(rows)
    return message


def malformed(members):
    message = image(depths())
    for name, value in members.items():
        setattr(message, name, value)
    return message


# check_depth_image() and check_camera() have tests of their own.
MALFORMED = [
    ({"encoding": "rgb8"}, "encoding is 'rgb8'"),
    ({"width": 63}, "has 63 x 48 pixels, its camera"),
]
P = camera_info().P
BAD_CAMERAS = [
    ({"P": [0.0] * 12}, "not calibrated"),
    ({"width": 640}, "its camera (width and height"),
]


class DepthImageTest(pt.NodeTest):
    CAMERA = X_BASE_CAMERA

    def setUp(self):
        super().setUp()
        self.images = rospy.Publisher(self.namespace + "/depth/image", Image, queue_size=10)
        self.infos = {}
        self.info = camera_info()

    def start_camera(self, topic="depth/camera_info", **source):
        source = {"topic": "depth/image", "type": "sensor_msgs/Image", **source}
        self.infos[topic] = rospy.Publisher(self.namespace + "/" + topic, CameraInfo, queue_size=10)
        self.start(sources={"depth": source}, **{"query/tolerance": 0.0})
        self.world.start_tf()
        if self.info is not None:
            self.world.repeat(10, lambda: self.infos[topic].publish(self.info))

    def stream(self, make, rate=20):
        return self.world.repeat(rate, lambda: self.images.publish(make()))

    def check_wall(self, **format):
        seen = pt.apply(X_BASE_CAMERA, points(depths()))
        with self.stream(lambda: image(depths(), **format)):
            begin = rospy.Time.now()
            answer = self.node.wait_for(
                lambda m: m.status == 0 and m.cloud_stamp > begin, "the wall"
            )
        for name, link_pose in (("ball_link", self.BALL), ("box_link", self.BOX)):
            truth = pt.DISTANCE[name](pt.apply(pt.inverse(link_pose), seen)).min()
            self.assertAlmostEqual(pt.link(answer, name).distance, truth, 5)
            self.assertEqual(pt.link(answer, name).source, "depth")
        self.assertEqual(answer.sources[0].points_received, WIDTH * HEIGHT)
        self.assertEqual(answer.sources[0].points_used, len(seen))

    def test_distances_and_silence(self):
        self.start_camera()
        for format in (
            {},
            {"encoding": "mono16", "big": True, "padding": 3},
            {"encoding": "32FC1"},
            {"encoding": "32FC1", "big": True, "padding": 5},
        ):
            with self.subTest(format):
                self.check_wall(**format)
        self.node.wait_for_unknown(ProximityArray.STALE_CLOUD, "the newest image is")

    def test_baseline_and_unit(self):
        """Gazebo's hackBaseline, and a camera that counts tenths of a millimetre."""
        self.info = camera_info(P=P[:3] + [-0.07 * FOCAL_LENGTH] + P[4:])
        self.start_camera(depth_scale=1e-4)
        tenths = 10 * depths()
        seen = pt.apply(X_BASE_CAMERA, points(depths()) + [0.07, 0, 0])
        with self.stream(lambda: image(tenths)):
            answer = self.node.wait_for_status(ProximityArray.OK)
        truth = pt.distance_to_ball(seen).min()
        self.assertAlmostEqual(pt.link(answer, "ball_link").distance, truth, 5)

    def wait_for_reason(self, words):
        message = self.node.wait_for(lambda m: m.status != 0 and words in m.status_text, words)
        self.assertTrue(pt.all_unknown(message))
        return message

    def test_malformed(self):
        self.start_camera()
        self.check_wall()
        for members, words in MALFORMED:
            with self.subTest(words), self.stream(lambda m=members: malformed(m)):
                self.assertIn("malformed image", self.wait_for_reason(words).status_text)
        self.check_wall()
        for members, words in BAD_CAMERAS:
            self.info = camera_info(**members)
            with self.subTest(words), self.stream(lambda: image(depths())):
                self.wait_for_reason(words)
        self.info = camera_info(frame="another")
        with self.stream(lambda: image(depths())):
            self.node.wait_for_status(ProximityArray.STALE_CLOUD, "is of 'another'")
        self.info = camera_info(frame="")
        self.check_wall()

    def test_camera_info(self):
        """Without a CameraInfo nothing is known, and the text says where one is expected."""
        self.info = None
        self.start_camera("elsewhere/info", camera_info="elsewhere/info")
        with self.stream(lambda: image(depths())):
            message = self.node.wait_for_status(
                ProximityArray.NO_CLOUD, self.namespace + "/elsewhere/info; set ~sources/depth/"
            )
        self.assertTrue(pt.all_unknown(message))
        self.info = camera_info(D=[0.1, 0.0, 0.0, 0.0, 0.0])
        self.world.repeat(10, lambda: self.infos["elsewhere/info"].publish(self.info))
        self.check_wall()
        # Lens distortion: the image must be rectified. It is used, and said once.
        self.node.wait_until(
            lambda: self.node.log().count("has distortion coefficients") == 1, "the warning"
        )

    def test_extent(self):
        """Noise, footprint and latency: the bound is that of a sphere about each point."""
        self.start_camera(
            noise={"a": 0.001, "b": 0.004, "calibration": 0.003},
            footprint="camera",
            latency=0.02,
        )
        self.check_wall()  # the distance stays that of the nearest point
        seen = pt.apply(X_BASE_CAMERA, points(depths()))
        ranges = np.linalg.norm(seen - X_BASE_CAMERA[:3, 3], axis=1)
        pixel = np.sqrt(0.5) / np.cos(1.0472) / FOCAL_LENGTH
        radius = 3 * (0.001 + 0.004 * ranges**2) + 0.003 + pixel * ranges + 0.02 * 1.6
        self.assertGreater(radius.min(), 0.02)
        with self.stream(lambda: image(depths())):
            answer = self.node.wait_for_status(ProximityArray.OK)
        for name, link_pose in (("ball_link", self.BALL), ("box_link", self.BOX)):
            one = pt.link(answer, name)
            distances = pt.DISTANCE[name](pt.apply(pt.inverse(link_pose), seen))
            truth = (distances - radius).min()
            self.assertLessEqual(one.lower_bound, truth + 1e-6)
            self.assertGreaterEqual(one.lower_bound, truth - 1e-4)
            self.assertAlmostEqual(one.interval_sensor, distances.min() - truth, 3)
            self.assertEqual(one.interval_model, 0.0)

    def test_extent_of_what_is_hidden(self):
        """What was measured with wide pixels stays as uncertain, whatever measures now."""
        ball = X_BASE_CAMERA @ pt.transform((0, 0, 1.2))
        self.world.stand(ball, X_BASE_CAMERA @ pt.transform((0, 0, 9)))
        memory = {"enabled": True, "decay": 1000.0, "resolution": 0.01}
        self.start_camera(footprint="camera", max_range=3.0, memory=memory)
        shown = [np.full((HEIGHT, WIDTH), 1.6, np.float32)]
        self.stream(lambda: image(shown[0], "32FC1"))
        bounds = []

        def wait(source, count):
            first = len(self.node.messages)
            is_it = lambda m: m.status == ProximityArray.OK and pt.link(m, "ball_link").source == source  # noqa: E731
            self.node.wait_until(
                lambda: sum(map(is_it, self.node.messages[first:])) > count, source
            )
            bounds.append(pt.link(self.node.messages[-1], "ball_link").lower_bound)

        wait("depth", 60)
        shown[0] = np.full((HEIGHT, WIDTH), 0.3, np.float32)
        wait("depth/memory", 60)
        narrow = np.array(self.info.P)
        narrow[[0, 5]] *= 10.0
        self.info = camera_info(P=list(narrow))
        wait("depth/memory", 200)
        self.assertLess(bounds[1], bounds[0] + 1e-6)
        self.assertLess(bounds[2], bounds[1] + 1e-3)

    def test_footprint_of_no_camera(self):
        """A cloud that is no image has no angle between pixels: it is not used, and why is said."""
        clouds = rospy.Publisher(self.namespace + "/points", PointCloud2, queue_size=1)
        self.start(sources={"c": {"topic": "points", "footprint": "camera", "noise": "kinect_v1"}})
        self.world.start_tf()
        self.world.repeat(20, lambda: clouds.publish(pt.cloud(points(depths()))))
        self.wait_for_reason("the footprint of a point is asked for")

    def test_wrong_topic(self):
        """A topic of another type is named; else the topics that a source could have."""
        other = rospy.Publisher(self.namespace + "/points", PointCloud2, queue_size=1)
        info = rospy.Publisher(self.namespace + "/depth/camera_info", CameraInfo, queue_size=10)
        self.world.repeat(10, lambda: info.publish(self.info))
        name = self.namespace + "/depth/image"
        cases = (
            ({"c": {"topic": "depth/image"}}, name + r" is a sensor_msgs/Image: give the source"),
            ({"c": {"topic": "nothing"}}, r"published are .*" + self.namespace + r"/points \("),
            ({"c": {"topic": "depth/camera_info"}}, "CameraInfo, which no source reads"),
        )
        for sources, words in cases:
            with self.subTest(words):
                self.start(sources=sources)
                expected = re.compile(words)
                message = self.node.wait_for(
                    lambda m: expected.search(m.status_text), words  # noqa: B023
                )
                self.assertEqual(message.status, ProximityArray.NO_CLOUD)
                self.assertNotIn("filtered_cloud", message.status_text)
                self.node.wait_until(
                    lambda: expected.search(self.node.log()), "the log"  # noqa: B023
                )
                self.finish(self.node)
                rospy.delete_param(self.node.name)
        other.unregister()


if __name__ == "__main__":
    pt.run("depth_image_test", DepthImageTest)
