"""Distances from the links of a robot to points, with proven lower bounds.

    import ist_proximity as ist
    robot = ist.Robot('arm.urdf')
    obstacles = ist.Obstacles(points)
    print(robot.distances(q, obstacles).lower_bound)

The messages of the ROS package are in ist_proximity.msg and ist_proximity.srv.
"""

_NAMES = ('CLEAR', 'CONTACT', 'ConstraintRows', 'Distances', 'Extent', 'FilterAnswer', 'ModelError',
          'Nearest', 'NEAR', 'Obstacles', 'Robot', 'UNKNOWN', 'VelocityFilter', 'constraint_rows')

__all__ = list(_NAMES)


def __getattr__(name):
    # The library is loaded on first use: programs that need the messages alone do without it.
    if name not in _NAMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    from . import _core
    return getattr(_core, name)


def __dir__():
    return sorted(list(globals()) + list(_NAMES))
