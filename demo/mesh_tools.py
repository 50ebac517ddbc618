"""Closed surfaces from blocks: build, subdivide, check, write.

A link is modelled as the solid cells of a box grid. The boundary of those cells is a closed quad
mesh by construction, whatever its shape; Catmull-Clark subdivision then rounds its edges like the
fillets of a casting. Where two grid planes lie close together, the fillet gets small.
"""

import numpy as np

# Corners of a cell's six faces, counter-clockwise seen from outside.
_FACES = {
    (-1, 0, 0): ((0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0)),
    (+1, 0, 0): ((1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1)),
    (0, -1, 0): ((0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)),
    (0, +1, 0): ((0, 1, 0), (0, 1, 1), (1, 1, 1), (1, 1, 0)),
    (0, 0, -1): ((0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0)),
    (0, 0, +1): ((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)),
}


def block_surface(xs, ys, zs, is_solid):
    """Boundary quads of the grid cells whose centre satisfies is_solid(x, y, z)."""
    planes = [np.asarray(p, float) for p in (xs, ys, zs)]
    centres = np.meshgrid(*[(p[1:] + p[:-1]) / 2 for p in planes], indexing="ij")
    solid = np.pad(is_solid(*centres), 1)  # a rim of empty cells spares the border cases
    shape = [len(p) for p in planes]

    quads = []
    for step, corners in _FACES.items():
        open_side = solid & ~np.roll(solid, [-s for s in step], axis=(0, 1, 2))
        cells = np.argwhere(open_side) - 1
        quads.append(
            np.stack([np.ravel_multi_index((cells + c).T, shape) for c in corners], axis=1)
        )
    quads = np.concatenate(quads)
    used, quads = np.unique(quads, return_inverse=True)
    grid = np.stack(np.meshgrid(*planes, indexing="ij"), axis=-1).reshape(-1, 3)
    return grid[used], quads.reshape(-1, 4)


def round_ends(vertices, centre_z, upper):
    """Bends a square end about the y axis at height centre_z into a round one."""
    dx, dz = vertices[:, 0], vertices[:, 2] - centre_z
    square, circle = np.maximum(abs(dx), abs(dz)), np.hypot(dx, dz)
    scale = np.where((dz > 0) == upper, square / np.maximum(circle, 1e-12), 1.0)
    bent = vertices.copy()
    bent[:, 0] = dx * scale
    bent[:, 2] = centre_z + dz * scale
    return bent


def catmull_clark(vertices, quads):
    """One step of Catmull-Clark subdivision of a closed quad mesh."""
    n = len(vertices)
    face_points = vertices[quads].mean(axis=1)

    ends = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    edges, edge_of = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    edge_of = edge_of.reshape(-1, 4)
    if not np.all(np.bincount(edge_of.ravel()) == 2):
        raise ValueError("an edge has not exactly two faces: blocks touch along an edge only")

    def mean_at(index, values, count):
        total = np.zeros((count, 3))
        np.add.at(total, index, values)
        return total / np.bincount(index, minlength=count)[:, None]

    per_corner = np.repeat(face_points, 4, axis=0)
    edge_middles = vertices[edges].mean(axis=1)
    edge_points = (edge_middles + mean_at(edge_of.ravel(), per_corner, len(edges))) / 2

    valence = np.bincount(quads.ravel(), minlength=n)[:, None]
    faces_around = mean_at(quads.ravel(), per_corner, n)
    edges_around = mean_at(edges.ravel(), np.repeat(edge_middles, 2, axis=0), n)
    moved = (faces_around + 2 * edges_around + (valence - 3) * vertices) / valence

    edge_ids = n + edge_of
    face_ids = n + len(edges) + np.arange(len(quads))
    children = [
        np.stack([quads[:, k], edge_ids[:, k], face_ids, edge_ids[:, k - 1]], axis=1)
        for k in range(4)
    ]
    return np.concatenate([moved, edge_points, face_points]), np.concatenate(children)


def triangles_of(vertices, quads):
    """Splits every quad along its shorter diagonal."""
    a, b, c, d = (vertices[quads[:, k]] for k in range(4))
    along_ac = np.linalg.norm(a - c, axis=1) <= np.linalg.norm(b - d, axis=1)
    first = np.where(along_ac[:, None], quads[:, [0, 1, 2]], quads[:, [0, 1, 3]])
    second = np.where(along_ac[:, None], quads[:, [0, 2, 3]], quads[:, [1, 2, 3]])
    return np.stack([first, second], axis=1).reshape(-1, 3)


