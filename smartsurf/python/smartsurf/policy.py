"""Policies that every cell executes alike, on its own values and those of its direct neighbours.

`LocalPolicy` is a small convolutional network whose kernels are crosses: own cell, north, east, south, west. In NumPy it
acts on the sensor arrays of an environment; `export_policy` writes it as an APRON program that passes `apron check --local`
and gives the same commands to the bit.
"""
from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float32]
PathName = Union[str, "os.PathLike[str]"]

TAPS = ("own", "north", "east", "south", "west")
# Places of the taps in a 3×3 kernel, row 0 north.
_CROSS = ((1, 1), (0, 1), (1, 2), (2, 1), (1, 0))


class Action(NamedTuple):
    """A command channel and the range of its values."""
    channel: str
    low: float
    high: float


def cross(kernel: ArrayLike) -> FloatArray:
    """(out, in, 3, 3) or (out, in, 1, 1), as torch.nn.Conv2d.weight → (out, in, 5), in the order of TAPS.

    Raises ValueError if a corner is not 0: diagonal neighbours are not local."""
    kernel = np.asarray(kernel, np.float32)
    if kernel.ndim != 4 or kernel.shape[2:] not in ((1, 1), (3, 3)):
        raise ValueError(f"kernels must have the shape (out, in, 3, 3) or (out, in, 1, 1), not {kernel.shape}")
    weights = np.zeros((*kernel.shape[:2], 5), np.float32)
    if kernel.shape[2] == 1:
        weights[:, :, 0] = kernel[:, :, 0, 0]
        return weights
    if kernel[:, :, ::2, ::2].any():
        raise ValueError("the corners of a kernel must be 0: a cell reads only its north, east, south and west neighbours")
    for tap, (row, column) in enumerate(_CROSS):
        weights[:, :, tap] = kernel[:, :, row, column]
    return weights


