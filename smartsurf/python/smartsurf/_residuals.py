"""What the readings of cells are beside their model: white noise, rounding, and a random walk.

Readings that are multiples of a step much larger than their noise are wrong by as much for as long as a cell rests. With s the step,
σ the noise, and heights x between the multiples as they come, the mean error at x is a sum of waves of lengths s/k, k = 1, 2, …,
each of the variance s²/(2π²k²)·exp(−4π²k²σ²/s²); what is left of the error is white (Widrow and Kollár, Quantization Noise, 2008).
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize, special

from ._recorded import Array

_WAVES = 12
_COARSE = 0.7        # of the step: noise below it is found by maximum likelihood
_FIRST_DIFFERENCES_SHARE = 1.5  # first differences of white noise that estimate its variance as well as one independent number
_LEAST_WALK = 0.02   # of the variance of the residuals: what a walk adds to differences over a quarter of a recording


@dataclass
class Estimate:
    """A number with its standard error and 95 % interval."""
    value: float
    error: float
    low: float
    high: float

    @staticmethod
    def normal(value: float, error: float) -> "Estimate":
        return Estimate(value, error, value - 1.96 * error, value + 1.96 * error)

    @staticmethod
    def deviation(value: float, samples: int, quantum: float = 0.0) -> "Estimate":
        """The estimate of a standard deviation, by the χ² distribution; a quantum's share of the variance is subtracted."""
        samples = max(samples, 2)
        # Quantiles of χ² without scipy.stats, whose import takes longer than many a command.
        ends = [value ** 2 * samples / (2 * special.gammaincinv(samples / 2, p)) - quantum ** 2 / 12 for p in (0.975, 0.025)]
        own = value ** 2 - quantum ** 2 / 12
        root = [math.sqrt(max(v, 0)) for v in (own, *ends)]
        return Estimate(root[0], (root[2] - root[1]) / 3.92, root[1], root[2])

    def times(self, factor: float) -> "Estimate":
        return Estimate(*(factor * number for number in (self.value, self.error, self.low, self.high)))


def quantum(values: Array) -> float:
    """The step of which all values are multiples, or 0."""
    unique = np.unique(values)
    if len(unique) < 3 or len(unique) > len(values) / 8:
        return 0.0
    step = float(np.diff(unique).min())
    # The least difference is rounded to float32; that of the whole span is exact enough.
    step = float((unique[-1] - unique[0]) / np.rint((unique[-1] - unique[0]) / step))
    multiples = unique / step
    return step if step > 0 and np.abs(multiples - np.rint(multiples)).max() < 1e-2 else 0.0


@dataclass
class Residuals:
    """Of all cells. Variances in the square of the readings' unit."""
    step: float          # of which the readings are multiples, or 0
    noise: Estimate      # standard deviation before rounding; with a walk and a coarse step at most this
    walk: Estimate       # variance of a random walk after a second
    walks: bool          # there is one
    share: float         # of the variance of the residuals that is white
    waves: Array         # variance of each wave of the rounding error
    lengths: list[int]   # of the recordings
    period_s: float

    @property
    def is_coarse(self) -> bool:
        return self.noise.value < _COARSE * self.step

    def meat(self, slopes: Array, use: Array, x: Array, variance: Array) -> Array:
        """JᵀΣJ of each cell, cells × k × k, for k slopes by frame and cell and the covariance Σ of the residuals. variance: of
        the residuals, by cell."""
        j = slopes * use
        total = np.einsum("ifc,jfc,c->cij", j, j, variance * self.share)
        if self.walks:
            sums = _later(j, self.lengths)
            total += self.walk.value * self.period_s * np.einsum("ifc,jfc->cij", sums, sums)
        for k, amplitude in enumerate(self.waves, 1):
            for wave in (np.cos, np.sin):
                along = np.einsum("ifc,fc->ci", j, wave(2 * np.pi * k / self.step * x))
                total += amplitude * np.einsum("ci,cj->cij", along, along)
        return np.asarray(total)


