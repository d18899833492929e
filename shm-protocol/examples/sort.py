"""The case study (scripts/case-study/sort.aps) in NumPy: the same stages under the same names, bit-identical.

    smartsurf run scripts/case-study/sort.lua        python3 sort.py [SURFACE]
"""
import sys

import numpy as np
import shm_protocol

UP, DOWN = np.float32(2.5), np.float32(0)
THRESHOLD, MAX_STEPS, MAX_SIZE, MAX_QUEUE = 2, 8, 16, 24
CYCLE, WAIT, PUSH, NEAR = 480, 300, 400, 8


def moved(image, south, east):
    """The image shifted by whole cells, filled with zeros. Row 0 is north."""
    out = np.zeros_like(image)
    rows, columns = image.shape
    out[max(0, south):rows + min(0, south), max(0, east):columns + min(0, east)] = \
        image[max(0, -south):rows - max(0, south), max(0, -east):columns - max(0, east)]
    return out


# The neighbour's value, for each cell.
def north(image): return moved(image, 1, 0)
def south(image): return moved(image, -1, 0)
def east(image): return moved(image, 0, -1)
def west(image): return moved(image, 0, 1)


shift_north, shift_south, shift_west, shift_east = south, north, east, west


def least(image):
    return np.minimum(np.minimum(north(image), south(image)), np.minimum(east(image), west(image)))


def greatest(image):
    return np.maximum(np.maximum(north(image), south(image)), np.maximum(east(image), west(image)))


def heard(news, kind, steps):
    """The values that reach a cell in so many steps from neighbour to neighbour, through touching objects of one kind."""
    for _ in range(steps):
        news = np.maximum(news, greatest(news)) * kind
    return news


def widened(moving, ahead):
    """The footprint of a moving object, one cell wider at the sides."""
    across = (north, south) if ahead in (shift_west, shift_east) else (east, west)
    return np.maximum(moving, np.maximum(across[0](moving), across[1](moving)))


def pocket_of(moving, ahead):
    """The pocket of a moving object: runs ahead of its footprint by one cell."""
    return ahead(np.maximum(widened(moving, ahead), ahead(moving)))


def long_pocket_of(moving, ahead):
    """Runs ahead by three cells."""
    wide = widened(moving, ahead)
    return ahead(ahead(np.maximum(np.maximum(wide, ahead(wide)), ahead(ahead(moving)))))


def as_number(truth):
    return truth.astype(np.float32)


class Sort:
    def __init__(self, shape):
        # The border ring is a wall. Its cells know it: they miss a neighbour.
        self.inside = least(np.ones(shape, np.float32))
        self.ahead = np.zeros(shape, np.float32)

    def heights(self, proximity_hit, tick):
        inside = self.inside

        # (a) Sensor data: the footprint of whatever lies on the surface. A sensor that all four neighbours contradict is
        # overruled: it is dead, has missed the object, or reports one that is not there.
        sensed = proximity_hit * inside
        sensed = np.maximum(np.minimum(sensed, greatest(sensed)), least(sensed))

        # (b) Erosion by one cell, so that objects that touch come apart.
        eroded = np.minimum(sensed, least(sensed))

        # (c) Count the steps from the rim to the centre: peel off ring after ring, and number the rings.
        steps, rest = np.zeros_like(sensed), eroded
        for ring in range(1, MAX_STEPS + 1):
            inner = np.minimum(rest, least(rest))
            steps = steps + np.float32(ring) * (rest - inner)
            rest = inner

        # (d) The largest number of steps in an object is its size: spread it to all of the object's cells.
        size = heard(steps, eroded, MAX_SIZE)

        # (e) Dilation by one cell, back to the whole footprint. What is too thin to survive the erosion is small.
        found = np.maximum(size, greatest(size))
        found = sensed * np.maximum(found, np.float32(1))

        # (f) Small objects move west, large ones east.
        small = as_number((found > 0) & (found <= THRESHOLD))
        large = as_number(found > THRESHOLD)

        # Whoever has arrived at the wall halts, and so does the queue behind it: pushed on, they would climb out.
        halt_small = small * (west(inside) == 0)
        halt_large = large * (east(inside) == 0)

        # Large objects wait for small ones: a small one sends a signal west, one cell a tick, that halts those it meets.
        self.ahead = np.maximum(small, east(self.ahead)) * inside
        if tick % CYCLE < WAIT:
            halt_large = np.maximum(halt_large, large * self.ahead)
        halt_small = heard(halt_small, small, MAX_QUEUE)
        halt_large = heard(halt_large, large, MAX_QUEUE)

        # Where a small one is shut in, waiting does not help: large ones close to it step aside, by turns north and
        # south, unless they, or those that they touch, have a wall there.
        aside = np.zeros_like(small)
        wall, step_aside = (north, shift_north) if tick % (2 * CYCLE) < CYCLE else (south, shift_south)
        if tick % CYCLE >= PUSH:
            aside = small
            for _ in range(NEAR):
                aside = np.maximum(aside, east(aside))
            stop = heard(large * (wall(inside) == 0), large, MAX_QUEUE)
            aside = heard(aside * large, large, MAX_SIZE) * (1 - stop)
            halt_large = halt_large * (1 - aside)

        # (g) Actuators: pockets go down, everything else up. Who moves has a pocket that runs ahead of its footprint,
        # small ones by one cell, large ones by three, so that the pins behind it push; who halts sinks into one that
        # surrounds it.
        halt = np.maximum(halt_small, halt_large)
        move_small, move_large = small - halt_small, large - np.maximum(halt_large, aside)
        pocket = np.maximum(halt, greatest(halt))
        pocket = np.maximum(pocket, pocket_of(move_small, shift_west))
        pocket = np.maximum(pocket, long_pocket_of(move_large, shift_east))
        pocket = np.maximum(pocket, pocket_of(aside, step_aside))
        return np.where(pocket != 0, DOWN, UP)


def run(name, timeout=10.0):
    with shm_protocol.Controller(name, timeout) as table:
        sort = Sort((table.description.rows, table.description.columns))
        while table.wait():
            table.actuators["height"][:] = sort.heights(table.sensors["proximity_hit"], table.tick)
            table.publish()


if __name__ == "__main__":
    try:
        run(sys.argv[1] if len(sys.argv) > 1 else "surface")
    except shm_protocol.Error as error:
        sys.exit(error.report())
