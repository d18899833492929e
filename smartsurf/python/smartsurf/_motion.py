"""Mass, friction, rolling friction and restitution of an object, from how the sensors saw it move over known cells."""
from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import ndimage, optimize

from ._recorded import Array
from ._rerun import Rerun

PARAMETERS = {"friction": (1e-3, 3.0), "rolling_friction": (1e-4, 2.0), "restitution": (1e-2, 0.99), "mass": (1e-6, 1e6)}
_WHY = {"friction": "nothing slides", "rolling_friction": "nothing rolls far enough",
        "restitution": "nothing bounces, or the table's own is larger",
        "mass": "no sensor feels a weight, and the motion does not depend on it"}
_ORDER = ("restitution", "mass", "rolling_friction", "friction")  # what comes first in a motion comes first
_BLOCK_S = 0.1    # residuals this far apart count as independent
_FARTHEST = 10.0  # a residual counts at most as this
_ROBUST = 3.0     # residuals beyond count less than their squares
_CHANGE = 0.01    # of logarithms, for derivatives
_STARTS = 5       # searches besides the one from the best of the grid,
_SPREAD = 0.1     # the standard deviation of the logarithms they start from,
_ALIKE = 3.0      # and how much higher a minimum may be to be as likely, in roots of the lowest
_OTHERS = 6       # cells as likely with which each parameter's profile is drawn,
_PROFILE = 0.05   # in steps of its logarithm
_UNSURE = 1.5     # times the spread of a few re-runs counts as noise
_ASTRAY = 0.25    # cells between where the object was and where the best re-run has it, from where on nothing follows from it


@dataclass
class MotionFit:
    """Values and standard errors of an object's parameters."""
    label: str
    values: dict[str, tuple[float, float]] = field(default_factory=dict)
    unknown: dict[str, str] = field(default_factory=dict)
    tracks: list[tuple[Array, Array]] = field(default_factory=list)  # by recording: sensed and predicted _View.track()
    names: tuple[str, ...] = ()                                      # of its columns
    samples: int = 0
    strays: bool = False                                             # the re-run is elsewhere than the object


