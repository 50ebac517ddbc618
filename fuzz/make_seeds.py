#!/usr/bin/env python3
"""Writes the first seeds of the fuzz targets to fuzz/seeds/TARGET.

Formats are written by hand, small. Targets that build their input from plain bytes get pseudo-random
ones. Other files in these folders were found by fuzzing; this script leaves them alone.
"""
import pathlib
import random
import struct

ROOT = pathlib.Path(__file__).resolve().parent
VERTICES = [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)]
TRIANGLES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]


def write(target, name, content):
    folder = ROOT / "seeds" / target
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())


def pseudo_random(target, lengths, count=4):
    for length in lengths:
        for number in range(count):
            generator = random.Random(f"{target} {length} {number}")
            write(target, f"random_{length}_{number}", bytes(generator.getrandbits(8) for _ in range(length)))


def ascii_stl():
    lines = ["solid tetrahedron"]
    for triangle in TRIANGLES:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += ["vertex %g %g %g" % VERTICES[k] for k in triangle]
        lines += ["endloop", "endfacet"]
    return "\n".join(lines + ["endsolid tetrahedron", ""])


def binary_stl():
    content = b"binary".ljust(80) + struct.pack("<I", len(TRIANGLES))
    for triangle in TRIANGLES:
        content += struct.pack("<3f", 0, 0, 0)
        content += b"".join(struct.pack("<3f", *VERTICES[k]) for k in triangle) + b"\0\0"
    return content


def obj():
    lines = ["v %g %g %g" % v for v in VERTICES]
    return "\n".join(lines + ["f %d %d %d" % tuple(k + 1 for k in t) for t in TRIANGLES] + [""])


def collada(transform=""):
    positions = " ".join("%g %g %g" % v for v in VERTICES)
    indices = " ".join("%d %d %d" % t for t in TRIANGLES)
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="millimeter" meter="0.001"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="12">{positions}</float_array><technique_common>
<accessor source="#a" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>{indices}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n">{transform}
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""


