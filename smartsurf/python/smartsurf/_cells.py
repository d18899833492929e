"""How the cells answer their commands: least squares of what the experiment does against what the table did.

The law is the simulator's own: a re-run of the commands gives the heights and, with one parameter changed at a time, their
derivatives. Cells do not disturb each other, so one re-run has the derivatives of all cells by their own gains, or offsets.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from . import _residuals
from ._recorded import Array
from ._rerun import HEIGHT, Rerun

SHARED = ("max_speed", "max_acceleration", "lag")  # of all cells
LONGEST_DELAY = 12                                 # ticks
_NEAR = 0.03                                       # of gains
_UNKNOWN_GAIN = 0.1                                # a standard error beyond which a cell is not fitted
# FROZEN: the sensor always says the same; IDLE: hardly commanded; UNSURE: its gain or delay stays open
GOOD, STUCK, FROZEN, IDLE, UNSURE = range(5)
STATES = ("good", "stuck", "frozen", "idle", "unsure")


@dataclass
class CellFit:
    """What is known of the cells of one channel; arrays of rows × columns. An error of 0: not identified."""
    channel: str
    state: Array                              # GOOD, …
    gain: Array
    gain_error: Array
    offset: Array
    offset_error: Array
    delay: Array                              # ticks
    delay_sure: Array                         # the next best delay fits worse by more than chance
    noise: Array                              # standard deviation of the residual
    level: Array                              # mean reading, of cells that are stuck or frozen
    shared: dict[str, tuple[float, float]]    # value and standard error
    unknown: dict[str, str]                   # name and why it is not identified
    of_cells: dict[str, tuple[Array, Array]]  # the shared ones by cell, each from its own readings alone, with their errors
    samples: int = 0
    outliers: int = 0
    residuals: _residuals.Residuals | None = None  # of the cells that are good
    predicted: list[Array] = field(default_factory=list)  # by recording


class _Problem:
    """Readings of all recordings one after the other, frames × cells, and re-runs in the same form."""

    def __init__(self, rerun: Rerun, channel: str, prefix: str, readings: Sequence[Array]):
        self.rerun, self.channel, self.prefix = rerun, channel, prefix
        self.y = np.concatenate([r.reshape(len(r), -1) for r in readings]).astype(np.float64)
        self.lengths = [len(r) for r in readings]
        self.cells = self.y.shape[1]
        self.shape = readings[0].shape[1:]
        self.use = np.isfinite(self.y)
        self.y[~self.use] = 0
        # A sensor that misses says 0, between readings that are not near 0.
        middle = np.median([self.y[:-2], self.y[1:-1], self.y[2:]], axis=0)
        self.noise = 1.4826 * np.median(np.abs(np.diff(self.y, axis=0)), axis=0) + 1e-9
        self.use[1:-1] &= (self.y[1:-1] != 0) | (np.abs(middle) < 6 * self.noise)
        known = np.all([self.use[k:len(self.use) - 5 + k] for k in range(6)], axis=0)  # where nothing is known y is 0
        self.fastest = np.where(known, np.abs(middle[3:] - middle[:-3]) / 3, np.nan)

    def gain_error(self, heights: Array) -> Array:
        """The standard error of each cell's gain, with the longest delay; large where a cell hardly moves while it is read."""
        late = self.late(heights, np.full(self.cells, LONGEST_DELAY))
        count = np.maximum(self.use.sum(0), 1)
        away = (late - (late * self.use).sum(0) / count) * self.use
        return np.asarray(self.noise / np.sqrt((away ** 2).sum(0) + 1e-30))

    def heights(self, shared: Array, gain: Array, offset: Array) -> Array:
        """Without delay. shared: speed, acceleration, lag."""
        values = {self.prefix + name: max(value, 1e-9) if name != "lag" else value for name, value in zip(SHARED, shared)}
        values[f"faults.{self.channel}.gain"] = gain.reshape(self.shape)
        values[f"faults.{self.channel}.offset"] = offset.reshape(self.shape)
        return np.concatenate([out[HEIGHT].reshape(-1, self.cells) for out in self.rerun.run(values)]).astype(np.float64)

    def late(self, heights: Array, delay: Array) -> Array:
        """The same, each cell late by its delay, ticks. Before a recording's first frame its first height holds."""
        out = np.empty_like(heights)
        begin = 0
        for length in self.lengths:
            part = heights[begin:begin + length]
            for ticks in np.unique(delay):
                cells = delay == ticks
                late = np.maximum(np.arange(length) - ticks, 0)
                out[begin:begin + length, cells] = part[late][:, cells]
            begin += length
        return out


