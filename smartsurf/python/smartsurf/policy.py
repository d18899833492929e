"""Policies that every cell executes alike, on its own values and those of its neighbours.

`LocalPolicy` is a small convolutional network whose kernels are crosses (own cell, north, east, south, west) or 3×3 squares. In
NumPy it acts on the sensor arrays of an environment; `export_policy` writes it as an APRON program that passes
`apron check --local` and gives the same commands to the bit.
"""
from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._files import PathName, replaced
from ._onnx import OnnxGraph

FloatArray = NDArray[np.float32]

TAPS = ("own", "north", "east", "south", "west", "northeast", "southeast", "southwest", "northwest")
_CROSS_TAPS = 5  # the first ones
# Places of the taps in a 3×3 kernel, row 0 north.
_PLACES = ((1, 1), (0, 1), (1, 2), (2, 1), (1, 0), (0, 2), (2, 2), (2, 0), (0, 0))


class Action(NamedTuple):
    """A command channel and the range of its values."""
    channel: str
    low: float
    high: float


def cross(kernel: ArrayLike) -> FloatArray:
    """(out, in, 3, 3) or (out, in, 1, 1), as torch.nn.Conv2d.weight → (out, in, 5), in the order of TAPS.

    Raises ValueError if a corner is not 0: `square` keeps diagonal neighbours."""
    weights = square(kernel)
    if weights[:, :, _CROSS_TAPS:].any():
        raise ValueError("the corners of a kernel must be 0: in a cross a cell reads only its north, east, south and west "
                         "neighbours")
    return weights[:, :, :_CROSS_TAPS]


def square(kernel: ArrayLike) -> FloatArray:
    """(out, in, 3, 3) or (out, in, 1, 1), as torch.nn.Conv2d.weight → (out, in, 9), in the order of TAPS."""
    kernel = np.asarray(kernel, np.float32)
    if kernel.ndim != 4 or kernel.shape[2:] not in ((1, 1), (3, 3)):
        raise ValueError(f"kernels must have the shape (out, in, 3, 3) or (out, in, 1, 1), not {kernel.shape}")
    weights = np.zeros((*kernel.shape[:2], len(TAPS)), np.float32)
    if kernel.shape[2] == 1:
        weights[:, :, 0] = kernel[:, :, 0, 0]
        return weights
    for tap, (row, column) in enumerate(_PLACES):
        weights[:, :, tap] = kernel[:, :, row, column]
    return weights


def draw_links(random: np.random.Generator, shape: Sequence[int], dead: float, diagonal: bool = False) -> NDArray[np.bool_]:
    """Which links between neighbouring cells work, for LocalPolicy: bool, (…, 4 or 8, rows, columns) for a shape of (…, rows,
    columns), in the order of TAPS without the own cell. Each link is dead, in both directions, with the probability `dead`."""
    *leading, rows, columns = shape
    taps = len(TAPS) if diagonal else _CROSS_TAPS
    links = np.ones((*leading, taps - 1, rows, columns), np.bool_)
    for tap in range(1, taps):
        row, column = (place - 1 for place in _PLACES[tap])
        if (row, column) > (0, 0):  # the other end of a link that has been drawn
            continue
        works = random.random((*leading, rows, columns)) >= dead
        links[..., tap - 1, :, :] = works
        links[..., _PLACES.index((1 - row, 1 - column)) - 1, :, :] = _shifted(works, -row, -column, True)
    return links


def plane_names(channel: str, components: int) -> list[str]:
    """The names of a channel's planes in APRON."""
    if components == 1:
        return [channel]
    return [f"{channel}.{k}" for k in "rgb"] if components == 3 else [f"{channel}[{k}]" for k in range(components)]


