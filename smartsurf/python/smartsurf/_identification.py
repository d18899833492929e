"""Identification of a table: `smartsurf identify` as a function."""
from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _identified
from ._cells import GOOD, STUCK, CellFit, fit_cells
from ._core import Error
from ._motion import PARAMETERS, MotionFit, fit_motion
from ._readings import SensorFit, fit_height_sensor, fit_proximity
from ._recorded import Array, Recorded, RecordingError, read
from ._rerun import HEIGHT, Rerun
from ._simulation import Simulation


PINS = "height"               # the pins' channel
HEIGHT_SENSOR = "pin_height"  # where a recording has none, the simulator's heights stand in
_LEAST_KNOWN = 0.2            # of the readings


@dataclass
class Identified:
    """The result of identify(). values: of each parameter its value and standard error."""
    values: dict[str, tuple[float, float]]
    cells: CellFit | None
    sensors: list[SensorFit]
    motion: MotionFit | None
    report: str


def identify(recordings: Sequence[str | pathlib.Path], experiment: str | pathlib.Path, output: str | pathlib.Path,
             channel: str = PINS, sensor: str = HEIGHT_SENSOR, label: str | None = None, fit: Sequence[str] = tuple(PARAMETERS),
             seconds: float | None = None, set: Mapping[str, str] | None = None) -> Identified:
    """The command as a function. channel, sensor: of the actuators' commands and heights. label: of the object, fit: its
    parameters. seconds: of its motion that count [all]. set: options of the experiment; those of a single recording follow its name:
    run.h5,NAME=VALUE. Raises ValueError with one line."""
    out = pathlib.Path(output)
    scenes = [_scene(path) for path in recordings]
    recordings = [path for path, _ in scenes]
    _check_output(out, experiment, recordings)
    read_in = [read(path) for path in recordings]
    for recording, (_, options) in zip(read_in, scenes):
        recording.options.update(options)
    rerun = Rerun(experiment, read_in, set)
    original = _identified.read_original(pathlib.Path(experiment))
    _check_place(out, rerun, original)
    for path, options in scenes:
        for name in options.keys() - rerun.simulation.options.keys():
            raise RecordingError(f"{path},{name}={options[name]}: {experiment} has no option '{name}' "
                                 f"(it has {', '.join(sorted(rerun.simulation.options)) or 'none'})")
    proximity = _proximity(rerun, read_in)
    force = _object_sensor(rerun, read_in, label, proximity) if label is not None else None
    prefix = "actuator." if "actuator.max_speed" in rerun.parameters else "actuator.pin."
    height = _height_channel(read_in, sensor, channel, label)
    cells, least_delay, known = None, 0, {}
    rms: dict[str, float] = {}
    declared: list[Array] | None = None
    if height is not None and channel == PINS and prefix + "max_speed" in rerun.parameters:
        if all(np.ptp(r.commands[channel], axis=0).max() == 0 for r in read_in if channel in r.commands):
            raise RecordingError(f"{read_in[0].path}: no excitation: the commands of '{channel}' never change")
        readings = [r.readings[height] for r in read_in]
        share = float(np.isfinite(np.concatenate(readings)).mean())
        if share < _LEAST_KNOWN:
            raise RecordingError(f"{read_in[0].path}: of {100 * share:.0f} % of its readings the command in force is known: too many frames were lost "
                                 "or late")
        declared = [result[HEIGHT] for result in rerun.run({})]
        rerun.run({prefix + "latency": 0}, most_frames=1)
        cells = fit_cells(rerun, channel, prefix, readings)
        good = cells.state == GOOD
        if good.any():
            least_delay = int(cells.delay[good].min())
            y, before, after = (np.concatenate([p[:, good] for p in parts]) for parts in (readings, declared, cells.predicted))
            near = np.abs(y - after) < 6 * cells.noise[good]
            rms["rms of heights, recording − as declared"] = _identified.rms_of(np.where(near, y - before, np.nan))
            rms["rms of heights, recording − identified"] = _identified.rms_of(np.where(near, y - after, np.nan))
        known = _cell_values(cells, channel, prefix)
    sensors = []
    if cells is not None and height:
        sensors.append(fit_height_sensor(height, cells, [r.readings[height] for r in read_in]))
    motion = None
    if label is not None:
        near, span = proximity or (None, 0.0)
        motion = fit_motion(rerun, label, known, near, span, force, fit, seconds, _as_likely(cells, known))
        known = dict(known, **{f"object.{label}.{name}": value for name, (value, _) in motion.values.items()})
    if proximity is not None:
        name, span = proximity
        ideal = [result[name] for result in rerun.run(known, (name,))]
        sensors.append(fit_proximity(name, span, [r.readings[name] for r in read_in], ideal,
                                     follows=motion is None or not motion.strays))
    if cells is None and motion is None and not sensors:
        raise RecordingError(f"{read_in[0].path}: no sensor measures what the actuators do, and no --object is named: nothing to identify")
    values = _identified.values(cells, prefix, least_delay, sensors, motion, rerun.parameters)
    rows = _identified.cell_faults(cells, least_delay) if cells is not None else []
    declared_sensors = {c.name for c in rerun.simulation.sensor_channels}
    for found in sensors:
        if found.name in declared_sensors:
            rows += found.faults
            rows += _bias(found, rerun)
    then = original.values.get(prefix + "latency", (0.0, 0.0))[0]
    rows = _identified.with_earlier_cells(rows, original.rows, cells, {s.name for s in sensors},
                                          round(then - values.get(prefix + "latency", (then, 0.0))[0]))
    report = _identified.summary(cells, sensors, motion, rms)
    map_file = out.with_suffix(".csv")
    if rows:
        map_file.write_text(_identified.map_text(rows))
    out.write_text(_identified.experiment_text(original, read_in, rerun.options[0], values, map_file.name if rows else None))
    out.with_suffix(".txt").write_text(report)
    out.with_suffix(".json").write_text(_identified.as_json(read_in, cells, sensors, motion, values, rms))
    _identified.draw(out.with_suffix(".svg"), read_in, cells, height or "", motion, declared)
    try:
        Simulation(out, set=rerun.options[0])
    except Error as error:
        raise RecordingError(f"{error}; {out} and the files beside it have what was found") from error
    return Identified(values, cells, sensors, motion, report)


