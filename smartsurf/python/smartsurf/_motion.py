"""Mass, friction, rolling friction and restitution of an object, from how the sensors saw it move over known cells."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import ndimage, optimize

from ._recorded import Array
from ._rerun import Rerun

PARAMETERS = {"friction": (1e-3, 3.0), "rolling_friction": (1e-4, 2.0), "restitution": (1e-2, 0.99), "mass": (1e-6, 1e6)}
_WHY = {"friction": "nothing slides", "rolling_friction": "nothing rolls far enough", "restitution": "nothing bounces",
        "mass": "no sensor feels a weight, and the motion does not depend on it"}
_BLOCK_S = 0.25  # residuals this far apart count as independent


@dataclass
class MotionFit:
    """Values and standard errors of an object's parameters."""
    label: str
    values: dict[str, tuple[float, float]] = field(default_factory=dict)
    unknown: dict[str, str] = field(default_factory=dict)
    tracks: list[tuple[Array, Array]] = field(default_factory=list)  # by recording: sensed and predicted features
    names: tuple[str, ...] = ()
    scale: Array = field(default_factory=lambda: np.ones(0))          # of each feature
    samples: int = 0


def features(planes: Mapping[str, Array], near: str | None, span: float, force: str | None) -> Array:
    """Frames × (x, y, height of what is over the table, its weight): NaN where nothing is sensed."""
    columns = []
    if near is not None:
        y = np.nan_to_num(planes[near].astype(np.float64), nan=span)
        hit = y < span
        # False hits are single cells.
        alone = ndimage.convolve(hit.astype(np.uint8), np.ones((1, 3, 3), np.uint8), mode="constant") < 4
        weight = np.where(hit & ~alone, span - y, 0.0)
        total = weight.sum((1, 2))
        # A cell that misses takes the mean of its neighbours, so that a miss does not pull the middle.
        hole = ~hit & (ndimage.convolve(hit.astype(np.uint8), np.ones((1, 3, 3), np.uint8), mode="constant") >= 7)
        around = ndimage.convolve(weight, np.ones((1, 3, 3)), mode="constant")
        weight = np.where(hole, around / 8, weight)
        total = weight.sum((1, 2))
        row, column = np.mgrid[0:y.shape[1], 0:y.shape[2]]
        seen = total > 0
        safe = np.where(seen, total, 1)
        columns += [np.where(seen, (weight * column).sum((1, 2)) / safe, np.nan), np.where(seen, (weight * row).sum((1, 2)) / safe, np.nan)]
        top = np.sort(weight.reshape(len(weight), -1), axis=1)[:, -4:].mean(1)
        columns.append(np.where(seen, top, np.nan))
    if force is not None:
        columns.append(np.nan_to_num(planes[force].astype(np.float64)).sum((1, 2)))
    return np.array(columns).T


