"""Checks and shapes of what parameters, ranges, poses and pushes are given, for one world and for many."""
from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._surface import real_array

Numbers = NDArray[np.float64]
# A range of a parameter: (low, high), each a number or an array; None ends the randomisation.
Range = tuple[ArrayLike, ArrayLike]
STATE = {"position": (0, 3), "orientation": (3, 7), "velocity": (7, 10), "angular_velocity": (10, 13)}


def numbers(name: str, values: ArrayLike, shape: tuple[int, ...], nan: bool = False) -> Numbers:
    """The values, broadcast to the shape, as contiguous float64, or ValueError."""
    array = real_array(name, values)
    try:
        full = np.broadcast_to(array, shape)
    except ValueError:
        raise ValueError(f"{name} has shape {array.shape}: must be a number or an array that broadcasts to {shape}") from None
    if not np.isfinite(array[~np.isnan(array)] if nan else array).all():
        raise ValueError(f"{name}: must be finite")
    return np.array(full, np.float64, order="C")


def limits(name: str, given: Any, shape: tuple[int, ...], whole: bool) -> tuple[Numbers, Numbers]:
    """Low and high of a range, broadcast to the shape."""
    if not isinstance(given, (tuple, list)) or len(given) != 2:
        raise ValueError(f"randomise: {name} = {given!r}: must be (low, high) or None")
    low, high = (numbers(f"randomise: {name}", end, shape) for end in given)
    if (low > high).any():
        raise ValueError(f"randomise: {name} = {given!r}: low must not be above high")
    if whole and ((low != np.rint(low)) | (high != np.rint(high))).any():
        raise ValueError(f"randomise: {name} = {given!r}: must be whole numbers")
    return low, high


def object_ids(labels: Sequence[str], given: str | int | Sequence[int] | None) -> tuple[list[int], bool]:
    """The ids that are meant, and whether they are a list: None for all declared objects, a label, an id, ids."""
    if given is None:
        return list(range(len(labels))), True
    if isinstance(given, str):
        found = [i for i, label in enumerate(labels) if label == given]
        if not found:
            known = ", ".join(sorted({label for label in labels if label})) or "none"
            raise ValueError(f"no object is called {given!r}; labels: {known}")
        return found, len(found) > 1
    ids = [given] if isinstance(given, (int, np.integer)) else list(given)
    for i in ids:
        if not isinstance(i, (int, np.integer)) or not 0 <= i < len(labels):
            raise ValueError(f"object {i!r}: must be 0 to {len(labels) - 1}, of the {len(labels)} declared objects")
    return [int(i) for i in ids], not isinstance(given, (int, np.integer))


def pose(name: str, values: ArrayLike, lead: tuple[int, ...], count: int, several: bool) -> Numbers:
    """The values of one field of the state of `count` objects: lead × count × size."""
    first, last = STATE[name]
    size = last - first
    checked = numbers(name, values, (*lead, count, size) if several else (*lead, size))
    if name == "orientation" and (np.linalg.norm(checked, axis=-1) < 1e-6).any():
        raise ValueError("orientation: must be a quaternion x y z w that is not 0")
    return checked.reshape(*lead, count, size)


def poses(lead: tuple[int, ...], count: int, several: bool, **fields: ArrayLike | None) -> Iterator[tuple[str, Numbers]]:
    """The names and values of the fields that are given, as pose()."""
    for name, values in fields.items():
        if values is not None:
            yield name, pose(name, values, lead, count, several)


def pushes(force: ArrayLike | None, torque: ArrayLike | None, lead: tuple[int, ...], count: int, several: bool) -> Numbers:
    """Force and torque of `count` objects: lead × count × 6."""
    shape = (*lead, count, 3) if several else (*lead, 3)
    parts = [np.zeros(shape) if given is None else numbers(name, given, shape)
             for name, given in (("force", force), ("torque", torque))]
    return np.ascontiguousarray(np.concatenate([part.reshape(*lead, count, 3) for part in parts], axis=-1))


def checked_ranges(ranges: Mapping[str, Range | None]) -> Mapping[str, Range | None]:
    if not isinstance(ranges, Mapping):
        raise ValueError(f"randomise: {ranges!r}: must be a dict of parameters and their ranges (low, high)")
    return ranges


def world_numbers(given: Any, count: int) -> list[int]:
    """Indices of worlds: None for all, a mask of bool, an index or indices."""
    if given is None:
        return list(range(count))
    array = np.atleast_1d(np.asarray(given))
    if array.dtype == np.bool_:
        if array.shape != (count,):
            raise ValueError(f"worlds: a mask has {array.size} values: must have one per world, {count}")
        array = np.flatnonzero(array)
    if array.ndim != 1 or (array.size and (array.dtype.kind not in "iu" or array.min() < 0 or array.max() >= count)):
        raise ValueError(f"worlds = {given!r}: must be None, a mask, or numbers of worlds, 0 to {count - 1}")
    return [int(i) for i in array]
