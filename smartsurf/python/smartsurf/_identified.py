"""The files that identification writes: an experiment that runs, its map of single cells, a report, a plot."""
from __future__ import annotations

import json
import math
import pathlib
import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ._cells import GOOD, IDLE, STUCK, UNSURE, CellFit
from ._motion import MotionFit
from ._printable import printable
from ._readings import SensorFit
from ._recorded import Array, Recorded, RecordingError
from .run import plot

Rows = list[tuple[int, int, str, str, "float | None"]]


def number(value: float, digits: int = 6) -> str:
    return f"{value:.{digits}g}"


def cell_faults(fit: CellFit, least_delay: int) -> Rows:
    """The cells' own values, as entries of a map of faults."""
    rows: Rows = []
    for r, c in np.argwhere(fit.state != IDLE):
        at = (int(r), int(c), fit.channel)
        if fit.state[r, c] == STUCK:
            rows.append((*at, "stuck", float(fit.level[r, c])))
        if fit.state[r, c] != GOOD:
            continue
        rows += [(*at, "gain", float(fit.gain[r, c])), (*at, "offset", float(fit.offset[r, c]))]
        if fit.delay[r, c] > least_delay:
            rows.append((*at, "late", float(fit.delay[r, c] - least_delay)))
    return rows


def values(fit: CellFit | None, prefix: str, least_delay: int, sensors: Sequence[SensorFit], motion: MotionFit | None,
           parameters: set[str]) -> dict[str, tuple[float, float]]:
    """Values and standard errors of all parameters of the whole table, by name."""
    found: dict[str, tuple[float, float]] = {}
    if fit is not None:
        found.update({prefix + name: pair for name, pair in fit.shared.items()})
        if (fit.state == GOOD).any():
            found[prefix + "latency"] = (float(least_delay), 0.0)
        found.update({f"faults.actuator.{name}": (0.0, 0.0) for name in ("stuck", "dead", "weak", "latency")})
    for sensor in sensors:
        for name, estimate in sensor.values.items():
            if f"sensor.{sensor.name}.{name}" in parameters:
                found[f"sensor.{sensor.name}.{name}"] = (estimate.value, estimate.error)
        for name in ("dead", "stuck_low", "stuck_high"):
            if f"sensor.{sensor.name}.{name}" in parameters:
                found[f"sensor.{sensor.name}.{name}"] = (0.0, 0.0)
    if motion is not None:
        found.update({f"object.{motion.label}.{name}": pair for name, pair in motion.values.items()})
    return found


def lua_string(text: str) -> str:
    """The text as a string of Lua."""
    return "'" + re.sub(r"[\\'\x00-\x1f\x7f\udc80-\udcff]", lambda c: "\\" + c[0] if c[0] in "\\'" else f"\\{ord(c[0]) & 0xff:03d}", text) + "'"


def _text_of(quoted: str) -> str:
    """The text that lua_string() has quoted."""
    return re.sub(r"\\(\d{3}|.)", lambda c: chr(int(c[1])) if c[1].isdigit() else c[1], quoted[1:-1])


_TAIL = """
if not has_faults then faults {} end
for name in pairs(ranges) do
  local label = name:match('^object%.(.*)%.')
  if label and label ~= '*' and not labels[label] then ranges[name] = nil end  -- not in this run
end
script_vary(ranges)
"""
_QUOTED = r"'(?:[^'\\\n]|\\.)*'"
_VALUE = re.compile(rf"  \[({_QUOTED})\] = {{ (\S+), (\S+) }},\n")
_MAP = re.compile(rf"\n  fields\.map = ({_QUOTED})  -- single cells\n")
_WITH_VALUES = re.compile(rf"(?P<comment>-- .* with what smartsurf identify has found in .*\n(?:-- (?:Then|There) with .*\n)*)"
                          rf"-- Each parameter: .*\n.*\nlocal identified = {{\n(?P<values>(?:{_VALUE.pattern})*)}}\n"
                          rf"(?P<head>(?:(?!-- ----).*\n)*)-- -{{20}} (?P<name>.*)\n(?P<text>[\s\S]*){re.escape(_TAIL)}")


