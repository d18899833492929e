"""How deep bodies of a recording are in pins or in one another: boxes by separating axes, spheres in closed form.

  overlap.py pins|bodies RECORDING.h5     prints the metrics as JSON
"""
import itertools
import json
import sys

import h5py
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


def in_pins(file):
    """The greatest depth of any body in any pin, over all frames."""
    with h5py.File(file) as f:
        frames = len(f["tick"])
        surface = f["surface"].attrs
        rows, columns, pitch, top, length = (surface[k] for k in ("rows", "columns", "pitch", "top", "length"))
        heights = heights_of(f["surface/changes"], frames, rows * columns)
        position, orientation = f["objects/position"][:frames].astype("f8"), f["objects/orientation"][:frames].astype("f8")
        half, round_ = f["objects/extents"][:] / 2, [s in (b"sphere", "sphere") for s in f["objects/shape"][:]]
    deepest = 0.0
    size = numpy.array([top[0], top[1], length])
    for p, q, height in zip(position, orientation, heights):
        height = height.reshape(rows, columns)
        for i in range(len(p)):
            reach = float(numpy.linalg.norm(half[i]))
            first_c, last_c = (int(numpy.clip(v, 0, columns - 1)) for v in ((p[i][0] - reach) // pitch, (p[i][0] + reach) // pitch + 1))
            first_r, last_r = (int(numpy.clip(rows - 1 - v, 0, rows - 1)) for v in ((p[i][1] + reach) // pitch + 1, (p[i][1] - reach) // pitch))
            axes = None if round_[i] else axes_of(q[i])
            for r, c in itertools.product(range(first_r, last_r + 1), range(first_c, last_c + 1)):
                h = height[r, c]
                if h < p[i][2] - reach:
                    continue
                centre = numpy.array([c * pitch, (rows - 1 - r) * pitch, h - length / 2])
                if round_[i]:
                    depth = sphere_depth(p[i], half[i][0], centre - size / 2, size)
                else:
                    depth = box_depth(p[i], axes, half[i], centre, numpy.eye(3), size / 2)
                deepest = max(deepest, depth)
    return {"pins": deepest}


def of_bodies(file):
    """Mean and greatest overlap of the boxes that touch, in the last frame."""
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
