"""The Python module: shapes, answers, errors, pickling, threads."""

import os
import pathlib
import pickle
import threading

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
os.environ['ROS_PACKAGE_PATH'] = str(ROOT)

import ist_proximity as ist  # noqa: E402  (the environment comes first)

URDF = ROOT / 'demo' / 'demo_arm.urdf'


@pytest.fixture(scope='module', name='robot')
def fixture_robot():
    return ist.Robot(str(URDF))


def random_scene(robot, seed, points=500, configurations=20):
    rng = np.random.default_rng(seed)
    cloud = rng.uniform((-0.9, -0.9, -0.4), (0.9, 0.9, 1.4), (points, 3)).astype(np.float32)
    return cloud, rng.uniform(-1.5, 1.5, (configurations, len(robot.joints)))


def sphere_bounds(robot, q, cloud):
    """(links,) upper bounds of the distances: those to the links' inner spheres."""
    bounds = []
    for X, link in zip(robot.link_poses(q), robot.packing):
        centers = link['centers'] @ X[:3, :3].T + X[:3, 3]
        gaps = np.linalg.norm(cloud[:, None] - centers[None], axis=2) - link['radii']
        bounds.append(gaps.min())
    return np.array(bounds)


def test_distances_lie_within_the_gap_of_the_spheres(robot):
    cloud, configurations = random_scene(robot, 1)
    obstacles = ist.Obstacles(cloud)
    assert len(obstacles) == len(cloud)
    gap = np.array([link['max_gap'] for link in robot.packing])
    for q in configurations:
        answer = robot.distances(q, obstacles, tolerance=0.0)
        truth = sphere_bounds(robot, q, cloud)
        near = answer.state == ist.NEAR
        assert near.any()
        assert (answer.distance[near] <= truth[near] + 1e-6).all()
        assert (answer.distance[near] >= (truth - gap)[near] - 1e-6).all()
        assert (answer.lower_bound <= answer.distance + 1e-9).all()
        # The witness points are as far apart as the distance says, along the direction.
        gaps = answer.point_on_link - answer.point_on_obstacle
        assert np.allclose(gaps[near], (answer.distance[:, None] * answer.direction)[near])
        assert np.allclose(cloud[answer.point[near]], answer.point_on_obstacle[near], atol=1e-6)


def test_shapes(robot):
    cloud, configurations = random_scene(robot, 2)
    obstacles = ist.Obstacles(cloud)
    n, links = len(configurations), len(robot.links)
    one, many = robot.distances(configurations[0], obstacles), robot.distances(configurations, obstacles)
    assert one.distance.shape == (links,) and many.distance.shape == (n, links)
    assert one.direction.shape == (links, 3) and many.direction.shape == (n, links, 3)
    nearest = robot.nearest(configurations, obstacles)
    assert nearest.lower_bound.shape == (n,) and nearest.point_on_link.shape == (n, 3)
    assert (np.abs(nearest.lower_bound - many.lower_bound.min(axis=1)) <= 0.001 + 1e-9).all()
    single = robot.nearest(configurations[0], obstacles)
    assert isinstance(single.lower_bound, float) and isinstance(single.link, int)
    assert robot.link_poses(configurations).shape == (n, links, 4, 4)
    at = robot.distances_at(robot.link_poses(configurations), obstacles)
    assert at.state.shape == (n, links) and (at.state == many.state).all()
    empty = robot.distances(np.empty((0, len(robot.joints))), obstacles)
    assert empty.distance.shape == (0, links)


def test_unknown_positions(robot):
    obstacles = ist.Obstacles(np.array([[0.5, 0.0, 0.5]]))
    q = np.zeros(len(robot.joints))
    q[-1] = np.nan
    answer = robot.distances(q, obstacles)
    assert answer.state[0] != ist.UNKNOWN and answer.state[-1] == ist.UNKNOWN
    assert np.isnan(answer.distance[-1]) and answer.lower_bound[-1] == -np.inf
    assert not robot.nearest(q, obstacles).all_known
    named = robot.distances({robot.joints[0]: 0.3}, obstacles)
    q = np.zeros(len(robot.joints))
    q[0] = 0.3
    assert (named.distance == robot.distances(q, obstacles).distance).all()


def test_images_and_double(robot):
    v, u = np.mgrid[0:48, 0:64]
    image = np.stack([0.02 * u - 0.6, np.full(u.shape, 0.45), 0.02 * v], axis=2)
    image[(u + 3 * v) % 11 == 0] = np.nan
    q = np.full(len(robot.joints), 0.2)
    listed = image[np.isfinite(image[..., 0])]
    expected = robot.distances(q, ist.Obstacles(listed), tolerance=0.0).distance
    for points in (image, image.astype(np.float32), image[:, ::-1]):
        obstacles = ist.Obstacles(points)
        assert len(obstacles) == len(listed)
        distance = robot.distances(q, obstacles, tolerance=0.0).distance
        assert np.allclose(distance, expected, atol=1e-6)


