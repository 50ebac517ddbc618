"""What the tests share."""

import os
import pathlib

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
os.environ['ROS_PACKAGE_PATH'] = str(ROOT)


@pytest.fixture(scope='session', name='robot')
def fixture_robot():
    """The demo's arm, packed once."""
    import ist_proximity as ist  # pylint: disable=import-outside-toplevel
    return ist.Robot(str(ROOT / 'demo' / 'demo_arm.urdf'))


@pytest.fixture(scope='session', name='wall_points')
def fixture_wall_points():
    """(1600, 3) [m] A wall of points in front of the demo's arm."""
    y, z = np.meshgrid(np.linspace(-0.5, 0.5, 40), np.linspace(0.0, 1.0, 40))
    return np.stack([np.full(y.size, 0.6), y.ravel(), z.ravel()], axis=1)


@pytest.fixture(scope='session', name='wall_pcd')
def fixture_wall_pcd(tmp_path_factory, wall_points):
    """The wall as a binary PCD file."""
    path = tmp_path_factory.mktemp('scene') / 'wall.pcd'
    header = ('VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n'
              f'WIDTH {len(wall_points)}\nHEIGHT 1\nPOINTS {len(wall_points)}\nDATA binary\n')
    path.write_bytes(header.encode() + wall_points.astype('<f4').tobytes())
    return path


@pytest.fixture(scope='session', name='wall_ply')
def fixture_wall_ply(tmp_path_factory, wall_points):
    """The wall as an ascii PLY file."""
    path = tmp_path_factory.mktemp('scene') / 'wall.ply'
    lines = [f'{x:.4f} {y:.4f} {z:.4f}' for x, y, z in wall_points]
    path.write_text('ply\nformat ascii 1.0\n' + f'element vertex {len(lines)}\n'
                    'property float x\nproperty float y\nproperty float z\nend_header\n'
                    + '\n'.join(lines) + '\n')
    return path
