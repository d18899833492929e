"""Recordings in the formats of other tools: USD scenes, Rerun recordings and MCAP logs of ROS 2 messages.

    python -m smartsurf.formats run.h5 -o run.usd        also .usda, .usdc; needs usd-core
    python -m smartsurf.formats run.h5 -o run.rrd        needs rerun-sdk
    python -m smartsurf.formats run.h5 -o run.mcap       needs mcap and mcap-ros2-support

`smartsurf export` does the same. Each format is written by its own library: the extras `usd`, `rerun` and `mcap`.
Shapes, colours and poses are those of the glTF model that the program smartsurf exports; channels and metrics are the
recording's. Lengths are in u, z points up, and time 0 is the first recorded frame.
"""
from __future__ import annotations

import argparse
import importlib
import json
import os
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from ._printable import guard_output, printable
from .run import program

Array = npt.NDArray[Any]

_CELL = re.compile(r"(pin|part) \d+,\d+")  # names of nodes that are no objects
EXTENSIONS = {".usd": "usd", ".usda": "usd", ".usdc": "usd", ".rrd": "rerun", ".mcap": "mcap"}
_MODULES = {"usd": {"pxr": "usd-core", "h5py": "h5py"}, "rerun": {"rerun": "rerun-sdk", "h5py": "h5py"},
            "mcap": {"mcap": "mcap", "mcap_ros2": "mcap-ros2-support", "h5py": "h5py"}}


class FormatError(ValueError):
    """A recording or a name that cannot be exported, in one line."""


@dataclass
class Mesh:
    """points, normals: vertices × 3; triangles: T × 3; colour: r, g, b, a in linear light."""
    name: str
    points: Array
    normals: Array
    triangles: Array
    colour: tuple[float, ...]


@dataclass
class Node:
    """One placed mesh. position and scale: F × 3, orientation: F × 4 (x y z w), or one row if they never change. A scale of 0
    hides the node."""
    name: str
    mesh: int
    position: Array
    orientation: Array
    scale: Array

    @property
    def is_object(self) -> bool:
        return _CELL.fullmatch(self.name) is None

    def at(self, frame: int) -> tuple[Array, Array, Array]:
        position, orientation, scale = (track[min(frame, len(track) - 1)] for track in (self.position, self.orientation, self.scale))
        return position, orientation, scale


@dataclass
class Model:
    """A recording's picture in F frames. frames: their numbers in the recording; times_s: since the first one."""
    frames: list[int]
    times_s: Array
    meshes: list[Mesh]
    nodes: list[Node]
    # Values at times_s by name: F × rows × columns (× components) of a channel, F of a metric.
    channels: dict[str, Array] = field(default_factory=dict)
    metrics: dict[str, Array] = field(default_factory=dict)


def _numbers(document: dict[str, Any], binary: bytes, index: int) -> Array:
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
    kind = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
    return np.frombuffer(binary, kind, width * accessor["count"], view["byteOffset"]).reshape(-1, width)


def _interpolate(times_s: Array, keys_s: Array, values: Array, steps: bool) -> Array:
    if steps:
        held: Array = values[np.searchsorted(keys_s, times_s + 1e-6, side="right").clip(1) - 1]
        return held
    between: Array = np.stack([np.interp(times_s, keys_s, component) for component in values.T], 1)
    if values.shape[1] == 4:
        between /= np.linalg.norm(between, axis=1, keepdims=True)
    return between


