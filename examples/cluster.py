#!/usr/bin/env python3
"""The clearance of many configurations, on the processes of a Dask cluster.

cluster.py robot.urdf scene.pcd [--count N] [--scheduler tcp://HOST:8786] [--workers N]

Without a scheduler's address, processes of this machine do the work. Workers need the Python module
and no files: robot and obstacles travel to each of them once.
"""

import argparse

import numpy as np
from dask.distributed import Client, progress

import ist_proximity as ist


def clearance(robot, obstacles, seed, count):
    """Lower bounds [m] of `count` configurations within the joints' limits."""
    low, high = np.maximum(robot.lower_limits, -np.pi), np.minimum(robot.upper_limits, np.pi)
    q = np.random.default_rng(seed).uniform(low, high, (count, len(robot.joints)))
    return robot.nearest(q, obstacles, threads=1).lower_bound


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('urdf')
    parser.add_argument('scene')
    parser.add_argument('--count', type=int, default=20000)
    parser.add_argument('--scheduler', default=None)
    parser.add_argument('--workers', type=int, default=None)
    options = parser.parse_args()

    local = {'n_workers': options.workers, 'threads_per_worker': 1, 'dashboard_address': None}
    with Client(options.scheduler) if options.scheduler else Client(**local) as client:
        robot, obstacles = client.scatter(
            [ist.Robot(options.urdf), ist.Obstacles(options.scene)], broadcast=True)
        chunk = 1000
        futures = [client.submit(clearance, robot, obstacles, seed, min(chunk, options.count - first))
                   for seed, first in enumerate(range(0, options.count, chunk))]
        progress(futures, notebook=False)
        bounds = np.concatenate(client.gather(futures))
    print(f'\n{len(bounds)} configurations: {np.mean(bounds > 0.0):.0%} are free')


if __name__ == '__main__':
    main()
