#!/usr/bin/env python3
"""A batch for a planner: which of many configurations are free, and how free is a straight motion?

planner.py robot.urdf scene.pcd [margin in m]
"""

import sys

import numpy as np

import ist_proximity as ist

robot = ist.Robot(sys.argv[1])
obstacles = ist.Obstacles(sys.argv[2])
margin = float(sys.argv[3]) if len(sys.argv) > 3 else 0.02

# Samples within the joints' limits; a joint without limits turns once.
low = np.maximum(robot.lower_limits, -np.pi)
high = np.minimum(robot.upper_limits, np.pi)
samples = np.random.default_rng(0).uniform(low, high, (2000, len(robot.joints)))
clearance = robot.nearest(samples, obstacles).lower_bound  # on all cores
is_free = clearance >= margin
print(f'{is_free.mean():.0%} of {len(samples)} configurations are free by {margin} m')

# A motion between two free ones, in 200 steps.
begin, end = samples[is_free][:2]
steps = begin + np.linspace(0.0, 1.0, 200)[:, None] * (end - begin)
nearest = robot.nearest(steps, obstacles)
worst = nearest.lower_bound.argmin()
name = robot.links[nearest.link[worst]] if nearest.link[worst] >= 0 else 'no link'
print(f'the motion between two of them: at least {nearest.lower_bound[worst]:.3f} m ({name})')