def read_model(data: bytes) -> Model:
    """The model of a .glb file that the program smartsurf wrote."""
    text_size = struct.unpack_from("<I", data, 12)[0]
    document, binary = json.loads(data[20:20 + text_size]), data[28 + text_size:]
    meshes = []
    for mesh in document["meshes"]:
        part = mesh["primitives"][0]
        colour = np.array(document["materials"][part["material"]]["pbrMetallicRoughness"]["baseColorFactor"])
        if "COLOR_0" in part["attributes"]:
            colour = colour * _numbers(document, binary, part["attributes"]["COLOR_0"])[0]
        meshes.append(Mesh(mesh["name"], _numbers(document, binary, part["attributes"]["POSITION"]),
                           _numbers(document, binary, part["attributes"]["NORMAL"]),
                           _numbers(document, binary, part["indices"]).reshape(-1, 3), tuple(float(c) for c in colour)))
    animation = document.get("animations", [{"channels": [], "samplers": []}])[0]
    tracks = {}
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        tracks[channel["target"]["node"], channel["target"]["path"]] = (
            _numbers(document, binary, sampler["input"])[:, 0], _numbers(document, binary, sampler["output"]),
            sampler["interpolation"] == "STEP")
    times_s = np.array(document["extras"]["times_s"], "f4")

    def values(index: int, path: str, default: list[float]) -> Array:
        if (index, path) in tracks:
            return _interpolate(times_s, *tracks[index, path])
        return np.array([document["nodes"][index].get(path, default)])

    return Model(document["extras"]["frames"], times_s, meshes,
                 [Node(node["name"], node["mesh"], values(i, "translation", [0, 0, 0]), values(i, "rotation", [0, 0, 0, 1]),
                       values(i, "scale", [1, 1, 1])) for i, node in enumerate(document["nodes"]) if "mesh" in node])


def _add_data(model: Model, recording: pathlib.Path) -> None:
    from ._recorded import RecordingError, name_of_link, read_apart

    def data(_: str, file: Any) -> tuple[dict[str, Array], dict[str, Array]]:
        def of(group: str, ranks: tuple[int, ...]) -> dict[str, Array]:
            return {name: values[model.frames] for name, values in file.get(group, {}).items()
                    if getattr(values, "ndim", 0) in ranks and values.dtype.kind in "fiu"}
        return {f"{group}/{name}": values for group in ("sensors", "actuators") for name, values in of(group, (3, 4)).items()}, \
            {name_of_link(link): values for link, values in of("metrics", (1,)).items()}
    try:
        model.channels, model.metrics = read_apart(recording, data)
    except RecordingError as error:
        raise FormatError(str(error)) from None


def _names(nodes: list[Node]) -> Iterator[tuple[str, Node]]:
    """Nodes with names that are identifiers, each once: a label and the object's id."""
    for node in nodes:
        name = "".join(c if c.isascii() and c.isalnum() else "_" for c in node.name)
        yield (name if name[0].isalpha() else "object_" + name), node


def _poses(nodes: list[Node], frame: int) -> tuple[Array, Array, Array]:
    position, orientation, scale = (np.array(track) for track in zip(*(node.at(frame) for node in nodes)))
    return position, orientation, scale


def _instances(model: Model) -> Iterator[tuple[str, int, list[Node]]]:
    """The cells' nodes, grouped by their mesh."""
    for index, mesh in enumerate(model.meshes):
        nodes = [node for node in model.nodes if node.mesh == index and not node.is_object]
        if nodes:
            yield f"{mesh.name}_{index}", index, nodes


def _constant(nodes: list[Node]) -> bool:
    return all(len(track) == 1 for node in nodes for track in (node.position, node.orientation, node.scale))


# ---- USD