def _scene(recording: str | pathlib.Path) -> tuple[str | pathlib.Path, dict[str, str]]:
    """A recording's file and the options that follow its name."""
    if pathlib.Path(recording).exists():
        return recording, {}
    path, *pairs = str(recording).split(",")
    for pair in pairs:
        if "=" not in pair:
            raise RecordingError(f"{recording}: {pair or 'nothing'} after the comma must be NAME=VALUE, an option of the experiment")
    return path, {name: value for name, _, value in (pair.partition("=") for pair in pairs)}


def _bias(sensor: SensorFit, rerun: Rerun) -> _identified.Rows:
    """A bias of all cells, as entries of the map."""
    bias = sensor.values.get("bias")
    if bias is None or bias.low <= 0 <= bias.high:
        return []
    rows, columns = rerun.simulation.rows, rerun.simulation.columns
    return [(r, c, sensor.name, "offset", bias.value) for r in range(rows) for c in range(columns)]


def _check_output(out: pathlib.Path, experiment: str | pathlib.Path, recordings: Sequence[str | pathlib.Path]) -> None:
    if out.suffix != ".lua":
        raise RecordingError(f"{out}: the identified experiment must be called NAME.lua")
    if not out.parent.is_dir():
        raise RecordingError(f"{out}: no such folder")
    for path in (experiment, *recordings):
        for suffix in (".lua", ".csv", ".txt", ".json", ".svg"):
            target = out.with_suffix(suffix)
            if target.exists() and pathlib.Path(path).exists() and target.samefile(path):
                raise RecordingError(f"{target}: would overwrite what is read")


def _check_place(out: pathlib.Path, rerun: Rerun, original: _identified.Original) -> None:
    """What keeps the experiment with the values from being loaded is known before they are found."""
    if not original.comment and "uncertainty" in rerun.simulation.options:
        raise RecordingError(f"{rerun.experiment}: has an option 'uncertainty', which identified experiments declare: must be called otherwise")
    if out.parent.samefile(pathlib.Path(rerun.experiment).parent):
        return
    try:
        Simulation(out, set=rerun.options[0], source=pathlib.Path(rerun.experiment).read_text())
    except Error as error:
        raise RecordingError(f"{error}; the files of {rerun.experiment} must be beside {out}") from error