def meshes():
    # Byte 0 chooses the format: STL, OBJ, Collada.
    write("mesh_file", "ascii.stl", b"\0" + ascii_stl().encode())
    write("mesh_file", "cut_off.stl", b"\0" + ascii_stl().encode()[:150])
    write("mesh_file", "binary.stl", b"\0" + binary_stl())
    write("mesh_file", "tetrahedron.obj", b"\1" + obj().encode())
    write("mesh_file", "polygon.obj", b"\1" + b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    write("mesh_file", "tetrahedron.dae", b"\2" + collada().encode())
    write("mesh_file", "transformed.dae",
          b"\2" + collada("<translate>1 2 3</translate><scale>-1 1 1</scale>").encode())


def urdfs():
    write("urdf", "demo_arm.urdf", (ROOT.parent / "demo" / "demo_arm.urdf").read_bytes())
    write("urdf", "one_link.urdf", '<robot name="r"><link name="a"/></robot>')
    shapes = ['<box size="1 2 3"/>', '<cylinder radius="0.1" length="0.5"/>',
              '<sphere radius="0.2"/>', '<mesh filename="package://p/a.stl" scale="1 1 1"/>']
    links = "".join(
        f'<link name="l{i}"><collision><origin xyz="0 0 {i}" rpy="0.1 0 3.1"/><geometry>{shape}'
        '</geometry></collision></link>' for i, shape in enumerate(shapes * 2))
    kinds = ["fixed", "revolute", "continuous", "prismatic", "planar", "floating", "revolute"]
    joints = "".join(
        f'<joint name="j{i}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/>'
        '<axis xyz="0 0 1"/><origin xyz="0.1 0 0" rpy="0 1 0"/>'
        '<limit lower="-1" upper="2" effort="1" velocity="1"/>'
        + ('<mimic joint="j1" multiplier="2" offset="0.1"/>' if i == 6 else "") + "</joint>"
        for i, kind in enumerate(kinds))
    write("urdf", "every_kind.urdf", f'<robot name="r">{links}{joints}</robot>')


def srdfs():
    pair = '<disable_collisions link1="a" link2="b" reason="Adjacent"/>'
    write("srdf", "two_pairs.srdf", f'<?xml version="1.0"?><robot name="r">{pair}{pair}</robot>')
    write("srdf", "without_link.srdf", '<robot name="r"><disable_collisions link1="a"/></robot>')


def octrees():
    free, occupied, inner = 1, 2, 3
    node = struct.pack("<H", sum(code << 2 * k for k, code in
                                 enumerate([inner, free, occupied, 0, inner, 0, 0, occupied])))
    leaves = struct.pack("<H", sum(code << 2 * k for k, code in enumerate([free, occupied] * 4)))
    binary = node + leaves + leaves
    full = struct.pack("<fB", 0.5, 0b1001)
    full += struct.pack("<fB", 1.5, 0) + struct.pack("<fB", -0.4, 0)
    resolution = bytes([0]) + struct.pack("<h", 1638)  # ByteReader::number(): 0.05 m
    write("octree", "binary_message", bytes([2]) + resolution + binary)
    write("octree", "full_message", bytes([0]) + resolution + full)
    header = "id OcTree\nsize {}\nres 0.05\ndata\n"
    write("octree", "binary_file", b"\1# Octomap OcTree binary file\n" + header.format(21).encode() + binary)
    write("octree", "full_file", b"\1# Octomap OcTree file\n" + header.format(3).encode() + full)


def scenes():
    pose = "0.5 0 0.2\n0 0 0 1\n"
    colour = "0 0 0 0\n"
    mesh = "mesh\n4 4\n" + "".join("%g %g %g\n" % v for v in VERTICES)
    mesh += "".join("%d %d %d\n" % t for t in TRIANGLES)
    shapes = ["box\n0.2 0.3 0.4\n", "sphere\n0.1\n", "cylinder\n0.1 0.5\n", "cone\n0.1 0.5\n",
              "plane\n0 0 1 0\n", mesh]
    new = "a cell\n"
    for i, shape in enumerate(shapes):
        new += f"* object {i}\n{pose}1\n{shape}{pose}{colour}0\n"
    write("world_scene", "every_shape.scene", new + ".\n")
    old = "old\n* wall\n2\n" + "".join(s + pose + colour for s in shapes[:2])
    write("world_scene", "without_poses.scene", old + ".\n")
    write("world_scene", "twice.scene", f"x\n* wall\n1\n{shapes[1]}{pose}{colour}* wall\n1\n"
          f"{shapes[1]}{pose}{colour}.\n")


def packings():
    # Byte 0: 1 a packing from the rest, 2 a file whose checksum is made right.
    spheres = b"".join(struct.pack("<5d", x, 0, 0, 0.05, 0.06) for x in (0.0, 0.1))
    header = b"ISTPACK\0" + struct.pack("<I", 1) + b"0" * 32 + struct.pack("<Q", 2)
    header += struct.pack("<5dI", 0.01, 0.005, 0.01, 0.0, 0.3, 1)
    write("packing_cache", "two_spheres", b"\2" + header + spheres + bytes(8))
    write("packing_cache", "cut_off", b"\2" + header + spheres[:-9] + bytes(8))


meshes()
urdfs()
srdfs()
octrees()
scenes()
packings()
pseudo_random("memory_map", [60, 400], 8)
pseudo_random("packing_cache", [200])
pseudo_random("cloud_layout", [40, 400], 8)
pseudo_random("laser_scan", [60, 400])
pseudo_random("depth_image", [60, 200], 8)
pseudo_random("ingest", [300, 3000])
pseudo_random("triangle_bvh", [60, 160], 8)
pseudo_random("query", [160, 500], 8)
pseudo_random("near_query", [160, 500], 8)
pseudo_random("link_pairs", [60, 200], 8)
pseudo_random("parameters", [60, 400])
pseudo_random("attach_request", [40, 120])
pseudo_random("noise_filter", [60, 600])


def depth_image(encoding, width=4, height=3):
    """A camera of a few pixels, by P, and an image that fits it; encoding: 0 for mm, 1 for m."""
    quarter = struct.pack("<h", 8192)
    content = bytes([width, height, 1])
    content += b"\0" + quarter + b"\1"  # focal length: 20 / 4 + 5
    content += b"\0" + quarter  # centre: 8 / 4
    content += b"\0" + quarter + b"\1" + b"\0" + quarter
    content += bytes([63, 1, encoding, 0, 0, 0])  # all as it is, no region, fits, no padding
    pack = "<f" if encoding == 1 else "<H"
    depths = [0.5 * i if encoding == 1 else 500 * i for i in range(width * height)]
    return content + b"".join(struct.pack(pack, depth) for depth in depths)


write("depth_image", "millimetres", depth_image(0))
write("depth_image", "metres", depth_image(1))