class _View:
    """What the sensors tell about an object: near, a proximity sensor of the range span, and force, a pressure sensor."""

    def __init__(self, near: str | None, span: float, force: str | None, sensed: Sequence[Mapping[str, Array]]):
        self.near, self.span, self.force = near, span, force
        self.channels = [name for name in (near, force) if name is not None]
        self.floor = 0.0  # forces below are noise
        if near is not None:
            self.near_noise = max(self._noise([planes[near] for planes in sensed], span), 5e-4 * span)
        if force is not None:
            quiet = np.concatenate([planes[force].ravel() for planes in sensed])
            quiet = quiet[np.isfinite(quiet) & (quiet <= np.nanquantile(quiet, 0.9))]
            self.floor = 10 * float(quiet.mean()) if len(quiet) else 0.0
            sums = [self.weight(planes) for planes in sensed]
            steps = np.concatenate([np.diff(s, 2)[(s[2:] > 0) & (s[1:-1] > 0) & (s[:-2] > 0)] for s in sums])
            typical = np.concatenate([s[s > 0] for s in sums])
            self.force_noise = 1.4826 * float(np.median(np.abs(steps))) / math.sqrt(6) if len(steps) else 1.0
            self.force_noise = max(self.force_noise, 0.01 * float(np.median(typical)) if len(typical) else 1.0)

    @staticmethod
    def _noise(planes: Sequence[Array], span: float) -> float:
        parts = []
        for y in planes:
            steps = np.diff(y.astype(np.float64), 2, axis=0)
            hit = y < span
            parts.append(steps[hit[2:] & hit[1:-1] & hit[:-2]])
        all_of_them = np.concatenate(parts)
        return 1.4826 * float(np.median(np.abs(all_of_them))) / math.sqrt(6) if len(all_of_them) else 0.0

    def weight(self, planes: Mapping[str, Array]) -> Array:
        """The sum of all forces that are more than noise, frame by frame."""
        force = np.nan_to_num(planes[self.force or ""].astype(np.float64))
        total: Array = np.where(force > self.floor, force, 0).sum((1, 2))
        return total

    def spread(self, runs: Sequence[Mapping[str, Array]]) -> dict[str, Array]:
        """How far re-runs that are as likely as each other are apart: standard deviations of distances and of the weight."""
        found = {}
        if self.near is not None:
            found[self.near] = _UNSURE * np.std([np.minimum(run[self.near], self.span) for run in runs], axis=0, ddof=1)
        if self.force is not None:
            found[self.force] = _UNSURE * np.std([self.weight(run) for run in runs], axis=0, ddof=1)
        return found

    def residuals(self, sensed: Mapping[str, Array], predicted: Mapping[str, Array], spread: Mapping[str, Array] | None = None) -> Array:
        """Frames × numbers, each about 1 where all is known. Distances count where both have one; a cell that only one of them
        sees counts as a miss, however far off it is, because sensors do miss. spread: what nobody can predict counts as noise."""
        parts = []
        if self.near is not None:
            y, x = sensed[self.near].astype(np.float64), predicted[self.near].astype(np.float64)
            hit, there, known = y < self.span, x < self.span, np.isfinite(y)
            r = np.where(hit & there, np.clip((y - x) / self.near_noise, -_FARTHEST, _FARTHEST), (hit ^ there) * _FARTHEST * 0.5)
            if spread is not None:
                r = r / np.hypot(1, spread[self.near] / self.near_noise)
            parts.append(np.where(known, r, 0).reshape(len(y), -1))
        if self.force is not None:
            f, p = self.weight(sensed), self.weight(self.as_known(predicted, sensed))
            # Both ticks have a part of an impact between them, in shares that are not known.
            noise = self.force_noise + 0.02 * np.maximum(f, p)
            r = np.clip((f - p) / noise, -_FARTHEST, _FARTHEST)
            parts.append((r if spread is None else r / np.hypot(1, spread[self.force] / noise))[:, None])
        return np.concatenate(parts, axis=1)

    @staticmethod
    def as_known(predicted: Mapping[str, Array], sensed: Mapping[str, Array]) -> dict[str, Array]:
        """`predicted` with NaN where a reading is not known."""
        return {name: np.where(np.isfinite(sensed[name]), plane, np.nan) for name, plane in predicted.items()}

    def track(self, planes: Mapping[str, Array]) -> Array:
        """For the plot: frames × (x, y, gap, force); NaN where nothing is sensed."""
        columns = []
        if self.near is not None:
            y = np.nan_to_num(planes[self.near].astype(np.float64), nan=self.span)
            hit = y < self.span
            around = ndimage.convolve(hit.astype(np.uint8), np.ones((1, 3, 3), np.uint8), mode="constant")
            weight = np.where(hit & (around > 2), self.span - y, 0.0)
            total = weight.sum((1, 2))
            row, column = np.mgrid[0:y.shape[1], 0:y.shape[2]]
            for value in ((weight * column).sum((1, 2)), (weight * row).sum((1, 2))):
                columns.append(np.where(total > 0, value / np.where(total > 0, total, 1), np.nan))
            columns.append(np.where(total > 0, self.span - weight.max((1, 2)), np.nan))
        if self.force is not None:
            columns.append(self.weight(planes))
        return np.array(columns).T

    @property
    def names(self) -> tuple[str, ...]:
        return (("column", "row", "least distance, u") if self.near else ()) + (("force",) if self.force else ())