def write_usd(model: Model, path: pathlib.Path) -> None:
    """A stage, z up, 1 u = 1 m, 100 time codes a second: /table/objects/NAME are meshes with a transform, /table/cells/MESH are
    point instancers, one instance a cell."""
    from pxr import Gf, Sdf, Usd, UsdGeom, Vt  # type: ignore[import-not-found,import-untyped,unused-ignore]
    codes_per_second = 100.0
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(codes_per_second)
    codes = np.round(model.times_s.astype(float) * codes_per_second, 6).tolist()
    stage.SetStartTimeCode(codes[0])
    stage.SetEndTimeCode(codes[-1])
    table = UsdGeom.Xform.Define(stage, "/table")
    stage.SetDefaultPrim(table.GetPrim())
    UsdGeom.Scope.Define(stage, "/table/objects")
    UsdGeom.Scope.Define(stage, "/table/cells")

    def define_mesh(prim: str, mesh: Mesh) -> Any:
        shape = UsdGeom.Mesh.Define(stage, prim)
        shape.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(mesh.points, "f4")))
        shape.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(mesh.normals, "f4")))
        shape.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        shape.CreateFaceVertexCountsAttr([3] * len(mesh.triangles))
        shape.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(mesh.triangles.reshape(-1), "i4")))
        shape.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        shape.CreateExtentAttr([Gf.Vec3f(*mesh.points.min(0).tolist()), Gf.Vec3f(*mesh.points.max(0).tolist())])
        shape.CreateDisplayColorAttr([Gf.Vec3f(*mesh.colour[:3])])
        if mesh.colour[3] < 1:
            shape.CreateDisplayOpacityAttr([mesh.colour[3]])
        return shape

    def at(track: Array) -> list[Any]:
        return [Usd.TimeCode.Default()] if len(track) == 1 else codes

    for name, node in _names([node for node in model.nodes if node.is_object]):
        shape = define_mesh(f"/table/objects/{name}", model.meshes[node.mesh])
        xform = UsdGeom.Xformable(shape)
        move, turn = xform.AddTranslateOp(UsdGeom.XformOp.PrecisionFloat), xform.AddOrientOp(UsdGeom.XformOp.PrecisionFloat)
        for code, p in zip(at(node.position), node.position.tolist()):
            move.Set(Gf.Vec3f(*p), code)
        for code, (x, y, z, w) in zip(at(node.orientation), node.orientation.tolist()):
            turn.Set(Gf.Quatf(w, x, y, z), code)
        was = None
        for code, s in zip(at(node.scale), node.scale[:, 0].tolist()):
            if was != (s > 0):
                was = s > 0
                shape.CreateVisibilityAttr().Set(UsdGeom.Tokens.inherited if was else UsdGeom.Tokens.invisible, code)
    for name, index, nodes in _instances(model):
        instancer = UsdGeom.PointInstancer.Define(stage, f"/table/cells/{name}")
        prototype = define_mesh(f"/table/cells/{name}/mesh", model.meshes[index])
        instancer.CreatePrototypesRel().AddTarget(prototype.GetPath())
        instancer.CreateProtoIndicesAttr([0] * len(nodes))
        for frame, code in enumerate([Usd.TimeCode.Default()] if _constant(nodes) else codes):
            position, orientation, scale = _poses(nodes, frame)
            instancer.CreatePositionsAttr().Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(position, "f4")), code)
            if frame == 0 or any(len(node.orientation) > 1 for node in nodes):
                instancer.CreateOrientationsAttr().Set(
                    Vt.QuathArray([Gf.Quath(w, x, y, z) for x, y, z, w in orientation.tolist()]), code)
            if frame == 0 or any(len(node.scale) > 1 for node in nodes):
                instancer.CreateScalesAttr().Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(scale, "f4")), code)
            low, high = position.min(0) - 1, position.max(0) + 1
            instancer.CreateExtentAttr().Set([Gf.Vec3f(*low.tolist()), Gf.Vec3f(*high.tolist())], code)
    for name, values in model.metrics.items():
        attribute = table.GetPrim().CreateAttribute("metrics:" + "".join(c if c.isalnum() else "_" for c in name),
                                                    Sdf.ValueTypeNames.Double, custom=True)
        for code, value in zip(codes, values.tolist()):
            attribute.Set(value, code)
    stage.GetRootLayer().Save()


# ---- Rerun

