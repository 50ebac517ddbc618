"""The examples in Python run, and say what the library says."""

import pathlib
import subprocess
import sys

import numpy as np
import pytest

import ist_proximity as ist

ROOT = pathlib.Path(__file__).resolve().parents[2]
URDF = ROOT / 'demo' / 'demo_arm.urdf'


def run(name, *arguments):
    return subprocess.run([sys.executable, ROOT / 'examples' / name, URDF, *map(str, arguments)],
                          check=True, capture_output=True, text=True, timeout=120).stdout


def test_distances(wall_pcd):
    text = run('distances.py', wall_pcd)
    robot = ist.Robot(str(URDF))  # as fresh as the program's: a query keeps what it found before
    answer = robot.distances({}, ist.Obstacles(wall_pcd))
    assert len(text.splitlines()) == len(robot.links)
    for line, link, lower_bound in zip(text.splitlines(), robot.links, answer.lower_bound):
        assert line.startswith(link) and f'{lower_bound:.3f} m' in line


def test_planner(wall_pcd):
    text = run('planner.py', wall_pcd, 0.05)
    assert '2000 configurations are free by 0.05 m' in text
    assert 'at least' in text.splitlines()[1]


def test_cluster(robot, wall_pcd):
    pytest.importorskip('dask.distributed')
    text = run('cluster.py', wall_pcd, '--count', 2000, '--workers', 2)
    assert '2000 configurations: ' in text
    # The same samples here: 1000 of each of the seeds 0 and 1.
    low, high = np.maximum(robot.lower_limits, -np.pi), np.minimum(robot.upper_limits, np.pi)
    q = np.vstack([np.random.default_rng(seed).uniform(low, high, (1000, len(robot.joints)))
                   for seed in (0, 1)])
    free = np.mean(robot.nearest(q, ist.Obstacles(wall_pcd)).lower_bound > 0.0)
    assert f'{free:.0%} are free' in text
