"""The Python module: shapes, answers, errors, pickling, threads."""

import copy
import pathlib
import pickle
import threading
import time
import types

import numpy as np
import pytest

import ist_proximity as ist

URDF = pathlib.Path(__file__).resolve().parents[2] / 'demo' / 'demo_arm.urdf'


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
    nearest = robot.nearest(q, obstacles)
    assert not nearest.all_known and nearest.lower_bound == -np.inf
    assert nearest.state == ist.NEAR and nearest.distance == np.nanmin(answer.distance)
    far = robot.nearest(q, ist.Obstacles(np.array([[50.0, 0.0, 0.5]])))
    assert far.state == ist.UNKNOWN and far.lower_bound == -np.inf
    named = robot.distances({robot.joints[0]: 0.3}, obstacles)
    q = np.zeros(len(robot.joints))
    q[0] = 0.3
    assert (named.distance == robot.distances(q, obstacles).distance).all()


BOX_STL = """solid wall
facet normal 0 0 0
outer loop
vertex 0 -0.1 -0.1
vertex 0 0.1 -0.1
vertex 0 0.1 0.1
endloop
endfacet
facet normal 0 0 0
outer loop
vertex 0 -0.1 -0.1
vertex 0 0.1 0.1
vertex 0 -0.1 0.1
endloop
endfacet
endsolid wall
"""


def mesh_urdf(*files):
    links = ''.join(f'<link name="l{i}"><collision><geometry><mesh filename="{name}"/></geometry></collision></link>'
                    for i, name in enumerate(files))
    joints = ''.join(f'<joint name="j{i}" type="fixed"><parent link="l0"/><child link="l{i}"/></joint>'
                     for i in range(1, len(files)))
    return f'<robot name="meshes">{links}{joints}</robot>'


def test_meshes_are_found_from_the_file(tmp_path):
    # As robots are published: meshes beside the URDF, above it, and in a package without package.xml.
    (tmp_path / 'arm_description' / 'meshes').mkdir(parents=True)
    (tmp_path / 'arm_description' / 'urdf').mkdir()
    for name in ('meshes/above.stl', 'urdf/beside.stl', 'meshes/package.stl'):
        (tmp_path / 'arm_description' / name).write_text(BOX_STL)
    urdf = tmp_path / 'arm_description' / 'urdf' / 'arm.urdf'
    urdf.write_text(mesh_urdf('beside.stl', '../meshes/above.stl', 'package://arm_description/meshes/package.stl'))
    obstacles = ist.Obstacles(np.array([[0.3, 0.0, 0.0]]))
    for folders in ([tmp_path], str(tmp_path), tmp_path / 'arm_description', (folder for folder in ['/', tmp_path])):
        robot = ist.Robot(urdf, package_dirs=folders)
        assert not robot.unknown_links
        assert np.allclose(robot.distances({}, obstacles, tolerance=0.0).distance, 0.3)
    with pytest.raises(ist.ModelError, match='arm_description'):
        ist.Robot(urdf)
    with pytest.raises(ist.ModelError, match='relative path'):
        ist.Robot(urdf.read_text(), package_dirs=[tmp_path])


def test_links_that_cannot_be_used_raise(tmp_path):
    (tmp_path / 'here.stl').write_text(BOX_STL)
    urdf = tmp_path / 'robot.urdf'
    urdf.write_text(mesh_urdf('here.stl', 'missing.stl'))
    with pytest.raises(ist.ModelError, match=r"1 of the 2 links .*'l1'.*missing.stl.*allow_unknown_links"):
        ist.Robot(urdf)
    robot = ist.Robot(urdf, allow_unknown_links=True)
    assert list(robot.unknown_links) == ['l1'] and 'missing.stl' in robot.unknown_links['l1']
    obstacles = ist.Obstacles(np.array([[0.3, 0.0, 0.0]]))
    for one in (robot, pickle.loads(pickle.dumps(robot))):
        nearest = one.nearest({}, obstacles)
        assert nearest.distance == pytest.approx(0.3) and nearest.lower_bound == -np.inf
        assert one.distances({}, obstacles).lower_bound[1] == -np.inf
        for n in (0, 1, 3):  # a robot without joints has an answer for each row, too
            q = np.zeros((n, 0))
            assert (one.nearest(q, obstacles).lower_bound == np.full(n, -np.inf)).all()
            assert np.allclose(one.distances(q, obstacles).distance[:, 0], np.full(n, 0.3))
    assert not ist.Robot(urdf, links=['l0']).unknown_links