def _inverse(of: Array) -> Array:
    """The inverses of 2 × 2 positive matrices; large ones of singular matrices. LAPACK would start its threads for each of them."""
    (a, b), (c, d) = of[:, 0].T, of[:, 1].T
    inverse: Array = np.array([[d, -b], [-c, a]]).transpose(2, 0, 1) / np.maximum(a * d - b * c, 1e-12 * a * d)[:, None, None]
    return inverse


def _line(x: Array, y: Array, use: Array) -> tuple[Array, Array, Array]:
    """Slope, intercept and sum of squares of y over x, of each column."""
    n = np.maximum(use.sum(0), 1)
    mx, my = (x * use).sum(0) / n, (y * use).sum(0) / n
    dx, dy = (x - mx) * use, (y - my) * use
    slope = (dx * dy).sum(0) / np.maximum((dx * dx).sum(0), 1e-12)
    return slope, my - slope * mx, ((dy - slope * dx) ** 2).sum(0)


def fit_cells(rerun: Rerun, channel: str, prefix: str, readings: Sequence[Array]) -> CellFit:
    """Fits the cells of the channel. prefix: of the actuator's parameters. readings: heights by recording, NaN: unknown."""
    problem = _Problem(rerun, channel, prefix, readings)
    y, use, cells = problem.y, problem.use, problem.cells
    commands = np.concatenate([r.commands[channel].reshape(r.frames, -1) for r in rerun.recordings]).astype(np.float64)
    count = np.maximum(use.sum(0), 1)
    level = (y * use).sum(0) / count
    spread = np.sqrt((((y - level) * use) ** 2).sum(0) / count)
    state = np.where(np.ptp(commands, axis=0) == 0, IDLE, GOOD)
    state[(spread < 1e-9) & (state == GOOD)] = FROZEN
    declared = np.array([np.ravel(rerun.simulation.get_parameter(prefix + name))[0] for name in SHARED])
    shared, gain, offset, delay = _start(problem, declared, state)
    nothing = _line(np.zeros_like(y), y, use)[2]
    heights = problem.heights(shared, np.ones(cells), np.zeros(cells))
    state[(state == GOOD) & (problem.gain_error(heights) > _UNKNOWN_GAIN)] = IDLE
    moved = problem.late(heights, delay)
    stuck = (_line(moved, y, use)[2] > 0.9 * nothing) & (state == GOOD)
    state[stuck] = STUCK
    limits = next(c for c in rerun.simulation.actuator_channels if c.name == channel)
    level[stuck] = np.clip(level[stuck], limits.minimum, limits.maximum)
    good = state == GOOD
    fit = CellFit(channel, state, gain, np.zeros(cells), offset, np.zeros(cells), delay, np.zeros(cells, bool), spread, level,
                  {}, {}, {})
    if good.any():
        _Search(problem, fit, shared, good).search()
    else:
        fit.unknown.update(dict.fromkeys(SHARED, "no cell answers its commands"))
    for name, value in list(vars(fit).items()):
        if isinstance(value, np.ndarray):
            setattr(fit, name, value.reshape(problem.shape))
    return fit