class LocalPolicy:
    """A network of layers of cross-shaped kernels, with rectification (max(x, 0)) between them.

    inputs: sensor channels by their APRON names ('proximity', 'colour.r'), or 'row' and 'column': the cell's position
        relative to the centre of the array, in cells, southward and eastward.
    actions: the command channels; the first outputs of the last layer, clamped to low … high.
    layers: pairs of weights, shape (out, in, 5) in the order of TAPS, and biases, shape (out,); float32. The inputs of
        the first layer are `inputs`, then the memory.
    memory: number of further outputs of the last layer, clamped to −1 … 1, which are inputs of the next tick. They are 0
        at first. With them information travels one cell per layer and tick.

    Beyond the edge all values are 0. All arithmetic is float32, in this order: the bias, then for each input, for each
    tap, plus input times weight, rounded after each operation; weights of 0 are skipped.
    """

    def __init__(self, inputs: Sequence[str], actions: Sequence[tuple[str, float, float]],
                 layers: Sequence[tuple[ArrayLike, ArrayLike]], memory: int = 0):
        self.inputs, self.actions, self.memory = tuple(inputs), tuple(Action(*a) for a in actions), memory
        self.layers = [(np.array(w, np.float32), np.array(b, np.float32)) for w, b in layers]
        for name in (*self.inputs, *(action.channel for action in self.actions)):
            if not re.fullmatch(r"\w+(\.\w+)?", name):
                raise ValueError(f"'{name}' is not the name of a channel")
        for channel, low, high in self.actions:
            if not (np.isfinite((low, high)).all() and low <= high):
                raise ValueError(f"action '{channel}': the range {low} … {high} must be finite and ascending")
        if not isinstance(memory, (int, np.integer)) or memory < 0:
            raise ValueError(f"memory = {memory!r}: must be a whole number, at least 0")
        width = len(self.inputs) + memory
        for number, (weights, biases) in enumerate(self.layers):
            if weights.ndim != 3 or weights.shape[1:] != (width, 5) or biases.shape != weights.shape[:1]:
                raise ValueError(f"layer {number}: weights {weights.shape} and biases {biases.shape} must be (out, {width}, 5) "
                                 "and (out,)")
            if not (np.isfinite(weights).all() and np.isfinite(biases).all()):
                raise ValueError(f"layer {number}: weights and biases must be finite")
            width = len(biases)
        if width != len(self.actions) + memory:
            raise ValueError(f"the last layer has {width} outputs, not {len(self.actions)} actions and {memory} of memory")
        self.reset()

    @staticmethod
    def parameters(inputs: int, actions: int, hidden: Sequence[int] = (), memory: int = 0) -> int:
        """The number of weights and biases of a network of these sizes."""
        sizes = [inputs + memory, *hidden, actions + memory]
        return sum(n * (5 * m + 1) for m, n in zip(sizes, sizes[1:]))

    @classmethod
    def from_vector(cls, vector: NDArray[Any], inputs: Sequence[str], actions: Sequence[tuple[str, float, float]],
                    hidden: Sequence[int] = (), memory: int = 0) -> LocalPolicy:
        """The network whose weights, then biases, layer by layer, are the vector's values."""
        sizes, layers, at = [len(inputs) + memory, *hidden, len(actions) + memory], [], 0
        if len(vector) != cls.parameters(len(inputs), len(actions), hidden, memory):
            raise ValueError(f"{len(vector)} parameters; this network has "
                             f"{cls.parameters(len(inputs), len(actions), hidden, memory)}")
        for m, n in zip(sizes, sizes[1:]):
            layers.append((np.reshape(vector[at:at + 5 * m * n], (n, m, 5)), vector[at + 5 * m * n:at + n * (5 * m + 1)]))
            at += n * (5 * m + 1)
        return cls(inputs, actions, layers, memory)

    def reset(self) -> None:
        """Forgets: the memory is 0 again."""
        self._memory: list[Any] = [np.float32(0)] * self.memory

    def __call__(self, observation: Mapping[str, NDArray[Any]]) -> dict[str, FloatArray]:
        """One tick. observation: channel → array (…, rows, columns); 'colour.r' is also found as component 0, 1 or 2 of an
        array 'colour' of shape (…, 3, rows, columns). Returns channel → float32 array (…, rows, columns)."""
        sensed = {name: _plane(observation, name) for name in self.inputs if name not in ("row", "column")}
        shape = next(iter(sensed.values())).shape if sensed else next(iter(observation.values())).shape
        planes = [sensed[name] if name in sensed else _coordinate(name, shape) for name in self.inputs]
        planes += [np.broadcast_to(m, shape) for m in self._memory]
        with np.errstate(over="ignore", invalid="ignore"):
            for number, (weights, biases) in enumerate(self.layers):
                planes = _convolve(planes, weights, biases)
                if number + 1 < len(self.layers):
                    planes = [np.maximum(p, np.float32(0)) for p in planes]
        self._memory = [_clamp(p, -1, 1) for p in planes[len(self.actions):]]
        return {a.channel: _clamp(p, a.low, a.high) for a, p in zip(self.actions, planes)}


def _plane(observation: Mapping[str, NDArray[Any]], name: str) -> FloatArray:
    if name in observation:
        plane = np.asarray(observation[name], np.float32)
        if plane.ndim < 2:
            raise ValueError(f"'{name}' has shape {plane.shape}: must be (…, rows, columns)")
        return plane
    channel, dot, component = name.rpartition(".")
    if channel in observation and component in ("r", "g", "b"):
        return np.asarray(observation[channel], np.float32)[..., "rgb".index(component), :, :]
    raise KeyError(f"there is no sensor '{name}' in the observation; there are {', '.join(observation)}")


def _coordinate(name: str, shape: tuple[int, ...]) -> FloatArray:
    rows, columns = shape[-2:]
    if name == "row":
        return np.broadcast_to((np.arange(rows, dtype=np.float32) - np.float32((rows - 1) * 0.5))[:, None], shape)
    return np.broadcast_to(np.arange(columns, dtype=np.float32) - np.float32((columns - 1) * 0.5), shape)


