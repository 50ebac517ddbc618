"""A pinhole depth camera that looks at solids: one exact ray per pixel, no noise.

Frames: C is the camera's optical frame (z along the view, x right, y down), S a shape's own.
"""

import numpy as np

from arm_model import inverse, transform

# [m] About what such a camera resolves. A power of two has few digits as a float: a cloud
# compresses to half of what it would with 0.001.
RESOLUTION = 1 / 1024


class DepthCamera:
    def __init__(self, width, height, focal_length, X_BC, max_depth):
        self.width, self.height, self.focal_length = width, height, focal_length
        self.X_BC, self.max_depth = X_BC, max_depth
        u, v = np.meshgrid(np.arange(width), np.arange(height))
        self._cu, self._cv = (width - 1) / 2, (height - 1) / 2
        x, y = (u - self._cu) / focal_length, (v - self._cv) / focal_length
        # With z = 1 the parameter along a ray is the depth.
        self.rays = np.stack([x, y, np.ones_like(x)], axis=-1)

    @staticmethod
    def looking_at(eye, target):
        """Pose of a camera at eye that sees target in its middle and the horizon level."""
        z = np.subtract(target, eye)
        z = z / np.linalg.norm(z)
        x = np.cross(z, [0, 0, 1])
        x = x / np.linalg.norm(x)
        return transform(np.stack([x, np.cross(z, x), z], axis=1), eye)

    def render(self, bodies):
        """Depth and index of the body that each pixel sees (inf and -1: none).

        bodies: (shape, X_BS) pairs.
        """
        depth = np.full((self.height, self.width), np.inf)
        seen = np.full((self.height, self.width), -1)
        X_CB = inverse(self.X_BC)
        for index, (shape, X_BS) in enumerate(bodies):
            z = self._depth(shape, X_CB @ X_BS)
            nearer = z < depth
            depth[nearer], seen[nearer] = z[nearer], index
        return depth, seen

    def measure(self, depth):
        """What a real camera reports: a limited range, and shadows at edges.

        Such a camera sees with two eyes: beside a near edge, a strip of what lies behind it is
        hidden from one of them, and has no depth. No point hangs in the air between the two.
        """
        z = np.where(depth <= self.max_depth, depth, np.nan)
        solid = np.where(np.isnan(z), np.inf, z)
        step = 0.04
        for shift, axis in ((1, 1), (2, 1), (-1, 1), (1, 0), (-1, 0)):
            neighbour = np.roll(solid, shift, axis)
            # np.roll wraps around; the picture's own border hides nothing.
            border = [slice(None)] * 2
            border[axis] = slice(0, shift) if shift > 0 else slice(shift, None)
            neighbour[tuple(border)] = np.inf
            z[solid > neighbour + step] = np.nan
        return z

    def points(self, z):
        """Organized points (height, width, 3) in the optical frame, on a grid of RESOLUTION."""
        return np.round(self.rays * z[..., None] / RESOLUTION) * RESOLUTION

    def _depth(self, shape, X_CS):
        if shape.kind == "mesh":
            return self._mesh(shape.vertices @ X_CS[:3, :3].T + X_CS[:3, 3], shape.triangles)
        X_SC = inverse(X_CS)
        o, d = X_SC[:3, 3], self.rays @ X_SC[:3, :3].T
        with np.errstate(divide="ignore", invalid="ignore"):
            near, far = getattr(self, "_" + shape.kind)(o, d, shape.size)
        return np.where((near <= far) & (near > 0), near, np.inf)

    @staticmethod
    def _slab(o, d, half):
        a, b = (-half - o) / d, (half - o) / d
        return np.minimum(a, b), np.maximum(a, b)

    @staticmethod
    def _quadratic(a, b, c):
        root = np.sqrt(b * b - a * c)  # NaN where the ray misses: no comparison holds then
        return (-b - root) / a, (-b + root) / a

    def _box(self, o, d, size):
        slabs = [self._slab(o[k], d[..., k], size[k] / 2) for k in range(3)]
        return np.max([s[0] for s in slabs], axis=0), np.min([s[1] for s in slabs], axis=0)

    def _sphere(self, o, d, size):
        return self._quadratic((d * d).sum(-1), d @ o, o @ o - size[0] ** 2)

    def _cylinder(self, o, d, size):
        radius, length = size
        d2, o2 = d[..., :2], o[:2]
        side = self._quadratic((d2 * d2).sum(-1), d2 @ o2, o2 @ o2 - radius**2)
        caps = self._slab(o[2], d[..., 2], length / 2)
        return np.maximum(side[0], caps[0]), np.minimum(side[1], caps[1])

    def _mesh(self, vertices, triangles):
        """Depth of a closed mesh, given in the optical frame.

        A triangle is tried only by the rays of the pixels in its bounding box on the image.
        """
        u = self.focal_length * vertices[:, 0] / vertices[:, 2] + self._cu
        v = self.focal_length * vertices[:, 1] / vertices[:, 2] + self._cv
        corners = vertices[triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        facing = np.einsum("ij,ij->i", normals, corners[:, 0]) < 0
        tri_u, tri_v = u[triangles], v[triangles]
        u0 = np.clip(np.ceil(tri_u.min(1)), 0, self.width).astype(int)
        v0 = np.clip(np.ceil(tri_v.min(1)), 0, self.height).astype(int)
        columns = np.clip(np.floor(tri_u.max(1)) + 1 - u0, 0, self.width - u0).astype(int)
        rows = np.clip(np.floor(tri_v.max(1)) + 1 - v0, 0, self.height - v0).astype(int)

        count = np.where(facing, columns * rows, 0)
        triangle = np.repeat(np.arange(len(triangles)), count)
        k = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        pixel_u = u0[triangle] + k % np.maximum(columns[triangle], 1)
        pixel_v = v0[triangle] + k // np.maximum(columns[triangle], 1)

        ray = self.rays[pixel_v, pixel_u]
        inside = np.ones(len(triangle), bool)
        for a, b in ((0, 1), (1, 2), (2, 0)):
            # The side planes of the pyramid from the eye through the triangle.
            plane = np.cross(corners[:, a], corners[:, b])
            inside &= np.einsum("ij,ij->i", plane[triangle], ray) <= 1e-12
        triangle, ray = triangle[inside], ray[inside]
        n = normals[triangle]
        z = np.einsum("ij,ij->i", n, corners[triangle, 0]) / np.einsum("ij,ij->i", n, ray)

        depth = np.full((self.height, self.width), np.inf)
        np.minimum.at(depth, (pixel_v[inside], pixel_u[inside]), z)
        return depth
