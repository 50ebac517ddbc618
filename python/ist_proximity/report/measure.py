"""What a report measures, with a robot and a scene on this machine."""

import dataclasses
import os

import numpy as np

import ist_proximity as ist

PIECES = 8  # pieces of motion
STEPS = 330  # steps of a piece; at 1 kHz ten images of a camera
SPEED = 1.0  # [rad/s, m/s] of the fastest joint
CLOUD_RATE = 30.0  # [Hz] of a camera
PER_CLOUD = 33  # cycles for each image, at 1 kHz
PACED_TIME = 10.0  # [s] for cycles at the wanted rate
SAME = 0.15  # as a share: 99th percentiles that differ less may be the same in another run
DEADLINES = (0.1, 0.25, 0.5, 1.0, 2.0)  # as shares of the 99th percentile of a query


@dataclasses.dataclass
class Cost:
    """Times [s] of cycles along the motion, with one setting."""

    max_error: float  # [m]
    tolerance: float  # [m]
    query: np.ndarray
    repulsion: np.ndarray
    width: np.ndarray  # [m]
    unknown: np.ndarray

    @property
    def cycle(self):
        return self.query + self.repulsion


@dataclasses.dataclass
class Report:
    """Everything that the page shows."""

    robot: object
    scene: object
    obstacles: object
    warnings: list
    packing: list  # one dictionary for each link
    packing_time: float  # [s]
    costs: list  # of Cost, by packing and tolerance, one cycle at once after the other
    best: object  # Cost of the recommended setting among them
    paced: object  # Cost of the recommended setting at the wanted rate, asleep between cycles
    deadlines: list  # (share, deadline [s], mean width [m], share of steps with all links known)
    ingest: np.ndarray  # [s]
    memory: dict  # [bytes] by what
    answer: object  # Distances at the scene's configuration
    q: np.ndarray


def resident_memory():
    """[bytes] of this process."""
    with open('/proc/self/statm', encoding='ascii') as file:
        return int(file.read().split()[1]) * os.sysconf('SC_PAGE_SIZE')


def configuration(robot, positions):
    """(joints,) of the positions that are known; 0, or the nearest limit, for the others."""
    q = np.array([positions.get(name, 0.0) for name in robot.joints], float)
    return np.clip(q, robot.lower_limits, robot.upper_limits)


def motion(robot, q, seed=0, rate=1000.0, steps=STEPS):
    """(n, joints): pieces of motion at `rate` [Hz] within the joints' limits; the first begins at q."""
    rng = np.random.default_rng(seed)
    low = np.maximum(robot.lower_limits, -np.pi)
    high = np.minimum(robot.upper_limits, np.pi)
    pieces = []
    for number in range(PIECES):
        begin = q if number == 0 else rng.uniform(low, high)
        way = rng.uniform(low, high) - begin
        way *= SPEED / max(np.abs(way).max(initial=0.0), 1e-9)
        piece = begin + np.arange(steps)[:, None] / rate * way
        pieces.append(np.clip(piece, robot.lower_limits, robot.upper_limits))
    return np.vstack(pieces)


def paced_cycles(robot, q, obstacles, rate, tolerance):
    """Cycles as a node runs them: at `rate` [Hz], asleep between them, 30 new clouds a second."""
    steps = int(np.clip(PACED_TIME * rate / PIECES, 1, STEPS))
    per_cloud = max(1, round(rate / CLOUD_RATE))
    return robot.cycle_cost(motion(robot, q, rate=rate, steps=steps), obstacles, tolerance=tolerance,
                            per_cloud=per_cloud, period=1.0 / rate)


def warn_about(robot, packing, counts):
    """Sentences about links and points that a user should look at."""
    warnings = []
    for link, more in zip(robot.packing, packing):
        name = link['link']
        if link['error']:
            warnings.append(f'{name} cannot be used and is UNKNOWN: {link["error"]}')
            continue
        share = more['filled_volume'] / max(more['solid_volume'], 1e-12)
        box = np.ptp(link['centers'], axis=0) if len(link['centers']) else np.zeros(3)
        if more['solid_volume'] < 0.02 * box.prod():
            warnings.append(f'{name} looks like a hollow shell: its mesh has only '
                            f'{1e6 * more["solid_volume"]:.1f} cm³ of volume. Distances are right, '
                            'but points inside the housing count as outside, and contact volumes '
                            'mean little. Use a closed collision mesh.')
        elif share < 0.5:
            warnings.append(f'{name} is filled to {share:.0%} only; contact volumes are coarse.')
        if more['open_edges'] > 0:
            warnings.append(f'{name} has {more["open_edges"]} open edges: inside is where the '
                            'winding number exceeds 0.5, and queries in contact take longer.')
    if robot.links_without_geometry:
        warnings.append('Links without geometry are not monitored: ' +
                        ', '.join(robot.links_without_geometry) + '.')
    received = max(counts['received'], 1)
    if counts['on_robot'] > 0.3 * received:
        warnings.append(f'{counts["on_robot"] / received:.0%} of the points are on the robot; if '
                        'that is more than the camera sees of it, its pose or the joints are wrong.')
    if counts['used'] == 0:
        warnings.append('No point is left as an obstacle: '
                        + ', '.join(f'{count} {name}' for name, count in counts.items()) + '.')
    return warnings


