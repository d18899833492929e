"""One run of the simulator as a function call.

`run` starts the program `smartsurf`, waits for it and returns its statistics. The function, its arguments, results and
errors can be pickled, so that Dask, Ray, joblib, concurrent.futures or a Slurm job can execute it elsewhere. It needs the
standard library only.
"""
from __future__ import annotations

import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Mapping, Sequence
from typing import Any

from ._printable import printable

TIMED_OUT = 124  # the exit status of timeout(1)
_GRACE_S = 5.0   # between SIGTERM and SIGKILL

_running: set[subprocess.Popen[bytes]] = set()
_ending = False  # whether end_all() was called


class RunError(RuntimeError):
    """A run that failed. Its text is the simulator's one-line message.

    status: the exit status: 1 failure, 2 invalid input, 3 lost controller, 124 timed out, -n ended by signal n.
    """

    def __init__(self, message: str, status: int):
        super().__init__(message, status)
        self.status = status

    def __str__(self) -> str:
        return str(self.args[0])


class Interrupted(Exception):
    """end_all() has ended the run, or keeps it from starting."""


def program(given: str | os.PathLike[str] | None = None) -> str:
    """The path of the program smartsurf: the given one, else $SMARTSURF, that of this build or checkout, that which pip
    installed beside Python, or that of PATH.

    Raises FileNotFoundError if there is none."""
    folders = pathlib.Path(__file__).resolve().parents
    candidates = (folders[2] / "bin/smartsurf", folders[3] / "build/release/bin/smartsurf",
                  pathlib.Path(sysconfig.get_path("scripts")) / "smartsurf")
    built = [str(path) for path in candidates if path.is_file()]
    name = os.fspath(given) if given else os.environ.get("SMARTSURF") or (built or ["smartsurf"])[0]
    path = shutil.which(name)
    if not path:
        raise FileNotFoundError(f"{name}: no such program (scripts/build makes it)")
    return os.path.abspath(path)


def _plain(value: Any) -> Any:
    """The value as JSON has it: arrays and scalars of NumPy as lists and numbers, NaN, a gap, as None."""
    if isinstance(value, Mapping):
        return {str(name): _plain(member) for name, member in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(member) for member in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, float) and math.isinf(value):
        raise ValueError(f"chart: has the value {value}: must be finite, or NaN for a gap")
    return None if isinstance(value, float) and math.isnan(value) else value


def plot(chart: Mapping[str, Any], file: str | os.PathLike[str], smartsurf: str | os.PathLike[str] | None = None) -> None:
    """Draws a chart as SVG, PDF or PNG. chart: its description, as docs/recordings.md has it; its values may be arrays, and NaN
    is a gap. Raises RunError if it cannot be drawn, FileNotFoundError if there is no program."""
    with tempfile.TemporaryDirectory(prefix="smartsurf-plot-") as folder:
        description = pathlib.Path(folder, "chart.json")
        description.write_text(json.dumps(_plain(chart)))
        done = subprocess.run([program(smartsurf), "plot", description, "-o", os.fspath(file)], stdin=subprocess.DEVNULL,
                              stderr=subprocess.PIPE)
    log = done.stderr.decode(errors="replace")
    if done.returncode != 0:
        raise RunError(_last_line(log, done.returncode), done.returncode)
    if log:  # a warning
        print(printable(log, "\n\t"), end="", file=sys.stderr)


def _last_line(log: str, status: int) -> str:
    """The message of a program that has failed."""
    return printable((log.strip().splitlines() or [f"smartsurf ended with status {status}"])[-1])


def _text(value: Any) -> str:
    is_bool = isinstance(value, bool) or getattr(getattr(value, "dtype", None), "kind", "") == "b"  # Python's, NumPy's
    return str(value).lower() if is_bool else str(value)