def volume(vertices, triangles):
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6


def check(name, vertices, triangles):
    """Raises unless the mesh is closed, oriented outward, free of slivers, and not convex."""
    directed = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    keys = directed[:, 0] * len(vertices) + directed[:, 1]
    reverse = directed[:, 1] * len(vertices) + directed[:, 0]
    if len(np.unique(keys)) != len(keys):
        raise ValueError(f"{name}: an edge is used twice in the same direction")
    if not np.array_equal(np.sort(keys), np.sort(reverse)):
        raise ValueError(f"{name}: an edge has a face on one side only")
    if volume(vertices, triangles) <= 0:
        raise ValueError(f"{name}: the faces look inward")

    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1) / 2
    if areas.min() <= 0:
        raise ValueError(f"{name}: a triangle has no area")
    normals /= 2 * areas[:, None]
    above_face = (normals @ vertices.T - np.einsum("ij,ij->i", normals, a)[:, None]).max()
    if above_face < 0.05 * np.ptp(vertices, axis=0).max():
        raise ValueError(f"{name}: convex")


def vertex_normals(vertices, triangles):
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    total = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(total, triangles[:, k], np.cross(b - a, c - a))
    return total / np.linalg.norm(total, axis=1)[:, None]


def write_stl(path, vertices, triangles):
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    data = np.zeros(len(triangles), record)
    corners = vertices[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    data["normal"] = normal / np.linalg.norm(normal, axis=1)[:, None]
    data["corners"] = corners
    with open(path, "wb") as f:
        f.write(b"ist_proximity demo arm".ljust(80))
        f.write(np.uint32(len(data)).tobytes())
        f.write(data.tobytes())


def write_obj(path, vertices, triangles):
    with open(path, "w") as f:
        f.write("# ist_proximity demo arm\n")
        f.writelines("v %.6f %.6f %.6f\n" % tuple(v) for v in vertices)
        f.writelines("vn %.3f %.3f %.3f\n" % tuple(n) for n in vertex_normals(vertices, triangles))
        f.writelines("f %d//%d %d//%d %d//%d\n" % tuple(np.repeat(t + 1, 2)) for t in triangles)


def write_dae(path, vertices, triangles, rgb):
    def source(name, rows, digits):
        numbers = " ".join(f"{x:.{digits}f}" for x in rows.ravel())
        return (
            f'<source id="{name}"><float_array id="{name}-array" count="{rows.size}">{numbers}'
            f'</float_array><technique_common><accessor source="#{name}-array" '
            f'count="{len(rows)}" stride="3"><param name="X" type="float"/>'
            f'<param name="Y" type="float"/><param name="Z" type="float"/>'
            f"</accessor></technique_common></source>\n"
        )

    colour = " ".join(f"{x:g}" for x in (*rgb, 1))
    with open(path, "w") as f:
        f.write(
            f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2024-01-01T00:00:00Z</created><modified>2024-01-01T00:00:00Z</modified>
<unit name="meter" meter="1"/><up_axis>Z_UP</up_axis></asset>
<library_effects><effect id="paint"><profile_COMMON><technique sid="common"><phong>
<diffuse><color>{colour}</color></diffuse><specular><color>0.2 0.2 0.2 1</color></specular>
<shininess><float>20</float></shininess></phong></technique></profile_COMMON></effect>
</library_effects>
<library_materials><material id="material"><instance_effect url="#paint"/></material>
</library_materials>
<library_geometries><geometry id="geometry"><mesh>
{source("positions", vertices, 6)}{source("normals", vertex_normals(vertices, triangles), 3)}\
<vertices id="vertices"><input semantic="POSITION" source="#positions"/>
<input semantic="NORMAL" source="#normals"/></vertices>
<triangles count="{len(triangles)}" material="material">
<input semantic="VERTEX" source="#vertices" offset="0"/>
<p>{" ".join(map(str, triangles.ravel()))}</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="scene"><node id="node">
<instance_geometry url="#geometry"><bind_material><technique_common>
<instance_material symbol="material" target="#material"/>
</technique_common></bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#scene"/></scene>
</COLLADA>
"""
        )
