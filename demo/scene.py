"""What happens in the demo: the bench, the ball, the arm's motion, and where the camera stands.

Everything is a function of the time t, and all of it repeats after PERIOD. Frame: base_link.
"""

import numpy as np

from arm_model import Shape, transform
from depth_camera import DepthCamera

PERIOD = 20.0  # [s]
FLOOR = -0.95  # [m] height
BENCH_TOP = -0.20
BALL_RADIUS = 0.08

# Joint positions: mean, and amplitude and phase of the first two harmonics of PERIOD. The order is
# the URDF's: shoulder yaw, shoulder pitch, elbow pitch, forearm roll, wrist pitch, wrist roll,
# all in [rad], and the jaw's slide [m].
_MEAN = np.array([0.05, 0.42, 1.35, 0.0, 0.30, 0.0, 0.035])
_AMPLITUDE = np.array(
    [[0.50, 0.25, 0.10, 0.45, 0.20, 0.80, 0.0], [0.25, 0.20, 0.30, 0.40, 0.30, 0.50, 0.025]]
)
_PHASE = np.array([[0.0, 0.8, 2.1, 0.5, 1.3, 2.6, 0.4], [1.0, 2.0, 0.3, 0.0, 2.2, 1.1, 0.0]])
_HARMONIC = 2 * np.pi / PERIOD * np.array([[1.0], [2.0]])

# The ball leaves its place twice, the second time toward another spot beside the arm.
_BALL_HOME = np.array([0.55, 0.60, 0.15])
_BALL_NEAR = (np.array([0.615, 0.408, 0.39]), np.array([-0.05, 0.152, 0.40]))


def joint_positions(t):
    return _MEAN + (_AMPLITUDE * np.sin(_HARMONIC * t + _PHASE)).sum(0)


def joint_velocities(t):
    return (_AMPLITUDE * _HARMONIC * np.cos(_HARMONIC * t + _PHASE)).sum(0)


def ball_position(t):
    half = PERIOD / 2
    way = ((1 - np.cos(2 * np.pi * t / half)) / 2) ** 2
    near = _BALL_NEAR[int(t % PERIOD // half)]
    return _BALL_HOME + way * (near - _BALL_HOME)


def obstacles(t):
    """(name, shape, X_BS) of all that is not the robot."""
    top = Shape("box", size=(0.80, 1.10, 0.03))
    post = Shape("cylinder", size=(0.03, 0.45))
    crate = Shape("box", size=(0.16, 0.22, 0.12))
    floor = Shape("box", size=(8.0, 8.0, 0.02))
    return [
        ("bench", top, transform(p=(0.80, 0, BENCH_TOP - 0.015))),
        ("post", post, transform(p=(0.55, -0.42, BENCH_TOP + 0.225))),
        ("crate", crate, transform(p=(0.62, -0.17, BENCH_TOP + 0.06))),
        ("floor", floor, transform(p=(0, 0, FLOOR - 0.01))),
        ("ball", Shape("sphere", size=(BALL_RADIUS,)), transform(p=ball_position(t))),
    ]


def camera():
    pose = DepthCamera.looking_at(eye=(1.40, -0.35, 0.65), target=(0.25, 0.08, 0.08))
    return DepthCamera(160, 120, focal_length=135.0, X_BC=pose, max_depth=2.5)
