#!/usr/bin/env python3
"""Makes the meshes of the demo arm: closed, outward oriented, and anything but convex.

Writes into meshes/ beside this file, the same bytes each time:

  shoulder_fork.stl  millimetres (the URDF scales it)   fork that carries the upper arm
  upper_arm.stl      metres                             open channel with windows, elbow fork
  wrist_fork.obj     metres                             small fork
  gripper.dae        metres                             hook-shaped fixed jaw on a palm

Every link's origin lies on the axis of the joint that moves it.
"""

import os

import numpy as np

import mesh_tools

MESHES = os.path.join(os.path.dirname(os.path.abspath(__file__)), "meshes")


def mirrored(*positive):
    """Grid planes on both sides of zero."""
    return [-p for p in reversed(positive)] + list(positive)


def shoulder_fork():
    """Turret on z = 0; two cheeks with bearing holes about the y axis at z = 135 mm."""
    axis, radius = 135, 52

    def is_solid(x, y, z):
        turret = z < 46
        cheek = (abs(x) < radius) & (abs(y) > 38) & (abs(y) < 62)
        bore = (abs(x) < 22) & (abs(z - axis) < 22)
        return turret | (cheek & ~bore)

    v, q = mesh_tools.block_surface(
        mirrored(22, radius, 74, 80),
        mirrored(38, 43, 57, 62, 74, 80),
        [0, 5, 41, 46, 60, axis - 22, axis, axis + 22, axis + radius],
        is_solid,
    )
    # The turret's corners go onto its circle; the cheeks end round.
    corner = (abs(v[:, 0]) > 70) & (abs(v[:, 1]) > 70)
    v[corner, :2] *= 0.86
    return mesh_tools.round_ends(v, axis, upper=True), q


def upper_arm():
    """Hub about the y axis at z = 0, channel open to +x, fork about the y axis at z = 0.34."""
    elbow, hub, cheek = 0.34, 0.045, 0.042

    def is_solid(x, y, z):
        beam = (abs(x) < 0.042) & (abs(y) < 0.034) & (z < 0.285)
        channel = (x > -0.024) & (abs(y) < 0.020) & (z > 0.068) & (z < 0.25)
        window = (abs(y) < 0.020) & (((z > 0.092) & (z < 0.138)) | ((z > 0.178) & (z < 0.224)))
        collar = (abs(x) < 0.042) & (z > 0.25) & (z < 0.285)
        cheeks = (abs(x) < 0.042) & (abs(y) > 0.034) & (z > 0.25)
        bore = (abs(x) < 0.018) & (abs(z - elbow) < 0.018)
        return (beam & ~channel & ~window) | collar | (cheeks & ~bore)

    v, q = mesh_tools.block_surface(
        [-0.042, -0.036, -0.024, -0.018, 0.018, 0.036, 0.042],
        mirrored(0.020, 0.034, 0.050),
        [-hub, -0.02, 0.02, 0.045, 0.068, 0.092, 0.138, 0.178, 0.224, 0.25, 0.285]
        + [elbow - 0.018, elbow, elbow + 0.018, elbow + cheek],
        is_solid,
    )
    v = mesh_tools.round_ends(v, 0.0, upper=False)
    return mesh_tools.round_ends(v, elbow, upper=True), q


def wrist_fork():
    """Flange on z = 0; two cheeks about the y axis at z = 0.085."""
    axis, radius = 0.085, 0.030

    def is_solid(x, y, z):
        flange = z < 0.034
        cheek = (abs(x) < radius) & (abs(y) > 0.036)
        bore = (abs(x) < 0.012) & (abs(z - axis) < 0.012)
        return flange | (cheek & ~bore)

    v, q = mesh_tools.block_surface(
        mirrored(0.012, radius, 0.040),
        mirrored(0.012, 0.036, 0.040, 0.048, 0.052),
        [0, 0.004, 0.030, 0.034, axis - 0.012, axis, axis + 0.012, axis + radius],
        is_solid,
    )
    return mesh_tools.round_ends(v, axis, upper=True), q


def gripper():
    """Palm with a guide slot along x, where the moving jaw slides, and a hook-shaped fixed jaw."""

    def is_solid(x, y, z):
        palm = (z < 0.052) & (abs(y) < 0.034)
        slot = (x > -0.034) & (abs(y) < 0.014) & (z > 0.030)
        jaw = (x < -0.048) & (abs(y) < 0.022)
        hook = (x < -0.026) & (abs(y) < 0.022) & (z > 0.128)
        return (palm & ~slot) | jaw | hook

    return mesh_tools.block_surface(
        [-0.068, -0.063, -0.053, -0.048, -0.034, -0.026, 0.063, 0.068],
        mirrored(0.014, 0.022, 0.034),
        [0, 0.006, 0.030, 0.047, 0.052, 0.070, 0.122, 0.128, 0.144, 0.150],
        is_solid,
    )


def finished(surface, steps):
    vertices, quads = surface
    for _ in range(steps):
        vertices, quads = mesh_tools.catmull_clark(vertices, quads)
    return vertices, mesh_tools.triangles_of(vertices, quads)


def main():
    os.makedirs(MESHES, exist_ok=True)
    writers = {".stl": mesh_tools.write_stl, ".obj": mesh_tools.write_obj}
    writers[".dae"] = lambda *args: mesh_tools.write_dae(*args, rgb=(0.85, 0.45, 0.10))
    links = {
        "shoulder_fork.stl": (finished(shoulder_fork(), 1), 3),
        "upper_arm.stl": (finished(upper_arm(), 1), 6),
        "wrist_fork.obj": (finished(wrist_fork(), 1), 6),
        "gripper.dae": (finished(gripper(), 1), 6),
    }
    for name, ((vertices, triangles), digits) in links.items():
        # What is checked is what is written: single precision, or as many digits as the text has.
        vertices = np.round(vertices, digits).astype(np.float32).astype(float)
        mesh_tools.check(name, vertices, triangles)
        path = os.path.join(MESHES, name)
        writers[os.path.splitext(name)[1]](path, vertices, triangles)
        size = "x".join(f"{s:.4g}" for s in np.ptp(vertices, axis=0))
        print(f"{name}: {len(triangles)} triangles, {size}, {os.path.getsize(path) // 1024} KiB")


if __name__ == "__main__":
    main()
