"""Policies for an array of tactile pillars: low-frequency shapes of a patch around the load.

A policy commands the heights of 5×5 pillars around the object by the six lowest coefficients of their discrete cosine
transform, as ArrayBot does (arXiv 2306.16857). It observes loads, where the goal is, and the coefficients that it commanded.
`Patches` evaluates many of them in NumPy, `export` writes one as an APRON program.
"""
import numpy as np

HIDDEN = 4            # kinds of hidden units, each of which looks in four directions
FELT = 1.5            # a load below it is noise, kg·cm/s²
PLAY = 0.5            # the patch follows the load this far behind, in pillars, so that noise does not shake it
REACH = 3.5           # loads farther from the object, in pillars, are faults of sensors
DIRECTIONS = ((1, 0), (0, 1), (-1, 0), (0, -1))  # of columns and rows: east, south, west, north
INPUTS = ("goal ahead", "goal beside", "speed ahead", "tilt ahead", "height", "curvature ahead", "curvature beside",
          "load's spread ahead", "load's spread beside", "sine of the clock", "its cosine", "time", "sine by goal to the left")
OUTPUTS = ("tilt", "height", "curvature along", "curvature across")
LARGEST = 2           # coefficient, of half the travel
FAR = 3.0             # pillars: a goal is seen up to there
ROLLED = 2.5          # pillars: what has moved by them has rolled over a face
SETTLED = 1.05        # s, from which the object lies where it was set down
SIZES = (HIDDEN * (len(INPUTS) + 1), HIDDEN * len(OUTPUTS), 3)
PARAMETERS = sum(SIZES)  # 75


def bowl(lean, curvature, height):
    """The parameters of a bowl around the load that leans towards the goal: by the coefficient lean at FAR or more from it, with
    these coefficients of curvature and height."""
    weights, outputs = np.zeros((HIDDEN, len(INPUTS) + 1)), np.zeros((HIDDEN, len(OUTPUTS)))
    # Unit by unit, the coefficient of tilt, curvature or height goes to what it should be.
    weights[0, [INPUTS.index("goal ahead"), INPUTS.index("tilt ahead")]] = -lean / 2, -0.5
    weights[1, [INPUTS.index("curvature ahead"), -1]] = -1, curvature
    weights[2, [INPUTS.index("height"), -1]] = -1, height
    outputs[[0, 1, 2], [OUTPUTS.index(name) for name in ("tilt", "curvature along", "height")]] = 1, 0.5, 0.25
    return np.concatenate([weights.ravel(), outputs.ravel(), np.zeros(SIZES[2])])


def unpacked(vectors):
    """The parameters (population, PARAMETERS) as: weights of the hidden units and their biases (population, HIDDEN, INPUTS + 1),
    weights of the outputs (population, HIDDEN, OUTPUTS), and the biases of height and curvature and the weight of the
    twist (population, 3)."""
    a, b = SIZES[0], SIZES[0] + SIZES[1]
    vectors = np.asarray(vectors)
    return (vectors[:, :a].reshape(-1, HIDDEN, len(INPUTS) + 1), vectors[:, a:b].reshape(-1, HIDDEN, len(OUTPUTS)), vectors[:, b:])