def fit_motion(rerun: Rerun, label: str, known: Mapping[str, Any], near: str | None, span: float, force: str | None,
               wanted: Sequence[str], first_s: float | None = None, also: Sequence[Mapping[str, Any]] = ()) -> MotionFit:
    """known: the parameters of cells, identified before; also: others that are as likely. near, force: channels of a proximity
    and of a pressure sensor."""
    names = tuple(f"object.{label}.{name}" for name in wanted)
    fit = MotionFit(label)
    period = rerun.recordings[0].period_s
    used = [i for i, s in enumerate(rerun.simulations) if names[0] in rerun.names[s]]
    recordings = [rerun.recordings[i] for i in used]
    keep = [r.frames if first_s is None else min(r.frames, int(first_s / period)) for r in recordings]
    sensed = [{name: r.readings[name][:n] for name in (near, force) if name is not None} for r, n in zip(recordings, keep)]
    view = _View(near, span, force, sensed)
    fit.names = view.names
    declared = [float(np.ravel(rerun.simulations[used[0]].get_parameter(name))[0]) for name in names]
    limits = np.log([PARAMETERS[name] for name in wanted])
    start = np.clip(np.log(np.maximum(declared, 1e-9)), limits[:, 0] + 1e-6, limits[:, 1] - 1e-6)

    def predict(log: Array, cells: Mapping[str, Any] = known) -> list[dict[str, Array]]:
        values = dict(cells, **{name: float(np.exp(v)) for name, v in zip(names, log)})
        runs = rerun.run(values, view.channels, max(keep), used)
        return [{name: plane[:n] for name, plane in out.items()} for out, n in zip(runs, keep)]

    spread: list[dict[str, Array]] | None = None

    def residuals(log: Array, cells: Mapping[str, Any] = known) -> Array:
        of: Sequence[dict[str, Array] | None] = spread or [None] * len(sensed)
        return np.concatenate([view.residuals(s, p, w).ravel() for s, p, w in zip(sensed, predict(log, cells), of)])

    def spread_at(log: Array) -> list[dict[str, Array]] | None:
        # Contacts amplify what is not known of the cells until, after seconds, nothing follows from the parameters.
        runs = [predict(log, changed) for changed in also]
        return [view.spread(of_recording) for of_recording in zip(*runs)] if len(runs) > 1 else None

    # Contacts make the sum of squares rough: derivatives serve the errors only.
    spread = spread_at(start)
    best = _grid(lambda log: _robust(residuals(log)), start, limits, sorted(range(len(wanted)), key=lambda i: _ORDER.index(wanted[i])))
    free = list(range(len(names)))
    random = np.random.default_rng(1)
    while free:
        spread = spread_at(best)

        def of_free(values: Array) -> Array:
            full = best.copy()
            full[free] = np.clip(values, *limits[free].T)
            return residuals(full)

        def slopes(values: Array) -> Array:
            # Over a change that is large beside the contacts' rounding.
            return np.array([(of_free(values + c) - of_free(values - c)) / (2 * _CHANGE) for c in _CHANGE * np.eye(len(free))]).T

        def lower(begin: Array, size: float) -> tuple[float, Array]:
            corners = np.vstack([begin, begin + size * np.eye(len(free))])
            found = optimize.minimize(lambda v: _robust(of_free(v)), begin, method="Nelder-Mead",
                                      options={"initial_simplex": corners, "xatol": 1e-4, "fatol": 0.5, "maxfev": 45 * len(free)})
            return float(found.fun), np.clip(found.x, *limits[free].T)

        # Local minima lie side by side: the lowest of several counts, and those that are as low say how far it can be off.
        begins = best[free] + _SPREAD * np.vstack([np.zeros(len(free)), random.standard_normal((_STARTS, len(free)))])
        minima = sorted((lower(np.clip(begin, *limits[free].T), 0.03) for begin in begins), key=lambda found: found[0])
        lowest, best[free] = lower(minima[0][1], 0.01)
        alike = [values for value, values in minima if value < lowest + _ALIKE * math.sqrt(lowest)]
        jacobian, r = slopes(best[free]), of_free(best[free])
        others = [residuals(best, changed) for changed in also]
        def along(changed: Mapping[str, Any], k: int) -> float:
            return _lowest_along(lambda log: _robust(residuals(log, changed)), best, k)
        moved = [along(changed, k) for k in free for changed in also[:_OTHERS]]
        error = np.hypot(_errors(jacobian, r, others, keep, period), np.sqrt(np.mean(np.square(alike - best[free]), axis=0)) if alike else 0.0)
        if moved:
            error = np.hypot(error, np.sqrt(np.mean(np.square(np.reshape(moved, (len(free), -1))), axis=1)))
        for k in range(len(free)):
            # One that counts to one side only is hidden by the table's own, as a restitution below that of the table is.
            step = _CHANGE * np.eye(len(free))[k]
            sides = [float(np.abs(of_free(best[free] + s) - of_free(best[free])).sum()) for s in (step, -step)]
            if min(sides) < 0.02 * max(sides) or max(sides) == 0:
                error[k] = math.inf
        worst = int(error.argmax())
        if error[worst] < 0.3:
            fit.values = {wanted[i]: (math.exp(best[i]), math.exp(best[i]) * float(error[k])) for k, i in enumerate(free)}
            break
        fit.unknown[wanted[free[worst]]] = _WHY[wanted[free[worst]]]
        best[free[worst]] = start[free[worst]]
        del free[worst]
    fit.tracks = [(view.track(s), view.track(view.as_known(p, s))) for s, p in zip(sensed, predict(best))]
    fit.samples = sum(keep)
    astray = _astray(fit.tracks) if near is not None else 0.0
    if astray > _ASTRAY:
        fit.strays = True
        fit.values, fit.unknown = {}, dict.fromkeys(wanted, f"the re-run strays from the object, by {astray:.2f} cells")
    return fit