def _height_channel(recordings: Sequence[Recorded], sensor: str, channel: str, label: str | None) -> str | None:
    for recording in recordings:
        there = ", ".join(sorted(recording.commands)) or "none"
        if label is None and channel in recording.commands and channel != PINS:
            raise RecordingError(f"{recording.path}: actuator channel '{channel}': of actuators, only pins are identified, by their channel '{PINS}'")
        if channel not in recording.commands:
            raise RecordingError(f"{recording.path}: no actuator channel '{channel}' (it has {there}); of actuators, only pins are identified"
                                 + ("" if label is None else "; --channel names the one that moves the object"))
    for name in (sensor, "") if sensor == HEIGHT_SENSOR else (sensor,):
        if all(name in recording.readings for recording in recordings):
            return name
    if sensor != HEIGHT_SENSOR:
        lacking = next(r for r in recordings if sensor not in r.readings)
        there = ", ".join(sorted(name for name in lacking.readings if name)) or "none"
        raise RecordingError(f"{lacking.path}: no sensor channel '{sensor}' (it has {there})")
    return None


def _cell_values(cells: CellFit, channel: str, prefix: str) -> dict[str, Any]:
    """The parameters of cells for re-runs."""
    good = cells.state == GOOD
    nan = np.full(cells.state.shape, np.nan)
    known: dict[str, Any] = {prefix + name: pair[0] for name, pair in cells.shared.items()}
    if "lag" in cells.unknown:
        known[prefix + "lag"] = 0.0
    known[f"faults.{channel}.gain"] = np.where(good, cells.gain, nan)
    known[f"faults.{channel}.offset"] = np.where(good, cells.offset, nan)
    known[f"faults.{channel}.late"] = np.where(good & (cells.delay > 0), cells.delay, nan)
    known[f"faults.{channel}.stuck"] = np.where(cells.state == STUCK, cells.level, nan)
    return known


def _as_likely(cells: CellFit | None, known: Mapping[str, Any], count: int = 16) -> list[dict[str, Any]]:
    """The parameters of cells, changed by their errors."""
    if cells is None:
        return []
    random = np.random.default_rng(1)
    drawn = []
    for _ in range(count):
        changed = dict(known)
        for name, error in (("gain", cells.gain_error), ("offset", cells.offset_error)):
            key = f"faults.{cells.channel}.{name}"
            changed[key] = known[key] + error * random.standard_normal(error.shape)
        drawn.append(changed)
    return drawn


def _proximity(rerun: Rerun, recordings: Sequence[Recorded]) -> tuple[str, float] | None:
    """The first proximity sensor that looks up, and its range."""
    for channel in rerun.simulation.sensor_channels:
        if f"sensor.{channel.name}.false_hits" in rerun.parameters and f"sensor.{channel.name}.range" in rerun.parameters \
                and any(c.name == channel.name + "_hit" for c in rerun.simulation.sensor_channels) \
                and all(channel.name in r.readings for r in recordings):
            return channel.name, float(np.float32(channel.maximum))
    return None


def _object_sensor(rerun: Rerun, recordings: Sequence[Recorded], label: str, proximity: tuple[str, float] | None) -> str | None:
    """The sensor that feels the weight of the object, if any. Refuses an object that is not there or that nothing senses."""
    if f"object.{label}.mass" not in rerun.parameters:
        labels = sorted({name.split(".")[1] for name in rerun.parameters if name.startswith("object.")} - {"*"})
        there = ", ".join(labels) or "none with a label"
        raise RecordingError(f"--object {label}: {rerun.experiment} has no such object (it has {there})")
    force = next((c.name for c in rerun.simulation.sensor_channels if c.unit.startswith("mass") and c.components == 1
                  and all(c.name in r.readings for r in recordings)), None)
    if proximity is None and force is None:
        raise RecordingError(f"{recordings[0].path}: no proximity and no pressure sensor sees the object")
    return force
