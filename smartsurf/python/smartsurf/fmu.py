"""Functional mock-up units: an experiment as one file that every co-simulation program imports.

    python -m smartsurf.fmu table.lua -o table.fmu [--set NAME=VALUE]… [--seed N] [--with FILE]…

`smartsurf fmu` does the same. The unit is one of FMI 3.0 for co-simulation. Its inputs are the actuator channels and its outputs
the sensor channels and the objects' states, arrays of 32-bit floats whose row 0 is north and column 0 west; sensors of several
components have these first. `seed` is a parameter. A communication step of any length takes the control periods that end by its
end, with the inputs held. States can be saved and restored. The unit holds the script, the files named by --with, and the
simulator for this kind of machine; Debian's libraries that the simulator is linked with must be installed where it runs.
"""
from __future__ import annotations

import hashlib
import os
import pathlib
import platform
import sys
import zipfile
from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

from ._arguments import Parser, whole
from ._core import Error, __version__
from ._files import replaced
from ._printable import guard_output, printable
from ._simulation import Simulation
from ._surface import Channel

_LIBRARY = "smartsurf_fmu"
_START = "start"  # the resource that tells the library what to load
# Value references, as in smartsurf/library/fmu/Fmu.cpp.
_SEED, _POSITION, _ACTUATOR, _SENSOR = 1, 10, 100, 1000
_SCALARS = (("Float64", "reward", 3, "of the latest step"), ("UInt64", "tick", 2, "control periods since the start"),
            ("Boolean", "terminated", 4, "the script ended the episode"), ("Boolean", "success", 5, "the script's goal is reached"),
            ("UInt64", "state_hash", 6, "of all poses, velocities, heights and speeds, as in recordings"))
_STATES = (("position", 3, "m"), ("orientation", 4, ""), ("velocity", 3, "m/s"), ("angular_velocity", 3, "rad/s"))


class FmuError(ValueError):
    """An experiment that cannot be packed, in one line."""


def _array(channel: Channel, reference: int, rows: int, columns: int, is_input: bool, start: str) -> str:
    sizes = ([channel.components] if channel.components > 1 else []) + [rows, columns]
    limits = "".join(f' {name}="{value!r}"' for name, value in (("min", channel.minimum), ("max", channel.maximum))
                     if abs(value) < 3e38)
    role = f'causality="input" start="{start}"' if is_input else 'causality="output"'
    note = quoteattr("row 0 north, column 0 west" + (f"; in {channel.unit}" if channel.unit else ""))
    return (f'    <Float32 name={quoteattr(("actuators." if is_input else "sensors.") + channel.name)} valueReference="{reference}" '
            f'variability="discrete" description={note}{limits} {role}>\n'
            + "".join(f'      <Dimension start="{size}"/>\n' for size in sizes) + "    </Float32>\n")


def _description(name: str, token: str, simulation: Simulation) -> str:
    rows, columns = simulation.rows, simulation.columns
    objects = len(simulation.objects["id"])
    variables = ['    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>\n',
                 f'    <UInt64 name="seed" valueReference="{_SEED}" causality="parameter" variability="fixed" '
                 f'start="{simulation.seed}"/>\n']
    outputs = []
    for kind, label, reference, note in _SCALARS:
        variables.append(f'    <{kind} name="{label}" valueReference="{reference}" causality="output" variability="discrete" '
                         f'description={quoteattr(note)}/>\n')
        outputs.append(reference)
    if objects:
        for index, (label, width, unit) in enumerate(_STATES):
            variables.append(
                f'    <Float32 name="objects.{label}" valueReference="{_POSITION + index}" causality="output" variability="discrete" '
                f'description="of the objects of the start, by id; NaN: gone">\n'
                f'      <Dimension start="{objects}"/>\n      <Dimension start="{width}"/>\n    </Float32>\n')
            outputs.append(_POSITION + index)
    for index, channel in enumerate(simulation.actuator_channels):
        start = " ".join(f"{value!r}" for value in simulation.actuators[channel.name].reshape(-1).tolist())
        variables.append(_array(channel, _ACTUATOR + index, rows, columns, True, start))
    for index, channel in enumerate(simulation.sensor_channels):
        variables.append(_array(channel, _SENSOR + index, rows, columns, False, ""))
        outputs.append(_SENSOR + index)
    period = repr(simulation.period)
    return (f'<?xml version="1.0" encoding="UTF-8"?>\n'
            f'<fmiModelDescription fmiVersion="3.0" modelName={quoteattr(name)} instantiationToken="{token}" '
            f'generationTool="SmartSurf {__version__}" variableNamingConvention="structured">\n'
            f'  <CoSimulation modelIdentifier="{_LIBRARY}" canHandleVariableCommunicationStepSize="true" '
            f'fixedInternalStepSize="{period}" canGetAndSetFMUState="true"/>\n'
            f'  <LogCategories>\n    <Category name="logStatusError"/>\n  </LogCategories>\n'
            f'  <DefaultExperiment startTime="0" stepSize="{period}"/>\n'
            f'  <ModelVariables>\n{"".join(variables)}  </ModelVariables>\n'
            f'  <ModelStructure>\n' + "".join(f'    <{element} valueReference="{reference}"/>\n'
                                              for element in ("Output", "InitialUnknown") for reference in outputs)
            + "  </ModelStructure>\n</fmiModelDescription>\n")