def write_rrd(model: Model, path: pathlib.Path) -> None:
    """table/objects/NAME and table/cells/MESH on the timeline `time`; sensors/NAME, actuators/NAME as tensors; metrics/NAME."""
    import rerun as rr  # type: ignore[import-not-found,import-untyped,unused-ignore]
    stream = rr.RecordingStream("smartsurf", recording_id="smartsurf", send_properties=False)
    stream.save(str(path))
    stream.disable_timeline("log_time")
    stream.disable_timeline("log_tick")
    stream.log("table", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)

    def mesh_of(mesh: Mesh) -> Any:
        return rr.Mesh3D(vertex_positions=mesh.points, vertex_normals=mesh.normals, triangle_indices=mesh.triangles,
                         albedo_factor=[round(255 * _srgb(c)) for c in mesh.colour[:3]] + [round(255 * mesh.colour[3])])

    times = rr.TimeColumn("time", duration=model.times_s.astype(float))
    for name, node in _names([node for node in model.nodes if node.is_object]):
        entity = f"table/objects/{name}"
        stream.log(entity, mesh_of(model.meshes[node.mesh]), static=True)
        frames = len(model.times_s)
        stream.send_columns(entity, [times], rr.Transform3D.columns(
            translation=np.broadcast_to(node.position, (frames, 3)), quaternion=np.broadcast_to(node.orientation, (frames, 4)),
            scale=np.broadcast_to(node.scale, (frames, 3))))
    for name, index, nodes in _instances(model):
        stream.log(f"table/cells/{name}", mesh_of(model.meshes[index]), static=True)
        constant = _constant(nodes)
        for frame, time in enumerate(model.times_s[:1] if constant else model.times_s):
            position, orientation, scale = _poses(nodes, frame)
            stream.set_time("time", duration=float(time))
            stream.log(f"table/cells/{name}", rr.InstancePoses3D(translations=position, quaternions=orientation, scales=scale),
                       static=constant)
    for name, values in model.channels.items():
        names = ["row", "column", "component"][:values.ndim - 1]
        for time, value in zip(model.times_s, values):
            stream.set_time("time", duration=float(time))
            stream.log(name, rr.Tensor(value, dim_names=names))
    for name, values in model.metrics.items():
        stream.send_columns(f"metrics/{name}", [times], rr.Scalars.columns(scalars=values))
    stream.flush()
    stream.disconnect()


def _srgb(linear: float) -> float:
    return 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055


# ---- MCAP

# The definitions of ROS 2 messages that are used, each with those that it contains.
_TIME = "int32 sec\nuint32 nanosec"
_HEADER = "builtin_interfaces/Time stamp\nstring frame_id"
_VECTOR, _POINT = "float64 x\nfloat64 y\nfloat64 z", "float64 x\nfloat64 y\nfloat64 z"
_QUATERNION, _COLOUR = "float64 x\nfloat64 y\nfloat64 z\nfloat64 w", "float32 r\nfloat32 g\nfloat32 b\nfloat32 a"
_MARKER = """std_msgs/Header header
string ns
int32 id
int32 type
int32 action
geometry_msgs/Pose pose
geometry_msgs/Vector3 scale
std_msgs/ColorRGBA color
builtin_interfaces/Duration lifetime
bool frame_locked
geometry_msgs/Point[] points
std_msgs/ColorRGBA[] colors
string texture_resource
sensor_msgs/CompressedImage texture
visualization_msgs/UVCoordinate[] uv_coordinates
string text
string mesh_resource
visualization_msgs/MeshFile mesh_file
bool mesh_use_embedded_materials"""
_PARTS = {
    "builtin_interfaces/Time": _TIME, "builtin_interfaces/Duration": _TIME, "std_msgs/Header": _HEADER,
    "std_msgs/ColorRGBA": _COLOUR, "geometry_msgs/Vector3": _VECTOR, "geometry_msgs/Point": _POINT,
    "geometry_msgs/Quaternion": _QUATERNION, "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "geometry_msgs/TransformStamped":
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform",
    "sensor_msgs/CompressedImage": "std_msgs/Header header\nstring format\nuint8[] data",
    "visualization_msgs/UVCoordinate": "float32 u\nfloat32 v", "visualization_msgs/MeshFile": "string filename\nuint8[] data",
    "visualization_msgs/Marker": _MARKER}
_MESSAGES = {
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "visualization_msgs/MarkerArray": "visualization_msgs/Marker[] markers",
    "sensor_msgs/Image": "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n"
                         "uint8[] data",
    "std_msgs/Float64": "float64 data"}
_CUBE_LIST, _TRIANGLE_LIST = 6, 11


