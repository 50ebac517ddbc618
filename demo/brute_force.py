"""Distances from points to the arm by trying every point against every triangle and primitive.

Slow and plain on purpose: it shares nothing with the ray caster that makes the points.
"""

import numpy as np

from arm_model import inverse


def _to_segment(p, a, b):
    ab = b - a
    t = ((p - a) * ab).sum(-1) / (ab * ab).sum(-1)
    closest = a + np.clip(t, 0, 1)[..., None] * ab
    return np.linalg.norm(p - closest, axis=-1)


def point_triangle(points, corners):
    """Distances (n, m) from n points to m triangles (m, 3, 3)."""
    p = points[:, None, :]
    a, b, c = corners[None, :, 0], corners[None, :, 1], corners[None, :, 2]
    distance = np.minimum(_to_segment(p, a, b), _to_segment(p, b, c))
    distance = np.minimum(distance, _to_segment(p, c, a))
    n = np.cross(b - a, c - a)
    n = n / np.linalg.norm(n, axis=-1)[..., None]
    above = np.ones(distance.shape, bool)
    for start, end in ((a, b), (b, c), (c, a)):
        above &= (np.cross(n, end - start) * (p - start)).sum(-1) >= 0
    return np.where(above, abs(((p - a) * n).sum(-1)), distance)


def _to_primitive(kind, size, p):
    if kind == "sphere":
        return np.linalg.norm(p, axis=-1) - size[0]
    if kind == "box":
        q = abs(p) - np.array(size) / 2
    else:
        q = np.stack([np.hypot(p[:, 0], p[:, 1]) - size[0], abs(p[:, 2]) - size[1] / 2], axis=-1)
    return np.linalg.norm(np.maximum(q, 0), axis=-1) + np.minimum(q.max(-1), 0)


def _to_mesh(shape, p, beyond):
    """Distance and index of the nearest point, tried against every triangle; inf if beyond.

    Points that cannot be the nearest are left out first: by the mesh's box, then by its vertices,
    from which no point of a triangle is farther than the longest edge.
    """
    nearest_in_box = np.clip(p, shape.vertices.min(0), shape.vertices.max(0))
    near = np.flatnonzero(np.linalg.norm(p - nearest_in_box, axis=1) < beyond)
    if not len(near):
        return np.inf, -1
    corners = shape.vertices[shape.triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max()
    v, q = shape.vertices, p[near]
    squares = (q * q).sum(1)[:, None] - 2 * q @ v.T + (v * v).sum(1)
    to_vertex = np.sqrt(np.maximum(squares.min(1), 0))
    near = near[to_vertex - longest <= to_vertex.min() + 1e-9]

    best = np.inf, -1
    for k in range(0, len(near), 16):
        batch = near[k : k + 16]
        d = point_triangle(p[batch], corners).min(1)
        best = min(best, (d.min(), batch[d.argmin()]))
    return best


def distance_to_link(shapes, X_BL, points):
    """Smallest distance from points (n, 3) in the base frame to a link, and that point's index."""
    best = np.inf, -1
    for shape in sorted(shapes, key=lambda s: s.kind == "mesh"):  # the cheap ones first
        X_SB = inverse(X_BL @ shape.X_LS)
        p = points @ X_SB[:3, :3].T + X_SB[:3, 3]
        if shape.kind == "mesh":
            best = min(best, _to_mesh(shape, p, best[0]))
        else:
            d = _to_primitive(shape.kind, shape.size, p)
            best = min(best, (d.min(), d.argmin()))
    return best


def distances(arm, X_BL, points):
    """(distance, index of the point) by name of each link that has geometry."""
    return {
        link: distance_to_link(shapes, X_BL[link], points)
        for link, shapes in arm.shapes.items()
        if shapes
    }
