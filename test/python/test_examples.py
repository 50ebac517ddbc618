"""The examples in Python run, and say what the library says."""

import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
os.environ['ROS_PACKAGE_PATH'] = str(ROOT)

import ist_proximity as ist  # noqa: E402  (the environment comes first)

URDF = ROOT / 'demo' / 'demo_arm.urdf'


@pytest.fixture(scope='module', name='scene')
def fixture_scene(tmp_path_factory):
    """A wall of points in front of the arm."""
    y, z = np.meshgrid(np.linspace(-0.5, 0.5, 40), np.linspace(0.0, 1.0, 40))
    points = np.stack([np.full(y.size, 0.6), y.ravel(), z.ravel()], axis=1)
    path = tmp_path_factory.mktemp('scene') / 'wall.pcd'
    header = ('VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n'
              f'WIDTH {len(points)}\nHEIGHT 1\nPOINTS {len(points)}\nDATA binary\n')
    path.write_bytes(header.encode() + points.astype('<f4').tobytes())
    return path


def run(name, *arguments):
    return subprocess.run([sys.executable, ROOT / 'examples' / name, URDF, *map(str, arguments)],
                          check=True, capture_output=True, text=True, timeout=120).stdout


def test_distances(scene):
    text = run('distances.py', scene)
    robot = ist.Robot(str(URDF))
    answer = robot.distances({}, ist.Obstacles(scene))
    assert len(text.splitlines()) == len(robot.links)
    for line, link, lower_bound in zip(text.splitlines(), robot.links, answer.lower_bound):
        assert line.startswith(link) and f'{lower_bound:.3f} m' in line


def test_planner(scene):
    text = run('planner.py', scene, 0.05)
    assert '2000 configurations are free by 0.05 m' in text
    assert 'at least' in text.splitlines()[1]


def test_cluster(scene):
    pytest.importorskip('dask.distributed')
    text = run('cluster.py', scene, '--count', 2000, '--workers', 2)
    robot = ist.Robot(str(URDF))
    assert '2000 configurations: ' in text
    # The same samples here: 1000 of each of the seeds 0 and 1.
    low, high = np.maximum(robot.lower_limits, -np.pi), np.minimum(robot.upper_limits, np.pi)
    q = np.vstack([np.random.default_rng(seed).uniform(low, high, (1000, len(robot.joints)))
                   for seed in (0, 1)])
    free = np.mean(robot.nearest(q, ist.Obstacles(scene)).lower_bound > 0.0)
    assert f'{free:.0%} are free' in text
