"""Rows and the velocity filter in Python."""

import numpy as np
import pytest

import ist_proximity as ist


@pytest.fixture(scope='module', name='obstacles')
def fixture_obstacles():
    rng = np.random.default_rng(46)
    return ist.Obstacles(rng.uniform((-0.9, -0.9, 0.0), (0.9, 0.9, 1.4), (60, 3)))


def configurations(robot, count):
    return np.random.default_rng(3).uniform(-1.0, 1.0, (count, len(robot.joints)))


def test_the_gradient_is_that_of_the_distance(robot, obstacles):
    compared = 0
    for q in configurations(robot, 20):
        rows = ist.constraint_rows(robot, q, robot.distances(q, obstacles, tolerance=0.0))
        assert rows.G.shape == rows.sweep.shape == (len(rows), len(robot.joints))
        assert rows.h.shape == rows.sweep_limit.shape == rows.radius.shape == rows.link.shape
        for k, step in enumerate(1e-5 * np.eye(len(q))):
            after = robot.distances(q + step, obstacles, tolerance=0.0)
            before = robot.distances(q - step, obstacles, tolerance=0.0)
            link = rows.link
            same = (after.state == ist.NEAR) & (after.point == before.point)
            same &= np.linalg.norm(after.direction - before.direction, axis=1) < 2e-4
            change = (after.distance - before.distance)[link][same[link]] / 2e-5
            assert np.allclose(change, -rows.G[same[link], k], atol=2e-3)
            compared += len(change)
    assert compared > 200


def test_the_filtered_velocity_meets_the_rows_and_the_margin(robot, obstacles):
    limits = ist.VelocityFilter(np.full(len(robot.joints), 2.0), lower=robot.lower_limits,
                                upper=robot.upper_limits)
    rng = np.random.default_rng(4)
    limited = 0
    for q in configurations(robot, 100):
        distances = robot.distances(q, obstacles)
        if distances.lower_bound.min() < 0.01:
            continue
        rows = ist.constraint_rows(robot, q, distances, horizon=0.1)
        answer = limits.run(rng.uniform(-2.0, 2.0, len(q)), q, rows)
        limited += answer.status == 'limited'
        assert (rows.G @ answer.velocity <= rows.h + 1e-7).all()
        assert (rows.sweep @ np.abs(answer.velocity) <= rows.sweep_limit + 1e-7).all()
        # The base cannot be moved away from what is near.
        after = robot.distances(q + 0.1 * answer.velocity, obstacles, tolerance=0.0)
        assert after.distance[rows.link].min() >= 0.01 - 1e-6
    assert limited > 20


def test_what_is_not_known_does_not_move(robot, obstacles):
    q = np.zeros(len(robot.joints))
    unknown = q.copy()
    unknown[0] = np.nan
    rows = ist.constraint_rows(robot, unknown, robot.distances(unknown, obstacles))
    assert (rows.sweep_limit == 0.0).any()
    answer = ist.VelocityFilter(np.ones(len(q))).run(np.full(len(q), 0.3), q, rows)
    assert answer.velocity[0] == 0.0
    assert 'not known' in str(answer)


def test_wrong_values_stop_the_robot_and_wrong_settings_raise(robot, obstacles):
    q = np.zeros(len(robot.joints))
    distances = robot.distances(q, obstacles)
    rows = ist.constraint_rows(robot, q, distances)
    limits = ist.VelocityFilter(np.ones(len(q)))
    for command in (np.full(len(q), np.nan), np.ones(len(q) + 1), []):
        answer = limits.run(command, q, rows)
        assert answer.status == 'fault' and not answer.velocity.any()
        assert 'command' in str(answer)
    assert limits.run(np.zeros(len(q)), q[:-1], rows).status == 'fault'
    with pytest.raises(ValueError, match='horizon'):
        ist.constraint_rows(robot, q, distances, horizon=0.0)
    with pytest.raises(ValueError, match='joints'):
        ist.constraint_rows(robot, q[:-1], distances)
    with pytest.raises(ValueError, match='upper'):
        ist.VelocityFilter([1.0], lower=[1.0], upper=[0.0])


def test_trajectories_are_clear_until_they_touch(robot, obstacles):
    rng = np.random.default_rng(7)
    times = np.array([0.0, 0.8, 2.0])
    positions = rng.uniform(-1.0, 1.0, (20, 3, len(robot.joints)))
    found = robot.clearance(times, positions, obstacles)
    alone = robot.clearance(times, positions[3], obstacles, threads=1)
    assert np.array_equal(alone['contact_time'], found['contact_time'][3])
    contacts = 0
    for k, path in enumerate(positions):
        samples = np.linspace(0.0, 2.0, 400)
        q = np.stack([np.interp(samples, times, path[:, j]) for j in range(path.shape[1])], axis=1)
        distance = robot.distances(q, obstacles, tolerance=0.0).distance
        for link in range(len(robot.links)):
            touches = np.flatnonzero(distance[:, link] <= 0.0)
            first = samples[touches[0]] if len(touches) else np.inf
            contacts += len(touches) > 0
            assert found['contact_time'][k, link] <= first
            before = samples <= found['contact_time'][k, link]
            assert found['lower_bound'][k, link] <= distance[before, link].min(initial=1.0) + 1e-9
    assert 0 < contacts < 20 * len(robot.links)
    gradients = found['gradient']
    assert gradients.shape == positions.shape[:1] + (len(robot.links), len(robot.joints))
    known = [index for index in np.ndindex(*gradients.shape[:2]) if np.isfinite(gradients[index]).all()]
    errors = []
    for k, link in known[:60]:
        when = found['nearest_time'][k, link]
        q = np.array([np.interp(when, times, positions[k, :, j]) for j in range(len(robot.joints))])
        steps = 1e-5 * np.eye(len(q))
        ahead, behind = [robot.distances(q + sign * steps, obstacles, tolerance=0.0).distance[:, link]
                         for sign in (1.0, -1.0)]
        errors.append(np.abs((ahead - behind) / 2e-5 - gradients[k, link]).max())
    assert len(errors) == 60 and np.median(errors) < 1e-5 and np.quantile(errors, 0.9) < 1e-3
    smooth = robot.clearance(times, positions, obstacles, velocities=np.zeros_like(positions))
    assert smooth['contact_time'].shape == found['contact_time'].shape
    for wrong, text in [((times[::-1], positions), 'rise'), ((times[:2], positions), 'times'),
                        ((times, positions[..., 1:]), 'joints'),
                        ((times, np.full_like(positions, np.nan)), 'finite')]:
        with pytest.raises(ValueError, match=text):
            robot.clearance(*wrong, obstacles)