def _start(problem: _Problem, declared: Array, state: Array) -> tuple[Array, Array, Array, Array]:
    """The best of a few speeds, accelerations and lags, with the line through the readings of each cell."""
    y, use, cells = problem.y, problem.use, problem.cells
    good = state == GOOD
    period = problem.rerun.recordings[0].period_s
    fast = problem.fastest[:, good & np.isfinite(problem.fastest).any(0)]
    fastest = np.median(np.nanquantile(fast, 0.97, axis=0)) / period if fast.size else declared[0]
    speed = float(np.clip(fastest, 0.05 * declared[0], 20 * declared[0]))
    whole = _line(np.zeros_like(y), y, use)[2]
    best = (np.inf, declared, np.ones(cells), np.zeros(cells), np.zeros(cells, int))
    for factor in (0.25, 0.5, 1, 2):
        for lag in (0, 1, 2, 3, 4.5):
            shared = np.array([speed, declared[1] * factor, lag * period])
            moved = problem.heights(shared, np.ones(cells), np.zeros(cells))
            lines = [_line(problem.late(moved, np.full(cells, d)), y, use) for d in range(LONGEST_DELAY + 1)]
            squares = np.array([line[2] for line in lines])
            delay = squares.argmin(0)
            # A cell counts by how much of its motion is left over, not by how far it moves.
            cost = float(np.median((squares.min(0) / np.maximum(whole, 1e-12))[good])) if good.any() else 0.0
            if cost < best[0]:
                gain, offset = (np.array([line[k] for line in lines])[delay, np.arange(cells)] for k in (0, 1))
                best = (cost, shared, gain, offset, delay)
    _, shared, gain, offset, delay = best
    gain = np.where(good & (np.abs(gain - 1) < 0.9), gain, 1.0)
    return shared, gain, np.where(good, offset, 0.0), delay