def _neighbour(plane: FloatArray, tap: int) -> FloatArray:
    """The value of that neighbour, 0 beyond the edge."""
    if tap == 0:
        return plane
    row, column = (place - 1 for place in _CROSS[tap])
    rows, columns = plane.shape[-2:]
    padded = np.zeros((*plane.shape[:-2], rows + 2, columns + 2), np.float32)
    padded[..., 1:-1, 1:-1] = plane
    return padded[..., 1 + row:1 + row + rows, 1 + column:1 + column + columns]


def _convolve(planes: list[FloatArray], weights: FloatArray, biases: FloatArray) -> list[FloatArray]:
    used = np.asarray(weights.any(axis=0))
    taps = [[_neighbour(plane, tap) if used[k, tap] else None for tap in range(5)] for k, plane in enumerate(planes)]
    outputs = []
    for kernel, bias in zip(weights, biases):
        total = np.full(planes[0].shape, bias + np.float32(0), np.float32)
        for neighbours, row in zip(taps, kernel):
            for plane, weight in zip(neighbours, row):
                if weight != 0:
                    total = total + plane * weight
        outputs.append(total)
    return outputs


def _clamp(plane: FloatArray, low: float, high: float) -> FloatArray:
    return np.minimum(np.maximum(plane, np.float32(low)), np.float32(high))


def export_policy(policy: LocalPolicy, path: PathName, title: str = "A learned local policy.") -> None:
    """Writes the policy as an APRON program, which commands the surface tick by tick like policy(observation).

    The program passes `apron check --local`, works on arrays of any size, and gives the same float32 commands to
    the bit. title: the program's first line, a comment."""
    registers: list[str] = []
    body: list[str] = []

    def register(name: str) -> str:
        registers.append(name)
        return name

    planes = []
    for k, name in enumerate(policy.inputs):
        plane = register(f"IN{k}")
        if name in ("row", "column"):
            cell, size = ("cell.row", "SURFACE_HEIGHT") if name == "row" else ("cell.col", "SURFACE_WIDTH")
            body.append(f"{plane} = {cell} - ({size} - 1) * 0.5")
        else:
            body.append(f"{plane} = surface.sense('{name}')")
        planes.append(plane)
    memory = [register(f"MEMORY{k}") for k in range(policy.memory)]
    planes += memory
    for number, (weights, biases) in enumerate(policy.layers):
        last = number + 1 == len(policy.layers)
        body.append(f"// Layer {number + 1} of {len(policy.layers)}")
        outputs = [register(f"{'OUT' if last else f'LAYER{number + 1}_'}{k}") for k in range(len(biases))]
        for output, bias in zip(outputs, biases):
            body.append(f"{output} = {_literal(bias + np.float32(0))}")
        # Input by input, so that each neighbour is read once for all outputs.
        for k, plane in enumerate(planes):
            for tap, direction in enumerate(TAPS):
                if not weights[:, k, tap].any():
                    continue
                source = plane
                if tap:
                    source = "NEAR"
                    body.append(f"NEAR = {direction}({plane})")
                for output, weight in zip(outputs, weights[:, k, tap]):
                    if weight != 0:
                        body.append(f"{output} = {output} + {source} * {_literal(weight)}")
        if not last:
            body += [f"{output} = max({output}, 0)" for output in outputs]
        planes = outputs
    for action, output in zip(policy.actions, planes):
        body.append(f"surface.actuate('{action.channel}', min(max({output}, {_literal(action.low)}), {_literal(action.high)}))")
    for name, output in zip(memory, planes[len(policy.actions):]):
        body.append(f"{name} = min(max({output}, -1), 1)")
    body.append("surface.step")
    lines = [f"// {line}" for line in title.splitlines()]
    lines += [f"!register({', '.join([*registers, 'NEAR'])})", "", "boundary('zero')"]
    lines += ["while(1)", *(f"  {line}" for line in body), "endwhile"]
    with open(path, "w") as file:
        file.write("\n".join(lines) + "\n")


def _literal(value: float) -> str:
    """The float32 value, exactly."""
    text = repr(float(np.float32(value)))
    return text.removesuffix(".0")


