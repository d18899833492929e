"""Sweeps: points of a search space, their execution into folders, and tables of their results.

`scripts/sweep` is the command line. A task is a plain dict, so that an array job can read it from a file:

    python3 -m smartsurf.sweep TASKS.jsonl INDEX CHUNK     executes the INDEX-th CHUNK of tasks, counted from 1
"""
from __future__ import annotations

import contextlib
import csv
import datetime
import fcntl
import hashlib
import itertools
import json
import math
import os
import pathlib
import platform
import random
import re
import shlex
import shutil
import statistics
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from ._files import ResultError, clear, open_own, read_json, read_own, replaced, require_no_link, write_own
from ._printable import guard_output
from .run import command, execute as execute_command
from .success import Step, success_curve, time_of_share, wilson

Options = tuple[tuple[str, str], ...]

SUCCESS_TIMES = ("success_s", "sorted_at_s")  # figures: when the run succeeded; null if it did not
DECIDED = ("success", "purity")  # figures that the metric of that name decides
OWN_COLUMNS = ("seed", "exit_status", "runs", "failed", "succeeded", "success_rate", "success_low", "success_high")  # besides options
LOSSES = ("left_table", "off_surface", "lost")  # figures: objects lost

COLOURS = ("#0073b3", "#d65e00", "#009e73", "#cc78a6", "#57b5e8", "#e69e00", "#595959")  # as in common/color/LineColours.h

OUTPUTS = ("stats.json", "log", "provenance.json", "recording.h5", "status")  # of a run, in its folder

MAX_NAME_BYTES = 200  # of a folder: file systems take 255, and files in preparation have longer names


# Points

def grid(axes: Sequence[tuple[str, list[str]]]) -> list[Options]:
    """All combinations of the values of each option."""
    return [tuple(zip((name for name, _ in axes), values))
            for values in itertools.product(*(values for _, values in axes))]


def samples(axes: Sequence[tuple[str, list[str]]], count: int, method: str, seed: int) -> list[Options]:
    """count points. method: 'random' draws independently; 'latin-hypercube' draws one point in each of count equal
    strata of each option (McKay, Beckman, Conover 1979) and needs SciPy. A value 'LOW:HIGH' is a range: of integers, both
    included, if both are written as integers; other values are drawn from their list with equal probability."""
    if method == "latin-hypercube":
        from scipy.stats import qmc
        shares = qmc.LatinHypercube(len(axes), seed=seed).random(count)
    else:
        source = random.Random(seed)
        shares = zip(*([source.random() for _ in range(count)] for _ in axes))
    return [tuple((name, _at(values, share)) for (name, values), share in zip(axes, point)) for point in shares]


def bounds(value: str) -> tuple[float, float] | None:
    """'LOW:HIGH' → (LOW, HIGH); None for anything else."""
    try:
        low, high = map(float, value.split(":"))
    except ValueError:
        return None
    return (low, high) if math.isfinite(low) and math.isfinite(high) and low <= high else None


def _at(values: list[str], share: float) -> str:
    """The value at share in [0, 1) of the option's distribution."""
    limits = bounds(values[0]) if len(values) == 1 else None
    if limits is None:
        return values[min(int(share * len(values)), len(values) - 1)]
    low, high = limits
    if re.fullmatch(r"[+-]?\d+:[+-]?\d+", values[0]):
        return str(min(int(low) + int(share * (int(high) - int(low) + 1)), int(high)))
    return f"{low + share * (high - low):.9g}"


# Provenance

def sources(path: pathlib.Path, known: dict[pathlib.Path, bytes] | None = None) -> dict[pathlib.Path, bytes]:
    """The file and, recursively, the files beside it that it names in quotes: what it requires, includes and loads."""
    known = {} if known is None else known
    if path in known or not path.is_file():
        return known
    known[path] = path.read_bytes()
    if path.suffix not in (".lua", ".aps"):
        return known
    for word in re.findall(r"['\"]([^'\"\n]+)['\"]", known[path].decode(errors="replace")):
        for name in (word, word.replace(".", "/") + ".lua", word + ".aps"):
            if len(name) < 200:
                sources(path.parent / name, known)
    return known


