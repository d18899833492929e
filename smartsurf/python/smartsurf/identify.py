"""Finds the parameters with which an experiment behaves like a recorded table; `smartsurf identify`, or
python -m smartsurf.identify.

    smartsurf identify run.h5[,NAME=VALUE…] [more.h5 …] --experiment table.lua -o identified.lua

A live recording does not contain the experiment's options, such as which object lay on the table; append them to the file name.
Recordings need commands, readings and every tick: record { sensors = true, actuators = true }, or `smartsurf record`. The recorded
commands are replayed in the experiment. Parameters of actuators (per cell), sensors and, with --object, one moving object are fitted
so that it matches the recording. Writes the experiment with the identified values, which runs as the original does (identified.lua, and for single cells
identified.csv), a report (identified.txt, identified.json) and a plot (identified.svg). Needs SciPy and h5py.
"""
from __future__ import annotations

import argparse
import pathlib
import sys
from collections.abc import Sequence

from ._arguments import Parser, positive
from ._printable import guard_output, printable

PARAMETERS = ("friction", "rolling_friction", "restitution", "mass")  # of an object


def _option(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise argparse.ArgumentTypeError(f"{text} must be NAME=VALUE")
    return name, value


def _names(text: str) -> tuple[str, ...]:
    names = tuple(text.split(","))
    for name in names:
        if name not in PARAMETERS:
            raise argparse.ArgumentTypeError(f"{name} must be of {', '.join(PARAMETERS)}")
    return names


def main(arguments: Sequence[str] | None = None) -> None:
    """The command. arguments: without the program's name [sys.argv]."""
    parser = Parser(prog="smartsurf identify", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", metavar="FILE.h5", help="recording, with options of the experiment after commas")
    parser.add_argument("--experiment", required=True, metavar="FILE.lua", help="experiment to fit")
    parser.add_argument("-o", "--output", required=True, metavar="FILE.lua", help="identified experiment")
    parser.add_argument("--channel", default="height", help="actuator channel that moves the cells [height]")
    parser.add_argument("--sensor", default="pin_height", help="sensor channel of their heights [pin_height; else the simulator's heights]")
    parser.add_argument("--object", metavar="LABEL", help="moving object to fit")
    parser.add_argument("--fit", type=_names, default=PARAMETERS, metavar="NAME,…", help=f"parameters of the object to fit [{','.join(PARAMETERS)}]")
    parser.add_argument("--seconds", type=positive, help="seconds of its motion that count, from the start of each recording [all]")
    parser.add_argument("--set", action="append", type=_option, default=[], metavar="NAME=VALUE", help="option of the experiment")
    how = parser.parse_args(arguments)
    try:
        from ._identification import identify
    except ImportError as error:
        raise ValueError(f"{error} in {sys.executable}; it needs SciPy and h5py: scripts/setup --identify, or the package's extra "
                         "'identify' (docs/python.md)") from error
    found = identify(how.recordings, how.experiment, how.output, how.channel, how.sensor, how.object, how.fit, how.seconds, dict(how.set))
    print(found.report, end="")
    out = pathlib.Path(how.output)
    print("wrote " + ", ".join(str(out.with_suffix(s)) for s in (".lua", ".csv", ".txt", ".json", ".svg") if out.with_suffix(s).exists()))


if __name__ == "__main__":
    guard_output()
    try:
        main()
    except (OSError, ValueError) as failed:
        print(f"smartsurf identify: {printable(failed)}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