def export_onnx(policy: LocalPolicy, path: PathName) -> None:
    """Writes the policy as an ONNX model, which gives the same float32 commands to the bit in onnxruntime. Needs the package
    onnx.

    Inputs are the sensor channels by name ('colour.r' is one), then MEMORY0, …: float32, worlds × rows × columns. Outputs are
    the command channels, then NEXT_MEMORY0, …, the memory of the next tick, which starts at 0."""
    try:
        import onnx
        from onnx import TensorProto, helper, numpy_helper
    except ImportError as error:
        raise ImportError("export_onnx needs onnx: pip install onnx") from error
    nodes: list[Any] = []
    constants: dict[str, Any] = {}

    def constant(value: Any, kind: Any = np.float32) -> str:
        array = np.asarray(value, kind)
        name = f"constant{len(constants)}"
        constants[name] = numpy_helper.from_array(array, name)
        return name

    def apply(operator: str, *inputs: str, output: str | None = None, **attributes: Any) -> str:
        name = output or f"value{len(nodes)}"
        nodes.append(helper.make_node(operator, list(inputs), [name], **attributes))
        return name

    sensed = [name for name in policy.inputs if name not in ("row", "column")]
    memory = [f"MEMORY{k}" for k in range(policy.memory)]
    if not sensed and not memory:
        raise ValueError("export_onnx: the policy has no inputs but row and column: a model has no shape without one")
    shape = apply("Shape", (sensed + memory)[0])

    def coordinate(name: str) -> str:
        axis = 1 if name == "row" else 2
        size = apply("Squeeze", apply("Gather", shape, constant([axis], np.int64), axis=0))
        count = apply("Cast", size, to=TensorProto.FLOAT)
        places = apply("Cast", apply("Range", constant(0, np.int64), size, constant(1, np.int64)), to=TensorProto.FLOAT)
        middle = apply("Mul", apply("Sub", count, constant(1)), constant(0.5))
        line = apply("Sub", places, middle)
        axes = constant([0, 2] if name == "row" else [0, 1], np.int64)
        return apply("Expand", apply("Unsqueeze", line, axes), shape)

    def neighbour(plane: str, tap: int) -> str:
        if tap == 0:
            return plane
        row, column = (place - 1 for place in _CROSS[tap])
        # One line of zeros on the side from which the values come, one line less on the other.
        pads = [0, max(-row, 0), max(-column, 0), 0, max(row, 0), max(column, 0)]
        padded = apply("Pad", plane, constant(pads, np.int64), constant(0))
        starts, ends = [max(row, 0), max(column, 0)], [-1 if row < 0 else 2**31, -1 if column < 0 else 2**31]
        return apply("Slice", padded, constant(starts, np.int64), constant(ends, np.int64), constant([1, 2], np.int64))

    planes = [name if name in sensed else coordinate(name) for name in policy.inputs] + memory
    for number, (weights, biases) in enumerate(policy.layers):
        near: dict[tuple[int, int], str] = {}
        outputs = []
        for kernel, bias in zip(weights, biases):
            total = apply("Expand", constant(bias + np.float32(0)), shape)
            for k, row_of_taps in enumerate(kernel):
                for tap, weight in enumerate(row_of_taps):
                    if weight != 0:
                        if (k, tap) not in near:
                            near[k, tap] = neighbour(planes[k], tap)
                        total = apply("Add", total, apply("Mul", near[k, tap], constant(weight)))
            outputs.append(total if number + 1 == len(policy.layers) else apply("Max", total, constant(0)))
        planes = outputs
    results = [(action.channel, action.low, action.high) for action in policy.actions]
    results += [(f"NEXT_{name}", -1, 1) for name in memory]
    for (name, low, high), plane in zip(results, planes):
        apply("Min", apply("Max", plane, constant(low)), constant(high), output=name)

    def values(names: Sequence[str]) -> list[Any]:
        return [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["worlds", "rows", "columns"]) for name in names]
    graph = helper.make_graph(nodes, "policy", values([*dict.fromkeys(sensed), *memory]),
                              values([name for name, _, _ in results]), initializer=list(constants.values()))
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model)
    onnx.save(model, os.fspath(path))