def provenance(version: str, experiment: str, controller: str | None, settings: Iterable[str]) -> dict[str, Any]:
    """The version, the sources with their SHA-256, and the digest of all that results depend on besides options and
    seed."""
    files = sources(pathlib.Path(experiment).resolve())
    for word in shlex.split(controller or ""):
        sources(pathlib.Path(word).resolve(), files)
    digest = hashlib.sha256()
    for text in (version, controller or "", *settings):
        digest.update(text.encode() + b"\0")
    for path in sorted(files):
        digest.update(path.name.encode() + b"\0" + files[path] + b"\0")
    return {"version": version, "digest": digest.hexdigest()[:16],
            "sources": {str(path): hashlib.sha256(text).hexdigest() for path, text in sorted(files.items())}}


# Execution

def folder_name(options: Options, seed: int) -> str:
    """A name for the folder of a point and seed, which no other has: NAME=VALUE,…,seed=N where a file system takes that and it
    can be read in one way only, otherwise its beginning and a hash."""
    text = ",".join([f"{k}={v}" for k, v in options] + [f"seed={seed}"])
    name = re.sub("[/\0]", "_", text)
    ambiguous = name != text or any("," in k or re.search(",.*=", v, re.DOTALL) for k, v in options)
    if not ambiguous and len(name.encode()) <= MAX_NAME_BYTES:
        return name
    whole = json.dumps([options, seed]) if ambiguous else text
    digest = hashlib.sha256(whole.encode()).hexdigest()[:16]
    return name.encode()[:MAX_NAME_BYTES - 17].decode(errors="ignore") + "-" + digest


@contextlib.contextmanager
def locked(folder: pathlib.Path) -> Iterator[bool]:
    """Whether this process alone works in the folder, which the kernel decides and forgets with the process."""
    with open(open_own(folder / ".lock", os.O_RDWR | os.O_CREAT)) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
        except OSError:  # a file system without locks
            yield True
        else:
            yield True


def require_own(folder: pathlib.Path) -> None:
    """Raises ResultError if the folder of a run lies outside that of its sweep."""
    for link in (folder.parent, folder):
        require_no_link(link)


class Point:
    """One point of the search space with one seed, and its folder. Raises ResultError where that holds what no run has left."""

    def __init__(self, out: pathlib.Path, options: Options, seed: int, digest: str):
        self.options, self.seed, self.digest = options, seed, digest
        self.folder = out / "runs" / folder_name(options, seed)

    def status(self) -> int | None:
        """The exit status; None: not run yet, or with other sources."""
        require_own(self.folder)
        try:
            text = read_own(self.folder / "status")
        except OSError:
            return None
        try:
            status, digest, *options = text.decode().rstrip("\n").split(" ", 2)
            # Without options: of an earlier version, in whose names of folders "_" also stood for "/".
            same = json.loads(options[0]) == dict(self.options) if options else not any("_" in value for _, value in self.options)
            return int(status) if same and digest == self.digest else None
        except (ValueError, RecursionError):
            return None

    def read(self, name: str) -> dict[str, Any]:
        """One of the folder's JSON files; empty if there is none."""
        require_own(self.folder)
        try:
            stored = read_json(self.folder / name)
        except OSError:
            return {}
        if not is_number(stored.get("simulated_s", 0)):
            raise ResultError(f"{self.folder / name}: is damaged: simulated_s: must be a number")
        return stored

    def named_figures(self) -> Iterator[tuple[str, str, Any]]:
        """Name, column of the tables and value of each figure. The statistics have nested names, joined by dots, and the metrics
        their own: one with the name of a statistic is metrics.NAME, but in DECIDED. Options, seed and exit_status have columns
        of their own: a metric with such a name has metrics.NAME, a statistic stats.NAME. None if not run."""
        flat: dict[str, Any] = {}

        def walk(prefix: str, value: Any) -> None:
            if isinstance(value, dict):
                for key, inner in value.items():
                    walk(f"{prefix}.{key}" if prefix else key, inner)
            else:
                flat[prefix] = value

        if self.status() is not None:
            walk("", self.read("stats.json"))
        taken = {*dict(self.options), "seed", "exit_status"}
        for path, value in flat.items():
            if path not in ("seed", "experiment"):
                own = path.removeprefix("metrics.")
                name = path if own in flat and own not in DECIDED else own
                kind = "stats" if own == path and own not in DECIDED else "metrics"
                yield name, f"{kind}.{own}" if name in taken else name, value

    def figures(self) -> dict[str, Any]:
        return {name: value for name, _, value in self.named_figures()}

    def columns(self) -> dict[str, Any]:
        return {column: value for _, column, value in self.named_figures()}

    def figure(self, name: str) -> Any:
        """By its column or, where an option has the column of that name, by its own name; None: the run has none."""
        return self.columns().get(name, self.figures().get(name))

    def message(self) -> str:
        """The last line of the run's log."""
        try:
            text = read_own(self.folder / "log", last=65536).decode(errors="replace")
        except OSError:
            text = ""
        return (text.strip().splitlines() or ["no message"])[-1]


