#!/usr/bin/env python3
"""Makes demo.bag: a moving arm, a ball that comes close to it, and a depth camera that sees both.

  /joint_states         sensor_msgs/JointState    100 Hz
  /tf_static            tf2_msgs/TFMessage        base_link -> camera_depth_optical_frame, latched
  /camera/depth/points  sensor_msgs/PointCloud2   10 Hz, organized, NaN where nothing was measured

20 s whose end meets its beginning, so that it can be played in a loop. There is no random number in
it: the same meshes give the same bytes. Nothing in the bag says which points are the robot's; this
script knows, and with --check prints the true distances, found by trying every triangle.
"""

import argparse
import os

import genpy
import numpy as np
import rosbag
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import JointState, PointCloud2, PointField
from tf2_msgs.msg import TFMessage

import brute_force
import scene
from arm_model import DEMO, ArmModel

START = 1700000000  # [s] any time will do that is not zero, which ROS takes for "no time yet"
JOINT_PERIOD_MS = 10
CLOUD_PERIOD_MS = 100
CLOUD_FIRST_MS = 50
CLOUD_LATENCY_MS = 40  # from the stamp, the instant of the picture, to the message's arrival
CAMERA_FRAME = "camera_depth_optical_frame"
# bz2 looks for repetitions in blocks of 900 kB: three clouds to a chunk make use of it.
CHUNK_BYTES = 640 * 1024


def stamp(milliseconds):
    return genpy.Time(START + milliseconds // 1000, milliseconds % 1000 * 1000000)


def quaternion(R):
    """(x, y, z, w) of a rotation matrix."""
    K = np.array(
        [
            [R[0, 0] - R[1, 1] - R[2, 2], 0, 0, 0],
            [R[0, 1] + R[1, 0], R[1, 1] - R[0, 0] - R[2, 2], 0, 0],
            [R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], R[2, 2] - R[0, 0] - R[1, 1], 0],
            [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], np.trace(R)],
        ]
    )
    q = np.linalg.eigh(K, "L")[1][:, -1]
    return q if q[3] >= 0 else -q


def joint_state(names, milliseconds):
    message = JointState(name=names)
    message.header.stamp = stamp(milliseconds)
    # Single precision is finer than any encoder, and half as large once compressed.
    message.position = np.float32(scene.joint_positions(milliseconds / 1000)).tolist()
    message.velocity = np.float32(scene.joint_velocities(milliseconds / 1000)).tolist()
    return message


def camera_transform(camera):
    message = TransformStamped()
    message.header.stamp = stamp(0)
    message.header.frame_id = "base_link"
    message.child_frame_id = CAMERA_FRAME
    p, q = message.transform.translation, message.transform.rotation
    p.x, p.y, p.z = camera.X_BC[:3, 3].tolist()
    # Rounded, so that the last bit does not depend on the linear algebra library.
    q.x, q.y, q.z, q.w = np.round(quaternion(camera.X_BC[:3, :3]), 12).tolist()
    return TFMessage([message])


def cloud(points, milliseconds):
    height, width = points.shape[:2]
    message = PointCloud2(height=height, width=width, is_bigendian=False, is_dense=False)
    message.header.stamp = stamp(milliseconds)
    message.header.frame_id = CAMERA_FRAME
    message.fields = [
        PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate(("x", "y", "z"))
    ]
    message.point_step, message.row_step = 12, 12 * width
    message.data = points.astype("<f4").tobytes()
    return message


class Recorder:
    """Takes the pictures, and remembers which of their points are obstacles."""

    def __init__(self):
        self.arm = ArmModel()
        self.camera = scene.camera()
        self.seen = []  # per picture: time [ms], X_BL by link, obstacle points, their names, ...

    def picture(self, milliseconds):
        t = milliseconds / 1000
        positions = scene.joint_positions(t)
        self.arm.check_limits(positions)
        X_BL = self.arm.link_poses(positions)
        robot = [
            (shape, X_BL[link] @ shape.X_LS)
            for link, shapes in self.arm.shapes.items()
            for shape in shapes
        ]
        obstacles = scene.obstacles(t)
        depth, index = self.camera.render(robot + [(s, X) for _, s, X in obstacles])
        points = self.camera.points(self.camera.measure(depth))

        X_BC = self.camera.X_BC
        valid = np.isfinite(points[..., 2])
        on_robot = valid & (index >= 0) & (index < len(robot))
        off_robot = valid & ~on_robot
        p_B = points[off_robot] @ X_BC[:3, :3].T + X_BC[:3, 3]
        names = np.array([name for name, _, _ in obstacles])[index[off_robot] - len(robot)]
        self.seen.append((milliseconds, X_BL, p_B, names, int(on_robot.sum())))
        return cloud(points, milliseconds)


def write_bag(path, recorder):
    duration = int(scene.PERIOD * 1000)
    entries = [(0, "/tf_static", camera_transform(recorder.camera))]
    for ms in range(0, duration, JOINT_PERIOD_MS):
        entries.append((ms, "/joint_states", joint_state(recorder.arm.joint_names, ms)))
    for ms in range(CLOUD_FIRST_MS, duration - CLOUD_LATENCY_MS, CLOUD_PERIOD_MS):
        entries.append((ms + CLOUD_LATENCY_MS, "/camera/depth/points", recorder.picture(ms)))
    entries.sort(key=lambda entry: entry[0])

    with rosbag.Bag(path, "w", compression="bz2", chunk_threshold=CHUNK_BYTES) as bag:
        for ms, topic, message in entries:
            header = {
                "topic": topic,
                "type": message._type,
                "md5sum": message._md5sum,
                "message_definition": message._full_text,
            }
            if topic == "/tf_static":
                # A player that starts late, or at a later time, sends it all the same.
                header["latching"] = "1"
            bag.write(topic, message, stamp(ms), connection_header=header)


def print_distances(recorder, every):
    """Per picture: the nearest link and obstacle; at the end: the smallest distance by link."""
    smallest = {}
    print("   t [s]   points  on robot  nearest [m]")
    for ms, X_BL, points, names, on_robot in recorder.seen[::every]:
        found = brute_force.distances(recorder.arm, X_BL, points)
        for link, (d, i) in found.items():
            smallest[link] = min(smallest.get(link, (np.inf,)), (d, names[i], ms))
        link = min(found, key=found.get)
        d, i = found[link]
        count = len(points) + on_robot
        print(f"{ms / 1000:8.2f} {count:8d} {on_robot:9d} {d:12.4f}  {link} - {names[i]}")
    print("smallest distance of each link")
    for link, (d, name, ms) in smallest.items():
        print(f"  {link:16s} {d:7.4f} m from {name} at {ms / 1000:.2f} s")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", default=os.path.join(DEMO, "demo.bag"))
    parser.add_argument("--check", action="store_true", help="print the true distances")
    parser.add_argument("--every", type=int, default=1, help="with --check: only each n-th picture")
    args = parser.parse_args()

    recorder = Recorder()
    write_bag(args.output, recorder)
    size = os.path.getsize(args.output)
    print(f"{args.output}: {len(recorder.seen)} clouds, {size / 1e6:.2f} MB")
    if args.check:
        print_distances(recorder, args.every)


if __name__ == "__main__":
    main()
