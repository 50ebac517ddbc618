#!/usr/bin/env python3
"""Time of a configuration from Python, in batches of 1, 100 and 10,000, beside the service ~query.

    source devel/setup.bash
    benchmark/python_batches.py --update-doc doc/library.md

The robot and the scene are the demo's, the configurations random within the joints' limits. Without ROS
the last column is left out.
"""

import argparse
import os
import sys
import time

import numpy as np

import ist_proximity as ist
from ist_proximity.report import scene as report_scene
from private_master import ROOT, PrivateMaster, rewrite

BATCHES = (1, 100, 10000)


def us_each(ask, count, seconds):
    """Median time of a call, for each of its `count` configurations [us]."""
    ask()
    times, end = [], time.monotonic() + seconds
    while len(times) < 3 or time.monotonic() < end:
        begin = time.perf_counter()
        ask()
        times.append(time.perf_counter() - begin)
    return 1e6 * np.median(times) / count


class QueryService:
    """A node of its own with the scene, and a master of its own."""

    def __init__(self, robot, urdf, points):
        self.master = PrivateMaster('python_batches')
        testing = self.master.testing
        import rospy
        from ist_proximity.srv import QueryProximity
        parameters = {'self_filter': False, 'max_distance': 1.0, 'query/max_answers': 10**6,
                      'penetration/enabled': False}
        self.world = testing.World('/batches', static=False)
        self.node = testing.ProximityNode('/batches', parameters, urdf.read_text(encoding='utf-8'))
        cloud = testing.cloud(points, robot.root_link)

        def send():
            cloud.header.stamp = rospy.Time.now()
            self.world.cloud_publisher.publish(cloud)

        self.world.repeat(10, send)
        self.service = rospy.ServiceProxy(self.node.name + '/query', QueryProximity, persistent=True)
        self.service.wait_for_service(30)
        self.joints = robot.joints

    def prepare(self, q):
        """A call for these configurations, which checks that they were answered."""
        from sensor_msgs.msg import JointState
        states = [JointState(name=self.joints, position=row) for row in q]

        def ask():
            answer = self.service(states=states)
            if not answer.success or answer.results[0].status != 0:
                raise RuntimeError(answer.message)
        for attempt in range(100):  # until the cloud has come
            try:
                ask()
                return ask
            except RuntimeError:
                time.sleep(0.2)
        raise RuntimeError('~query does not answer')

    def stop(self):
        self.world.stop()
        self.node.stop()
        self.master.stop()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--seconds', type=float, default=1.0, help='for each figure')
    parser.add_argument('--without-ros', action='store_true', help='leave out ~query')
    parser.add_argument('--update-doc', metavar='FILE', help='rewrite the table in this document')
    options = parser.parse_args()

    urdf = ROOT / 'demo' / 'demo_arm.urdf'
    os.environ['ROS_PACKAGE_PATH'] = f'{ROOT}:' + os.environ.get('ROS_PACKAGE_PATH', '')
    robot = ist.Robot(str(urdf))
    scene = report_scene.load(ROOT / 'demo' / 'demo.bag', robot.root_link)
    points = np.asarray(scene.points, float).reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)] @ scene.sensor_pose[:3, :3].T
    points += scene.sensor_pose[:3, 3]
    obstacles = ist.Obstacles(points)
    low, high = np.maximum(robot.lower_limits, -np.pi), np.minimum(robot.upper_limits, np.pi)
    samples = np.random.default_rng(0).uniform(low, high, (max(BATCHES), len(robot.joints)))

    service = None if options.without_ros else QueryService(robot, urdf, points)
    cores = os.cpu_count()
    lines = [f'| configurations | `distances`, one thread | {cores} threads | speed-up | `nearest`, one '
             f'thread | {cores} threads | speed-up |' + (' `~query` |' if service else ''),
             '|---:|---:|---:|---:|---:|---:|---:|' + ('---:|' if service else '')]
    try:
        for count in BATCHES:
            q, cells = samples[:count], [f'{count:,}']
            for call in (robot.distances, robot.nearest):
                one, every = (us_each(lambda: call(q, obstacles, threads=n), count, options.seconds)
                              for n in (1, 0))
                cells += [f'{one:.1f} µs', f'{every:.1f} µs', f'{one / every:.1f}']
            if service:
                cells.append(f'{us_each(service.prepare(q), count, options.seconds):.1f} µs')
            lines.append('| ' + ' | '.join(cells) + ' |')
            print(lines[-1], file=sys.stderr)
    finally:
        if service:
            service.stop()
    load = os.getloadavg()[0]
    text = '\n'.join(lines) + (f'\n\n{len(points):,} points, {len(robot.links)} links, {cores} cores, load '
                               f'{load:.1f} at the end. All but the last column are without ROS.\n')
    if options.update_doc:
        rewrite(options.update_doc, 'python batches', text)
    else:
        print(text, end='')


if __name__ == '__main__':
    main()