def fit_motion(rerun: Rerun, label: str, known: Mapping[str, Any], near: str | None, span: float, force: str | None,
               wanted: Sequence[str], first_s: float | None = None) -> MotionFit:
    """known: the parameters of cells, identified before. near, force: channels of a proximity and of a pressure sensor."""
    names = tuple(f"object.{label}.{name}" for name in wanted)
    fit = MotionFit(label)
    fit.names = (("x, cells", "y, cells", "height, u") if near else ()) + (("force",) if force else ())
    channels = [name for name in (near, force) if name is not None]
    period = rerun.recordings[0].period_s
    used = [i for i, s in enumerate(rerun.simulations) if names[0] in rerun.names[s]]
    recordings = [rerun.recordings[i] for i in used]
    keep = [r.frames if first_s is None else min(r.frames, int(first_s / period)) for r in recordings]
    sensed = [features({name: r.readings[name] for name in channels}, near, span, force)[:n] for r, n in zip(recordings, keep)]
    declared = [float(np.ravel(rerun.simulations[used[0]].get_parameter(name))[0]) for name in names]
    limits = np.log([PARAMETERS[name] for name in wanted])
    start = np.clip(np.log(np.maximum(declared, 1e-9)), limits[:, 0] + 1e-6, limits[:, 1] - 1e-6)
    steps = np.concatenate([np.diff(s, 2, axis=0) for s in sensed])
    scale = 1.4826 * np.nanmedian(np.abs(steps), axis=0) / math.sqrt(6)
    typical = np.nanstd(np.concatenate(sensed), axis=0)
    scale = np.maximum(scale, 1e-3 * np.maximum(typical, 1e-6))

    def predict(log: Array) -> list[Array]:
        values = dict(known, **{name: float(np.exp(v)) for name, v in zip(names, log)})
        return [features(out, near, span, force)[:n] for out, n in zip(rerun.run(values, channels, max(keep), used), keep)]

    def residuals(log: Array) -> Array:
        parts = []
        for s, p in zip(sensed, predict(log)):
            r = (s - p) / scale
            # Seen by one alone: as far off as anything can be.
            r = np.where(np.isnan(s) & np.isnan(p), 0, np.where(np.isnan(r), 30, r))
            parts.append(np.clip(r, -60, 60))
        return np.concatenate(parts).ravel()

    # Coordinate by coordinate over a grid, twice: a search by derivatives alone stops at impacts that come too late.
    best = start.copy()
    lowest = float((residuals(best) ** 2).sum())
    for _ in range(2):
        for i in range(len(names)):
            for factor in (0.25, 0.5, 0.7, 0.85, 1.2, 1.4, 2, 4):
                trial = best.copy()
                trial[i] = np.clip(start[i] + math.log(factor) if _ == 0 else best[i] + math.log(factor) / 2, *limits[i])
                cost = float((residuals(trial) ** 2).sum())
                if cost < lowest:
                    lowest, best = cost, trial
    free = list(range(len(names)))
    jacobian = np.zeros((0, 0))
    for _ in range(len(names) + 1):
        if not free:
            break

        def of_free(values: Array) -> Array:
            full = best.copy()
            full[free] = values
            return residuals(full)
        # A derivative over a small change would be that of the contacts' rounding.
        found = optimize.least_squares(of_free, best[free], diff_step=0.01, bounds=limits[free].T, loss="soft_l1", f_scale=3, max_nfev=15)
        best[free] = found.x
        r = of_free(best[free])
        change = np.array([0.02 * np.eye(len(free))[k] for k in range(len(free))])
        jacobian = np.array([(of_free(np.clip(best[free] + c, *limits[free].T)) - of_free(np.clip(best[free] - c, *limits[free].T))) / 0.04
                             for c in change]).T
        error = _errors(jacobian, r, len(fit.names), keep, period)
        worst = int(error.argmax())
        if error[worst] < 0.3:
            for k, i in enumerate(free):
                value = math.exp(best[i])
                fit.values[wanted[i]] = (value, value * float(error[k]))
            break
        fit.unknown[wanted[free[worst]]] = _WHY[wanted[free[worst]]]
        best[free[worst]] = start[free[worst]]
        del free[worst]
    fit.tracks = list(zip(sensed, predict(best)))
    fit.scale, fit.samples = scale, sum(keep)
    return fit


def _errors(jacobian: Array, r: Array, features_count: int, lengths: Sequence[int], period: float) -> Array:
    """Standard errors that hold for residuals which depend on their neighbours: each block of ticks counts once."""
    n, k = jacobian.shape
    bread = np.linalg.pinv(jacobian.T @ jacobian + 1e-9 * np.eye(k))
    block = max(int(_BLOCK_S / period), 1) * features_count
    scores = []
    begin = 0
    for length in lengths:
        end = begin + length * features_count
        for first in range(begin, end, block):
            scores.append(jacobian[first:min(first + block, end)].T @ r[first:min(first + block, end)])
        begin = end
    meat = np.array(scores).T @ np.array(scores) * len(scores) / max(len(scores) - k, 1)
    robust = bread @ meat @ bread
    plain = bread * float(r @ r) / max(n - k, 1)
    return np.sqrt(np.maximum(np.maximum(np.diag(robust), np.diag(plain)), 0))