def test_self_filter_and_sensor_pose(robot):
    q = np.zeros(len(robot.joints))
    on_robot = np.array([X[:3, 3] + X[:3, :3] @ link['centers'][0]
                         for X, link in zip(robot.link_poses(q), robot.packing)])
    cloud = np.vstack([on_robot, [[0.9, 0.9, 0.9]]])
    assert len(ist.Obstacles(cloud, robot=robot, q=q)) == 1
    pose = np.eye(4)
    pose[:3, 3] = 0.1, -0.2, 0.3
    moved = ist.Obstacles(cloud - pose[:3, 3], sensor_pose=pose)
    a, b = robot.distances(q, moved, tolerance=0), robot.distances(q, ist.Obstacles(cloud), tolerance=0)
    assert np.allclose(a.distance, b.distance, atol=1e-6)
    assert len(ist.Obstacles(cloud, max_range=0.5)) < len(cloud)


def test_pickling(robot):
    cloud, configurations = random_scene(robot, 3)
    obstacles = ist.Obstacles(cloud, robot=robot, q=configurations[0])
    robot_copy, obstacles_copy = pickle.loads(pickle.dumps((robot, obstacles)))
    assert robot_copy.links == robot.links and robot_copy.joints == robot.joints
    assert len(obstacles_copy) == len(obstacles)
    a = robot.distances(configurations, obstacles, tolerance=0.0)
    b = robot_copy.distances(configurations, obstacles_copy, tolerance=0.0)
    assert (a.state == b.state).all()
    assert np.allclose(a.distance, b.distance, atol=1e-9, equal_nan=True)


def test_threads_share_robot_and_obstacles(robot):
    cloud, configurations = random_scene(robot, 4, configurations=200)
    obstacles = ist.Obstacles(cloud)
    expected = robot.distances(configurations, obstacles, tolerance=0.0, threads=1).distance
    results = [None] * 4

    def ask(k):
        results[k] = robot.distances(configurations, obstacles, tolerance=0.0, threads=2).distance

    threads = [threading.Thread(target=ask, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for result in results:
        assert np.allclose(result, expected, atol=1e-9)


def test_the_interpreter_runs_during_queries(robot):
    cloud, configurations = random_scene(robot, 5, points=20000, configurations=500)
    obstacles = ist.Obstacles(cloud)
    done = threading.Event()

    def ask():
        robot.distances(configurations, obstacles, tolerance=0.0, threads=1)
        done.set()

    thread = threading.Thread(target=ask)
    thread.start()
    turns = 0
    while not done.wait(0.001):
        turns += 1
    thread.join()
    assert turns > 5


@pytest.mark.parametrize('points, message', [
    (np.zeros((3, 4)), r'\(n, 3\)'),
    (np.zeros(3), r'\(n, 3\)'),
    ('scene.xyz', 'extension'),
    ('/no/such.pcd', '/no/such.pcd'),
    (np.array(['a', 'b']), 'array of numbers'),
    (None, 'array of numbers'),
])
def test_wrong_points(points, message):
    with pytest.raises((ValueError, TypeError, ist.ModelError), match=message):
        ist.Obstacles(points)


def test_wrong_arguments(robot):
    obstacles = ist.Obstacles(np.zeros((1, 3)))
    q = np.zeros(len(robot.joints))
    with pytest.raises(ValueError, match=r'\(3,\)'):
        robot.distances(np.zeros(3), obstacles)
    with pytest.raises(ValueError, match='tolerance'):
        robot.distances(q, obstacles, tolerance=-1.0)
    with pytest.raises(ValueError, match="no joint 'knee'"):
        robot.distances({'knee': 1.0}, obstacles)
    with pytest.raises(ValueError, match=r'\(links, 4, 4\)'):
        robot.distances_at(np.eye(4), obstacles)
    with pytest.raises(ValueError, match='not rigid'):
        robot.distances_at(np.tile(2 * np.eye(4), (len(robot.links), 1, 1)), obstacles)
    with pytest.raises(TypeError):
        robot.distances(q, np.zeros((1, 3)))
    with pytest.raises(ValueError, match='rotation'):
        ist.Obstacles(np.zeros((1, 3)), sensor_pose=2 * np.eye(4))
    with pytest.raises(ist.ModelError, match='/no.urdf'):
        ist.Robot('/no.urdf')
    with pytest.raises(ist.ModelError, match='xacro'):
        ist.Robot('<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:include filename="a"/></robot>')
    with pytest.raises(ValueError, match='geometry'):
        ist.Robot(str(URDF), geometry='meshes')
    with pytest.raises(AttributeError):
        ist.Robott  # noqa: B018


def test_progress_rises_and_an_exception_ends_the_packing():
    seen = []
    ist.Robot(str(URDF), max_error=0.01, progress=seen.append)
    assert seen == sorted(seen) and seen[-1] == 1.0

    def stop(fraction):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ist.Robot(str(URDF), max_error=0.0005, progress=stop)