def pack(experiment: str | os.PathLike[str], output: str | os.PathLike[str], set: Sequence[str] = (), seed: int | None = None,
         files: Sequence[str | os.PathLike[str]] = ()) -> None:
    """Writes the unit, replacing the file. set: NAME=VALUE of options. seed: the parameter's start. files: what the script reads,
    below its folder. The same arguments give the same bytes. Raises FmuError."""
    script, target = pathlib.Path(experiment), pathlib.Path(output)
    if target.suffix != ".fmu":
        raise FmuError(f"fmu -o {target}: the name must end in .fmu")
    if not target.parent.is_dir():
        raise FmuError(f"fmu -o {target}: there is no folder {target.parent}")
    for file in map(pathlib.Path, (script, *files)):
        if target.exists() and file.exists() and target.samefile(file):
            raise FmuError(f"fmu -o {target}: would overwrite an input of this command; choose another name")
    library = pathlib.Path(__file__).with_name(f"{_LIBRARY}.so")
    if not library.is_file():
        raise FmuError(f"fmu: this build of the package has no {library.name}")
    for assignment in set:
        if "=" not in assignment or "\n" in assignment:
            raise FmuError(f"fmu --set {assignment!r}: must be NAME=VALUE")
    try:
        simulation = Simulation(script, seed=seed, set=dict(assignment.split("=", 1) for assignment in set))
    except Error as error:
        place, unloaded, _ = str(error).partition(": is not loaded, and a script may not load native code")
        if unloaded:
            raise FmuError(f"{place}: a unit cannot hold extensions") from None
        raise
    for extension in simulation._description["extensions"]:
        raise FmuError(f"{script}: extension '{extension}': a unit cannot hold extensions")
    contents = {script.name: script.read_bytes()}
    for file in map(pathlib.Path, files):
        try:
            name = file.resolve().relative_to(script.resolve().parent).as_posix()
        except ValueError:
            raise FmuError(f"fmu --with {file}: must lie below {script.resolve().parent}, where the script finds its files") from None
        contents[name] = file.read_bytes()
    for name in contents:
        if name.split("/")[0] == _START:
            raise FmuError(f"fmu: {name}: a unit has a file '{_START}' of its own; choose another name")
    start = "\n".join([str(simulation.seed), script.name, *set, ""])
    token = hashlib.sha256(b"\0".join([__version__.encode(), start.encode(), *(n.encode() + b"\0" + c for n, c in contents.items())]))
    if platform.machine() not in ("x86_64", "aarch64"):
        raise FmuError(f"fmu: FMI 3.0 has no name for this platform, {platform.machine()}")
    system = f"{platform.machine()}-linux"
    members = {"modelDescription.xml": _description(script.stem, token.hexdigest(), simulation).encode(),
               f"binaries/{system}/{_LIBRARY}.so": library.read_bytes(),
               f"resources/{_START}": f"{token.hexdigest()}\n{start}".encode(),
               **{f"resources/{name}": content for name, content in contents.items()}}
    with replaced(target) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)


def main() -> int:
    parser = Parser(prog="smartsurf fmu", description="Packs an experiment as a functional mock-up unit (FMI 3.0).")
    parser.add_argument("experiment", metavar="EXPERIMENT.lua")
    parser.add_argument("-o", "--output", required=True, metavar="FILE.fmu")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="give an option of the script another value")
    parser.add_argument("--seed", type=whole(0, 2**64 - 1), metavar="N", help="the start of the parameter seed (default: the script's)")
    parser.add_argument("--with", action="append", default=[], dest="files", metavar="FILE", help="a file that the script reads")
    try:
        given = parser.parse_args()
        pack(given.experiment, given.output, given.set, given.seed, given.files)
    except (FmuError, Error, OSError, ValueError) as error:
        print(f"smartsurf: {printable(error)}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    guard_output()
    sys.exit(main())
