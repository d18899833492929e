"""How deep bodies of a recording are in pins or in one another: boxes by separating axes, spheres in closed form, other
round bodies by the least overlap along any direction.

  overlap.py pins|bodies RECORDING.h5     prints the metrics as JSON
"""
import itertools
import json
import sys

import numpy


def heights_of(log, frames, cells):
    """The pins' heights in each frame, from the change log."""
    values, rows, done = numpy.empty(cells, "f8"), [], 0
    end, cell, value = log["end"][:frames], log["cell"][:], log["value"][:]
    for n in end:
        # Later changes of a cell overwrite earlier ones.
        values[cell[done:n]] = value[done:n]
        rows.append(values.copy())
        done = n
    return rows


def axes_of(q):
    """The columns of the rotation matrix of a quaternion x, y, z, w."""
    x, y, z, w = q
    return numpy.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def box_depth(p, a, half, p2, a2, half2):
    """The least overlap of two boxes along their 15 candidate axes; not positive if they are apart."""
    crossed = numpy.cross(a.T[:, None, :], a2.T[None, :, :]).reshape(9, 3)
    length = numpy.linalg.norm(crossed, axis=1)
    axes = numpy.vstack([a.T, a2.T, crossed[length > 1e-3] / length[length > 1e-3, None]])
    reach = numpy.abs(axes @ a) @ half + numpy.abs(axes @ a2) @ half2
    return float((reach - numpy.abs(axes @ (p2 - p))).min())


def sphere_depth(p, radius, corner, size):
    """Of a sphere in an upright box; its centre is taken to be outside."""
    return radius - float(numpy.linalg.norm(p - numpy.clip(p, corner, corner + size)))


def reach_of(shape, radius, height, directions):
    """How far a round body reaches from its centre of mass along each direction, in its own axes; z is its axis."""
    along, across = directions[:, 2], numpy.hypot(directions[:, 0], directions[:, 1])
    if shape == "cylinder":
        return radius * across + height / 2 * numpy.abs(along)
    if shape == "capsule":
        return radius + (height / 2 - radius) * numpy.abs(along)
    if shape == "cone":
        return numpy.maximum(0.75 * height * along, radius * across - 0.25 * height * along)
    raise ValueError(f"overlap.py: no reach of a {shape}")


def spread_directions():
    """Unit vectors all over the upper hemisphere."""
    z, angle = (numpy.arange(400) + 0.5) / 400, numpy.arange(400) * numpy.pi * (3 - 5**0.5)
    across = numpy.sqrt(1 - z * z)
    return numpy.stack([across * numpy.cos(angle), across * numpy.sin(angle), z], axis=1)


SPREAD = spread_directions()


def round_depth(shape, radius, height, p, axes, centre, half, top, known):
    """The least translation, not downwards, that takes a round body out of a bottomless column; or an upper bound of it
    that does not exceed `known`."""
    def depth(n):
        return (numpy.abs(n[:, :2]) @ half + n[:, 2] * top + n[:, :2] @ centre - n @ p
                + reach_of(shape, radius, height, -n @ axes))
    flat = numpy.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]], "f8")
    own = numpy.vstack([axes.T, -axes.T, numpy.cross(axes[:, 2], numpy.eye(3)), -numpy.cross(axes[:, 2], numpy.eye(3))])
    own = own[(own[:, 2] >= 0) & (numpy.linalg.norm(own, axis=1) > 1e-6)]
    n = numpy.vstack([flat, own / numpy.linalg.norm(own, axis=1, keepdims=True)])
    if depth(n).min() <= known:
        return known
    n = numpy.vstack([n, SPREAD])
    d = depth(n)
    least = d.min()
    for start in n[numpy.argsort(d)[:6]] if least > 0 else ():
        width = 0.15
        while width > 1e-4 and least > 0:
            near = start + width * SPREAD_AROUND
            near[:, 2] = numpy.maximum(near[:, 2], 0)
            near /= numpy.linalg.norm(near, axis=1, keepdims=True)
            found = depth(near)
            start, least, width = near[found.argmin()], min(least, found.min()), width / 2
    return max(0.0, float(least))


SPREAD_AROUND = numpy.vstack([SPREAD[::8], -SPREAD[::8], numpy.zeros((1, 3))])


def in_pins(file):
    """The greatest depth of any body in any pin, over all frames."""
    import h5py
    with h5py.File(file) as f:
        frames = len(f["tick"])
        surface = f["surface"].attrs
        rows, columns, pitch, top, length = (surface[k] for k in ("rows", "columns", "pitch", "top", "length"))
        heights = heights_of(f["surface/changes"], frames, rows * columns)
        position, orientation = f["objects/position"][:frames].astype("f8"), f["objects/orientation"][:frames].astype("f8")
        half = f["objects/extents"][:] / 2
        shape = [s.decode() if isinstance(s, bytes) else s for s in f["objects/shape"][:]]
        radius, length_of = f["objects/radius"][:], f["objects/height"][:]
    deepest = 0.0
    size = numpy.array([top[0], top[1], length])
    for p, q, height in zip(position, orientation, heights):
        height = height.reshape(rows, columns)
        for i in range(len(p)):
            reach = float(numpy.linalg.norm(half[i]))
            first_c, last_c = (int(numpy.clip(v, 0, columns - 1)) for v in ((p[i][0] - reach) // pitch, (p[i][0] + reach) // pitch + 1))
            first_r, last_r = (int(numpy.clip(rows - 1 - v, 0, rows - 1)) for v in ((p[i][1] + reach) // pitch + 1, (p[i][1] - reach) // pitch))
            axes = axes_of(q[i])
            for r, c in itertools.product(range(first_r, last_r + 1), range(first_c, last_c + 1)):
                h = height[r, c]
                if h < p[i][2] - reach:
                    continue
                centre = numpy.array([c * pitch, (rows - 1 - r) * pitch, h - length / 2])
                if shape[i] == "sphere":
                    depth = sphere_depth(p[i], half[i][0], centre - size / 2, size)
                elif shape[i] != "box":
                    depth = round_depth(shape[i], radius[i], length_of[i], p[i], axes, centre[:2], size[:2] / 2, h,
                                        deepest)
                else:
                    depth = box_depth(p[i], axes, half[i], centre, numpy.eye(3), size / 2)
                deepest = max(deepest, depth)
    return {"pins": deepest}


def of_bodies(file):
    """Mean and greatest overlap of the boxes that touch, in the last frame."""
    import h5py
    with h5py.File(file) as f:
        last = len(f["tick"]) - 1
        position, orientation = f["objects/position"][last].astype("f8"), f["objects/orientation"][last].astype("f8")
        half = f["objects/extents"][:] / 2
    axes, depths = [axes_of(q) for q in orientation], []
    for i, j in itertools.combinations(range(len(position)), 2):
        if numpy.linalg.norm(position[i] - position[j]) < numpy.linalg.norm(half[i]) + numpy.linalg.norm(half[j]):
            depth = box_depth(position[i], axes[i], half[i], position[j], axes[j], half[j])
            if depth > 0:
                depths.append(depth)
    return {"mean": sum(depths) / max(1, len(depths)), "deepest": max(depths, default=0.0)}


MEASURES = {"pins": in_pins, "bodies": of_bodies}


if __name__ == "__main__":
    print(json.dumps(MEASURES[sys.argv[1]](sys.argv[2])))
