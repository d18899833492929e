"""What the sensors of a table add to what they sense, from recordings and re-runs."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import ndimage, optimize, special

from ._cells import FROZEN, GOOD, CellFit
from ._recorded import Array
from .success import wilson


_DIFFERENCES_SHARE = 35 / 18  # second differences of white noise that tell as much of its variance as one independent number


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

    @staticmethod
    def fraction(hits: int, of: int) -> "Estimate":
        low, high = wilson(hits, of)
        share = hits / max(of, 1)
        return Estimate(share, math.sqrt(share * (1 - share) / max(of, 1)), low, high)


@dataclass
class SensorFit:
    """Errors of a sensor. faults: row, column, channel, fault, value of single cells."""
    name: str
    values: dict[str, Estimate] = field(default_factory=dict)
    unknown: dict[str, str] = field(default_factory=dict)
    faults: list[tuple[int, int, str, str, float | None]] = field(default_factory=list)
    samples: int = 0


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


def fit_height_sensor(name: str, fit: CellFit, readings: Sequence[Array], period_s: float) -> SensorFit:
    """Noise, resolution, drift, misses and dead cells of the sensor of the heights."""
    out = SensorFit(name)
    good = fit.state == GOOD
    for row, column in np.argwhere(fit.state == FROZEN):
        level = float(fit.level[row, column])
        out.faults.append((int(row), int(column), name, *(("dead", None) if level == 0 else ("stuck", level))))
    if not good.any():
        out.unknown["noise"] = "no cell answers its commands"
        return out
    y = np.concatenate(readings)[:, good].astype(np.float64)
    r = y - np.concatenate(fit.predicted)[:, good]
    noise = np.maximum(fit.noise[good], 1e-9)
    known = np.isfinite(y)
    miss = known & (y == 0) & (np.abs(r) > 6 * noise)
    near = known & (np.abs(r) <= 6 * noise)
    out.samples = int(near.sum())
    # Where 0 is a reading of its own, a miss does not show.
    tellable = known & (np.abs(y - r) > 6 * noise)
    out.values["dropout"] = Estimate.fraction(int((miss & tellable).sum()), int(tellable.sum()))
    step = quantum(y[near])
    if step > 0:
        out.values["quantize"] = Estimate(step, 0.0, step, step)
    else:
        out.unknown["quantize"] = "the readings have no common step"
    r = np.where(near, r, np.nan)
    dof = out.samples - 2 * int(good.sum()) - len(fit.shared)
    spread = math.sqrt(np.nansum(r * r) / max(dof, 1))
    # A random walk makes distant residuals differ by more than neighbouring ones.
    far = max(len(r) // 4, 2)
    apart = [np.nanmean((r[h:] - r[:-h]) ** 2, axis=0) for h in (1, far)]
    walk = (apart[1] - apart[0]) / ((far - 1) * period_s)
    mean, error = float(walk.mean()), float(walk.std() / math.sqrt(max(len(walk), 2)))
    if mean > 4 * error and mean * far * period_s > 0.02 * spread ** 2:
        out.values["drift"] = Estimate(math.sqrt(mean), error / (2 * math.sqrt(mean)), math.sqrt(max(mean - 1.96 * error, 0)),
                                       math.sqrt(mean + 1.96 * error))
        spread = math.sqrt(max(float(apart[0].mean()) - mean * period_s, 0) / 2)
    else:
        out.unknown["drift"] = f"less than {math.sqrt(max(mean + 1.96 * error, 0)):.2g} per √s, if any"
    if step > 0 and spread < 0.7 * step:
        out.values["noise"] = _noise_below_quantum(r[near], step)
    else:
        out.values["noise"] = Estimate.deviation(spread, dof, step)
    out.unknown["offset, gain"] = "stand for those of the actuator, which are given in their place; a gauge would tell them apart"
    out.unknown["latency"] = "stands for the delay of the actuator, which is given in its place"
    return out


def _noise_below_quantum(residual: Array, step: float) -> Estimate:
    """Maximum likelihood of rounded readings."""
    lower, upper = residual - step / 2, residual + step / 2

    def loss(sigma: float) -> float:
        share = special.ndtr(upper / sigma) - special.ndtr(lower / sigma)
        return -float(np.log(np.maximum(share, 1e-12)).sum())
    grid = step * np.geomspace(0.05, 2, 30)
    near = int(np.argmin([loss(sigma) for sigma in grid]))
    found = optimize.minimize_scalar(loss, bounds=(grid[max(near - 1, 0)], grid[min(near + 1, len(grid) - 1)]), method="bounded",
                                     options={"xatol": 1e-6 * step})
    best, limit = float(found.x), float(found.fun) + 1.92
    # Where the likelihood falls by half the 95 % quantile of χ².
    low, high = (float(optimize.brentq(lambda sigma: loss(sigma) - limit, best, end)) if loss(end) > limit else float(end)
                 for end in (0.02 * step, 4 * step))
    return Estimate(best, (high - low) / 3.92, low, high)


def _second_differences(planes: Sequence[Array], use: Array) -> Array:
    """r[t − 1] − 2 r[t] + r[t + 1] of each cell where all three are used; no difference is over the end of a recording. Of white
    noise their variance is six times that of r."""
    parts, begin = [], 0
    for r in planes:
        u = use[begin:begin + len(r)]
        begin += len(r)
        parts.append(np.diff(r, 2, axis=0)[u[:-2] & u[1:-1] & u[2:]])
    return np.concatenate(parts)


def fit_proximity(name: str, span: float, sensed: Sequence[Array], ideal: Sequence[Array], follows: bool = True) -> SensorFit:
    """Noise, bias, misses, false hits and dead cells of a proximity sensor. span: its range, which nothing reads. ideal: what
    the re-run senses without errors. follows: the objects are where the re-run has them."""
    out = SensorFit(name)
    y, x = np.concatenate(sensed).astype(np.float64), np.concatenate(ideal).astype(np.float64)
    known = np.isfinite(y)
    hit, there = known & (y < span), x < span
    near = ndimage.binary_dilation(there, np.ones((3, 3, 3), bool))
    near_nothing = ~near
    # Ticks in which the re-run has the objects where the table had them; a third may be false or missed. What is sensed far from
    # them has no say: ticks with many false hits would be left out.
    agrees = (hit & there).sum((1, 2)) >= 0.6 * ((hit & near) | there).sum((1, 2))
    cross = ndimage.generate_binary_structure(2, 1)[None]
    inside = ndimage.binary_erosion(there, cross)
    nothing, sure = (mask & agrees[:, None, None] & known for mask in (near_nothing, inside))
    false_by_cell, n_by_cell = (hit & nothing).sum(0), nothing.sum(0)
    always = (n_by_cell >= 20) & (false_by_cell > 0.9 * n_by_cell)
    for row, column in np.argwhere(always):
        out.faults.append((int(row), int(column), name, "stuck", float(np.median(y[:, row, column]))))
    seen, shown = (hit & sure).sum(0), sure.sum(0)
    blind = (shown >= 20) & (seen == 0) & ~always
    for row, column in np.argwhere(blind):
        out.faults.append((int(row), int(column), name, "dead", None))
    rest = ~(always | blind)
    n = int(n_by_cell[rest].sum())
    if n >= 100:
        out.values["false_hits"] = Estimate.fraction(int(false_by_cell[rest].sum()), n)
    else:
        out.unknown["false_hits"] = "no cells without objects"
    n = int(shown[rest].sum())
    if n < 100:
        for what in ("noise", "bias", "dropout"):
            out.unknown[what] = "no object stays over a cell and its neighbours, where the re-run agrees"
        return out
    missed = out.values["dropout"] = Estimate.fraction(n - int(seen[rest].sum()), n)
    if "false_hits" in out.values:  # dropout hides a share of them
        out.values["false_hits"] = out.values["false_hits"].times(1 / (1 - missed.value))
    use = hit & sure & rest
    r = (y - x)[use]
    # Near its limits a reading is cut off.
    rough = 1.4826 * float(np.median(np.abs(r - np.median(r))))
    use &= (x > 4 * rough) & (x < span - 4 * rough)
    r = (y - x)[use]
    if len(r) < 30:
        out.unknown["noise"] = out.unknown["bias"] = "too few distances between the sensor's limits"
        return out
    middle = np.median(r)
    kept = np.abs(r - middle) < 6 * max(1.4826 * np.median(np.abs(r - middle)), 1e-9)
    r = r[kept]
    out.samples = len(r)
    step = quantum(y[use])
    if step > 0:
        out.values["quantize"] = Estimate(step, 0.0, step, step)
    # An object that is a little beside its re-run is so in neighbouring ticks as well.
    jumps = _second_differences([s.astype(np.float64) - i for s, i in zip(sensed, ideal)], use)
    jumps = jumps[np.abs(jumps) < 6 * max(1.4826 * float(np.median(np.abs(jumps))), 1e-9)] if len(jumps) else jumps
    if len(jumps) < 30:
        out.unknown["noise"] = "no distances in three ticks, one after the other"
    else:
        noise = math.sqrt(float(np.square(jumps).mean()) / 6)
        out.values["noise"] = Estimate.deviation(noise, int(len(jumps) / _DIFFERENCES_SHARE), step)
    if follows:
        out.values["bias"] = Estimate.normal(float(r.mean()), float(r.std() / math.sqrt(len(r))))
    else:
        out.unknown["bias"] = "the re-run strays from the object"
    hidden = int((~((shown >= 20) | always))[rest].sum())
    if hidden:
        out.unknown["dead cells"] = f"{hidden} cells never have an object over them and their neighbours for 20 ticks"
    return out
