"""The case study (scripts/case-study/sort.aps) in NumPy: the same stages under the same names, bit-identical.

    smartsurf run scripts/case-study/sort.lua        python3 sort.py [SURFACE]
"""
import sys

import numpy as np
import shm_protocol

DOWN, RISE, TALLEST = np.float32(1), np.float32(2), np.float32(5)
SINKING, RAISING, NOTHING, RIDGE = np.float32(0.2), np.float32(0.07), np.float32(20), np.float32(0.5)
MAX_STEPS, SHARE, GROWTH, DECAY = 8, 0.77, 0.01, 0.002
MAX_QUEUE, NEAR, BEHIND = 8, 6, 12
REACH, WALL = 8, 1000
PATIENCE, HEATING, COOLING, LOUDER, FARTHEST, ALARM = 240, 0.2, 0.01, 15, 16, 6
LIFTING, MAX_LIFT, ROUND, RAMP, SHORE, BANK = 0.1, 3, 6, 0.5, 8, 0.3
EAST, SOUTH, NORTH, WEST = 1, 2, 3, 4


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


def least_diagonal(image):
    return np.minimum(np.minimum(north(east(image)), south(west(image))), np.minimum(north(west(image)), south(east(image))))


def greatest_diagonal(image):
    return np.maximum(np.maximum(north(east(image)), south(west(image))), np.maximum(north(west(image)), south(east(image))))


def ridge(image, one_way, other_way):
    """Where the image is higher than on both sides."""
    near = np.maximum(one_way(image), other_way(image))
    return image > np.maximum(near, np.maximum(one_way(one_way(image)), other_way(other_way(image))) + RIDGE)


def around(image, cells):
    """The image's cells and those up to so many cells from them."""
    for _ in range(cells):
        image = np.maximum(image, greatest(image))
    return image


def heard(news, kind, steps):
    """The values that reach a cell in so many steps from neighbour to neighbour, through touching objects of one kind."""
    for _ in range(steps):
        news = np.maximum(news, greatest(news)) * kind
    return news


def told(news, core, uphill):
    """What an object's core says, in its whole footprint: each cell repeats it from the neighbour nearest to the core."""
    said = news = core * news
    for _ in range(MAX_STEPS):
        following = said
        for slope, neighbour in uphill:
            following = following + slope * neighbour(news)
        news = following
    return news


def way(known, cost):
    """The length of the shortest way to the goal, REACH cells better known; the cost is that of a step into a cell."""
    for _ in range(REACH):
        known = least(known) + cost
    return known


def downhill(cost, first, last):
    """The direction of the neighbour with the least cost; `first` if several have it."""
    best = least(cost)
    neighbour = {WEST: west, EAST: east}
    return np.select([neighbour[first](cost) <= best, north(cost) <= best, south(cost) <= best],
                     [np.float32(first), np.float32(NORTH), np.float32(SOUTH)], np.float32(last))


def front(turn, cells):
    """The cells two ahead of those that turn, and so many around them."""
    ahead = np.zeros_like(turn)
    for direction, shift in ((NORTH, shift_north), (SOUTH, shift_south), (EAST, shift_east), (WEST, shift_west)):
        ahead = np.maximum(ahead, shift(shift(as_number(turn == direction))))
    return around(ahead, cells)


def widened(moving, ahead):
    """The footprint of a moving object, one cell wider at the sides."""
    across = (north, south) if ahead in (shift_west, shift_east) else (east, west)
    return np.maximum(moving, np.maximum(across[0](moving), across[1](moving)))


def pocket_of(moving, ahead):
    """The pocket of a moving object: runs ahead of its footprint by one cell."""
    return ahead(np.maximum(widened(moving, ahead), ahead(moving)))


def long_pocket_of(moving, ahead, cells):
    """The footprint, two cells longer, so many cells ahead."""
    wide = widened(moving, ahead)
    pocket = np.maximum(np.maximum(wide, ahead(wide)), ahead(ahead(moving)))
    for _ in range(cells):
        pocket = ahead(pocket)
    return pocket


