"""A surface that runs elsewhere, such as hardware or `smartsurf run --shm NAME`, through shared memory."""
from __future__ import annotations

from typing import Any

import numpy as np

from ._surface import Actions, Channel, Surface, views

try:
    from shm_protocol import Controller, Result, SurfaceDied
except ModuleNotFoundError as error:
    raise ImportError("a live surface needs the package shm_protocol: add shm-protocol/python to PYTHONPATH") from error


class LiveSurface(Surface):
    """A surface that another process runs, used like a Simulation: sensors, actuators, step().

    name: of the surface. timeout: seconds to wait for it, and for each frame. The arrays are float32, whatever the
    channels' types. A surface has one controller at a time; close() makes room for the next. This class needs neither the
    compiled part of the package nor Gymnasium.
    """

    def __init__(self, name: str, timeout: float = 30.0):
        self._controller, self._timeout, self.closed, self._left = Controller(name, timeout), timeout, False, False
        d = self._controller.description
        self.name = name
        self.pitch: float = d.pitch
        self.period: float = d.period
        sensors, actuators = (tuple(Channel(c.name, c.unit, c.minimum, c.maximum, c.components, c.safe)
                                    for c in d.channels if c.direction == of) for of in ("sensor", "actuator"))
        observation, targets = (np.zeros((sum(c.components for c in of), d.rows, d.columns), np.float32)
                                for of in (sensors, actuators))
        self._readings = views(observation, sensors)  # writable, unlike those of `sensors`
        super().__init__(sensors, actuators, observation, targets)
        self.reset()
        try:
            self._await_frame()
            if self.closed:
                raise RuntimeError(f"surface {name} closed before its first frame")
        except BaseException:
            self.close()
            raise

    @property
    def tick(self) -> int:
        """The tick of the latest frame."""
        return int(self._controller.tick)

    @property
    def time(self) -> float:
        """The surface's time in the latest frame, s."""
        return float(self._controller.time)

    @property
    def info(self) -> dict[str, Any]:
        return {"tick": self.tick, "time": self.time, "surface_closed": self.closed}

    def step(self, actions: Actions | None = None) -> tuple[float, bool, bool]:
        """Answers the latest frame and waits for the next. Returns (0.0, whether the surface has closed, False); the
        last readings stay. actions: as of Simulation.step(); values beyond a channel's range are clamped.

        Raises TimeoutError without a frame in time, shm_protocol.SurfaceDied if the surface was killed, RuntimeError once it
        has closed."""
        self._require_open("step")
        if actions is not None:
            self._take(actions)
        for channel in self.actuator_channels:
            array, values = self._controller.actuators[channel.name], self._actuators[channel.name]
            if array.dtype.kind == "u":
                values = np.where(np.isnan(values), channel.safe, values.astype(np.float64))  # u32 exceeds float32
                values = np.rint(np.clip(values, channel.minimum, channel.maximum))
            array[...] = values
        self._controller.publish()
        self._await_frame()
        return 0.0, self.closed, False

    def _await_frame(self) -> None:
        try:
            self.closed = not self._controller.wait(self._timeout)
        except SurfaceDied:
            self.closed = True
            raise
        if not self.closed:
            for name, array in self._readings.items():
                array[...] = self._controller.sensors[name]

    def reset(self, seed: int | None = None) -> None:
        """Returns the targets to the channels' safe values, which the next step() sends. The surface goes on: it cannot be
        reset to a seed. Raises RuntimeError once it has closed."""
        self.closed = self.closed or not self._left and self._controller.surface_status == Result.SURFACE_DEAD
        self._require_open("episode")
        if seed is not None:
            raise ValueError(f"surface {self.name} runs in another process: it cannot be reset to a seed")
        for channel in self.actuator_channels:
            self._actuators[channel.name][...] = channel.safe

    def _require_open(self, what: str) -> None:
        if self.closed or self._left:
            raise RuntimeError(f"surface {self.name} {'has closed' if self.closed else 'is closed here'}: no {what} can follow; "
                               "attach again where it runs")

    def close(self) -> None:
        """Releases the surface for another controller. Arrays stay readable."""
        self._left = True
        self._controller.close()

    def __enter__(self) -> LiveSurface:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


attach = LiveSurface