def earlier(out: pathlib.Path, points: Sequence[Point]) -> tuple[list[Point], int]:
    """The completed runs in the sweep's folder that are not among the points but could be: of the same sources and the same
    options with other values or seeds, in their order. And how many more completed runs there are."""
    names, digest = [name for name, _ in points[0].options], points[0].digest
    known = {(point.options, point.seed) for point in points}
    found, others, folders = [], 0, {point.folder for point in points}
    for folder in sorted((out / "runs").iterdir()) if (out / "runs").is_dir() else ():
        try:
            require_own(folder)
            status, of, text = read_own(folder / "status").decode().rstrip("\n").split(" ", 2)
            options, seed = dict(json.loads(text)), read_json(folder / "stats.json")["seed"]
            is_run = isinstance(seed, int) and all(isinstance(part, str) for option in options.items() for part in option)
        # Not run, failed, of an earlier version, or no run at all.
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            continue
        if not is_run:
            continue
        if folder in folders or status != "0":
            continue
        if of != digest or options.keys() != set(names):
            others += 1
            continue
        point = Point(out, tuple((name, options[name]) for name in names), seed, digest)
        point.folder = folder
        if (point.options, seed) not in known:
            known.add((point.options, seed))
            found.append(point)

    def place(point: Point) -> tuple[Any, ...]:
        heads = [value.partition(":")[0] for _, value in point.options]  # of a nuisance, its number: 0.5:factor
        return [(float(head) if is_numeric(head) else math.inf, value) for head, (_, value) in zip(heads, point.options)], point.seed

    return sorted(found, key=place), others


def tasks(points: Sequence[Point], arguments: dict[str, Any], worlds: int = 1, timeout: float | None = None, retry: int = 0,
          record: bool = False) -> list[dict[str, Any]]:
    """Packs points with equal options and consecutive seeds into tasks of up to `worlds` points."""
    packs: list[list[Point]] = []
    for point in points:
        last = packs[-1] if packs else []
        if last and len(last) < worlds and last[-1].options == point.options and last[-1].seed + 1 == point.seed:
            last.append(point)
        else:
            packs.append([point])
    return [{"arguments": {**arguments, "set": dict(pack[0].options)}, "seed": pack[0].seed, "digest": pack[0].digest,
             "folders": [str(p.folder) for p in pack], "timeout": timeout, "retry": retry, "record": record}
            for pack in packs]


@contextlib.contextmanager
def temporary(folder: pathlib.Path) -> Iterator[pathlib.Path]:
    """The folder, empty, while its context lasts."""
    clear(folder)
    shutil.rmtree(folder, ignore_errors=True)  # of a process that was killed
    folder.mkdir()
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def execute(task: dict[str, Any]) -> None:
    """Runs a task and writes each run's OUTPUTS, the last its status, and beside a recording what its script writes.

    A pack is one process. If it fails, its runs are repeated one by one, so that each has its own status and log."""
    folders = [pathlib.Path(folder) for folder in task["folders"]]
    for folder in folders:
        require_own(folder)
        folder.mkdir(parents=True, exist_ok=True)
        for name in ("status", "stats.json"):
            (folder / name).unlink(missing_ok=True)
        for name in ("recording.h5", "recording.files"):  # which the simulator writes
            clear(folder / name)
        shutil.rmtree(folder / "recording.files", ignore_errors=True)
    is_pack = len(folders) > 1
    with temporary(folders[0] / "worlds") if is_pack else contextlib.nullcontext(folders[0]) as made:
        words = command(**task["arguments"], seed=task["seed"], worlds=len(folders) if is_pack else None,
                        record=made / "recording.h5" if task["record"] else None)
        started, start = datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"), time.monotonic()
        for attempt in range(1, task["retry"] + 2):
            status, stats, log = execute_command(words, task["timeout"])
            if status in (0, 2):  # invalid input stays invalid
                break
        if not is_pack or status == 0:
            for k, folder in enumerate(folders):
                for file in made.glob(f"recording-{k}.*") if is_pack else ():
                    file.replace(folder / f"recording{file.suffix}")
                if stats is not None:
                    write_own(folder / "stats.json", json.dumps(stats["runs"][k] if is_pack else stats, indent=2) + "\n")
                write_own(folder / "log", log)
                write_own(folder / "provenance.json", json.dumps({
                    "host": platform.node(), "platform": platform.platform(), "started": started,
                    "wall_s": round(time.monotonic() - start, 3), "attempts": attempt, "worlds": len(folders),
                    "digest": task["digest"], "command": shlex.join(words)}, indent=2) + "\n")
                write_own(folder / "status", f"{status} {task['digest']} {json.dumps(task['arguments']['set'])}\n")
            return
    for k, folder in enumerate(folders):
        execute({**task, "seed": task["seed"] + k, "folders": [str(folder)]})