def test_obstacles_own_their_points(robot, tmp_path):
    points, pose = np.array([[0.9, 0.0, 0.5]]), np.eye(4)
    q = np.zeros(len(robot.joints))
    obstacles = ist.Obstacles(points, sensor_pose=pose)
    before = robot.distances(q, obstacles).distance
    points[0, 0] = 0.4
    pose[0, 3] = -0.3
    for one in (pickle.loads(pickle.dumps(obstacles)), copy.deepcopy(obstacles)):
        assert (robot.distances(q, one).distance == before).all()
    file = tmp_path / 'scene.pcd'
    header = 'VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\nDATA ascii\n'
    file.write_text(header + '0.9 0 0.5\n')
    obstacles = ist.Obstacles(file)
    file.write_text(header + '0.4 0 0.5\n')
    assert (robot.distances(q, pickle.loads(pickle.dumps(obstacles))).distance == before).all()
    # A camera 8 m away that looks from above: its ranges are 8 m and more, whoever asks again.
    file.write_text(header.replace('WIDTH', 'VIEWPOINT 0 0 8.5 1 0 0 0\nWIDTH') + '0.9 0 -8\n')
    for X, x in ((None, 0.9), (np.array([[1.0, 0, 0, -0.4], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), 0.5)):
        far = ist.Obstacles(file, sensor_pose=X, min_range=8.0)
        for one in (far, pickle.loads(pickle.dumps(far))):
            expected = robot.distances(q, ist.Obstacles(np.array([[x, 0.0, 0.5]])), tolerance=0.0).distance
            assert np.allclose(robot.distances(q, one, tolerance=0.0).distance, expected, atol=1e-9)


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


def cloud_message(points, number='<f4', **changes):
    """A sensor_msgs/PointCloud2 of (height, width, 3), with bytes before and after each point and row."""
    height, width, _ = points.shape
    rows = np.zeros((height, width), np.dtype([('ring', 'u2'), ('xyz', number, 3), ('spare', 'u1', 2)]))
    rows['xyz'] = points
    size = np.dtype(number).itemsize
    fields = [types.SimpleNamespace(name='ring', offset=0, datatype=4, count=1)]
    fields += [types.SimpleNamespace(name=name, offset=2 + k * size, datatype=7 if size == 4 else 8, count=1)
               for k, name in enumerate('xyz')]
    step = rows.dtype.itemsize
    message = types.SimpleNamespace(fields=fields, width=width, height=height, point_step=step,
                                    row_step=width * step + 5, is_bigendian=number[0] == '>',
                                    data=b''.join(row.tobytes() + 5 * b'?' for row in rows), is_dense=False)
    vars(message).update(changes)
    return message


def test_points_of_other_libraries(robot):
    """The same points give the same distances, whatever they come in."""
    rng = np.random.default_rng(7)
    image = rng.uniform(-1.0, 1.0, (30, 40, 3)).astype('f4')
    image[::7, ::5] = np.nan
    q = np.zeros(len(robot.joints))
    expected = robot.distances(q, ist.Obstacles(image), tolerance=0.0).distance
    points = image.reshape(-1, 3)

    class Converts:  # pylint: disable=too-few-public-methods
        """What only numpy can convert, as open3d's .points."""
        def __array__(self, dtype=None, **_):
            return points.astype(dtype or 'f8')
    listed = points[np.isfinite(points[:, 0])]
    for same in [points, points[::-1], points.tolist(), image.astype('f8'), np.asfortranarray(image),
                 image[:, ::-1], listed, image.astype('>f4'), Converts(), cloud_message(image), cloud_message(image, '>f4'),
                 cloud_message(image, '<f8'), cloud_message(points[None])]:
        obstacles = ist.Obstacles(same)
        assert len(obstacles) == len(listed)
        assert np.array_equal(robot.distances(q, obstacles, tolerance=0.0).distance, expected)
        again = pickle.loads(pickle.dumps(obstacles))
        assert np.array_equal(robot.distances(q, again, tolerance=0.0).distance, expected)
    assert len(ist.Obstacles(cloud_message(np.zeros((0, 0, 3), 'f4')))) == len(ist.Obstacles([])) == 0
    for wrong, message in [({'data': b''}, 'data holds'), ({'fields': []}, "'x'"), ({'row_step': 3}, 'row_step')]:
        with pytest.raises(ValueError, match=message):
            ist.Obstacles(cloud_message(image, **wrong))


def test_points_are_copied(robot):
    """Whatever becomes of an array, obstacles stay as they were made."""
    image = np.full((20, 20, 3), [0.6, 0.0, 0.5], 'f4') + np.random.default_rng(1).normal(0, 0.1, (20, 20, 3))
    q = np.zeros(len(robot.joints))
    expected = robot.distances(q, ist.Obstacles(image.copy()), tolerance=0.0).distance
    obstacles = ist.Obstacles(image)
    image[:] = 50.0
    assert np.array_equal(robot.distances(q, obstacles, tolerance=0.0).distance, expected)


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


def test_extent(robot):
    """Points with extent: the bound is that of spheres about the points, the distance stays."""
    cloud, configurations = random_scene(robot, 9)
    points = ist.Obstacles(cloud)
    for extent, smallest in ((0.02, 0.02), (ist.Extent(footprint_radius=0.02), 0.02),
                             (ist.Extent('kinect_v1', sigmas=2.0), 0.0024),
                             (ist.Extent(noise_quadratic=0.002, latency=0.01, speed=2.0), 0.02)):
        spheres = pickle.loads(pickle.dumps(ist.Obstacles(cloud, extent=extent, max_range=3.0)))
        for q in configurations[:5]:
            plain, wide = robot.distances(q, points), robot.distances(q, spheres)
            near = (plain.state == ist.NEAR) & (wide.state == ist.NEAR)
            assert near.any()
            assert np.abs(plain.distance - wide.distance)[near].max() <= 0.001  # the tolerance
            assert (wide.lower_bound <= plain.distance - smallest + 1e-9)[near].all()
            # No sphere is larger than that of the farthest point.
            largest = {0.0024: 2 * (0.0012 * 1.2 + 0.0019 * 9.0)}.get(smallest, 0.02 + 3 * 0.002 * 9.0)
            assert (wide.lower_bound >= plain.distance - largest - 0.003)[near].all()
    assert 'kinect_v1' in ist.Extent.sensors
    assert ist.Extent('kinect_v1', noise_constant=0.5).noise_constant == 0.5


@pytest.mark.parametrize('make, error, message', [
    (lambda: ist.Extent('kinect_9'), ValueError, 'realsense_d435'),
    (lambda: ist.Extent(footprint_radius=0.1, footprint_angle=0.1), ValueError, 'one of them'),
    (lambda: ist.Obstacles(np.zeros((1, 3)), extent='large'), TypeError, 'a str was given'),
    (lambda: ist.Obstacles(np.zeros((1, 3)), extent=-0.1), ValueError, 'footprint_radius is -0.1'),
    (lambda: ist.Obstacles(np.zeros((1, 3)), extent=float('nan')), ValueError, 'footprint_radius'),
    (lambda: ist.Obstacles(np.zeros((1, 3)), extent=ist.Extent('kinect_v1')), ValueError, 'max_range'),
])
def test_wrong_extent(make, error, message):
    with pytest.raises(error, match=message):
        make()


@pytest.mark.parametrize('points, message', [
    (np.full((4, 6, 3), np.nan), 'of 24 points none was measured: 24 are NaN'),
    (np.full((9, 3), -np.inf), '9 are infinite'),
    (np.zeros((9, 3), 'f4'), '9 are at'),
    (0.02 * np.eye(3), '3 are nearer than min_range'),
])
def test_nothing_measured(points, message):
    """What was not measured is not free; an empty array says that there is nothing."""
    with pytest.raises(ValueError, match=message):
        ist.Obstacles(points, min_range=0.0 if np.all(points == 0) else 0.05)
    assert len(ist.Obstacles(np.zeros((0, 3)))) == 0


def test_cycle_cost(robot):
    """The first cycle after a new cloud costs more: nothing of the last answer holds for it."""
    y, z = np.meshgrid(np.linspace(-1, 1, 320), np.linspace(0, 1.5, 240))
    image = np.stack([np.full_like(y, 0.6), y, z], axis=-1).astype(np.float32)
    obstacles = ist.Obstacles(image)
    steps = np.linspace(0.0, 0.2, 200)[:, None] * np.ones(len(robot.joints))
    cost = robot.cycle_cost(steps, obstacles, per_cloud=20)
    assert all(len(cost[name]) == 200 for name in ('query', 'repulsion', 'width', 'smallest', 'unknown'))
    is_first = np.arange(200) % 20 == 0
    assert np.median(cost['query'][is_first]) > np.median(cost['query'][~is_first])
    expected = [robot.distances(q, obstacles).lower_bound.min() for q in steps[::20]]
    assert np.abs(cost['smallest'][::20] - expected).max() <= 0.002  # two tolerances
    begin = time.monotonic()
    robot.cycle_cost(steps[:50], obstacles, period=0.01)
    assert time.monotonic() - begin >= 0.45
    for wrong in ({'per_cloud': 0}, {'period': -1.0}, {'period': float('nan')}, {'period': 100.0}):
        with pytest.raises(ValueError, match='0 to 10 s'):
            robot.cycle_cost(steps, obstacles, **wrong)


def test_cycle_cost_of_a_file(robot, wall_pcd):
    obstacles = ist.Obstacles(str(wall_pcd))
    q = np.zeros((3, len(robot.joints)))
    cost = robot.cycle_cost(q, obstacles)
    expected = robot.distances(q[0], obstacles).lower_bound.min()
    assert np.abs(cost['smallest'] - expected).max() <= 0.002