def _later(of: Array, lengths: Sequence[int]) -> Array:
    """For each frame the sum over it and those after it in its recording: how an increment of a walk acts, which is 0 in the first frame."""
    sums, begin = np.zeros_like(of), 0
    for length in lengths:
        part = np.s_[:, begin:begin + length]
        sums[part] = np.flip(np.cumsum(np.flip(of[part], 1), 1), 1)
        sums[:, begin] = 0
        begin += length
    return sums


def _waves(step: float, sigma: float) -> Array:
    k = np.arange(1, _WAVES + 1)
    waves: Array = step ** 2 / (2 * (np.pi * k) ** 2) * np.exp(-4 * (np.pi * k * sigma / step) ** 2) if step > 0 else np.zeros(0)
    return waves[waves > 1e-3 * step ** 2 / 12]


def find(y: Array, x: Array, use: Array, lengths: Sequence[int], period_s: float, shared: int) -> Residuals:
    """What y − x is made of, frames × cells, where it counts. Of each cell a gain and an offset are fitted, and `shared` more."""
    r = (y - x) * use
    dof = max(int(use.sum()) - 2 * y.shape[1] - shared, 1)
    total = float((r * r).sum()) / dof
    step = quantum(y[use])
    noise = Estimate.deviation(math.sqrt(total), dof, step)
    if step > 0 and total < (_COARSE * step) ** 2:
        noise = noise_of_rounded(r, x, use, step)
    waves = _waves(step, noise.value)
    walk, near = _walk(r, x, use, lengths, period_s, step, waves)
    far = _far(lengths)
    added = walk.value * far * period_s
    walks = walk.value > 4 * walk.error and added > _LEAST_WALK * total and added > float(waves.sum()) / 2
    if walks:
        white = near - walk.value * period_s / 2
        if not noise.value < _COARSE * step:
            noise = Estimate.deviation(math.sqrt(max(white, 0)), int(dof / _FIRST_DIFFERENCES_SHARE), step)
            error = math.hypot(noise.error, walk.error * period_s / 4 / max(noise.value, 1e-9))
            noise = Estimate(noise.value, error, max(noise.value - 1.96 * error, 0), noise.value + 1.96 * error)
    else:
        white = total - float(waves.sum())
    share = float(np.clip(white / total, 1e-3, 1)) if total > 0 else 1.0
    return Residuals(step, noise, walk, walks, share, waves, list(lengths), period_s)


