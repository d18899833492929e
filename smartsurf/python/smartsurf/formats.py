"""Recordings in the formats of other tools: USD scenes, Rerun recordings and MCAP logs of ROS 2 messages.

    python -m smartsurf.formats run.h5 -o run.usd        also .usda, .usdc; needs usd-core
    python -m smartsurf.formats run.h5 -o run.rrd        needs rerun-sdk
    python -m smartsurf.formats run.h5 -o run.mcap       needs mcap

`smartsurf export` does the same. Each format is written by its own library: the extras `usd`, `rerun` and `mcap`; ROS messages are encoded here.
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

from .run import program

Array = npt.NDArray[Any]

_CELL = re.compile(r"(pin|part) \d+,\d+")  # names of nodes that are no objects
EXTENSIONS = {".usd": "usd", ".usda": "usd", ".usdc": "usd", ".rrd": "rerun", ".mcap": "mcap"}
_MODULES = {"usd": {"pxr": "usd-core", "h5py": "h5py"}, "rerun": {"rerun": "rerun-sdk", "h5py": "h5py"},
            "mcap": {"mcap": "mcap", "h5py": "h5py"}}


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
    from ._recorded import RecordingError, read_apart

    def data(_: str, file: Any) -> tuple[dict[str, Array], dict[str, Array]]:
        def of(group: str, ranks: tuple[int, ...]) -> dict[str, Array]:
            return {name: values[model.frames] for name, values in file.get(group, {}).items()
                    if getattr(values, "ndim", 0) in ranks and values.dtype.kind in "fiu"}
        return {f"{group}/{name}": values for group in ("sensors", "actuators") for name, values in of(group, (3, 4)).items()}, \
            of("metrics", (1,))
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


class _Cdr:
    """A ROS 2 message in the Common Data Representation, little-endian: numbers are aligned to their size."""

    def __init__(self) -> None:
        self.data = bytearray()

    def _align(self, size: int) -> None:
        self.data += bytes(-len(self.data) % size)

    def put(self, kind: str, *values: float) -> None:
        """kind: one letter of struct for all."""
        self._align(struct.calcsize(kind))
        self.data += struct.pack(f"<{len(values)}{kind}", *values)

    def text(self, text: str) -> None:
        encoded = text.encode() + b"\0"
        self.put("I", len(encoded))
        self.data += encoded

    def numbers(self, values: Array, kind: str) -> None:
        """A sequence of structures of equal numbers: rows of values, or the values themselves."""
        self.put("I", len(values))
        if len(values):
            self._align(np.dtype(kind).itemsize)
            self.data += np.ascontiguousarray(values, kind).tobytes()

    def header(self, nanoseconds: int, frame: str) -> None:
        self.put("i", nanoseconds // 10**9)
        self.put("I", nanoseconds % 10**9)
        self.text(frame)

    def message(self) -> bytes:
        return b"\0\1\0\0" + bytes(self.data)


@dataclass
class _Part:
    """A node in the log. frame: that of its marker, which has the pose if the frame is the table's."""
    space: str
    index: int
    frame: str
    node: Node

    @property
    def moves(self) -> bool:
        return self.frame != "table"


_ORIGIN = np.zeros(3), np.array([0.0, 0, 0, 1])


def _put_marker(to: _Cdr, nanoseconds: int, frame: str, space: str, index: int, kind: int, mesh: Mesh, points: Array, scale: Array,
                pose: tuple[Array, Array]) -> None:
    """visualization_msgs/Marker; a scale of 0 removes it."""
    to.header(nanoseconds, frame)
    to.text(space)
    to.put("i", index, kind, 0 if scale[0] > 0 else 2)
    to.put("d", *pose[0], *pose[1], *scale)
    to.put("f", *(_srgb(c) for c in mesh.colour[:3]), mesh.colour[3])
    to.put("i", 0, 0)  # lifetime
    to.put("B", 1)  # frame_locked
    to.numbers(points, "<f8")
    to.put("I", 0)  # colors
    to.text("")  # texture_resource
    to.header(nanoseconds, "table")  # texture
    to.text("")
    to.put("I", 0, 0)  # its data, uv_coordinates
    to.text("")  # text
    to.text("")  # mesh_resource
    to.text("")  # mesh_file
    to.put("I", 0)
    to.put("B", 0)  # mesh_use_embedded_materials


