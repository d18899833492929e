"""An experiment that repeats recorded commands, with parameters of which the script knows nothing."""
from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ._core import Error
from ._recorded import Array, Recorded, RecordingError
from ._simulation import Simulation

HEIGHT = "identify_height"  # the sensor that a re-run adds: the heights, without errors
# Before the script's first line, so that its lines keep their numbers: the script commands nothing, ends nothing and varies
# nothing, and all sensors are without errors and faults.
_SILENT = """
local nothing, cells_of_script = function() end, cells
cells = setmetatable({}, { __index = function(_, key)
  if key == 'target' or key == 'targets' then return nothing end
  local value = cells_of_script[key]
  if type(value) ~= 'function' then return value end
  return function(_, ...) return value(cells_of_script, ...) end
end })
stop, quit, success, episode, vary, print, faults, pause = nothing, nothing, nothing, nothing, nothing, nothing, nothing, nothing
local surface_of_script = surface
surface = function(fields)
  local sensors = {}
  for _, sensor in ipairs(fields.sensors or {}) do sensors[#sensors + 1] = sensor end
  sensors[#sensors + 1] = pin_height { name = '%s' }
  fields.sensors = sensors
  return surface_of_script(fields)
end
""" % HEIGHT
_ERRORS = ("noise", "quantize", "latency", "dropout", "false_hits", "drift", "stuck_low", "stuck_high", "dead")
# For heights alone: the script registers no function, because one may need what another has done.
_WITHOUT_FUNCTIONS = "at, every, on_tick, on_leave, on_finish, metric, reward, info = " + ", ".join(8 * ["nothing"]) + " "


def silent_source(experiment: str | pathlib.Path, functions: bool = True) -> str:
    """The script, as re-runs load it. functions: with those that it registers to run later."""
    try:
        text = pathlib.Path(experiment).read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{experiment}: {getattr(error, 'strerror', None) or error}") from error
    return " ".join(_SILENT.split("\n")) + ("" if functions else _WITHOUT_FUNCTIONS) + text


def _is_of_pins_alone(simulation: Simulation) -> bool:
    """Whether nothing but commands moves the pins: there are no objects yet, and none that comes is too heavy for a pin."""
    limits = [n for n in simulation.parameters if n.startswith("actuator.") and n.endswith(".max_force")]
    return not len(simulation.objects["id"]) and all(np.isnan(simulation.get_parameter(n)).all() for n in limits)


class Rerun:
    """One experiment and some recordings. run() repeats the commands of all of them."""

    def __init__(self, experiment: str | pathlib.Path, recordings: Sequence[Recorded], options: Mapping[str, str] | None = None):
        self.experiment, self.recordings = str(experiment), recordings
        source = silent_source(experiment)
        given = dict(options or {})
        plain = Simulation(experiment, set=given, source=source)
        by_options: dict[tuple[tuple[str, str], ...], Simulation] = {}
        of_heights: dict[Simulation, Simulation] = {}
        self.simulations: list[Simulation] = []  # by recording: with its options
        self.options: list[dict[str, str]] = []  # the same: those that are not the experiment's own
        for recording in recordings:
            own = {name: value for name, value in recording.options.items() if name in plain.options and plain.options[name] != value}
            key = tuple(sorted({**own, **given}.items()))
            if key not in by_options:
                by_options[key] = Simulation(experiment, set=dict(key), source=source) if own else plain
                if _is_of_pins_alone(by_options[key]):
                    of_heights[by_options[key]] = Simulation(experiment, set=dict(key), source=silent_source(experiment, functions=False))
            self.simulations.append(by_options[key])
            self.options.append(dict(key))
        self.simulation = self.simulations[0]
        # By recording, for heights alone: without the script's functions, which take about half of a step.
        self._of_heights = [of_heights.get(s, s) for s in self.simulations]
        self._check_table()
        self.names = {s: set(s.parameters) for s in [*self.simulations, *self._of_heights]}
        self.parameters = set().union(*self.names.values())
        self._applied: dict[Simulation, dict[str, Array]] = {s: {} for s in self.names}  # what run() has set
        for s, names in self.names.items():
            for name in names:
                if name.startswith("sensor.") and name.rsplit(".", 1)[-1] in _ERRORS:
                    s.set_parameter(name, 0)

    def _check_table(self) -> None:
        for recording, s in zip(self.recordings, self.simulations):
            for what, theirs, ours in (("rows", recording.rows, s.rows), ("columns", recording.columns, s.columns),
                                       ("pitch", recording.pitch, s.pitch), ("control period", recording.period_s, s.period)):
                if abs(theirs - ours) > 1e-6 * abs(ours):
                    raise RecordingError(f"{recording.path}: {what} {theirs:g}, but {self.experiment} has {ours:g}: is of another table")
            known = {channel.name: channel for channel in s.actuator_channels}
            for name in recording.commands:
                if name not in known:
                    raise RecordingError(f"{recording.path}: actuator channel '{name}', which {self.experiment} does not have "
                                         f"(it has {', '.join(sorted(known)) or 'none'})")
                low, high = known[name].minimum, known[name].maximum
                was = recording.ranges.get(name, (low, high))
                if not np.allclose(was, (low, high), rtol=1e-6, atol=1e-6 * (high - low)):
                    raise RecordingError(f"{recording.path}: '{name}' ranges from {was[0]:g} to {was[1]:g}, but from {low:g} to {high:g} "
                                         f"in {self.experiment}: is of another table")

    def settle_ticks(self, recording: Recorded) -> int:
        """Ticks in which the first commands of a recording are held before it: its past is unknown."""
        return 0 if recording.from_start else int(np.ceil(2 / recording.period_s))

    def run(self, values: Mapping[str, Any], sensors: Sequence[str] = (HEIGHT,), most_frames: int | None = None,
            only: Sequence[int] | None = None) -> list[dict[str, Array]]:
        """The readings of these sensor channels in every frame of each recording (frames × rows × columns), or in the first
        ones, with these values of parameters. only: of these recordings."""
        for s, names in self.names.items():
            applied = self._applied[s]
            for name, value in values.items():  # a call checks the whole scene, and most values stay the same
                if name in names and not (name in applied and np.array_equal(applied[name], value, equal_nan=True)):
                    s.set_parameter(name, value)
                    applied[name] = np.array(value, float)
        simulations = self._of_heights if tuple(sensors) == (HEIGHT,) else self.simulations
        results = []
        for index in range(len(self.recordings)) if only is None else only:
            recording, s = self.recordings[index], simulations[index]
            s.reset(recording.seed)
            frames = min(recording.frames, most_frames or recording.frames)
            out = {name: np.empty((frames, s.rows, s.columns), np.float32) for name in sensors}
            views = [(out[name], s.sensors[name]) for name in sensors]
            commands = [(s.actuators[name], plane) for name, plane in recording.commands.items()]
            for to, plane in commands:
                to[...] = plane[0]
            for _ in range(self.settle_ticks(recording)):
                s.step()
            for frame in range(frames):
                if frame > 0:
                    for to, plane in commands:
                        to[...] = plane[frame]
                    s.step()
                for to, view in views:
                    to[frame] = view
            results.append(out)
        return results


__all__ = ["Error", "HEIGHT", "Rerun", "silent_source"]