def as_number(truth):
    return truth.astype(np.float32)


class Sort:
    def __init__(self, shape):
        # The border ring is a wall. Its cells know it: they miss a neighbour. The others know which wall is nearer.
        ones = np.ones(shape, np.float32)
        self.inside, self.wall_east, self.wall_west = least(ones), 1 - east(ones), 1 - west(ones)
        from_east = self.inside * np.arange(shape[1], 0, -1, np.float32)
        self.west_half = as_number(self.inside * np.arange(1, shape[1] + 1, dtype=np.float32) < from_east)
        from_wall = np.zeros(shape, np.float32)
        for _ in range(max(shape)):
            from_wall = self.inside * (1 + least(from_wall))
        self.highest_lift = np.clip(np.float32(BANK) * (from_wall - SHORE), 0, MAX_LIFT)
        self.largest = np.full(shape, 3, np.float32)
        self.way_small, self.way_large, self.heat_small, self.heat_large = np.zeros((4, *shape), np.float32)
        self.stay, self.plight, self.call, self.pin = np.zeros((4, *shape), np.float32)

    def heights(self, proximity, proximity_hit):
        inside = self.inside

        # (a) Sensor data: the footprint of whatever lies on the surface. A sensor that three neighbours contradict
        # has missed the object or is dead; one that all four contradict reports an object that is not there.
        hit = proximity_hit * inside
        covered = north(hit) + south(hit) + east(hit) + west(hit)
        sensed = as_number((hit * covered > 0) | (covered > 2))

        # Where objects touch, the lower of their undersides, which the sensors see, has a ridge; the underside of one sphere
        # has none. Ridges part the footprints. A height that all eight neighbours contradict is overruled, and so is a
        # ridge of a single cell: the sensor is wrong, or the pin is not where it should be.
        underside = np.where(sensed != 0, hit * (self.pin + proximity), NOTHING)
        underside = np.clip(underside, np.minimum(least(underside), least_diagonal(underside)),
                            np.maximum(greatest(underside), greatest_diagonal(underside)))
        ridges = sensed * (ridge(underside, east, west) | ridge(underside, north, south))
        parted = sensed - ridges * np.maximum(greatest(ridges), greatest_diagonal(ridges))

        # (b) Erosion by one cell takes the rim away.
        eroded = np.minimum(parted, least(parted))

        # (c) Count the steps from the rim to the centre; a diagonal one counts 1.4.
        steps = np.where(eroded != 0, np.float32(MAX_STEPS), parted)
        for _ in range(MAX_STEPS):
            steps = np.minimum(steps, parted * np.minimum(least(steps) + 1, least_diagonal(steps) + np.float32(1.4)))

        # (d) The largest number of steps in an object is its size. The object's core has it.
        highest = greatest(steps)
        core = parted * (steps >= np.maximum(highest, greatest_diagonal(steps)))
        size = core * steps

        # (e) Dilation from the core, down the steps, to the whole footprint. Objects that touch part where the steps are
        # fewest.
        slope, uphill = sensed - core, []
        for neighbour in (north, south, east):
            uphill.append((slope * (neighbour(steps) == highest), neighbour))
            slope = slope - uphill[-1][0]
        uphill.append((slope, west))
        found = told(size, core, uphill)

        # (f) Small objects move west, large ones east. The largest size spreads from cell to cell.
        largest = np.maximum(self.largest, greatest(self.largest))
        self.largest = np.maximum(largest - np.float32(DECAY), np.minimum(size, largest + np.float32(GROWTH)))
        large = as_number(found > np.float32(SHARE) * self.largest)
        small = sensed - large

        # Whoever has arrived at the wall halts, and so does the queue behind it: pushed on, they would climb out.
        halt_small = heard(small * (west(inside) == 0), small, MAX_QUEUE)
        halt_large = heard(large * (east(inside) == 0), large, MAX_QUEUE)

        # In the east, large objects wait for small ones that come towards them.
        ahead = (small - halt_small) * (1 - self.west_half)
        for _ in range(NEAR):
            ahead = np.maximum(ahead, east(ahead))
        halt = np.maximum(np.maximum(halt_small, halt_large), heard(large * ahead, large, BEHIND))

        # The others take the shortest way round places where one of their kind stalled.
        self.way_small = way(self.way_small, 1 + WALL * (1 - inside - self.wall_west) + self.heat_small)
        self.way_large = way(self.way_large, 1 + WALL * (1 - inside - self.wall_east) + self.heat_large)
        turn = core * (1 - halt) * np.where(large != 0, downhill(self.way_large, EAST, WEST),
                                            downhill(self.way_small, WEST, EAST))

        # A small object that stalls in the east calls large ones away, louder and louder. One that hangs over the wall
        # calls at once.
        self.stay = (self.stay + 1) * around(as_number(turn > 0), 1)
        stalled = self.stay > PATIENCE
        self.plight = around(as_number(small * turn > 0), 1) * np.clip(
            around(self.plight, 1) + np.where(stalled, np.float32(1), np.float32(-1)), 0, FARTHEST * LOUDER)
        self.call = np.maximum(self.plight * (1 - self.west_half) / LOUDER, greatest(self.call) - 1)
        self.call = np.maximum(self.call, ALARM * (1 - inside) * proximity_hit)
        turn = np.where(core * large * (self.call > 0) != 0, downhill(self.call + WALL * (1 - inside), WEST, EAST), turn)

        # Where an object stalls, the cells ahead of it become dearer for its kind, so that it looks for another way.
        heating, cooling = np.float32(HEATING), np.float32(COOLING)
        self.heat_small = np.maximum(self.heat_small - cooling, 0) + heating * front(small * (turn * stalled), 1)
        self.heat_large = np.maximum(self.heat_large - cooling, 0) + heating * front(large * (turn * stalled), 2)

        # (g) Actuators: pockets go down, everything else up. Who moves has a pocket that runs ahead of its footprint, by
        # one cell, large ones to the east by three and small ones to the west by two, so that the pins behind it push; who
        # halts sinks into one that surrounds it. Under objects so tall that they reach over the wall the whole table is lower.
        turn = told(turn, core, uphill)
        pocket = around(sensed * (turn == 0), 1)
        for direction, shift in ((WEST, shift_west), (EAST, shift_east), (NORTH, shift_north), (SOUTH, shift_south)):
            moving = as_number(turn == direction) * {EAST: small, WEST: large}.get(direction, 1)
            pocket = np.maximum(pocket, pocket_of(moving, shift))
        pocket = np.maximum(pocket, long_pocket_of(large * (turn == EAST), shift_east, 2))
        pocket = np.maximum(pocket, long_pocket_of(small * (turn == WEST), shift_west, 1))
        level = np.clip(TALLEST - self.largest, np.float32(0), DOWN)
        height = level + np.where(pocket != 0, np.float32(0), RISE)

        # Where a large object has stalled, the table rises round it, so that stuck pins stand out less. It does not at the
        # wall, over which objects would roll, nor under objects so tall.
        lift = level * np.minimum(np.float32(LIFTING) * around(self.heat_large, ROUND), self.highest_lift)
        for _ in range(ROUND):
            lift = np.maximum(lift, greatest(lift) - np.float32(RAMP))
        height = height + lift

        # Pins are led, so that fast ones do not throw the spheres. No sensor tells how far up a pin is: it is where it is led
        # to.
        self.pin = self.pin + np.clip(height - self.pin, -SINKING, RAISING)
        return self.pin


def run(name, timeout=10.0):
    with shm_protocol.Controller(name, timeout) as table:
        sort = Sort((table.description.rows, table.description.columns))
        while table.wait():
            table.actuators["height"][:] = sort.heights(table.sensors["proximity"], table.sensors["proximity_hit"])
            table.publish()


if __name__ == "__main__":
    try:
        run(sys.argv[1] if len(sys.argv) > 1 else "surface")
    except shm_protocol.Error as error:
        sys.exit(error.report())