def _lowest_along(cost: Callable[[Array], float], best: Array, k: int) -> float:
    """How far from the best value the lowest one of a parameter's profile is."""
    steps = _PROFILE * np.arange(-8, 9)
    return float(steps[int(np.argmin([cost(best + step * (np.arange(len(best)) == k)) for step in steps]))])


def _astray(tracks: Sequence[tuple[Array, Array]]) -> float:
    """The larger rms difference of columns and rows."""
    apart = np.concatenate([(sensed - predicted)[:, :2] for sensed, predicted in tracks])
    apart = apart[np.isfinite(apart).all(axis=1)]
    return float(np.sqrt((apart ** 2).mean(axis=0)).max()) if len(apart) else 0.0


def _robust(r: Array) -> float:
    return float((2 * _ROBUST ** 2 * (np.sqrt(1 + (r / _ROBUST) ** 2) - 1)).sum())


def _grid(cost: Callable[[Array], float], start: Array, limits: Array, order: Sequence[int]) -> Array:
    """The best of some values of each parameter by itself, three times, the last with finer steps: where impacts come at the
    wrong time, nothing leads to the right one."""
    best, lowest = start.copy(), cost(start)
    for factors in (1.13 ** np.arange(-10, 11), 1.13 ** np.arange(-10, 11), 1.02 ** np.arange(-7, 8)):
        for i in order:
            middle = best[i]
            for factor in factors:
                trial = best.copy()
                trial[i] = np.clip(middle + math.log(factor), *limits[i])
                found = cost(trial)
                if found < lowest:
                    lowest, best = found, trial
    return best


def _errors(jacobian: Array, r: Array, others: Sequence[Array], lengths: Sequence[int], period: float) -> Array:
    """Standard errors of a robust fit (Huber 1981), for residuals that depend on their neighbours: each block of ticks counts
    once. others: the residuals with other cells, as likely as those of the fit: what these shift is uncertain, too."""
    n, k = jacobian.shape
    root = np.sqrt(1 + (r / _ROBUST) ** 2)
    score, weight = r / root, root ** -3  # first and second derivative of the loss
    bread = np.linalg.pinv((jacobian * weight[:, None]).T @ jacobian + 1e-9 * np.eye(k))
    width = n // sum(lengths)  # numbers of a frame
    block = max(round(_BLOCK_S / period), 1) * width
    sums = []
    begin = 0
    for length in lengths:
        end = begin + length * width
        for first in range(begin, end, block):
            last = min(first + block, end)
            sums.append(jacobian[first:last].T @ score[first:last])
        begin = end
    meat = np.array(sums).T @ np.array(sums) * len(sums) / max(len(sums) - k, 1)
    plain = (jacobian * (score ** 2)[:, None]).T @ jacobian
    both = [np.diag(bread @ m @ bread) for m in (meat, plain)]
    shifts = [bread @ (jacobian.T @ (o / np.sqrt(1 + (o / _ROBUST) ** 2) - score)) for o in others]
    between = np.mean(np.square(shifts), axis=0) if shifts else 0.0
    return np.sqrt(np.maximum(np.maximum(*both), 0) + between)
