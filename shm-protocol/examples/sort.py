"""The case study (scripts/case-study/sort.aps) in NumPy: the same stages under the same names, bit for bit the same.

    smartsurf run scripts/case-study/sort.lua        python3 sort.py [SURFACE]
"""
import sys

import numpy as np
import shm_protocol

UP, DOWN = np.float32(4), np.float32(0)
THRESHOLD, MAX_STEPS, MAX_SPREAD = 2, 8, 16


def moved(image, north, east):
    """The image, moved by so many cells; zero comes in."""
    out = np.zeros_like(image)
    rows, columns = image.shape
    out[max(0, -north):rows - max(0, north), max(0, east):columns - max(0, -east)] = \
        image[max(0, north):rows - max(0, -north), max(0, -east):columns - max(0, east)]
    return out


def four(reduce, image):
    """Of each cell's north, south, east and west neighbours; row 0 is north."""
    return reduce(reduce(moved(image, -1, 0), moved(image, 1, 0)), reduce(moved(image, 0, -1), moved(image, 0, 1)))


class Sort:
    def __init__(self, shape):
        # The border ring is a wall. Its cells know it: they miss a neighbour.
        self.inside = four(np.minimum, np.ones(shape, np.float32))

    def heights(self, proximity_hit):
        # (a) Sensor data: the footprint of whatever lies on the surface.
        sensed = proximity_hit * self.inside

        # (b) Erosion by one cell, so that objects that touch come apart.
        eroded = np.minimum(sensed, four(np.minimum, sensed))

        # (c) Count the steps from the rim to the centre: peel off ring after ring, and number the rings.
        steps, rest = np.zeros_like(sensed), eroded
        for ring in range(1, MAX_STEPS + 1):
            inner = np.minimum(rest, four(np.minimum, rest))
            steps = steps + np.float32(ring) * (rest - inner)
            rest = inner

        # (d) The largest number of steps in an object is its size: spread it to all of the object's cells.
        size = steps
        for _ in range(MAX_SPREAD):
            size = np.maximum(size, four(np.maximum, size)) * eroded

        # (e) Dilation by one cell, back to the whole footprint. What is too thin to survive the erosion is small.
        found = np.maximum(size, four(np.maximum, size))
        found = sensed * np.maximum(found, np.float32(1))

        # (f) Small objects move west, large ones east: the footprint, moved by one cell, is the pocket to come.
        west = moved(np.float32(1) * ((found > 0) & (found <= THRESHOLD)), 0, -1)
        east = moved(np.float32(1) * (found > THRESHOLD), 0, 1)

        # (g) Actuators: pockets go down, everything else up.
        return np.where((west != 0) | (east != 0), DOWN, UP)


def run(name, timeout=10.0):
    with shm_protocol.Controller(name, timeout) as table:
        sort = Sort((table.description.rows, table.description.columns))
        while table.wait():
            table.actuators["height"][:] = sort.heights(table.sensors["proximity_hit"])
            table.publish()


if __name__ == "__main__":
    run(sys.argv[1] if len(sys.argv) > 1 else "surface")
