"""What the sensors of a table add to what they sense, from recordings and re-runs."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import ndimage

from ._cells import FROZEN, GOOD, CellFit
from ._recorded import Array
from ._residuals import Estimate, quantum
from .success import wilson


_DIFFERENCES_SHARE = 35 / 18  # second differences of white noise that estimate its variance as well as one independent number


@dataclass
class SensorFit:
    """Errors of a sensor. faults: row, column, channel, fault, value of single cells."""
    name: str
    values: dict[str, Estimate] = field(default_factory=dict)
    unknown: dict[str, str] = field(default_factory=dict)
    faults: list[tuple[int, int, str, str, float | None]] = field(default_factory=list)
    samples: int = 0


def _fraction(hits: int, of: int) -> Estimate:
    low, high = wilson(hits, of)
    share = hits / max(of, 1)
    return Estimate(share, math.sqrt(share * (1 - share) / max(of, 1)), low, high)


def fit_height_sensor(name: str, fit: CellFit, readings: Sequence[Array]) -> SensorFit:
    """Noise, resolution, drift, misses and dead cells of the sensor of the heights."""
    out = SensorFit(name)
    good = fit.state == GOOD
    for row, column in np.argwhere(fit.state == FROZEN):
        level = float(fit.level[row, column])
        out.faults.append((int(row), int(column), name, *(("dead", None) if level == 0 else ("stuck", level))))
    if fit.residuals is None:
        out.unknown["noise"] = "no cell is known"
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
    out.values["dropout"] = _fraction(int((miss & tellable).sum()), int(tellable.sum()))
    found = fit.residuals
    if found.step > 0:
        out.values["quantize"] = Estimate(found.step, 0.0, found.step, found.step)
    else:
        out.unknown["quantize"] = "the readings have no common step"
    ends = [math.sqrt(max(variance, 0)) for variance in (found.walk.value, found.walk.low, found.walk.high)]
    if found.walks:
        out.values["drift"] = Estimate(ends[0], found.walk.error / (2 * ends[0]), ends[1], ends[2])
    else:
        out.unknown["drift"] = f"less than {ends[2]:.2g} per √s, if any" + ("; the steps of the readings hide it" if found.is_coarse else "")
    if found.walks and found.is_coarse:
        out.unknown["noise"] = f"at most {found.noise.high:.2g}: drift and the steps of the readings hide it"
    else:
        out.values["noise"] = found.noise
    out.unknown["offset, gain"] = "stand for those of the actuator, which are given in their place; a gauge would tell them apart"
    out.unknown["latency"] = "stands for the delay of the actuator, which is given in its place"
    return out


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
        out.values["false_hits"] = _fraction(int(false_by_cell[rest].sum()), n)
    else:
        out.unknown["false_hits"] = "no cells without objects"
    n = int(shown[rest].sum())
    if n < 100:
        for what in ("noise", "bias", "dropout"):
            out.unknown[what] = "no object stays over a cell and its neighbours, where the re-run agrees"
        return out
    missed = out.values["dropout"] = _fraction(n - int(seen[rest].sum()), n)
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