def command(experiment: str | os.PathLike[str], controller: str | None = None, seed: int | None = None,
            set: Mapping[str, Any] | None = None, *, until: float | None = None, engine: str | None = None,
            threads: int | None = None, worlds: int | None = None, record: str | os.PathLike[str] | None = None,
            extensions: Sequence[str | os.PathLike[str]] = (), smartsurf: str | os.PathLike[str] | None = None) -> list[str]:
    """The command line of a run; arguments as in `run`."""
    words = [program(smartsurf), "run", os.fspath(experiment)]
    words += ["--controller", os.fspath(controller)] if controller else ["--no-controller"]
    for name, value in (("seed", seed), ("until", until), ("engine", engine), ("threads", threads), ("worlds", worlds),
                        ("record", record)):
        words += [] if value is None else [f"--{name}", _text(value)]
    for name, value in (set or {}).items():
        words += ["--set", f"{name}={_text(value)}"]
    for path in extensions:
        words += ["--load", os.fspath(path)]
    return words


def execute(words: list[str], timeout: float | None = None) -> tuple[int, dict[str, Any] | None, str]:
    """Runs the command → exit status, statistics (None if there are none), what it wrote to stdout and then stderr.

    A run longer than timeout (wall-clock seconds) is ended; its status is 124. Raises Interrupted after end_all()."""
    with tempfile.TemporaryDirectory(prefix="smartsurf-run-") as folder:
        stats = pathlib.Path(folder, "stats.json")
        with open(pathlib.Path(folder, "out"), "w+b") as out, open(pathlib.Path(folder, "err"), "w+b") as err:
            _require_not_ending()
            process = subprocess.Popen([*words, "--stats", str(stats)], stdin=subprocess.DEVNULL, stdout=out, stderr=err,
                                       env={**os.environ, "SMARTSURF_PARENT": str(os.getpid())})
            _running.add(process)
            try:
                _require_not_ending()  # end_all() may have come before it was one of _running
                status = process.wait(timeout)
            except subprocess.TimeoutExpired:
                status = TIMED_OUT
            finally:
                _end(process)
                _running.discard(process)
            _require_not_ending()
            texts = []
            for file in (out, err):
                file.seek(0)
                texts.append(file.read().decode(errors="replace"))
        if status == TIMED_OUT:
            texts.append(f"timed out after {timeout:g} s\n")
        try:
            return status, json.loads(stats.read_text()), "".join(texts)
        except (OSError, ValueError):
            return status, None, "".join(texts)


def _end(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is not None:
        return
    process.terminate()  # the simulator ends its controller
    try:
        process.wait(_GRACE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def end_all() -> None:
    """Ends the simulators that other threads of this process wait for. None starts after it."""
    global _ending
    _ending = True
    for process in list(_running):
        process.terminate()


def _require_not_ending() -> None:
    if _ending:
        raise Interrupted


def run(experiment: str | os.PathLike[str], controller: str | None = None, seed: int | None = None,
        set: Mapping[str, Any] | None = None, *, until: float | None = None, engine: str | None = None,
        threads: int | None = None, worlds: int | None = None, record: str | os.PathLike[str] | None = None,
        extensions: Sequence[str | os.PathLike[str]] = (), timeout: float | None = None,
        smartsurf: str | os.PathLike[str] | None = None) -> dict[str, Any]:
    """Runs an experiment to its end and returns the statistics of `smartsurf run --stats`.

    experiment: the Lua file.
    controller: an APRON program, or a command in which {shm} is the surface's name; None: the script commands the cells.
    seed: overrides the script's seed.
    set: options of the script and their values.
    until: simulated seconds; None: until the script or the controller ends the run.
    engine: 'native' or 'bullet'; None: the script's.
    threads: of the simulator; results do not depend on it.
    worlds: this many copies with consecutive seeds in one process; the result's 'runs' lists their statistics.
    record: an HDF5 or CSV file to record to.
    extensions: paths of shared objects with actuators and sensors to load.
    timeout: wall-clock seconds after which the run is ended.
    smartsurf: the program; None: as `program` finds it.

    The script's metrics are in the result's 'metrics'. Raises RunError if the run fails, FileNotFoundError if there is no
    program."""
    status, stats, log = execute(command(experiment, controller, seed, set, until=until, engine=engine, threads=threads,
                                         worlds=worlds, record=record, extensions=extensions, smartsurf=smartsurf), timeout)
    if status != 0 or stats is None:
        raise RunError(_last_line(log, status), status)
    return stats
