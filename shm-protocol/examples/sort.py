"""The case study (scripts/case-study/sort.aps) in NumPy: the same stages under the same names, bit-identical.

    smartsurf run scripts/case-study/sort.lua        python3 sort.py [SURFACE]
"""
import sys

import numpy as np
import shm_protocol

DOWN, RISE, TALLEST = np.float32(1), np.float32(2), np.float32(5)
SINKING, RAISING, RIDGE = np.float32(0.2), np.float32(0.08), np.float32(0.5)
REACH, GROWTH, RATE = 8, np.float32(0.01), np.float32(0.1)
NEAR, PATIENCE, HIGHEST, WALL = 6, np.float32(120), 3, 1000
NOTHING = np.float32(20)  # an underside that is higher than any
WEST, EAST, NORTH, SOUTH = 1, 2, 3, 4


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


def wider(image):
    return np.maximum(image, greatest(image))


def average(image):
    """The mean of a cell and its four neighbours; beyond the edge the cell itself counts."""
    wide = np.pad(image, 1, mode="edge")
    return (image + ((wide[1:-1, :-2] + wide[1:-1, 2:]) + (wide[:-2, 1:-1] + wide[2:, 1:-1]))) / np.float32(5)


def downhill(cost):
    """The direction of the neighbour with the least cost."""
    best = least(cost)
    return np.select([west(cost) <= best, east(cost) <= best, north(cost) <= best],
                     [np.float32(WEST), np.float32(EAST), np.float32(NORTH)], np.float32(SOUTH))


def ahead(turn):
    """Directions, one cell ahead of where they are."""
    moves = ((WEST, shift_west), (EAST, shift_east), (NORTH, shift_north), (SOUTH, shift_south))
    return np.maximum.reduce([direction * shift(as_number(turn == direction)) for direction, shift in moves])


def broad(turn):
    """Directions, and one cell to their sides."""
    level = turn * (turn < NORTH)
    across = turn - level
    return np.maximum.reduce([turn, north(level), south(level), east(across), west(across)])


def as_number(truth):
    return truth.astype(np.float32)