def _far(lengths: Sequence[int]) -> int:
    return max(max(lengths) // 4, 2)


def _walk(r: Array, x: Array, use: Array, lengths: Sequence[int], period_s: float, step: float, waves: Array) -> tuple[Estimate, float]:
    """The variance of a random walk after a second, as it makes distant residuals differ by more than neighbouring ones; and the
    variance that these have without rounding. What a cell's own gain and offset take of the walk is accounted for."""
    n = np.maximum(use.sum(0), 1)
    middle = (x * use).sum(0) / n
    j = np.array([np.ones_like(x), x - middle])
    scale = np.sqrt(np.maximum((j[1] ** 2 * use).sum(0), 1e-12) / n)
    j[1] /= scale  # orthogonal, and as large as 1
    sums = _later(j * use, lengths)
    both = np.einsum("ifc,jfc->cij", sums, sums) / n[:, None, None] ** 2
    until = np.cumsum(sums, 1) / n
    apart, growth = [], []
    for h in (1, _far(lengths)):
        squares, grown, count = (np.zeros(x.shape[1]) for _ in range(3))
        begin = 0
        for length in lengths:
            a, b = np.s_[begin:max(begin + length - h, begin)], np.s_[min(begin + h, begin + length):begin + length]
            begin += length
            pairs = use[a] & use[b]
            square = (r[b] - r[a]) ** 2
            for k, amplitude in enumerate(waves, 1):
                square = square - 2 * amplitude * (1 - np.cos(2 * np.pi * k / step * (x[b] - x[a])))
            moved = j[:, b] - j[:, a]
            own = h - 2 * (moved * (until[:, b] - until[:, a])).sum(0) + np.einsum("ifc,cij,jfc->fc", moved, both, moved)
            squares, grown, count = squares + (square * pairs).sum(0), grown + (own * pairs).sum(0), count + pairs.sum(0)
        apart.append(squares / np.maximum(count, 1))
        growth.append(grown * period_s / np.maximum(count, 1))
    more = growth[1] - growth[0]
    known = more > 0.5 * np.median(more)
    walk = ((apart[1] - apart[0])[known] / more[known]) if known.any() else np.zeros(1)
    return Estimate.normal(float(walk.mean()), float(walk.std() / math.sqrt(max(len(walk), 2)))), float(apart[0].mean()) / 2


def noise_of_rounded(r: Array, x: Array, use: Array, step: float) -> Estimate:
    """Maximum likelihood of the noise of rounded readings, r beside x, frames × cells. Rounding misplaces a cell's least squares by
    more than little noise: its line over x is of the likelihood, too."""
    n = np.maximum(use.sum(0), 1)
    z = x - (x * use).sum(0) / n
    z = z / np.sqrt(np.maximum((z * z * use).sum(0) / n, 1e-12))
    line = np.zeros((2, x.shape[1]))

    def terms(sigma: float) -> tuple[Array, ...]:
        m = r - line[0] - line[1] * z
        side = np.abs(m)
        upper, lower = (step / 2 - side) / sigma, (-step / 2 - side) / sigma
        share = special.ndtr(upper) - special.ndtr(lower)
        counts = use & (share > 1e-12)  # what is farther off is ignored
        share = np.where(counts, share, 1)
        dense = [np.exp(-0.5 * e * e) / math.sqrt(2 * math.pi) for e in (upper, lower)]
        slope = (dense[0] - dense[1]) / share / sigma  # of the logarithm, towards larger x
        bend = slope ** 2 + (upper * dense[0] - lower * dense[1]) / share / sigma ** 2
        return counts, share, np.where(counts, slope * np.sign(m), 0), np.where(counts, np.maximum(bend, 0), 0)

    def loss(sigma: float) -> float:
        for _ in range(3):
            _, _, slope, bend = terms(sigma)
            a, b, c = (bend * k for k in (1, z, z * z))
            a, b, c = a.sum(0) + 1e-6 / sigma ** 2, b.sum(0), c.sum(0) + 1e-6 / sigma ** 2
            p, q = slope.sum(0), (slope * z).sum(0)
            det = np.maximum(a * c - b * b, 1e-12 * a * c)
            line[:] += np.clip([(c * p - b * q) / det, (a * q - b * p) / det], -step / 8, step / 8)
        counts, share, _, _ = terms(sigma)
        return -float(np.log(share).sum()) + 27.6 * int((use & ~counts).sum())
    grid = step * np.geomspace(2, 0.05, 30)
    losses = [loss(sigma) for sigma in grid]
    near = int(np.argmin(losses))
    ends = sorted((grid[max(near - 1, 0)], grid[min(near + 1, len(grid) - 1)]))
    found = optimize.minimize_scalar(loss, bounds=ends, method="bounded", options={"xatol": 1e-4 * step})
    best, limit = float(found.x), float(found.fun) + 1.92
    # Where the likelihood falls by half the 95 % quantile of χ².
    high, low = (float(optimize.brentq(lambda sigma: loss(sigma) - limit, best, end, xtol=1e-4 * step)) if loss(end) > limit else beyond
                 for end, beyond in ((4 * step, 4 * step), (0.02 * step, 0.0)))
    # The lines take their share of the noise.
    return Estimate(best, (high - low) / 3.92, low, high).times(math.sqrt(n.sum() / max(n.sum() - 2 * len(n), 1)))