@dataclass
class Original:
    """An experiment that is to be identified. If it is the result of an identification: the experiment before, and what was found."""
    name: str
    text: str
    comment: str = ""
    values: dict[str, tuple[float, float]] = field(default_factory=dict)
    rows: Rows = field(default_factory=list)


def read_original(path: pathlib.Path) -> Original:
    text = path.read_text()
    found = _WITH_VALUES.fullmatch(text)
    if not found:
        return Original(printable(path.name), text)
    rows: Rows = []
    if map_name := _MAP.search(found["head"]):
        map_file = path.parent / _text_of(map_name[1])
        try:
            lines = map_file.read_text().splitlines()[1:]
            for row, column, channel, fault, value in (line.split(",") for line in lines):
                rows.append((int(row), int(column), channel, fault, float(value) if value else None))
        except (OSError, ValueError) as error:
            raise RecordingError(f"{map_file}: {getattr(error, 'strerror', None) or error}; is the map of {path}") from error
    return Original(found["name"], found["text"], found["comment"],
                    {_text_of(name): (float(value), float(error)) for name, value, error in _VALUE.findall(found["values"])}, rows)


def with_earlier_cells(rows: Rows, earlier: Rows, fit: CellFit | None, sensors: set[str], later: int) -> Rows:
    """The rows and, of cells and sensors that are not identified again, the earlier ones. later: by how many ticks the pins'
    latency was above that of now."""
    again = set() if fit is None else {(int(r), int(c)) for r, c in np.argwhere((fit.state == GOOD) | (fit.state == STUCK))}
    kept = [row for row in earlier if row[2] not in sensors and not (fit is not None and row[2] == fit.channel and row[:2] in again)]
    if fit is not None and later:
        late = {row[:2]: row[4] or 0.0 for row in kept if row[2:4] == (fit.channel, "late")}
        delays = {row[:2]: late.get(row[:2], 0.0) + later for row in kept if row[2:4] == (fit.channel, "gain")}
        kept = [row for row in kept if row[2:4] != (fit.channel, "late")]
        kept += [(*cell, fit.channel, "late", delay) for cell, delay in delays.items() if delay > 0]
    return kept + rows


def experiment_text(original: Original, recordings: Sequence[Recorded], options: dict[str, str],
                    found: dict[str, tuple[float, float]], map_name: str | None) -> str:
    """The original script between lines that give it the values."""
    names = printable(", ".join(pathlib.Path(r.path).name for r in recordings))
    comment = f"-- Then with what it has found in {names}." if original.comment \
        else f"-- {original.name} with what smartsurf identify has found in {names}."
    lines = [*original.comment.splitlines(), comment]
    if options:
        words = " ".join("--set " + shlex.quote(f"{name}={value}") for name, value in sorted(options.items()))
        lines.append(f"-- There with {printable(words)}")
    lines += ["-- Each parameter: its value and its standard error. With --set uncertainty=2 each run draws from two errors to both sides.",
              "local uncertainty = option('uncertainty', 0, 'half width of the identified ranges, in standard errors')",
              "local identified = {"]
    lines += [f"  [{lua_string(name)}] = {{ {number(value, 9)}, {number(error, 4)} }}," for name, (value, error) in {**original.values, **found}.items()]
    lines += ["}", "local script_vary, script_faults, has_faults, ranges, labels = vary, faults, false, {}, {}",
              "for name, pair in pairs(identified) do",
              "  local width = uncertainty * pair[2]",
              # Masses and accelerations must be above 0.
              "  ranges[name] = { math.max(pair[1] - width, math.min(pair[1], 0.01 * pair[1])), pair[1] + width }",
              "end",
              "function vary(of_script)",
              "  for name, range in pairs(of_script) do ranges[name] = ranges[name] or range end",
              "end",
              "for _, shape in ipairs { 'sphere', 'box', 'cylinder', 'capsule', 'cone', 'hull', 'mesh' } do",
              "  local create = _G[shape]",
              "  _G[shape] = function(fields)",
              "    if fields.label then labels[fields.label] = true end",
              "    return create(fields)",
              "  end",
              "end",
              "function faults(fields)",
              "  has_faults = true"]
    if map_name is not None:
        lines.append(f"  fields.map = {lua_string(map_name)}  -- single cells")
    lines += ["  return script_faults(fields)", "end", f"-- {'-' * 20} {original.name}"]
    return "\n".join(lines) + "\n" + original.text + ("" if original.text.endswith("\n") else "\n") + _TAIL


