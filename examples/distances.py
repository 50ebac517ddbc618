#!/usr/bin/env python3
"""Distances of a robot to the points of a file: distances.py robot.urdf scene.pcd"""

import sys

import ist_proximity as ist

robot = ist.Robot(sys.argv[1])
obstacles = ist.Obstacles(sys.argv[2])  # in the root link's frame; an array (n, 3) will do as well

answer = robot.distances({}, obstacles)  # all joints at 0; {'elbow': 0.4} moves one
for link, lower_bound, point in zip(robot.links, answer.lower_bound, answer.point_on_obstacle):
    print(f'{link:20} at least {lower_bound:.3f} m, nearest point {point.round(3)}')