def measure_deadlines(robot, steps, obstacles, tolerance, high):
    """Widths of the bounds for deadlines of several shares of the 99th percentile `high` [s]."""
    rows = []
    for share in DEADLINES:
        deadline = max(share * high, 1e-6)
        cost = robot.cycle_cost(steps, obstacles, tolerance=tolerance, deadline=deadline,
                                per_cloud=PER_CLOUD)
        rows.append((share, deadline, cost['width'].mean(), (cost['unknown'] == 0).mean()))
    return rows


def run(make_robot, scene, max_errors, tolerances, padding, rate, error, tell):
    """Measures everything.

    make_robot(max_error, progress, warning): a Robot. max_errors, tolerances: [m], the first of
    each is the one that is used. rate [Hz], error [m]: what is wanted. tell(text, share): shows
    progress.
    """
    warnings, before = [], resident_memory()
    robots = {}
    for number, max_error in enumerate(max_errors):
        text = f'packing to {1e3 * max_error:g} mm'
        robots[max_error] = make_robot(
            max_error, lambda share, text=text, number=number: tell(
                text, 0.5 * (number + share) / len(max_errors)),
            warnings.append if number == 0 else None)
    robot = robots[max_errors[0]]
    model_bytes = resident_memory() - before
    q = configuration(robot, scene.positions)
    keywords = {'sensor_pose': scene.sensor_pose, 'max_range': 3.0}
    if scene.positions:
        keywords.update(robot=robot, q=q, self_filter_padding=padding)

    tell('reading the scene', 0.52)
    before = resident_memory()
    obstacles = ist.Obstacles(scene.points, **keywords)
    cloud_bytes = resident_memory() - before
    ingest = np.array([ist.Obstacles(scene.points, **keywords).ingest_time for _ in range(10)])

    steps = motion(robot, q)
    costs = []
    for max_error in max_errors:
        for tolerance in tolerances:
            share = 0.55 + 0.27 * len(costs) / (len(max_errors) * len(tolerances))
            tell(f'measuring {1e3 * max_error:g} mm, tolerance {1e3 * tolerance:g} mm', share)
            result = robots[max_error].cycle_cost(steps, obstacles, tolerance=tolerance,
                                                  per_cloud=PER_CLOUD)
            costs.append(Cost(max_error, tolerance, **_columns(result)))
    best = recommend(costs, error)
    tell(f'{rate:g} cycles a second', 0.85)
    paced = Cost(best.max_error, best.tolerance, **_columns(
        paced_cycles(robots[best.max_error], q, obstacles, rate, best.tolerance)))
    tell('measuring deadlines', 0.88)
    high = float(np.percentile(costs[0].query, 99))
    deadlines = measure_deadlines(robot, steps, obstacles, tolerances[0], high)
    tell('measuring the packing', 0.95)
    packing = robot.measure_packing()
    warnings += warn_about(robot, packing, obstacles.counts)
    memory = {'robots of this report (all packings)': model_bytes, 'one indexed cloud': cloud_bytes}
    packing_time = sum(link['packing_time'] for link in robot.packing)
    return Report(robot, scene, obstacles, warnings, packing, packing_time, costs, best, paced,
                  deadlines, ingest, memory, robot.distances(q, obstacles), q)


def recommend(costs, error):
    """The first setting that is about the fastest of those whose bounds are as wide as wanted."""
    fitting = [cost for cost in costs if cost.tolerance <= error] or costs
    high = [np.percentile(cost.cycle, 99) for cost in fitting]
    return next(cost for cost, own in zip(fitting, high) if own <= (1.0 + SAME) * min(high))


def _columns(result):
    """What a Cost keeps of a measurement."""
    return {name: result[name] for name in ('query', 'repulsion', 'width', 'unknown')}