class Patches:
    """Policies with these parameters, shape (population, PARAMETERS), each in the same number of worlds of a VectorEnv.

    travel: of the pillars, cm. period: of the clock, s. goal: 'lamp', below which it is; 'here', where the load was after a
    second; 'over', FAR from there along a row or a column, towards the middle of the table, and where the load is once it has
    ROLLED. level: outside the patch the heights continue those of its rim (None) or are this. step: the largest change of a
    coefficient in a tick, of half the travel. Its sums round otherwise than those of an APRON program, which suits a search."""

    def __init__(self, vectors, envs, travel, period, goal, level, step):
        self.weights, self.outputs, self.biases = unpacked(vectors)
        self.travel, self.period, self.kind, self.level, self.step = travel, period, goal, level, step
        self.dt = envs.period
        self.population, worlds = len(vectors), envs.num_envs
        self.rows, self.columns = np.mgrid[0:envs.rows, 0:envs.columns].astype(np.float32)
        names = [channel.name for channel in envs.sensor_channels]
        self.pressure, self.lamp = names.index("pressure"), names.index("goal_hit") if goal == "lamp" else None
        self.middle = np.array([(envs.columns - 1) / 2, (envs.rows - 1) / 2])
        # Positions of load, patch and goal, and of the load after a second.
        self.place, self.centre, self.target, self.start = (np.tile(self.middle, (worlds, 1)) for _ in range(4))
        self.over, self.speed = np.zeros(worlds, bool), np.zeros((worlds, 2))
        self.spread, self.reach, self.ticks = np.zeros((worlds, 2)), np.full(worlds, 16.0), 0
        # The patch's height, tilt and curvature along columns and rows, and twist. At first the pillars are down.
        self.height, self.twist = np.full(worlds, -1.0), np.zeros(worlds)
        self.tilt, self.curvature = np.zeros((worlds, 2)), np.zeros((worlds, 2))

    def _feel(self, observations):
        """Where the load is, in columns and rows, and its spread; where the goal is."""
        load = observations[:, self.pressure] - FELT
        away = np.stack([self.columns - self.place[:, 0, None, None], self.rows - self.place[:, 1, None, None]])
        load = np.where((load > 0) & (np.abs(away).max(axis=0) < self.reach[:, None, None]), load, 0)
        total = load.sum(axis=(1, 2))
        felt = total > FELT
        share = load / np.maximum(total, 1e-9)[:, None, None]
        moved = np.where(felt[:, None], (share * away).sum(axis=(2, 3)).T, 0)
        self.spread = np.where(felt[:, None], (share * away**2).sum(axis=(2, 3)).T - moved**2, self.spread)
        self.speed = 0.5 * self.speed + 0.5 * moved * (self.reach < 16)[:, None]
        self.place = self.place + moved
        self.centre = self.place - np.clip(self.place - self.centre, -PLAY, PLAY)
        self.reach = np.where(felt, REACH, 16.0)
        if self.kind == "lamp":
            lit = observations[:, self.lamp]
            count = lit.sum(axis=(1, 2))
            seen = np.stack([(lit * self.columns).sum(axis=(1, 2)), (lit * self.rows).sum(axis=(1, 2))]) / np.maximum(count, 1)
            self.target = np.where((count > 0)[:, None], seen.T, self.target)
        elif self.ticks * self.dt < SETTLED:
            self.target = self.start = self.place
        elif self.kind == "over":
            way = self.middle - self.start
            longer = np.abs(way) > np.abs(way[:, ::-1])
            longer[:, 1] = ~longer[:, 0]
            self.over |= ((self.place - self.start)**2).sum(axis=1) > ROLLED**2
            self.target = np.where(self.over[:, None], self.place, self.start + FAR * np.sign(way) * longer)

    def commands(self, observations):
        """One tick of all: worlds × planes × rows × columns → heights, worlds × 1 × rows × columns."""
        self._feel(observations)
        time = self.ticks * self.dt
        self.ticks += 1
        clock, ones = 2 * np.pi * time / self.period, np.ones(len(self.place))
        ahead, near = (np.clip((self.target - self.place) / far, -1, 1) for far in (FAR, 1))
        hidden = []
        for direction in DIRECTIONS:
            axis = 0 if direction[0] else 1
            sign, across = sum(direction), 1 - axis
            left = (sign if axis else -sign) * near[:, across]
            seen = np.stack([sign * ahead[:, axis], np.abs(ahead[:, across]), 2 * sign * self.speed[:, axis], sign * self.tilt[:, axis],
                             self.height, self.curvature[:, axis], self.curvature[:, across], self.spread[:, axis],
                             self.spread[:, across], ones * np.sin(clock), ones * np.cos(clock), ones * min(time / self.period, 1),
                             np.sin(clock) * left, ones], axis=1)
            seen = seen.reshape(self.population, -1, len(INPUTS) + 1)
            hidden.append(np.clip(np.einsum("psi,phi->psh", seen, self.weights), -1, 1))
        east, south, west, north = hidden
        # Each (population, seeds, outputs); the transposes below turn them to worlds.
        total = [np.einsum("psh,pho->pso", pair, self.outputs) for pair in (east + west, south + north)]
        odd = [np.einsum("psh,ph->ps", pair, self.outputs[:, :, 0]).ravel() for pair in (east - west, south - north)]
        bias = np.repeat(self.biases, len(self.place) // self.population, axis=0)
        change = np.stack(odd, axis=1)
        self.tilt = np.clip(self.tilt + self.step * np.clip(change, -1, 1), -LARGEST, LARGEST)
        height = (total[0] + total[1])[:, :, 1].ravel() + bias[:, 0]
        self.height = np.clip(self.height + self.step * np.clip(height, -1, 1), -LARGEST, LARGEST)
        curved = np.stack([(total[k][:, :, 2] + total[1 - k][:, :, 3]).ravel() + bias[:, 1] for k in (0, 1)], axis=1)
        self.curvature = np.clip(self.curvature + self.step * np.clip(curved, -1, 1), -LARGEST, LARGEST)
        self.twist = np.clip(bias[:, 2] * self.tilt[:, 0] * self.tilt[:, 1], -1, 1)
        return self._heights()[:, None].astype(np.float32)

    def _heights(self):
        away = [self.columns - self.centre[:, 0, None, None], self.rows - self.centre[:, 1, None, None]]
        u, v = (np.clip(a, -2, 2) * (np.pi / 5) for a in away)
        wide = lambda values: values[:, None, None]  # noqa: E731
        sine_u, sine_v = np.sin(u), np.sin(v)
        shape = (wide(self.height) + wide(self.tilt[:, 0]) * sine_u + wide(self.tilt[:, 1]) * sine_v
                 - wide(self.curvature[:, 0]) * np.cos(2 * u) - wide(self.curvature[:, 1]) * np.cos(2 * v)
                 + wide(self.twist) * sine_u * sine_v)
        heights = np.clip(self.travel / 2 * (1 + shape), 0, self.travel)
        if self.level is None:
            return heights
        inside = np.maximum(np.abs(away[0]), np.abs(away[1])) < 2.5
        return np.where(inside, heights, self.level)


# In the exported program, where the goal is, by its kind.
GOALS = {
    "lamp": """LOAD = surface.sense('goal_hit')
lit = globalsum(LOAD)
if(lit > 0)
  PART = LOAD * cell.x
  goal_x = globalsum(PART) / lit
  PART = LOAD * cell.y
  goal_y = globalsum(PART) / lit
endif
""",
    "here": f"""goal_x = select(surface.time < {SETTLED}, x, goal_x)
goal_y = select(surface.time < {SETTLED}, y, goal_y)
""",
    "over": f"""if(surface.time < {SETTLED})
  goal_x = x
  goal_y = y
  way_x = (SURFACE_WIDTH - 1) / 2 - x
  way_y = (SURFACE_HEIGHT - 1) / 2 - y
  along = abs(way_x) > abs(way_y)
  to_x = x + {FAR:g} * sign(way_x) * along
  to_y = y + {FAR:g} * sign(way_y) * (1 - along)
  from_x = x
  from_y = y
  over = 0
else
  over = max(over, (x - from_x) * (x - from_x) + (y - from_y) * (y - from_y) > {ROLLED * ROLLED:g})
  goal_x = select(over, x, to_x)
  goal_y = select(over, y, to_y)
endif
""",
}


def export(vector, path, title, travel, period, goal, level, step):
    """Writes the policy of one vector of parameters, shape (PARAMETERS,), as an APRON program. title: its first line, a comment.
    The other arguments are those of Patches."""
    weights, outputs, biases = (part[0] for part in unpacked(np.asarray(vector)[None]))
    seen = ("goal_ahead", "goal_beside", "speed_ahead", "tilt_ahead", "height", "curve_ahead", "curve_beside", "spread_ahead",
            "spread_beside", "sine", "cosine", "elapsed", "sway")
    units = [f"h{k}" for k in range(HIDDEN)]
    look = []
    for unit, row in zip(units, weights):
        terms = " + ".join(f"{name} * {_number(w)}" for name, w in zip(seen, row))
        look.append(f"{unit} = clamp({terms} + {_number(row[-1])}, -1, 1)")
    look += [f"{name} = " + " + ".join(f"{unit} * {_number(w)}" for unit, w in zip(units, outputs[:, k]))
             for k, name in enumerate(("to_tilt", "to_height", "to_along", "to_across"))]
    directions = []
    for name, (column, row) in zip(("east", "south", "west", "north"), DIRECTIONS):
        a, b = ("x", "y") if column else ("y", "x")
        sign = "" if column + row > 0 else "-"
        directions += [f"// {name}", f"goal_ahead = {sign}ahead_{a}", f"goal_beside = abs(ahead_{b})", f"speed_ahead = {sign}2 * speed_{a}",
                       f"tilt_ahead = {sign}tilt_{a}", f"curve_ahead = curve_{a}", f"curve_beside = curve_{b}",
                       f"spread_ahead = spread_{a}", f"spread_beside = spread_{b}",
                       f"sway = {'-' if column > row else ''}sine * near_{b}", "call(#look)",
                       f"change_{a} = change_{a} {'-' if sign else '+'} to_tilt", "rise = rise + to_height",
                       f"bend_{a} = bend_{a} + to_along", f"bend_{b} = bend_{b} + to_across"]
    outside = [] if level is None else [f"H = select(max(abs(U), abs(V)) < 2.5, H, {_number(level)})"]
    body = f"""LOAD = surface.sense('pressure') - FELT
U = cell.x - x
V = cell.y - y
LOAD = LOAD * (LOAD > 0 and abs(U) < reach and abs(V) < reach)
total = globalsum(LOAD)
moved_x = 0
moved_y = 0
if(total > FELT)
  PART = LOAD * U
  moved_x = globalsum(PART) / total
  PART = PART * U
  spread_x = globalsum(PART) / total - moved_x * moved_x
  PART = LOAD * V
  moved_y = globalsum(PART) / total
  PART = PART * V
  spread_y = globalsum(PART) / total - moved_y * moved_y
endif
speed_x = 0.5 * speed_x + 0.5 * moved_x * (reach < 16)
speed_y = 0.5 * speed_y + 0.5 * moved_y * (reach < 16)
x = x + moved_x
y = y + moved_y
centre_x = x - clamp(x - centre_x, -PLAY, PLAY)
centre_y = y - clamp(y - centre_y, -PLAY, PLAY)
reach = select(total > FELT, {REACH}, 16)
{GOALS[goal]}ahead_x = clamp((goal_x - x) / {FAR:g}, -1, 1)
ahead_y = clamp((goal_y - y) / {FAR:g}, -1, 1)
near_x = clamp(goal_x - x, -1, 1)
near_y = clamp(goal_y - y, -1, 1)
sine = math.sin({_number(2 * np.pi / period)} * surface.time)
cosine = math.cos({_number(2 * np.pi / period)} * surface.time)
elapsed = min(surface.time / {_number(period)}, 1)
rise = {_number(biases[0])}
bend_x = {_number(biases[1])}
bend_y = {_number(biases[1])}
change_x = 0
change_y = 0
""".splitlines() + directions + f"""tilt_x = clamp(tilt_x + {step} * clamp(change_x, -1, 1), -{LARGEST}, {LARGEST})
tilt_y = clamp(tilt_y + {step} * clamp(change_y, -1, 1), -{LARGEST}, {LARGEST})
height = clamp(height + {step} * clamp(rise, -1, 1), -{LARGEST}, {LARGEST})
curve_x = clamp(curve_x + {step} * clamp(bend_x, -1, 1), -{LARGEST}, {LARGEST})
curve_y = clamp(curve_y + {step} * clamp(bend_y, -1, 1), -{LARGEST}, {LARGEST})
twist = clamp(tilt_x * tilt_y * {_number(biases[2])}, -1, 1)
// The patch around the load: the lowest coefficients of a cosine transform of 5×5 pillars.
U = cell.x - centre_x
V = cell.y - centre_y
PART = {_number(np.pi / 5)} * clamp(U, -2, 2)
LOAD = {_number(np.pi / 5)} * clamp(V, -2, 2)
H = height + tilt_x * math.sin(PART) + tilt_y * math.sin(LOAD) + twist * math.sin(PART) * math.sin(LOAD)
H = H - curve_x * math.cos(2 * PART) - curve_y * math.cos(2 * LOAD)
H = clamp({_number(travel / 2)} + {_number(travel / 2)} * H, 0, {_number(travel)})
""".splitlines() + outside + ["surface.actuate('height', H)", "surface.step"]
    scalars = [f"{name}_{axis} = 0" for name in ("speed", "tilt", "curve", "spread") for axis in "xy"]
    lines = [
        f"// {title}", f"!define(FELT, {FELT})  // kg·cm/s²: a load below it is noise",
        f"!define(PLAY, {PLAY})  // pillars, by which the patch follows the load behind", "!register(LOAD, U, V, PART, H)", "",
        "x = (SURFACE_WIDTH - 1) / 2", "y = (SURFACE_HEIGHT - 1) / 2", "centre_x = x", "centre_y = y",
        "goal_x = x", "goal_y = y", "reach = 16", "height = -1", *scalars,
        "while(1)", *(f"  {line}" for line in body), "endwhile", "end", "",
        "// What the hidden units make of what is seen in one direction, and the outputs of it.", "#look", *look, "return"]
    with open(path, "w") as file:
        file.write("\n".join(lines) + "\n")


def _number(value):
    """The float32 value, exactly."""
    text = np.format_float_positional(np.float32(value), unique=True, trim="-")
    return f"({text})" if text.startswith("-") else text
