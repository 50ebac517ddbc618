#!/usr/bin/env python3
"""The 99th percentile of a cycle that proximity_report predicts, beside the one that a node measures.

    source devel/setup.bash
    benchmark/report_prediction.py --update-doc doc/library.md

Robots: the demo's arm, and the Panda among the test data (IST_PROXIMITY_DATA, or ../shared/data). The node
gets the configurations of the report's motion one after the other as joint states, and the report's scene as a
cloud for every 33 of them.
"""

import argparse
import os
import pathlib
import sys
import time

import numpy as np

import ist_proximity as ist
from ist_proximity.report import measure, scene
from private_master import ROOT, PrivateMaster, rewrite

TOLERANCE = 0.001  # [m] as the node's default
MAX_ERROR = 0.005  # [m] as the node's default


def cases(data):
    """(name, URDF, bag) of each robot."""
    yield 'demo arm', ROOT / 'demo/demo_arm.urdf', ROOT / 'demo/demo.bag'
    urdf = data / 'robots/franka_description/robots/panda.urdf'
    bag = data / 'bags/panda_table.bag'
    if urdf.is_file() and bag.is_file():
        yield 'Panda', urdf, bag
    else:
        print(f'no Panda in {data}: left out', file=sys.stderr)


def without_robot(where, robot, q):
    """The points, NaN where they are on the robot: neither side has a self-filter then."""
    points = np.array(where.points, np.float32)
    X = where.sensor_pose
    flat = points.reshape(-1, 3) @ X[:3, :3].T + X[:3, 3]
    on_robot = np.zeros(len(flat), bool)
    for X_FL, link in zip(robot.link_poses(q), robot.packing):
        if not len(link['centers']):
            continue
        centers = link['centers'] @ X_FL[:3, :3].T + X_FL[:3, 3]
        reach = link['radii'] + link['max_gap'] + 0.02
        low, high = (centers - reach[:, None]).min(axis=0), (centers + reach[:, None]).max(axis=0)
        for i in np.flatnonzero(((flat > low) & (flat < high)).all(axis=1)):
            on_robot[i] |= (np.linalg.norm(centers - flat[i], axis=1) < reach).any()
    points.reshape(-1, 3)[on_robot] = np.nan
    return points


def prediction(robot, where, steps, rate):
    """Costs as the report measures them for the setting in use, at the node's rate."""
    obstacles = ist.Obstacles(where.points, sensor_pose=where.sensor_pose, max_range=3.0)
    return robot.cycle_cost(steps, obstacles, tolerance=TOLERANCE, per_cloud=measure.PER_CLOUD,
                            period=1.0 / rate)


def cloud_message(testing, points, frame):
    points = np.asarray(points, np.float32)
    message = testing.cloud(points.reshape(-1, 3), frame)
    if points.ndim == 3:
        message.height, message.width = points.shape[:2]
        message.row_step = message.point_step * message.width
    return message


def measured(master, namespace, robot, urdf, where, steps, rate):
    """Parts of the node's cycles [s], (n, 3): distances, repulsion, the whole cycle."""
    import rospy
    from sensor_msgs.msg import JointState, PointCloud2
    from tf2_msgs.msg import TFMessage
    testing = master.testing
    parameters = {'pose_source': 'joint_states', 'packing/max_error': MAX_ERROR, 'self_filter': False,
                  'query/tolerance': TOLERANCE, 'query/deadline': 0.0,
                  'penetration/enabled': False, 'cloud_timeout': 100.0, 'pose_timeout': 5.0}
    node = testing.ProximityNode(namespace, parameters, urdf.read_text(encoding='utf-8'))
    frames = rospy.Publisher(namespace + '/tf_static', TFMessage, queue_size=1, latch=True)
    stamp = rospy.Time.now()
    frames.publish([testing.transform_message(robot.root_link, 'sensor', where.sensor_pose, stamp)])
    clouds = rospy.Publisher(namespace + '/cloud', PointCloud2, queue_size=2)
    joints = rospy.Publisher(namespace + '/joint_states', JointState, queue_size=10)
    message = cloud_message(testing, where.points, 'sensor')
    state = JointState(name=robot.joints)

    def send(q, with_cloud):
        if with_cloud:
            message.header.stamp = rospy.Time.now()
            clouds.publish(message)
        state.header.stamp = rospy.Time.now()
        state.position = list(q)
        joints.publish(state)

    end = time.monotonic() + 120.0
    while not node.messages or node.messages[-1].status != 0:
        if time.monotonic() > end:
            raise RuntimeError(node.messages[-1].status_text if node.messages else node.log())
        send(steps[0], True)
        time.sleep(0.05)
    for _ in range(2):  # The first time links get their final packings where they are near something.
        first, begin = len(node.messages), time.monotonic()
        for k, q in enumerate(steps):
            send(q, k % measure.PER_CLOUD == 0)
            time.sleep(max(0.0, begin + (k + 1) / rate - time.monotonic()))
        time.sleep(0.5)
    taken = [(m.query_time, m.repulsion_time, m.computation_time) for m in node.messages[first:]
             if m.status == 0]
    node.stop()
    return np.array(taken)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--rate', type=float, default=200.0, help='[Hz] of the joint states')
    parser.add_argument('--update-doc', metavar='FILE', help='rewrite the table in this document')
    options = parser.parse_args()
    data = pathlib.Path(os.environ.get('IST_PROXIMITY_DATA', ROOT / '../shared/data')).resolve()
    paths = [str(ROOT), str(data / 'robots'), os.environ.get('ROS_PACKAGE_PATH', '')]
    os.environ['ROS_PACKAGE_PATH'] = ':'.join(paths)

    master = PrivateMaster('report_prediction')
    lines = ['| robot | report: median | 99 % | node: median | 99 % | ratio of the 99 % | whole cycle, 99 % | '
             'cycles |', '|---|---:|---:|---:|---:|---:|---:|---:|']
    try:
        for number, (name, urdf, bag) in enumerate(cases(data)):
            robot = ist.Robot(str(urdf), max_error=MAX_ERROR)
            where = scene.load(bag, robot.root_link)
            q = measure.configuration(robot, where.positions)
            where.points = without_robot(where, robot, q)
            steps = measure.motion(robot, q)
            cost = prediction(robot, where, steps, options.rate)
            ours = np.asarray(cost['query']) + np.asarray(cost['repulsion'])
            taken = measured(master, f'/case{number}', robot, urdf, where, steps, options.rate)
            node = taken[:, 0] + taken[:, 1]
            a, b = np.percentile(ours, (50, 99)), np.percentile(node, (50, 99))
            cells = [name, *(f'{1e6 * v:.0f} µs' for v in (*a, *b)), f'{max(a[1] / b[1], b[1] / a[1]):.2f}',
                     f'{1e6 * np.percentile(taken[:, 2], 99):.0f} µs', f'{len(taken)}']
            lines.append('| ' + ' | '.join(cells) + ' |')
            print(lines[-1], file=sys.stderr)
    finally:
        master.stop()
    text = '\n'.join(lines) + f'\n\nLoad {os.getloadavg()[0]:.1f} at the end.\n'
    if options.update_doc:
        rewrite(options.update_doc, 'report prediction', text)
    else:
        print(text, end='')


if __name__ == '__main__':
    main()