# Tables

def quantile(values: Sequence[float], share: float) -> float:
    """The quantile, interpolated linearly between order statistics (as NumPy's default)."""
    ordered = sorted(values)
    place = share * (len(ordered) - 1)
    low = math.floor(place)
    return ordered[low] + (ordered[math.ceil(place)] - ordered[low]) * (place - low)


def rows(points: Iterable[Point]) -> list[dict[str, Any]]:
    """One dict per point: options, seed, exit_status, figures by their columns."""
    return [{**dict(p.options), "seed": p.seed, "exit_status": p.status(), **p.columns()} for p in points]


def outcomes(points: Iterable[Point], success: str) -> list[bool]:
    """Whether each completed run succeeded: its figure `success` is 1 or true."""
    return [p.figure(success) == 1 for p in points if p.status() == 0]


def tells(points: Iterable[Point], success: str) -> bool:
    """Whether any completed run has the figure `success`. If none has, the experiment has no goal; if some have, the others
    ended without reaching it."""
    return any(isinstance(p.figure(success), (int, float)) for p in points if p.status() == 0)


def success_time(figures: dict[str, Any], time: str) -> float | None:
    """When a run succeeded, by its figure `time`; None where it did not, although success() held for a while before a metric
    `success` said so."""
    known = figures.get(time)
    return known if is_number(known) and figures.get("success", 1) == 1 else None


def time_to_success(points: Iterable[Point], time: str, until: float | None = None) -> list[Step] | None:
    """The share of the completed runs that succeed within a time, from their figure `time`. A run that ends without
    success stays one of those that have not succeeded until `until` or, without it, until the longest run ends: its
    experiment may have given up early. None if a run succeeds at an unknown time. For points of which any tells()."""
    done = [p.figures() for p in points if p.status() == 0]
    times = [success_time(f, time) for f in done]
    if not done or any(f.get("success") == 1 and known is None for f, known in zip(done, times)):
        return None
    end = max([until or 0.0, *(f.get("simulated_s") or 0.0 for f in done)])
    return success_curve(times, [end] * len(times))


def groups_of(points: Iterable[Point]) -> dict[Options, list[Point]]:
    """The points of each combination of options."""
    groups: dict[Options, list[Point]] = {}
    for point in points:
        groups.setdefault(point.options, []).append(point)
    return groups


def summary(points: Sequence[Point], success: str, shares: Sequence[float], until: float | None = None) -> list[dict[str, Any]]:
    """One dict per combination of options, over its completed runs: their number and that of the failed ones; rate and
    95 % Wilson interval of those whose figure `success` is 1, if any run has it; median and quantiles of each numeric figure, of times to
    success with the runs that do not succeed (None: not reached); `missing`: the runs without a figure that other runs have;
    of counts of objects lost, their sum and the runs that lose any."""
    table, has_goal, has_success = [], tells(points, success), tells(points, "success")
    numeric = {column: name for p in points if p.status() == 0 for name, column, value in p.named_figures()
               if is_number(value) or (name in SUCCESS_TIMES and has_success)}
    for options, members in groups_of(points).items():
        done = [p.columns() for p in members if p.status() == 0]
        row: dict[str, object] = {**dict(options), "runs": len(members), "failed": len(members) - len(done)}
        won = outcomes(members, success) if has_goal else []
        if won:
            low, high = wilson(sum(won), len(won))
            row |= {"succeeded": sum(won), "success_rate": sum(won) / len(won), "success_low": low,
                    "success_high": high}
        for column, name in numeric.items():
            values = [f[column] for f in done if is_number(f.get(column))]
            if name in SUCCESS_TIMES and values and has_success and (curve := time_to_success(members, name, until)) is not None:
                row[f"{column}.median"], row[f"{column}.median_low"], row[f"{column}.median_high"] = time_of_share(curve, 0.5)
                row |= {f"{column}.q{100 * share:g}": time_of_share(curve, share)[0] for share in shares}
            elif values:
                row[f"{column}.median"] = statistics.median(values)
                row |= {f"{column}.q{100 * share:g}": quantile(values, share) for share in shares}
            if len(values) < len(done):
                row[f"{column}.missing"] = len(done) - len(values)
            if values and name in LOSSES:
                row |= {f"{column}.sum": sum(values), f"{column}.runs": sum(value > 0 for value in values)}
        table.append(row)
    return table