class _Search:
    """Levenberg and Marquardt over the shared parameters' logarithms and each cell's gain and offset; the cells' own parameters
    are eliminated from the normal equations, which are then as small as the shared ones."""

    def __init__(self, problem: _Problem, fit: CellFit, shared: Array, good: Array):
        self.p, self.fit, self.good = problem, fit, good
        self.shared, self.started = shared.copy(), shared.copy()
        self.period = problem.rerun.recordings[0].period_s
        self.free = [0, 1, 2]
        self.base: Array
        self.slopes: list[Array]
        self.variance: Array
        self.use = problem.use & good
        span = np.ptp(problem.y[:, good]) or 1.0
        self.longest = (np.full(3, 2e-3), np.full(problem.cells, 2e-3), np.full(problem.cells, 1e-3 * span))
        self.steps = self.longest  # for derivatives, of the shared logarithms, gains and offsets
        self.delay_open: Array  # a delay that is not the neighbour of the best one fits as well
        self.by_delay: Array    # by how much gain and offset change with a neighbouring delay that fits as well
        self.residuals: _residuals.Residuals

    def search(self) -> None:
        if self.shared[2] <= 0:
            self.shared[2] = 0.5 * self.period
        self.levenberg_marquardt(most=4)
        self.set_outliers()
        for _ in range(4):
            self.drop_flat()
            cost = self.levenberg_marquardt(most=4)
            before = self.state()
            # Lag and delay stand for each other in part: the neighbouring delays, each with its own best lag.
            kept = True
            for step in (-1, 1):
                if (self.fit.delay + step)[self.good].max() < 0:
                    continue
                self.fit.delay = np.maximum(self.fit.delay + step, 0)
                other = self.levenberg_marquardt(choose=False, most=4)
                if other < cost - 9:
                    kept = False
                    break
                self.set_state(before)
            if kept:
                break
        self.try_dropped()
        for wide in (True, False):
            self.set_steps()
            self.search_cells(wide)
            self.set_outliers()
            self.levenberg_marquardt(most=6)
        self.search_cells()
        self.finish()

    def search_cells(self, wide: bool = False) -> None:
        """Levenberg and Marquardt for each cell by itself, with a damping of its own: one that is far off does not hold up the
        others, nor do they outvote it. wide: also from neighbouring delays and gains, between which there are minima of their own, and
        from where the middle one of the others is."""
        free, self.free = self.free, []
        best, self.base = self.lower_cells()
        middle = (self.p.y * self.use).sum(0) / np.maximum(self.use.sum(0), 1)
        near = [(d, g) for d in (0, -1, 1) for g in (0, -_NEAR, _NEAR) if (d, g) != (0, 0)]
        for start in [None, *near] if wide else []:
            before = self.fit.delay, self.fit.gain, self.fit.offset, self.base
            if start is None:
                self.fit.delay, self.fit.gain, self.fit.offset = (np.full_like(of, np.median(of[self.good])) for of in before[:3])
            else:
                later, more = start
                self.fit.delay = np.clip(self.fit.delay + later, 0, LONGEST_DELAY)
                self.fit.gain, self.fit.offset = self.fit.gain + more, self.fit.offset - more * middle
            squares, base = self.lower_cells()
            better = squares < best
            after = self.fit.delay, self.fit.gain, self.fit.offset, base
            self.fit.delay, self.fit.gain, self.fit.offset, self.base = (np.where(better, b, a) for a, b in zip(before, after))
            best = np.minimum(best, squares)
        self.free = free
        self.set_variance(self.base)
        self.slopes = self.derivatives()

    def lower_cells(self) -> tuple[Array, Array]:
        """The sums of squares that are left with these delays, and the heights."""
        damping = np.full(self.p.cells, 1e-3)
        base = self.heights()
        squares = self.squares(base)
        for _ in range(8):
            _, _, matrix, vector, _ = self.normal(base, self.derivatives())
            matrix = matrix + (damping[:, None, None] * matrix + 1e-12) * np.eye(2)
            step = np.zeros_like(vector)
            step[self.good] = np.linalg.solve(matrix[self.good], vector[self.good][..., None])[..., 0]
            gain, offset = self.fit.gain, self.fit.offset
            trial = self.heights(gain=gain + step[:, 0], offset=offset + step[:, 1])
            left = self.squares(trial)
            better = left < squares
            self.fit.gain, self.fit.offset = np.where(better, gain + step[:, 0], gain), np.where(better, offset + step[:, 1], offset)
            base = np.where(better, trial, base)
            damping = np.where(better, damping / 5, damping * 10)
            gained = ((squares - left) / np.maximum(self.variance, 1e-18))[better & self.good].max(initial=0)
            squares = np.minimum(squares, left)
            if gained < 1e-3:
                break
        return squares, base

    def try_dropped(self) -> None:
        """Adds the parameters that were dropped as flat: they may not be flat at the end of the search."""
        for i in [k for k in range(3) if k not in self.free]:
            before, free, unknown = self.state(), list(self.free), dict(self.fit.unknown)
            cost = self.likelihood()
            self.free = sorted([*free, i])
            del self.fit.unknown[SHARED[i]]
            # At its present value the motion may not depend on it, as on a speed limit far above all speeds.
            self.shared[i] = 0.5 * self.period if i == 2 else self.started[i]
            new = self.levenberg_marquardt(choose=False, most=8)
            self.drop_flat()
            if i not in self.free or new > cost - 9:
                self.set_state(before)
                self.free, self.fit.unknown = free, unknown

    def likelihood(self) -> float:
        """Minus twice the logarithm, each cell with a variance of its own, so that two fits compare."""
        return float((self.use.sum(0) * np.log(np.maximum(self.variance, 1e-18)))[self.good].sum())

    def state(self) -> tuple[Any, ...]:
        return self.fit.delay, self.shared.copy(), self.fit.gain, self.fit.offset, self.variance, self.base, self.slopes

    def set_state(self, state: tuple[Any, ...]) -> None:
        self.fit.delay, self.shared, self.fit.gain, self.fit.offset, self.variance, self.base, self.slopes = state
        self.shared = self.shared.copy()

    def heights(self, shared: Array | None = None, gain: Array | None = None, offset: Array | None = None) -> Array:
        return self.p.heights(self.shared if shared is None else shared, self.fit.gain if gain is None else gain,
                              self.fit.offset if offset is None else offset)

    def derivatives(self) -> list[Array]:
        """The derivatives of the heights by the logarithm of each free shared parameter, by gain and by offset; without delay."""
        shared, gain, offset = self.steps
        all_of_them = []
        for i in self.free:
            ends = [self.heights(shared=self.shared * np.exp(s * (np.arange(3) == i))) for s in (shared[i], -shared[i])]
            all_of_them.append((ends[0] - ends[1]) / (2 * shared[i]))
        for name, step in (("gain", gain), ("offset", offset)):
            ends = [self.heights(**{name: getattr(self.fit, name) + s}) for s in (step, -step)]
            all_of_them.append((ends[0] - ends[1]) / (2 * step))
        return all_of_them

    def set_steps(self) -> None:
        """Derivatives over as much as is not known: the motion bends where one limit takes over from another."""
        shared, own = self.errors()
        steps = [step.copy() for step in self.longest]
        steps[0][self.free] = np.minimum(steps[0][self.free], shared)
        steps[1:] = [np.where(self.good, np.minimum(steps[1 + k], own[:, k]), steps[1 + k]) for k in (0, 1)]
        self.steps = tuple(np.maximum(step, 1e-2 * longest) for step, longest in zip(steps, self.longest))

    def choose_delays(self, base: Array, own: list[Array]) -> None:
        """The delay of each cell that leaves least, after the best small change of its gain and offset."""
        squares, changes = [], []
        most = np.full(self.p.cells, _UNKNOWN_GAIN), 1e2 * self.longest[2]  # where hardly anything depends on them, the best change is no small one
        for d in range(LONGEST_DELAY + 1):
            delay = np.full(self.p.cells, d)
            r = (self.p.y - self.p.late(base, delay)) * self.use
            a, b = (self.p.late(k, delay) * self.use for k in own)
            aa, bb, ab = (a * a).sum(0), (b * b).sum(0), (a * b).sum(0)
            ra, rb = (r * a).sum(0), (r * b).sum(0)
            det = np.maximum(aa * bb - ab * ab, 1e-30)
            g, o = (np.clip(change / det, -m, m) for m, change in zip(most, (bb * ra - ab * rb, aa * rb - ab * ra)))
            changes.append((g, o))
            squares.append((r * r).sum(0) + np.minimum(g * (g * aa + 2 * o * ab - 2 * ra) + o * (o * bb - 2 * rb), 0))
        table = np.array(squares)
        self.fit.delay = table.argmin(0)
        ordered = np.sort(table, axis=0)
        dof = np.maximum(self.use.sum(0) - 2, 1)
        margin = 9 * ordered[0] / dof
        self.fit.delay_sure = ordered[1] - ordered[0] > margin
        apart = np.abs(np.arange(LONGEST_DELAY + 1)[:, None] - self.fit.delay)
        likely = table - ordered[0] <= margin
        self.delay_open = (likely & (apart > 1)).any(0)
        change = np.array(changes).transpose(0, 2, 1)  # delays × cells × 2
        at_best = change[self.fit.delay, np.arange(self.p.cells)]
        self.by_delay = np.where((likely & (apart == 1))[..., None], np.abs(change - at_best), 0).max(0)

    def normal(self, base: Array, slopes: list[Array]) -> tuple[Array, ...]:
        """Weighted normal equations: shared S, s; of cells C (cells × 2 × 2), c; between them M (cells × shared × 2)."""
        r = (self.p.y - self.p.late(base, self.fit.delay)) * self.use
        j = np.array([self.p.late(k, self.fit.delay) * self.use for k in slopes])
        n = len(self.free)
        w = np.where(self.good, 1 / np.maximum(self.variance, 1e-18), 0)
        s_matrix = np.einsum("ifc,jfc,c->ij", j[:n], j[:n], w)
        s_vector = np.einsum("ifc,fc,c->i", j[:n], r, w)
        c_matrix = np.einsum("ifc,jfc,c->cij", j[n:], j[n:], w)
        c_vector = np.einsum("ifc,fc,c->ci", j[n:], r, w)
        m_matrix = np.einsum("ifc,jfc,c->cij", j[:n], j[n:], w)
        return s_matrix, s_vector, c_matrix, c_vector, m_matrix

    def normal_inverse(self) -> tuple[Array, Array, Array]:
        """S, M and the inverse of C where the model stands; of cells that are not good 0."""
        s_matrix, _, c_matrix, _, m_matrix = self.normal(self.base, self.slopes)
        inverse = np.zeros_like(c_matrix)
        inverse[self.good] = _inverse(c_matrix[self.good] + 1e-12 * np.eye(2))
        return s_matrix, m_matrix, inverse

    def squares(self, base: Array) -> Array:
        r = (self.p.y - self.p.late(base, self.fit.delay)) * self.use
        total: Array = (r * r).sum(0)
        return total

    def set_variance(self, base: Array) -> None:
        n = np.maximum(self.use.sum(0) - 2 - len(self.free) / max(self.good.sum(), 1), 1)
        self.variance = self.squares(base) / n + 1e-14 * (1 + self.p.y ** 2).mean(0)

    def cost(self, base: Array) -> float:
        return float((self.squares(base) / np.maximum(self.variance, 1e-18))[self.good].sum())

    def solve(self, equations: tuple[Array, ...], damping: float) -> tuple[Array, Array]:
        s_matrix, s_vector, c_matrix, c_vector, m_matrix = equations
        n = len(s_vector)
        two = np.eye(2)
        c_damped = c_matrix + (damping * c_matrix + 1e-12) * two
        inverse = np.zeros_like(c_damped)
        inverse[self.good] = _inverse(c_damped[self.good])
        s_damped = s_matrix + damping * np.diag(np.diag(s_matrix)) + 1e-9 * np.eye(n)
        reduced = s_damped - np.einsum("cij,cjk,clk->il", m_matrix, inverse, m_matrix)
        right = s_vector - np.einsum("cij,cjk,ck->i", m_matrix, inverse, c_vector)
        step = np.linalg.solve(reduced, right) if n else np.zeros(0)
        own = np.einsum("cij,cj->ci", inverse, c_vector - np.einsum("cij,i->cj", m_matrix, step))
        return np.clip(step, -1, 1), own

    def levenberg_marquardt(self, choose: bool = True, most: int = 25) -> float:
        damping = 1e-3
        base = self.heights()
        self.set_variance(base)
        cost = self.cost(base)
        for iteration in range(most):
            slopes = self.derivatives()
            if choose:
                before = self.fit.delay
                self.choose_delays(base, slopes[-2:])
                if (before != self.fit.delay).any():
                    self.set_variance(base)
                    cost = self.cost(base)
            equations = self.normal(base, slopes)
            gained = 0.0
            while damping < 1e6:
                step, own = self.solve(equations, damping)
                held = self.shared.copy(), self.fit.gain, self.fit.offset
                self.shared[self.free] *= np.exp(step)
                self.fit.gain, self.fit.offset = held[1] + own[:, 0], held[2] + own[:, 1]
                trial = self.heights()
                new = self.cost(trial)
                if new <= cost:
                    gained, base, damping = cost - new, trial, max(damping / 5, 1e-6)
                    self.set_variance(base)
                    cost = self.cost(base)
                    break
                self.shared, self.fit.gain, self.fit.offset = held
                damping *= 5
            if gained < 0.05 and iteration > 0:
                break
        self.base, self.slopes = base, self.derivatives()
        return self.likelihood()

    def set_outliers(self) -> None:
        self.use = self.p.use & self.good
        r = self.p.y - self.p.late(self.base, self.fit.delay)
        scale = 1.4826 * np.array([np.median(np.abs(r[self.use[:, c], c])) if self.use[:, c].any() else 0
                                   for c in range(self.p.cells)])
        far = (np.abs(r) > 6 * np.maximum(scale, 1e-9)) & self.use
        # A model that is far off everywhere has no outliers.
        far[:, far.sum(0) > 0.2 * np.maximum(self.use.sum(0), 1)] = False
        self.use = self.use & ~far
        self.fit.outliers = int(far.sum())

    def errors(self, coloured: bool = False) -> tuple[Array, Array]:
        """Standard errors of the shared logarithms, and of each cell's gain and offset. coloured: with the residuals that were found;
        else they are white."""
        s_matrix, m_matrix, inverse = self.normal_inverse()
        n = len(self.free)
        reduced = s_matrix - np.einsum("cij,cjk,clk->il", m_matrix, inverse, m_matrix)
        covariance = np.linalg.pinv(reduced + 1e-9 * np.eye(n)) if n else np.zeros((0, 0))
        gain = np.einsum("cij,ckj->cik", inverse, m_matrix)  # cells × 2 × shared
        if coloured:
            meat = self.meat() * np.where(self.good, 1 / np.maximum(self.variance, 1e-18), 0)[:, None, None] ** 2
            out = np.concatenate([np.broadcast_to(np.eye(n), (len(gain), n, n)), -gain.transpose(0, 2, 1)], axis=2)
            covariance = covariance @ np.einsum("cij,cjk,clk->il", out, meat, out) @ covariance
            # What the readings do not depend on has no white error that is too small.
            inverse = np.where(np.eye(2), np.maximum(inverse, inverse @ meat[:, n:, n:] @ inverse), inverse)
        own = inverse + np.einsum("cij,jk,clk->cil", gain, covariance, gain)
        # Rounding can make the variance of a flat parameter negative.
        variance = np.diag(covariance)
        return np.sqrt(np.where(variance > 0, variance, np.inf)), np.sqrt(np.maximum(np.einsum("cii->ci", own), 0))

    def meat(self) -> Array:
        """JᵀΣJ of each cell for the slopes."""
        j = np.array([self.p.late(k, self.fit.delay) for k in self.slopes])
        return self.residuals.meat(j, self.use, self.p.late(self.base, self.fit.delay), self.variance)

    def set_residuals(self) -> None:
        good, late = self.good, self.p.late(self.base, self.fit.delay)
        self.residuals = _residuals.find(self.p.y[:, good], late[:, good], self.use[:, good], self.p.lengths, self.period, len(self.free))

    def clustered_errors(self) -> Array:
        """The larger one of the standard errors of the shared logarithms for which only cells, or only tenths of a second, are
        independent (sandwich, Huber 1967): one cell or instant that disobeys the model does not pass for many."""
        n = len(self.free)
        s_matrix, m_matrix, inverse = self.normal_inverse()
        own = np.einsum("cij,cjk->cik", m_matrix, inverse)
        r = (self.p.y - self.p.late(self.base, self.fit.delay)) * self.use
        j = np.array([self.p.late(k, self.fit.delay) * self.use for k in self.slopes])
        weighted = r * np.where(self.good, 1 / np.maximum(self.variance, 1e-18), 0)
        scores = (j[:n] - np.einsum("cik,kfc->ifc", own, j[n:])) * weighted
        bread = np.linalg.pinv(s_matrix - np.einsum("cij,cjl->il", own, m_matrix.transpose(0, 2, 1)) + 1e-9 * np.eye(n))
        tenths = np.arange(0, r.shape[0], max(round(0.1 / self.period), 1))
        clustered = [scores.sum(1), np.add.reduceat(scores, tenths, axis=1).sum(2)]
        largest: Array = np.max([np.sqrt(((bread @ sums) ** 2).sum(1)) for sums in clustered], axis=0)
        return largest

    def drop_flat(self) -> None:
        """Takes parameters out of the search on which the readings do not depend."""
        while self.free:
            errors, _ = self.errors()
            short = 2 in self.free and self.shared[2] < 0.1 * self.period
            worst = self.free.index(2) if short else int(errors.argmax())
            if not short and errors[worst] < 0.25:
                return
            self.drop(self.free[worst])

    def drop(self, i: int) -> None:
        self.fit.unknown[SHARED[i]] = ("no motion reached the greatest speed", "the motion does not depend on the acceleration",
                                       "too short for the readings, if any")[i]
        self.free.remove(i)
        if i == 2:
            self.shared[2] = 0
        self.base = self.heights()
        self.set_variance(self.base)
        self.slopes = self.derivatives()

    def lag_shows(self, errors: Array) -> bool:
        """Whether the motion without lag fits worse by more than chance, three times the errors: near 0 it depends on the square of the
        lag, so that its error there says little."""
        at = self.free.index(2)
        inflated = (errors[at] / self.errors()[0][at]) ** 2
        before, free, cost = self.state(), list(self.free), self.likelihood()
        self.shared[2] = 0
        self.free.remove(2)
        without = self.levenberg_marquardt(choose=False, most=6)
        self.free = free
        self.set_state(before)
        return bool(without - cost > 9 * max(inflated, 1))

    def finish(self) -> None:
        f, p = self.fit, self.p
        starts_count = True
        for last in (False, False, True):
            self.choose_delays(self.base, self.slopes[-2:])
            self.drop_flat()
            self.set_residuals()
            if starts_count and self.residuals.walks:
                starts_count = False
                self.leave_out_starts()
                self.levenberg_marquardt(most=6)
                self.set_residuals()
            errors, own = self.errors(coloured=True)
            own = np.hypot(own, self.by_delay)
            unsure = self.good & ((own[:, 0] > _UNKNOWN_GAIN) | self.gain_open() | self.delay_open)
            f.state[unsure] = UNSURE
            self.good = self.good & ~unsure
            if not self.good.any():
                f.unknown.update(dict.fromkeys(SHARED, "no cell saw enough steps"))
                f.gain_error = f.offset_error = np.zeros(p.cells)
                f.delay_sure = np.zeros(p.cells, bool)
                return
            if unsure.any() and not last:
                self.set_outliers()
                self.levenberg_marquardt(most=6)
                continue
            if 2 in self.free and not self.lag_shows(errors):
                self.drop(2)
                self.levenberg_marquardt(choose=False, most=6)
                self.set_residuals()
                errors, own = self.errors(coloured=True)
                own = np.hypot(own, self.by_delay)
            break
        if self.free:
            errors = np.maximum(errors, np.maximum(self.errors()[0], self.clustered_errors()))
        f.residuals = self.residuals
        f.shared = {SHARED[i]: (float(self.shared[i]), float(self.shared[i] * errors[k])) for k, i in enumerate(self.free)}
        f.gain_error, f.offset_error = np.where(self.good, own[:, 0], 0), np.where(self.good, own[:, 1], 0)
        f.gain, f.offset = np.where(self.good, f.gain, 1), np.where(self.good, f.offset, 0)
        f.noise = np.where(self.good, np.sqrt(self.variance), f.noise)
        f.samples = int(self.use.sum())
        self.by_cell()
        late = p.late(self.base, f.delay)
        begin = 0
        for length in p.lengths:
            f.predicted.append(late[begin:begin + length].reshape(length, *p.shape))
            begin += length

    def leave_out_starts(self) -> None:
        """Leaves out the first crossing of recordings that begin at rest at a limit, which cuts offsets off to one side: beside those of
        a walk all pins would start too far up."""
        speed, acceleration, lag = self.shared
        crossing = (np.ptp(self.base[:, self.good]) / speed + speed / acceleration + 5 * lag) / self.period
        frames, begin = int(np.ceil(crossing)) + int(self.fit.delay[self.good].max()), 0
        for recording, length in zip(self.p.rerun.recordings, self.p.lengths):
            if recording.from_start and frames < length / 2:
                self.use[begin:begin + frames] = self.p.use[begin:begin + frames] = False
            begin += length

    def gain_open(self) -> Array:
        """Where a far larger or smaller gain, with an offset to it, fits as well: the derivatives of a cell that just arrives as the
        recording ends are those of an arrival, but with any larger gain it is still on its way."""
        own = self.normal(self.base, self.slopes)[2]
        line = own[:, 0, 1] / np.maximum(own[:, 1, 1], 1e-12)
        best = self.squares(self.base)
        worse = [self.squares(self.heights(gain=self.fit.gain + step, offset=self.fit.offset - step * line)) - best
                 for step in (-_UNKNOWN_GAIN, _UNKNOWN_GAIN)]
        is_open: Array = np.min(worse, axis=0) < 4 * self.variance
        return is_open

    def by_cell(self) -> None:
        """One step of Newton from the common values, for each cell by itself."""
        n = len(self.free)
        if n == 0:
            return
        r = (self.p.y - self.p.late(self.base, self.fit.delay)) * self.use
        j = np.array([self.p.late(k, self.fit.delay) * self.use for k in self.slopes])
        matrix = np.einsum("ifc,jfc->cij", j, j) + 1e-12 * np.eye(n + 2)
        inverse = np.linalg.pinv(matrix)
        step = np.einsum("cij,cj->ci", inverse, np.einsum("ifc,fc->ci", j, r))
        error = np.sqrt(np.maximum(np.einsum("cii->ci", inverse @ self.meat() @ inverse), 0))
        for k, i in enumerate(self.free):
            value = self.shared[i] * np.exp(np.clip(step[:, k], -2, 2))
            known = self.good & (error[:, k] < 0.25)
            self.fit.of_cells[SHARED[i]] = (np.where(known, value, np.nan).reshape(self.p.shape),
                                            np.where(known, self.shared[i] * error[:, k], 0).reshape(self.p.shape))