def map_text(rows: Rows) -> str:
    body = [f"{r},{c},{channel},{fault},{'' if value is None else number(value, 9)}" for r, c, channel, fault, value in rows]
    return "\n".join(["row,column,channel,fault,value", *body]) + "\n"


def rms_of(values: Array) -> float:
    known = values[np.isfinite(values)]
    return math.sqrt(float((known * known).mean())) if known.size else math.nan


def summary(fit: CellFit | None, sensors: Sequence[SensorFit], motion: MotionFit | None, rms: dict[str, float]) -> str:
    """The report, in lines."""
    out = []

    def line(name: str, value: float, error: float, note: str = "") -> None:
        out.append(f"  {name:28} {number(value, 5):>12} ± {number(1.96 * error, 2):10} {note}".rstrip())
    out.append("each value with the half width of its 95 % interval")
    if fit is not None:
        good = fit.state == GOOD
        out.append(f"actuator channel {fit.channel}: {int(good.sum())} cells answer, {int((fit.state == STUCK).sum())} stuck, "
                   f"{int((fit.state == IDLE).sum())} hardly commanded")
        if (fit.state == UNSURE).any():
            out.append(f"  {int((fit.state == UNSURE).sum())} cells not identified: they saw too few steps for their gain, or their delay to a tick")
        for name, (value, error) in fit.shared.items():
            line(name, value, error, _cells_differ(fit, name))
        if good.any():
            delays, counts = np.unique(fit.delay[good], return_counts=True)
            out.append(f"  {'delay, ticks (cells)':28} {', '.join(f'{d} ({n})' for d, n in zip(delays, counts))}"
                       + (f"; {int((~fit.delay_sure & good).sum())} of them uncertain by one" if (~fit.delay_sure & good).any() else ""))
            for name, of_cells, errors in (("gain", fit.gain, fit.gain_error), ("offset", fit.offset, fit.offset_error)):
                least, middle, most = (number(float(v), 4) for v in np.quantile(of_cells[good], (0, 0.5, 1)))
                out.append(f"  {name + ' of cells':28} {middle:>12}   from {least} to {most}, "
                           f"each ± {number(1.96 * float(np.median(errors[good])), 2)}")
        out += [f"  {name:28} not identified: {why}" for name, why in fit.unknown.items()]
        out.append(f"  {'quantisation of commands':28} not identified: the simulator's actuators have none")
        out.append(f"  readings {fit.samples}, of which {fit.outliers} far off were left out")
    for name, value in rms.items():
        out.append(f"  {name:45} {number(value, 4)}")
    for sensor in sensors:
        out.append(f"sensor {sensor.name}: {sensor.samples} readings, {len([f for f in sensor.faults if f[3] != 'offset'])} dead or stuck cells")
        for name, e in sensor.values.items():
            out.append(f"  {name:28} {number(e.value, 5):>12}   from {number(e.low, 4)} to {number(e.high, 4)}")
        out += [f"  {name:28} not identified: {why}" for name, why in sensor.unknown.items()]
    if motion is not None:
        out.append(f"object {motion.label}: {motion.samples} frames")
        for name, (value, error) in motion.values.items():
            line(name, value, error)
        out += [f"  {name:28} not identified: {why}" for name, why in motion.unknown.items()]
        for k, name in enumerate(motion.names):
            out.append(f"  {'rms residual of ' + name:45} {number(rms_of(np.concatenate([s[:, k] - p[:, k] for s, p in motion.tracks])), 4)}")
    return "\n".join(out) + "\n"


