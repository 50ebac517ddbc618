"""What is not known, or is no number, does not become one."""

import pickle

import numpy as np
import pytest

import ist_proximity as ist

BOX = ('<robot name="box"><link name="l"><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision>'
       '</link></robot>')


@pytest.fixture(scope='module', name='obstacles')
def fixture_obstacles():
    return ist.Obstacles([[0.9, 0.1, 0.5], [0.4, 0.5, 0.6]])


def masked(values, mask):
    return np.ma.masked_array(np.array(values, float), mask)


def test_what_is_masked_is_not_known(robot, obstacles):
    n = len(robot.joints)
    q = masked(np.zeros(n), np.arange(n) == 0)
    expected = robot.distances(q.filled(np.nan), obstacles)
    assert (expected.state == ist.UNKNOWN).any()
    assert np.array_equal(robot.distances(q, obstacles).state, expected.state)
    assert np.array_equal(ist.constraint_rows(robot, q, expected).sweep_limit,
                          ist.constraint_rows(robot, q.filled(np.nan), expected).sweep_limit)
    rows = ist.constraint_rows(robot, np.zeros(n), robot.distances(np.zeros(n), obstacles))
    assert ist.VelocityFilter(np.ones(n)).run(q, np.zeros(n), rows).status == 'fault'
    with pytest.raises(ValueError, match='not finite'):
        robot.clearance([0.0, 1.0], np.ma.stack([q, q]), obstacles)
    points = masked([[0.5, 0.5, 0.5], [0.6, 0.5, 0.5], [0.7, 0.5, 0.5]], [[1, 1, 1], [0, 0, 0], [0, 0, 1]])
    for same in (points, points.astype('f4'), np.ma.stack([points, points + 0.1])):
        one = ist.Obstacles(same)
        assert one.counts['used'] > 0 and one.counts['not_a_number'] == 2 * one.counts['used']


def test_what_is_no_number(robot, obstacles):
    q = np.zeros(len(robot.joints))
    for wrong in (q + 1j, q.astype('U'), q.astype('m8[s]'), [object()] * len(q)):
        with pytest.raises(TypeError, match='array of numbers'):
            robot.distances(wrong, obstacles)
        with pytest.raises(TypeError, match='array of numbers'):
            ist.Obstacles(np.eye(3), robot=robot, q=wrong)
        with pytest.raises(TypeError, match='times'):
            robot.clearance(wrong, q[None], obstacles)
    joint = robot.joints[0]
    for wrong, message in (({joint: '0.1'}, f"{joint}' is a number, not '0.1'"), ({joint: None}, 'not None'),
                           ({1: 0.1}, 'name is a str, not 1'), ({'\ud800': 0.1}, 'ud800')):
        with pytest.raises(TypeError, match=message):
            robot.distances(wrong, obstacles)
    with pytest.raises(TypeError, match='robot is a Robot'):
        ist.Obstacles(np.eye(3), robot='arm.urdf', q=q)


def test_trajectories_have_one_shape(robot, obstacles):
    n = len(robot.joints)
    positions = np.zeros((3, n))
    for wrong in (np.zeros((n, 3)), np.zeros(3 * n), np.zeros((0, n)), np.zeros((1, 3, n))):
        with pytest.raises(ValueError, match='velocities have the shape of the positions'):
            robot.clearance([0, 1, 2], positions, obstacles, velocities=wrong)
        with pytest.raises(ValueError, match='accelerations have the shape of the positions'):
            robot.clearance([0, 1, 2], positions, obstacles, velocities=positions, accelerations=wrong)


def test_clearance_of_a_robot_without_joints(obstacles):
    box = ist.Robot(BOX)
    for shape in ((2, 0), (3, 2, 0)):
        found = box.clearance([0.0, 1.0], np.zeros(shape), obstacles)
        assert (found['contact_time'] == np.inf).all() and (found['lower_bound'] > 0.0).all()
        assert found['gradient'].shape == shape[:-2] + (1, 0)


def test_a_transposed_pose_raises(robot, obstacles):
    X = np.eye(4)
    X[:3, 3] = 0.1, 0.2, 0.3
    poses = robot.link_poses(np.zeros(len(robot.joints)))
    with pytest.raises(ValueError, match='sensor_pose is not rigid.*last row'):
        ist.Obstacles(np.eye(3), sensor_pose=X.T)
    with pytest.raises(ValueError, match='pose is not rigid.*last row'):
        robot.distances_at(np.swapaxes(poses, 1, 2), obstacles)
    poses[0] = np.nan
    assert robot.distances_at(poses, obstacles).state[0] == ist.UNKNOWN


def test_a_range_without_end(robot, obstacles):
    """It crashed where there was nothing to find, and larger ones spoiled later answers."""
    q = np.zeros(len(robot.joints))
    usual = robot.distances(q, obstacles)
    for endless in ({'max_distance': np.inf}, {'max_distance': 1e308, 'margin': 1e308}, {'margin': 1e300},
                    {'max_distance': np.inf, 'relative_tolerance': 0.5}, {'max_distance': 1e12}):
        nothing = robot.distances(q, ist.Obstacles([]), **endless)
        assert set(nothing.state) == {ist.CLEAR}
        assert robot.nearest(q, ist.Obstacles([]), **endless).state == ist.CLEAR
        answer = robot.distances(q, obstacles, **endless)
        assert (answer.lower_bound <= usual.distance + 1e-6).all()
        if 'margin' not in endless and 'relative_tolerance' not in endless:
            near = usual.state != ist.CLEAR
            assert (np.abs(answer.distance - usual.distance)[near] < 1e-3 + 1e-6).all()
        again = robot.distances(q, obstacles)
        assert (np.abs(again.lower_bound - usual.lower_bound) <= 1e-3 + 1e-6).all()
    for end in (1e9, np.inf):
        assert robot.clearance([0, 1], [q, q], obstacles, max_distance=end)
        assert robot.cycle_cost([q, q], obstacles, max_distance=end)


def test_the_self_filter_takes_a_dictionary(robot):
    q = np.zeros(len(robot.joints))
    q[1] = 0.4
    named = {robot.joints[1]: 0.4}
    cloud = np.array([X[:3, 3] + X[:3, :3] @ link['centers'][0]
                      for X, link in zip(robot.link_poses(q), robot.packing)] + [[0.9, 0.9, 0.9]])
    obstacles = ist.Obstacles(cloud, robot=robot, q=named)
    named[robot.joints[1]] = 1.0
    assert len(obstacles) == len(pickle.loads(pickle.dumps(obstacles))) == 1


def test_answers_and_points_that_were_changed(robot, obstacles):
    q = np.zeros(len(robot.joints))
    for name in ('lower_bound', 'distance', 'direction', 'point_on_link', 'point_on_obstacle', 'state'):
        distances = robot.distances(q, obstacles)
        getattr(distances, name).resize((1,), refcheck=False)
        with pytest.raises(ValueError, match='distances are those of one configuration'):
            ist.constraint_rows(robot, q, distances)
    with pytest.raises(ValueError, match='read-only'):
        obstacles.__getstate__()[0][:] = 50.0