class LocalPolicy:
    """A network of layers of cross-shaped or 3×3 kernels, with rectification (max(x, 0)) between them.

    inputs: sensor channels by their APRON names ('proximity', 'colour.r', 'camera[3]'), or 'row' and 'column': the cell's position
        relative to the centre of the array, in cells, southward and eastward.
    actions: the command channels; the first outputs of the last layer, clamped to low … high.
    layers: pairs of weights, shape (out, in, 5) or, with diagonal neighbours, (out, in, 9), in the order of TAPS, and biases,
        shape (out,); float32. The inputs of the first layer are `inputs`, then the memory.
    memory: number of further outputs of the last layer, clamped to −1 … 1, which are inputs of the next step. They are 0
        at first. With them information travels one cell per layer and step.
    steps: how often the network is applied in a tick, each time with the memory of the time before; needs memory if it is not 1.

    Beyond the edge all values are 0. All arithmetic is float32, in this order: the bias, then for each input, for each
    tap, plus input times weight, rounded after each operation; weights of 0 are skipped.
    """

    def __init__(self, inputs: Sequence[str], actions: Sequence[tuple[str, float, float]],
                 layers: Sequence[tuple[ArrayLike, ArrayLike]], memory: int = 0, steps: int = 1):
        self.inputs, self.actions, self.memory = tuple(inputs), tuple(Action(*a) for a in actions), memory
        self.layers = [(np.array(w, np.float32), np.array(b, np.float32)) for w, b in layers]
        for name in (*self.inputs, *(action.channel for action in self.actions)):
            if not re.fullmatch(r"\w+(\.\w+)*(\[\d+\])?", name):
                raise ValueError(f"'{name}' is not the name of a channel")
        for channel, low, high in self.actions:
            if not (np.isfinite((low, high)).all() and low <= high):
                raise ValueError(f"action '{channel}': the range {low} … {high} must be finite and ascending")
        if not isinstance(memory, (int, np.integer)) or memory < 0:
            raise ValueError(f"memory = {memory!r}: must be a whole number, at least 0")
        if not isinstance(steps, (int, np.integer)) or steps < 1 or (steps > 1 and memory == 0):
            raise ValueError(f"steps = {steps!r}: must be a whole number, at least 1, and 1 without memory")
        self.steps = int(steps)
        width = len(self.inputs) + memory
        for number, (weights, biases) in enumerate(self.layers):
            if (weights.ndim != 3 or weights.shape[1] != width or weights.shape[2] not in (_CROSS_TAPS, len(TAPS))
                    or biases.shape != weights.shape[:1]):
                raise ValueError(f"layer {number}: weights {weights.shape} and biases {biases.shape} must be (out, {width}, 5 or "
                                 "9) and (out,)")
            if not (np.isfinite(weights).all() and np.isfinite(biases).all()):
                raise ValueError(f"layer {number}: weights and biases must be finite")
            width = len(biases)
        if width != len(self.actions) + memory:
            raise ValueError(f"the last layer has {width} outputs, not {len(self.actions)} actions and {memory} of memory")
        self.reset()

    @staticmethod
    def parameters(inputs: int, actions: int, hidden: Sequence[int] = (), memory: int = 0, diagonal: bool = False) -> int:
        """The number of weights and biases of a network of these sizes."""
        sizes, taps = [inputs + memory, *hidden, actions + memory], len(TAPS) if diagonal else _CROSS_TAPS
        return sum(n * (taps * m + 1) for m, n in zip(sizes, sizes[1:]))

    @classmethod
    def from_vector(cls, vector: NDArray[Any], inputs: Sequence[str], actions: Sequence[tuple[str, float, float]],
                    hidden: Sequence[int] = (), memory: int = 0, steps: int = 1, diagonal: bool = False) -> LocalPolicy:
        """The network whose weights, then biases, layer by layer, are the vector's values."""
        sizes, layers, at = [len(inputs) + memory, *hidden, len(actions) + memory], [], 0
        count, taps = cls.parameters(len(inputs), len(actions), hidden, memory, diagonal), len(TAPS) if diagonal else _CROSS_TAPS
        if len(vector) != count:
            raise ValueError(f"{len(vector)} parameters; this network has {count}")
        for m, n in zip(sizes, sizes[1:]):
            end = at + taps * m * n
            layers.append((np.reshape(vector[at:end], (n, m, taps)), vector[end:end + n]))
            at = end + n
        return cls(inputs, actions, layers, memory, steps)

    def reset(self) -> None:
        """Forgets: the memory is 0 again, and so are the commands that inactive cells keep."""
        self._state: list[Any] = [np.float32(0)] * (len(self.actions) + self.memory)

    def __call__(self, observation: Mapping[str, NDArray[Any]], *, active: ArrayLike | None = None,
                 links: ArrayLike | None = None) -> dict[str, FloatArray]:
        """One tick. observation: channel → array (…, rows, columns); 'colour.r' is also found as component 0 of an array
        'colour' of shape (…, 3, rows, columns), 'camera[3]' as component 3 of an array 'camera'. Returns channel → float32 array
        (…, rows, columns).

        The faults of a surface without a common clock, to train with: active: bool, (…, rows, columns), or with a first axis of
        steps, the cells that compute in this step; the others keep memory and commands. links: bool, (…, 4 or 8, rows, columns),
        which neighbours a cell hears, in the order of TAPS without the own cell, see draw_links(); the others read as 0."""
        sensed = {name: _plane(observation, name) for name in self.inputs if name not in ("row", "column")}
        if not observation:
            raise ValueError("the observation is empty: it must have a sensor, whose shape tells rows and columns")
        shape = next(iter(sensed.values())).shape if sensed else _plane(observation, next(iter(observation))).shape
        inputs = [sensed[name] if name in sensed else _coordinate(name, shape) for name in self.inputs]
        computes = None if active is None else np.broadcast_to(np.asarray(active, np.bool_), (self.steps, *shape))
        hears = None if links is None else self._links(links, shape)
        for step in range(self.steps):
            planes = inputs + [np.broadcast_to(m, shape) for m in self._state[len(self.actions):]]
            with np.errstate(over="ignore", invalid="ignore"):
                for number, (weights, biases) in enumerate(self.layers):
                    planes = _convolve(planes, weights, biases, hears)
                    if number + 1 < len(self.layers):
                        planes = [np.maximum(p, np.float32(0)) for p in planes]
            limits = [(a.low, a.high) for a in self.actions] + [(-1.0, 1.0)] * self.memory
            after = [_clamp(p, low, high) for p, (low, high) in zip(planes, limits)]
            if computes is not None:
                before = [_clamp(np.broadcast_to(p, shape), low, high) for p, (low, high) in zip(self._state, limits)]
                after = [np.where(computes[step], new, old) for new, old in zip(after, before)]
            self._state = after
        return {a.channel: p.copy() for a, p in zip(self.actions, self._state)}

    def _links(self, links: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        given = np.asarray(links, np.bool_)
        taps = max(weights.shape[2] for weights, _ in self.layers) - 1
        if given.ndim < 3 or given.shape[-3] < taps:
            raise ValueError(f"links has shape {given.shape}: must be (…, {taps}, rows, columns)")
        return np.broadcast_to(given, (*shape[:-2], given.shape[-3], *shape[-2:]))


def _plane(observation: Mapping[str, NDArray[Any]], name: str) -> FloatArray:
    if name in observation:
        plane = np.asarray(observation[name], np.float32)
        if plane.ndim < 2:
            raise ValueError(f"'{name}' has shape {plane.shape}: must be (…, rows, columns)")
        return plane
    component = re.fullmatch(r"(.+?)(?:\.([rgb])|\[(\d+)\])", name)
    if component and component[1] in observation:
        planes = np.asarray(observation[component[1]], np.float32)
        count = planes.shape[-3] if planes.ndim > 2 else 1
        k = int(component[3]) if component[3] else "rgb".index(component[2]) if count == 3 else count
        if k < count:
            return planes[..., k, :, :]
    raise KeyError(f"there is no sensor '{name}' in the observation; there are {', '.join(observation)}")


def _coordinate(name: str, shape: tuple[int, ...]) -> FloatArray:
    rows, columns = shape[-2:]
    if name == "row":
        return np.broadcast_to((np.arange(rows, dtype=np.float32) - np.float32((rows - 1) * 0.5))[:, None], shape)
    return np.broadcast_to(np.arange(columns, dtype=np.float32) - np.float32((columns - 1) * 0.5), shape)


def _shifted(plane: NDArray[Any], row: int, column: int, beyond: Any) -> NDArray[Any]:
    """The value of the cell so many rows and columns on, up to 1; `beyond` outside the array."""
    rows, columns = plane.shape[-2:]
    padded = np.full((*plane.shape[:-2], rows + 2, columns + 2), beyond, plane.dtype)
    padded[..., 1:-1, 1:-1] = plane
    return padded[..., 1 + row:1 + row + rows, 1 + column:1 + column + columns]


def _neighbour(plane: FloatArray, tap: int, links: NDArray[np.bool_] | None) -> FloatArray:
    """The value of that neighbour, 0 beyond the edge and without a link."""
    if tap == 0:
        return plane
    row, column = (place - 1 for place in _PLACES[tap])
    value = _shifted(plane, row, column, np.float32(0))
    return value if links is None else np.where(links[..., tap - 1, :, :], value, np.float32(0))


def _convolve(planes: list[FloatArray], weights: FloatArray, biases: FloatArray,
              links: NDArray[np.bool_] | None) -> list[FloatArray]:
    used = np.asarray(weights.any(axis=0))
    taps = [[_neighbour(plane, tap, links) if used[k, tap] else None for tap in range(weights.shape[2])]
            for k, plane in enumerate(planes)]
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

    inputs = []
    for k, name in enumerate(policy.inputs):
        plane = register(f"IN{k}")
        if name in ("row", "column"):
            cell, size = ("cell.row", "SURFACE_HEIGHT") if name == "row" else ("cell.col", "SURFACE_WIDTH")
            body.append(f"{plane} = {cell} - ({size} - 1) * 0.5")
        else:
            body.append(f"{plane} = surface.sense('{name}')")
        inputs.append(plane)
    memory = [register(f"MEMORY{k}") for k in range(policy.memory)]
    planes, indent = inputs + memory, ""
    if policy.steps > 1:
        body.append(f"repeat({policy.steps})")
        indent = "  "
    for number, (weights, biases) in enumerate(policy.layers):
        last = number + 1 == len(policy.layers)
        body.append(f"{indent}// Layer {number + 1} of {len(policy.layers)}")
        outputs = [register(f"{'OUT' if last else f'LAYER{number + 1}_'}{k}") for k in range(len(biases))]
        for output, bias in zip(outputs, biases):
            body.append(f"{indent}{output} = {_literal(bias + np.float32(0))}")
        # Input by input, so that each neighbour is read once for all outputs.
        for k, plane in enumerate(planes):
            for tap in range(weights.shape[2]):
                if not weights[:, k, tap].any():
                    continue
                source = plane
                if tap:
                    source = "NEAR"
                    body.append(f"{indent}NEAR = {_near(plane, tap)}")
                for output, weight in zip(outputs, weights[:, k, tap]):
                    if weight != 0:
                        body.append(f"{indent}{output} = {output} + {source} * {_literal(weight)}")
        if not last:
            body += [f"{indent}{output} = max({output}, 0)" for output in outputs]
        planes = outputs
    for name, output in zip(memory, planes[len(policy.actions):]):
        body.append(f"{indent}{name} = min(max({output}, -1), 1)")
    if policy.steps > 1:
        body.append("endrepeat")
    for action, output in zip(policy.actions, planes):
        body.append(f"surface.actuate('{action.channel}', min(max({output}, {_literal(action.low)}), {_literal(action.high)}))")
    body.append("surface.step")
    lines = [f"// {line}" for line in title.splitlines()]
    lines += [f"!register({', '.join([*registers, 'NEAR'])})", "", "boundary('zero')"]
    lines += ["while(1)", *(f"  {line}" for line in body), "endwhile"]
    with replaced(path) as part:
        part.write_text("\n".join(lines) + "\n")


def _near(plane: str, tap: int) -> str:
    """The expression of that neighbour; a diagonal one is the neighbour's neighbour."""
    if tap < _CROSS_TAPS:
        return f"{TAPS[tap]}({plane})"
    vertical, horizontal = TAPS[tap][:5], TAPS[tap][5:]
    return f"{vertical}({horizontal}({plane}))"


def _literal(value: float) -> str:
    """The float32 value, exactly."""
    text = repr(float(np.float32(value)))
    return text.removesuffix(".0")


def export_onnx(policy: LocalPolicy, path: PathName) -> None:
    """Writes the policy as an ONNX model, which gives the same float32 commands to the bit in onnxruntime. Needs the package
    onnx.

    Inputs are the sensor channels by name ('colour.r' is one), then MEMORY0, …: float32, worlds × rows × columns. Outputs are
    the command channels, then NEXT_MEMORY0, …, the memory of the next tick, which starts at 0."""
    graph = OnnxGraph()
    constant, apply, to_float = graph.constant, graph.apply, graph.onnx.TensorProto.FLOAT
    sensed = [name for name in policy.inputs if name not in ("row", "column")]
    memory = [f"MEMORY{k}" for k in range(policy.memory)]
    if not sensed and not memory:
        raise ValueError("export_onnx: the policy has no inputs but row and column: a model has no shape without one")
    shape = apply("Shape", (sensed + memory)[0])

    def coordinate(name: str) -> str:
        axis = 1 if name == "row" else 2
        size = apply("Squeeze", apply("Gather", shape, constant([axis], np.int64), axis=0))
        count = apply("Cast", size, to=to_float)
        places = apply("Cast", apply("Range", constant(0, np.int64), size, constant(1, np.int64)), to=to_float)
        middle = apply("Mul", apply("Sub", count, constant(1)), constant(0.5))
        line = apply("Sub", places, middle)
        axes = constant([0, 2] if name == "row" else [0, 1], np.int64)
        return apply("Expand", apply("Unsqueeze", line, axes), shape)

    def neighbour(plane: str, tap: int) -> str:
        if tap == 0:
            return plane
        row, column = (place - 1 for place in _PLACES[tap])
        # One line of zeros on the side from which the values come, one line less on the other.
        pads = [0, max(-row, 0), max(-column, 0), 0, max(row, 0), max(column, 0)]
        padded = apply("Pad", plane, constant(pads, np.int64), constant(0))
        starts, ends = [max(row, 0), max(column, 0)], [-1 if row < 0 else 2**31, -1 if column < 0 else 2**31]
        return apply("Slice", padded, constant(starts, np.int64), constant(ends, np.int64), constant([1, 2], np.int64))

    inputs = [name if name in sensed else coordinate(name) for name in policy.inputs]
    results = [(action.channel, action.low, action.high) for action in policy.actions]
    results += [(f"NEXT_{name}", -1, 1) for name in memory]
    state = memory
    for step in range(policy.steps):
        planes = inputs + state
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
        last = step + 1 == policy.steps
        planes = [apply("Min", apply("Max", plane, constant(low)), constant(high), output=name if last else None)
                  for (name, low, high), plane in zip(results, planes)]
        state = planes[len(policy.actions):]
    size_of_surface = ["rows", "columns"]
    graph.write(path, dict.fromkeys([*sensed, *memory], size_of_surface), {name: size_of_surface for name, _, _ in results})
