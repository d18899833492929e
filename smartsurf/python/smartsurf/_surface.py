"""What simulations and live surfaces share: channels, arrays by channel, checks of arguments. Needs NumPy only."""
from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float32]
Actions = Union[Mapping[str, ArrayLike], ArrayLike]


@dataclasses.dataclass(frozen=True)
class Channel:
    """An array of the surface that is exchanged in each tick: components × rows × columns."""
    name: str
    unit: str
    minimum: float
    maximum: float
    components: int = 1
    safe: float = 0.0  # actuators: the target before the first command


class Closed:
    """Stands for the core of an environment that was closed."""

    def __getattr__(self, name: str) -> NoReturn:
        raise ValueError("the environment is closed: make a new one")


def whole(name: str, value: Any, least: int) -> int:
    """The int, or ValueError."""
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool) and least <= value < 2**31:
        return int(value)
    raise ValueError(f"{name} = {value!r}: must be a whole number, at least {least}")


def real_array(name: str, values: ArrayLike) -> NDArray[Any]:
    """The values as an array of real numbers, or ValueError."""
    try:
        array = np.asarray(values)
    except ValueError:
        raise ValueError(f"{name} has rows of different lengths: must be an array") from None
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{name} has values of type {array.dtype}: must be real numbers")
    return array


def aligned_zeros(shape: tuple[int, ...]) -> FloatArray:
    """float32 at an address from which JAX takes arrays without a copy, a multiple of 64 bytes."""
    bytes_ = 4 * math.prod(shape)
    memory = np.zeros(bytes_ + 64, np.uint8)
    first = -memory.ctypes.data % 64
    return memory[first:first + bytes_].view(np.float32).reshape(shape)


def finite(name: str, array: NDArray[Any], strict: bool) -> int:
    """The number of values that are not finite; ValueError if there are any and `strict`."""
    bad = ~np.isfinite(array)
    if strict and bad.any():
        place = tuple(map(int, np.argwhere(bad)[0]))
        raise ValueError(f"{name} is {array[place]} at {list(place)}: must be finite with strict=True")
    return int(np.count_nonzero(bad))


def checked_options(options: Any, *known: str) -> Mapping[str, Any]:
    """The options of a reset, or ValueError for those that have no meaning."""
    if options is not None and not isinstance(options, Mapping):
        raise ValueError(f"options = {options!r}: must be a dict")
    for name in options or ():
        if name not in known:
            raise ValueError(f"options[{name!r}]: no such option of reset(); known: {', '.join(known) or 'none'}")
    return options or {}


def views(planes: FloatArray, of: Sequence[Channel]) -> dict[str, FloatArray]:
    """The planes of each channel by name: rows × columns, or components × rows × columns. Views, not copies."""
    out: dict[str, FloatArray] = {}
    first = 0
    for channel in of:
        out[channel.name] = planes[first] if channel.components == 1 else planes[first:first + channel.components]
        first += channel.components
    return out


class Surface:
    """The arrays of a surface: one block of planes for the sensors and one for the actuators' targets, both float32,
    and views of their channels by name."""

    rows: int
    columns: int
    sensor_channels: tuple[Channel, ...]
    actuator_channels: tuple[Channel, ...]

    def __init__(self, sensor_channels: tuple[Channel, ...], actuator_channels: tuple[Channel, ...],
                 observation: FloatArray, targets: FloatArray):
        self.sensor_channels, self.actuator_channels = sensor_channels, actuator_channels
        self._observation, self._targets = observation, targets
        self.rows, self.columns = targets.shape[1:]
        self._sensors, self._actuators = views(observation, sensor_channels), views(targets, actuator_channels)
        for array in self._sensors.values():
            array.flags.writeable = False

    @property
    def sensors(self) -> dict[str, FloatArray]:
        """The readings by channel name: read-only views, each in its channel's unit."""
        return self._sensors

    @property
    def actuators(self) -> dict[str, FloatArray]:
        """The actuator targets by channel name, in the channel's unit: writable views that the next step() sends. A
        Simulation's step() leaves the targets in effect in them: clamped values, and the script's commands, which hold
        until the cell is written."""
        return self._actuators

    def _take(self, actions: Actions) -> None:
        if not isinstance(actions, Mapping):
            if len(self.actuator_channels) != 1:
                raise ValueError("actions: the surface has the channels "
                                 f"{', '.join(c.name for c in self.actuator_channels)}: give a dict")
            actions = {self.actuator_channels[0].name: actions}
        for name, values in actions.items():
            if name not in self._actuators:
                raise ValueError(f"actions: no actuator channel '{name}'; known: "
                                 f"{', '.join(c.name for c in self.actuator_channels)}")
            values = real_array(f"actions['{name}']", values)
            try:
                self._actuators[name][...] = values
            except ValueError:
                raise ValueError(f"actions['{name}'] has shape {values.shape}: must be a number or an array of shape "
                                 f"{self._actuators[name].shape}") from None


def checked_seed(seed: Any, bits: int = 64) -> int:
    if not isinstance(seed, (int, np.integer)) or isinstance(seed, bool) or not 0 <= seed < 2**bits:
        raise ValueError(f"seed = {seed!r}: must be a whole number from 0 to 2**{bits} - 1")
    return int(seed)


def draw_seed(random: np.random.Generator | None = None) -> int:
    """A new seed, of 53 bits, from a NumPy generator or the operating system."""
    return int(random.integers(2**53)) if random is not None else int.from_bytes(os.urandom(8), "little") >> 11