def _cells_differ(fit: CellFit, name: str) -> str:
    """Whether the cells' own values scatter more than their errors say."""
    if name not in fit.of_cells:
        return ""
    value, error = fit.of_cells[name]
    known = np.isfinite(value) & (error > 0)
    if known.sum() < 8:
        return ""
    z = (value[known] - fit.shared[name][0]) / error[known]
    ratio = float((z * z).mean())
    if ratio < 1 + 4 * math.sqrt(2 / int(known.sum())):
        return "(cells agree)"
    spread = math.sqrt(max(float(np.var(value[known]) - (error[known] ** 2).mean()), 0))
    return f"(cells differ by {number(spread, 2)}: one value for all is an average)"


def as_json(recordings: Sequence[Recorded], fit: CellFit | None, sensors: Sequence[SensorFit], motion: MotionFit | None,
            found: dict[str, tuple[float, float]], rms: dict[str, float]) -> str:
    document: dict[str, Any] = {"recordings": [r.path for r in recordings], "rms": rms,
                                "parameters": {name: {"value": v, "error": e} for name, (v, e) in found.items()}}
    if fit is not None:
        cells = {name: getattr(fit, name).tolist() for name in ("state", "gain", "gain_error", "offset", "offset_error", "delay", "noise", "level")}
        cells["delay_sure"] = fit.delay_sure.tolist()
        for name, (value, error) in fit.of_cells.items():
            cells[name], cells[name + "_error"] = np.where(np.isfinite(value), value, 0).tolist(), error.tolist()
        document["cells"] = cells
        document["not_identified"] = {f"actuator.{name}": why for name, why in fit.unknown.items()}
    document["sensors"] = {s.name: {"values": {k: vars(e) for k, e in s.values.items()}, "not_identified": s.unknown,
                                    "cells": [list(f) for f in s.faults]} for s in sensors}
    if motion is not None:
        document["object"] = {"label": motion.label, "not_identified": motion.unknown}
    return json.dumps(document, indent=1) + "\n"


def draw(path: pathlib.Path, recordings: Sequence[Recorded], fit: CellFit | None, height: str, motion: MotionFit | None,
         declared: Sequence[Array] | None) -> None:
    """The recording beside the re-run: the cell of median residual, the worst one, and the object."""
    panels = []
    r = recordings[0]
    if fit is not None and (fit.state == GOOD).any():
        order = np.argsort(np.where(fit.state == GOOD, fit.noise, np.inf).ravel())
        good = int((fit.state == GOOD).sum())
        n = min(r.frames, int(3 / r.period_s))
        t = (np.arange(n) * r.period_s).tolist()
        for title, index in (("median cell", order[good // 2]), ("worst cell", order[good - 1])):
            row, column = divmod(int(index), r.columns)
            layers = [_layer("point", "recorded", "#999999", t, r.readings[height][:n, row, column])]
            if declared is not None:
                layers.append(_layer("line", "as declared", "#d08040", t, declared[0][:n, row, column]))
            layers.append(_layer("line", "identified", "#1f4e79", t, fit.predicted[0][:n, row, column]))
            panels.append({"title": f"{title}: row {row}, column {column}", "x": {"title": "time, s"}, "y": {"title": "height, u"}, "layers": layers})
    if motion is not None and motion.tracks:
        sensed, predicted = motion.tracks[0]
        t = (np.arange(len(sensed)) * r.period_s).tolist()
        for k, name in enumerate(motion.names):
            panels.append({"title": motion.label, "x": {"title": "time, s"}, "y": {"title": name},
                           "layers": [_layer("point", "recorded", "#999999", t, sensed[:, k]), _layer("line", "identified", "#1f4e79", t, predicted[:, k])]})
    if panels:
        plot({"title": "Recording and re-run", "columns": 2, "panels": panels}, path)


def _layer(mark: str, name: str, color: str, x: list[float], y: Array) -> dict[str, Any]:
    return {"mark": mark, "name": name, "color": color, "x": x, "y": [float(v) if math.isfinite(v) else None for v in y]}