def lighter(colour: str) -> str:
    """A colour '#rrggbb', halfway to white."""
    return "#" + "".join(f"{(255 + int(colour[at:at + 2], 16)) // 2:02x}" for at in (1, 3, 5))


def rate_chart(x: str, lines: dict[str, list[tuple[float, int, int]]], colours: Sequence[str] = COLOURS) -> dict[str, Any]:
    """A chart, as smartsurf.plot() draws it, of success rates over x. lines: by name, points of (x, successes, runs); each
    is a line through the rates and two lighter ones through the ends of Wilson's interval."""
    layers: list[dict[str, Any]] = []
    for (name, points), colour in zip(lines.items(), itertools.cycle(colours)):
        points = sorted(points)
        at, ends = [value for value, _, _ in points], [wilson(won, runs) for _, won, runs in points]
        layers += [{"mark": "line", "color": lighter(colour), "x": at, "y": [end[k] for end in ends]} for k in (0, 1)]
        layers.append({"mark": "line", "point": True, "name": name, "color": colour, "x": at, "y": [won / runs for _, won, runs in points]})
    values = [value for points in lines.values() for value, _, _ in points]
    margin = 0.03 * (max(values) - min(values)) or 1.0
    return {"title": "Runs that succeed", "subtitle": "share and its 95 % interval", "width": 720, "height": 420,
            "x": {"title": x, "domain": [min(values) - margin, max(values) + margin]},
            "y": {"title": "share of the runs", "domain": [-0.03, 1.03]}, "layers": layers}


def is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def is_numeric(text: str) -> bool:
    try:
        float(text)
        return True
    except ValueError:
        return False


def columns(table: Iterable[dict[str, Any]]) -> list[str]:
    return list(dict.fromkeys(key for row in table for key in row))


def write_csv(path: pathlib.Path, table: Sequence[dict[str, Any]]) -> None:
    names = columns(table)
    with replaced(path, own=True) as part, part.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(["" if row.get(name) is None else row[name] for name in names] for row in table)


def write_jsonl(path: pathlib.Path, points: Iterable[Point]) -> None:
    """One object per point: options, seed, exit_status, stats, provenance."""
    with replaced(path, own=True) as part, part.open("w") as file:
        for p in points:
            known = p.status() is not None
            file.write(json.dumps({"options": dict(p.options), "seed": p.seed, "exit_status": p.status(),
                                   "stats": p.read("stats.json") if known else {},
                                   "provenance": p.read("provenance.json") if known else {}}) + "\n")


def write_parquet(path: pathlib.Path, table: Sequence[dict[str, Any]], provenance: dict[str, Any]) -> None:
    """The rows as typed columns, the provenance in the file's metadata. Needs pyarrow: raises ImportError without."""
    import pyarrow
    import pyarrow.parquet
    arrays = {}
    for name in columns(table):
        values: list[Any] = [row.get(name) for row in table]
        if all(isinstance(v, str) and is_numeric(v) for v in values):  # an option
            values = [float(str(v)) for v in values]
        elif any(isinstance(v, str) for v in values):
            values = [None if v is None else str(v) for v in values]
        elif any(isinstance(v, float) for v in values):
            values = [None if v is None else float(v) for v in values]
        arrays[name] = pyarrow.array(values)
    metadata = {"smartsurf.provenance": json.dumps(provenance)}
    with replaced(path, own=True) as part:
        pyarrow.parquet.write_table(pyarrow.table(arrays).replace_schema_metadata(metadata), part)


def read_tasks(path: pathlib.Path, index: int, chunk: int) -> Iterator[dict[str, Any]]:
    with path.open() as file:
        yield from map(json.loads, itertools.islice(file, (index - 1) * chunk, index * chunk))


if __name__ == "__main__":
    guard_output()
    for one in read_tasks(pathlib.Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])):
        execute(one)