def _definition(message: str) -> str:
    needed: list[str] = []

    def visit(text: str) -> None:
        for line in text.splitlines():
            kind = line.split()[0].removesuffix("[]")
            if kind in _PARTS and kind not in needed:
                needed.append(kind)
                visit(_PARTS[kind])

    visit(_MESSAGES[message])
    return "\n".join([_MESSAGES[message], *(f"{'=' * 80}\nMSG: {kind}\n{_PARTS[kind]}" for kind in needed)])


def _changes(track: Array) -> set[int]:
    """The first frame, and each that differs by over 0.001 u, the model's exactness, from the last of these."""
    frames = [0]
    if np.ptp(track, axis=0).max() > 0.001:
        for frame in range(1, len(track)):
            if np.abs(track[frame] - track[frames[-1]]).max() > 0.001:
                frames.append(frame)
    return set(frames)


def write_mcap(model: Model, path: pathlib.Path) -> None:
    """ROS 2 messages; the log's time is the simulated one. /tf: a frame for each object and each moving part of a cell, in the
    frame `table`. /objects and /cells: markers of both, once and where their scale changes; pins as one list of cubes.
    /sensors/NAME, /actuators/NAME: images of 32-bit floats, row 0 north. /metrics/NAME: numbers."""
    from mcap_ros2.writer import Writer  # type: ignore[import-not-found,import-untyped,unused-ignore]

    def xyz(values: Array) -> dict[str, float]:
        return dict(zip("xyzw", values.tolist()))

    def points(values: Array) -> list[dict[str, float]]:
        return [{"x": x, "y": y, "z": z} for x, y, z in values.tolist()]

    corners = []
    for mesh in model.meshes:
        vertices = points(mesh.points)
        corners.append([vertices[i] for i in mesh.triangles.reshape(-1).tolist()])
    # For each node: its frame, name space and number of its marker, the times at which that is written, and the node.
    objects = [(name, "objects", index, _changes(node.scale), node)
               for index, (name, node) in enumerate(_names([node for node in model.nodes if node.is_object]))]
    cells, boxes = [], []
    for space, mesh_index, nodes in _instances(model):
        mesh = model.meshes[mesh_index]
        if mesh.name in ("pin", "wall") and all((node.orientation[:, 3] == 1).all() for node in nodes):
            track = np.concatenate([np.broadcast_to(node.position, (len(model.times_s), 3)) for node in nodes], 1, dtype="f4")
            boxes.append((space, mesh, _changes(track), track))
        else:
            cells += [("table" if len(node.position) == len(node.orientation) == 1 else f"{space}/{index}", space, index, _changes(node.scale), node)
                      for index, node in enumerate(nodes)]
    with path.open("wb") as file:
        writer = Writer(file)
        schemas = {name: writer.register_msgdef(name.replace("/", "/msg/"), _definition(name)) for name in _MESSAGES}
        for frame, time in enumerate(model.times_s.tolist()):
            nanoseconds = round(time * 1e9)
            stamp = {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
            header = {"stamp": stamp, "frame_id": "table"}
            transforms: list[dict[str, Any]] = []
            markers: dict[str, list[dict[str, Any]]] = {"/objects": [], "/cells": []}

            def write(topic: str, message: str, content: dict[str, Any]) -> None:
                writer.write_message(topic, schemas[message], content, log_time=nanoseconds, publish_time=nanoseconds)

            def mark(topic: str, own: str, space: str, index: int, mesh: Mesh, scale: Array, **shape: Any) -> None:
                """own: the marker's frame. A scale of 0 removes the marker."""
                markers[topic].append({
                    "header": {"stamp": stamp, "frame_id": own}, "ns": space, "id": index, "action": 0 if scale[0] > 0 else 2,
                    "scale": xyz(scale), "color": dict(zip("rgba", [*(_srgb(c) for c in mesh.colour[:3]), mesh.colour[3]])),
                    "frame_locked": True, "pose": {"orientation": {"w": 1.0}}, **shape})

            for topic, parts in (("/objects", objects), ("/cells", cells)):
                for own, space, index, changes, node in parts:
                    position, orientation, scale = node.at(frame)
                    pose = {}
                    if own == "table":
                        pose = {"pose": {"position": xyz(position), "orientation": xyz(orientation)}}
                    else:
                        transforms.append({"header": header, "child_frame_id": own,
                                           "transform": {"translation": xyz(position), "rotation": xyz(orientation)}})
                    if frame in changes:
                        mark(topic, own, space, index, model.meshes[node.mesh], scale, type=_TRIANGLE_LIST,
                             points=corners[node.mesh], **pose)
            for space, mesh, changes, track in boxes:
                if frame in changes:
                    low, high = mesh.points.min(0), mesh.points.max(0)
                    mark("/cells", "table", space, 0, mesh, high - low, type=_CUBE_LIST,
                         points=points(track[frame].reshape(-1, 3) + (low + high) / 2))
            if transforms:
                write("/tf", "tf2_msgs/TFMessage", {"transforms": transforms})
            for topic, those in markers.items():
                if those:
                    write(topic, "visualization_msgs/MarkerArray", {"markers": those})
            for channel, values in model.channels.items():
                image = np.ascontiguousarray(values[frame], "<f4")
                write("/" + channel, "sensor_msgs/Image", {
                    "header": header, "height": image.shape[0], "width": image.shape[1], "step": image.strides[0],
                    "encoding": f"32FC{image.shape[2] if image.ndim == 3 else 1}", "data": image.tobytes()})
            for metric, numbers in model.metrics.items():
                write("/metrics/" + metric, "std_msgs/Float64", {"data": float(numbers[frame])})
        writer.finish()


_WRITERS: dict[str, Callable[[Model, pathlib.Path], None]] = {"usd": write_usd, "rerun": write_rrd, "mcap": write_mcap}


def export(recording: str | os.PathLike[str], output: str | os.PathLike[str], fps: float = 30.0) -> None:
    """Writes the recording in the format that the output's extension names, replacing the file. fps: most frames a recorded
    second. Raises FormatError for a recording that cannot be read, a name without such a format, and a library that is not
    installed."""
    source, target = pathlib.Path(recording), pathlib.Path(output)
    kind = EXTENSIONS.get(target.suffix.lower())
    if kind is None:
        raise FormatError(f"export -o {target}: the name must end in one of {', '.join(EXTENSIONS)}")
    for module, package in _MODULES[kind].items():
        try:
            importlib.import_module(module)
        except ImportError as error:
            raise FormatError(f"export -o {target}: needs the Python package {package} (pip install {package}): {error}") from None
    if not target.parent.is_dir():
        raise FormatError(f"export -o {target}: there is no folder {target.parent}")
    with tempfile.TemporaryDirectory(prefix=".export-", dir=target.parent) as folder:
        model_file = pathlib.Path(folder) / "model.glb"
        ended = subprocess.run([program(), "export", str(source), "-o", str(model_file), "--fps", str(fps)], capture_output=True,
                               text=True, errors="replace")
        if ended.returncode != 0:
            raise FormatError(ended.stderr.strip().removeprefix("smartsurf: ") or f"{source}: cannot be exported")
        model = read_model(model_file.read_bytes())
        _add_data(model, source)
        written = pathlib.Path(folder) / f"run{target.suffix}"
        _WRITERS[kind](model, written)
        written.replace(target)


def main() -> int:
    parser = argparse.ArgumentParser(prog="smartsurf export", description="Exports a recording for other tools.")
    parser.add_argument("recording", metavar="FILE.h5")
    parser.add_argument("-o", "--output", required=True, metavar="|".join("FILE" + e for e in EXTENSIONS))
    parser.add_argument("--fps", type=float, default=30.0, help="maximum frames per recorded second (default: 30)")
    given = parser.parse_args()
    try:
        export(given.recording, given.output, given.fps)
    except (FormatError, OSError) as error:
        print(f"smartsurf: {printable(error)}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    guard_output()
    sys.exit(main())