class Sort:
    def __init__(self, shape):
        # The border ring is a wall. Its cells know it: they miss a neighbour.
        ones = np.ones(shape, np.float32)
        self.inside, self.goal_small, self.goal_large = least(ones), 1 - west(ones), 1 - east(ones)
        self.largest, self.high, self.low = np.full(shape, 3, np.float32), ones, 0.5 * ones
        self.found, self.way_small, self.way_large, self.from_wall = np.zeros((4, *shape), np.float32)
        self.halt_small, self.halt_large, self.ahead = np.zeros((3, *shape), np.float32)
        self.stay, self.plight, self.posts, self.near_large, self.underside = np.zeros((5, *shape), np.float32)
        self.pin = np.full(shape, DOWN + RISE, np.float32)  # at once, before the dropped spheres come down

    def heights(self, proximity, proximity_hit):
        inside = self.inside

        # (a) Sensor data; a cell that its neighbours contradict is overruled. Where objects touch, their undersides have
        # a ridge, which parts their footprints.
        hit = proximity_hit * inside
        covered = north(hit) + south(hit) + east(hit) + west(hit)
        sensed = as_number((hit * covered > 0) | (covered > 2))
        underside = np.where(sensed != 0, hit * (self.pin + proximity), NOTHING)
        underside = np.clip(underside, np.minimum(least(underside), least_diagonal(underside)),
                            np.maximum(greatest(underside), greatest_diagonal(underside)))
        falling = np.clip(underside - self.underside, -RAISING, 0)
        self.underside = underside
        ridges = sensed * (ridge(underside, east, west) | ridge(underside, north, south))
        parted = sensed - ridges * np.maximum(greatest(ridges), greatest_diagonal(ridges))

        # (b) Erosion by one cell takes the rim away.
        eroded = np.minimum(parted, least(parted))

        # (c) Count the steps from the rim to the centre; a diagonal one counts 1.4.
        steps = np.where(eroded != 0, np.float32(REACH), parted)
        for _ in range(REACH):
            steps = np.minimum(steps, parted * np.minimum(least(steps) + 1, least_diagonal(steps) + np.float32(1.4)))

        # (d) The largest number, in the object's core, is its size.
        highest = greatest(steps)
        core = parted * (steps >= np.maximum(highest, greatest_diagonal(steps)))
        size = core * np.maximum(steps, self.found - 2 * GROWTH)

        # (e) Dilation from the core, down the steps, to the whole footprint.
        uphill = [neighbour(steps) == highest for neighbour in (north, south, east)]

        def told(news):
            said = core * news
            for _ in range(REACH):
                said = sensed * np.select([core != 0, *uphill], [said, north(said), south(said), east(said)],
                                          west(said))
            return said

        self.found = told(size)

        # (f) Small objects move west, large ones east. The mean sizes of both kinds are shares of the largest seen.
        largest = wider(self.largest)
        self.largest = np.maximum(largest - GROWTH / np.float32(5), np.minimum(core * steps, largest + GROWTH))
        large = as_number(self.found > (self.high + self.low) / 2 * self.largest)
        small = as_number(self.found > 0) - large
        for _ in range(4):
            self.high, self.low = average(self.high), average(self.low)
        self.high = self.high + RATE * core * large * (size / self.largest - self.high)
        self.low = self.low + RATE * core * small * (size / self.largest - self.low)
        self.way_small = 1 + self.posts + least(self.way_small) + WALL * (1 - inside - self.goal_small)
        self.way_large = 1 + self.posts + least(self.way_large) + WALL * (1 - inside - self.goal_large)
        self.from_wall = inside * (1 + least(self.from_wall))

        # Who has arrived halts, with the queue behind; large ones also before small ones.
        eastern = as_number(self.way_small > self.way_large)
        self.halt_small = small * np.maximum(REACH * (self.way_small < 3), greatest(self.halt_small) - 1)
        self.ahead = np.maximum(NEAR * small * eastern * (self.halt_small <= 0), east(self.ahead) - 1)
        stops = (self.way_large < 3) | (self.ahead > 0)
        self.halt_large = large * np.maximum(REACH * stops, greatest(self.halt_large) - 1)

        # Small ones go round large ones. Who is stalled goes away from the wall first, and is lifted over stuck pins; where
        # it cannot go then costs more and more. Near the wall only who finds no way is lifted.
        self.near_large = np.maximum(NEAR * large, greatest(self.near_large) - 1)
        away = 2 * wider(self.plight) * np.minimum(self.from_wall, REACH)
        turn = np.where(large != 0, downhill(self.way_large - away), downhill(self.way_small - away + self.near_large))
        turn = core * turn * ((self.halt_small <= 0) & (self.halt_large <= 0))
        moving = wider(as_number(turn > 0))
        self.stay = (self.stay + 1) * moving
        change = (as_number(self.stay > PATIENCE) - np.float32(0.5)) / PATIENCE
        self.plight = moving * np.clip(wider(self.plight) + change, 0, 1)
        self.posts = self.posts + as_number(ahead(turn * (self.plight >= 1)) > 0) / PATIENCE
        room = np.clip(told(self.from_wall - size + least(self.posts)), 0, HIGHEST)
        lift = np.minimum(wider(wider(wider(told(np.minimum(HIGHEST * self.plight, room))))),
                          np.where(sensed != 0, room, np.float32(HIGHEST)))

        # (g) Actuators: pockets ahead of who moves and around who halts are down, others up. Pins are led, so that fast
        # ones do not throw the spheres, and rise by as much less as what is above them falls. No sensor tells how far up
        # a pin is: it is where it is led to.
        turn = told(turn)
        run = turn * np.where(large != 0, turn == EAST, turn == WEST)
        start = np.maximum(run * small, ahead(run * large))
        front, aside = ahead(broad(start)), turn - run
        pocket = np.maximum.reduce([wider(sensed * (turn == 0)), front, ahead(np.maximum(front, ahead(ahead(start)))),
                                    ahead(np.maximum(broad(aside), ahead(aside)))])
        level = np.clip(TALLEST - self.largest, np.float32(0), DOWN)
        height = level + level * lift + np.where(pocket != 0, level * lift / np.float32(3), RISE)
        self.pin = self.pin + np.clip(height - self.pin, -SINKING, RAISING + falling)
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