def write_mcap(model: Model, path: pathlib.Path) -> None:
    """ROS 2 messages; the log's time is the simulated one. /tf: a frame for each object and each moving part of a cell, in the
    frame `table`. /objects and /cells: markers of both, once and where their scale changes; pins as one list of cubes.
    /sensors/NAME, /actuators/NAME: images of 32-bit floats, row 0 north. /metrics/NAME: numbers."""
    from mcap.writer import Writer  # type: ignore[import-not-found,import-untyped,unused-ignore]
    corners = [mesh.points[mesh.triangles.reshape(-1)] for mesh in model.meshes]
    objects = [_Part("objects", index, name, node)
               for index, (name, node) in enumerate(_names([node for node in model.nodes if node.is_object]))]
    boxes: list[tuple[str, Mesh, list[Node]]] = []
    cells: list[_Part] = []
    for name, mesh_index, nodes in _instances(model):
        if model.meshes[mesh_index].name in ("pin", "wall") and all((node.orientation[:, 3] == 1).all() for node in nodes):
            boxes.append((name, model.meshes[mesh_index], nodes))
            continue
        cells += [_Part(name, i, "table" if len(node.position) == len(node.orientation) == 1 else f"{name}/{i}", node)
                  for i, node in enumerate(nodes)]
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "smartsurf")
        schemas = {name: writer.register_schema(name.replace("/", "/msg/"), "ros2msg", _definition(name).encode()) for name in _MESSAGES}
        topics: dict[str, int] = {}

        def write(topic: str, message: str, content: _Cdr, nanoseconds: int) -> None:
            if topic not in topics:
                topics[topic] = writer.register_channel(topic, "cdr", schemas[message])
            writer.add_message(topics[topic], nanoseconds, content.message(), nanoseconds)

        def write_markers(topic: str, count: int, markers: _Cdr, nanoseconds: int) -> None:
            if count:
                write(topic, "visualization_msgs/MarkerArray", markers, nanoseconds)

        def put_parts(to: _Cdr, parts: list[_Part], frame: int, nanoseconds: int) -> int:
            """The markers that are new or whose scale has changed."""
            count = 0
            for part in parts:
                position, orientation, scale = part.node.at(frame)
                if frame == 0 or (len(part.node.scale) > 1 and (part.node.scale[frame] != part.node.scale[frame - 1]).any()):
                    mesh = part.node.mesh
                    _put_marker(to, nanoseconds, part.frame, part.space, part.index, _TRIANGLE_LIST, model.meshes[mesh], corners[mesh], scale,
                                _ORIGIN if part.moves else (position, orientation))
                    count += 1
            return count

        def array() -> _Cdr:
            """A message that begins with the length of a sequence."""
            message = _Cdr()
            message.put("I", 0)
            return message

        boxes_before: dict[str, Array] = {}
        moving = [part for part in objects + cells if part.moves]
        for frame, time in enumerate(model.times_s.tolist()):
            nanoseconds = round(time * 1e9)
            if moving:
                transforms = _Cdr()
                transforms.put("I", len(moving))
                for part in moving:
                    position, orientation, _ = part.node.at(frame)
                    transforms.header(nanoseconds, "table")
                    transforms.text(part.frame)
                    transforms.put("d", *position.tolist(), *orientation.tolist())
                write("/tf", "tf2_msgs/TFMessage", transforms, nanoseconds)
            markers = array()
            count = put_parts(markers, objects, frame, nanoseconds)
            struct.pack_into("<I", markers.data, 0, count)
            write_markers("/objects", count, markers, nanoseconds)
            markers = array()
            count = put_parts(markers, cells, frame, nanoseconds)
            for name, mesh, nodes in boxes:
                position = np.array([node.at(frame)[0] for node in nodes])
                if name not in boxes_before or (boxes_before[name] != position).any():
                    boxes_before[name] = position
                    low, high = mesh.points.min(0), mesh.points.max(0)
                    _put_marker(markers, nanoseconds, "table", name, 0, _CUBE_LIST, mesh, position + (low + high) / 2, high - low, _ORIGIN)
                    count += 1
            struct.pack_into("<I", markers.data, 0, count)
            write_markers("/cells", count, markers, nanoseconds)
            for channel, values in model.channels.items():
                image = np.ascontiguousarray(values[frame], "<f4")
                message = _Cdr()
                message.header(nanoseconds, "table")
                message.put("I", *image.shape[:2])
                message.text(f"32FC{image.shape[2] if image.ndim == 3 else 1}")
                message.put("B", 0)  # is_bigendian
                message.put("I", image.strides[0])
                message.numbers(np.frombuffer(image.tobytes(), "u1"), "u1")
                write("/" + channel, "sensor_msgs/Image", message, nanoseconds)
            for metric, numbers in model.metrics.items():
                message = _Cdr()
                message.put("d", float(numbers[frame]))
                write("/metrics/" + metric, "std_msgs/Float64", message, nanoseconds)
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
        print(f"smartsurf: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
