"""Statistics of success: the rate with its interval, and the time to success with runs that do not succeed in time."""
from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from typing import NamedTuple


def wilson(successes: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval of a success rate (Wilson 1927). (0, 1) without runs."""
    if runs == 0:
        return 0.0, 1.0
    z = _normal_quantile(confidence)
    rate, scale = successes / runs, 1 + z * z / runs
    middle = (rate + z * z / (2 * runs)) / scale
    half = z / scale * math.sqrt(rate * (1 - rate) / runs + z * z / (4 * runs * runs))
    return max(0.0, middle - half), min(1.0, middle + half)


class Step(NamedTuple):
    """From time `time_s` on, `share` of the runs have succeeded; `low` and `high` bound it at each time by itself."""

    time_s: float
    share: float
    low: float
    high: float


def success_curve(times_s: Sequence[float | None], ends_s: Sequence[float], confidence: float = 0.95) -> list[Step]:
    """The share of runs that succeed within a time, by the product-limit estimate (Kaplan and Meier 1958), one step for
    each time at which a run succeeds.

    times_s: of each run, when it succeeded, or None; ends_s: until when it was watched, of a run without success. The
    interval is that of Greenwood's variance on the scale log(−log), which stays within 0 and 1."""
    z = _normal_quantile(confidence)
    watched = sorted(end if time is None else time for time, end in zip(times_s, ends_s))
    successes: dict[float, int] = {}
    for time in times_s:
        if time is not None:
            successes[time] = successes.get(time, 0) + 1
    curve: list[Step] = []
    left, variance, low, high = 1.0, 0.0, 0.0, 1.0  # `left`: the share that has not succeeded
    for time, count in sorted(successes.items()):
        at_risk = sum(end >= time for end in watched)
        left *= 1 - count / at_risk
        if at_risk > count:
            variance += count / (at_risk * (at_risk - count))
            spread = math.exp(z * math.sqrt(variance) / -math.log(left))
            low, high = 1 - left ** (1 / spread), 1 - left ** spread
        else:
            left, high = 0.0, 1.0
        curve.append(Step(time, 1 - left, low, high))
    return curve


def time_of_share(curve: Sequence[Step], share: float) -> tuple[float | None, float | None, float | None]:
    """When this share of the runs has succeeded, and its interval (Brookmeyer and Crowley 1982); None: not in the time
    watched."""
    def first(bound: str) -> float | None:
        return next((step.time_s for step in curve if getattr(step, bound) >= share - 1e-12), None)
    return first("share"), first("high"), first("low")


def _normal_quantile(confidence: float) -> float:
    return statistics.NormalDist().inv_cdf(0.5 + confidence / 2)
