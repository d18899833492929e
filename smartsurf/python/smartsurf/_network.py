"""Policies of the whole surface: dense and convolutional networks, as ONNX models."""
from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._files import PathName
from ._onnx import OnnxGraph

FloatArray = NDArray[np.float32]


class NetworkPolicy:
    """A network that commands the whole surface: action = clip(middle + half ·
    network((observation − mean) / scale), low, high).

    layers: weights and biases; (out, in) of a dense layer, which sees all that is before it as one vector, (out, in, 3, 3) of a
        convolution with zeros beyond the edge. max(x, 0) between them. All float32.
    scale, mean: of the observations, broadcast to their shape. low, high: of the actions, broadcast to their shape; middle and half
        are those of this range.
    observation_shape, action_shape: without worlds, such as (planes, rows, columns) of an `Env`.
    """

    def __init__(self, layers: Sequence[tuple[ArrayLike, ArrayLike]], observation_shape: Sequence[int],
                 action_shape: Sequence[int], low: ArrayLike, high: ArrayLike, scale: ArrayLike = 1.0,
                 mean: ArrayLike = 0.0):
        self.layers = [(np.array(w, np.float32), np.array(b, np.float32)) for w, b in layers]
        self.observation_shape, self.action_shape = tuple(observation_shape), tuple(action_shape)
        self.low, self.high = (np.broadcast_to(np.asarray(end, np.float32), self.action_shape).copy() for end in (low, high))
        self.scale, self.mean = (np.broadcast_to(np.asarray(of, np.float32), self.observation_shape).copy() for of in (scale, mean))
        shape: tuple[int, ...] = self.observation_shape
        for number, (weights, biases) in enumerate(self.layers):
            convolves = weights.ndim == 4 and len(shape) == 3
            needed = (shape[0], 3, 3) if convolves else (int(np.prod(shape)),)
            after = (len(biases), *shape[1:]) if convolves else (len(biases),)
            if weights.shape[1:] != needed or biases.shape != weights.shape[:1]:
                raise ValueError(f"layer {number}: weights {weights.shape} and biases {biases.shape} do not fit its input {shape}")
            shape = after
        if int(np.prod(shape)) != int(np.prod(self.action_shape)):
            raise ValueError(f"the last layer has outputs {shape}: must be as many as the actions {self.action_shape}")

    def __call__(self, observation: ArrayLike) -> FloatArray:
        """The actions, (worlds, *action_shape), of observations (worlds, *observation_shape), as the ONNX model's to rounding."""
        value = (np.asarray(observation, np.float32) - self.mean) / self.scale
        worlds = len(value)
        for number, (weights, biases) in enumerate(self.layers):
            value = np.maximum(value, 0) if number else value
            if weights.ndim == 4:
                padded = np.pad(value, ((0, 0), (0, 0), (1, 1), (1, 1)))
                windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), axis=(2, 3))
                value = np.einsum("nirckl,oikl->norc", windows, weights, optimize=True) + biases[:, None, None]
            else:
                value = value.reshape(worlds, -1) @ weights.T + biases
        half, middle = (self.high - self.low) / 2, (self.high + self.low) / 2
        actions: FloatArray = np.clip(middle + half * value.reshape(worlds, *self.action_shape), self.low, self.high)
        return actions.astype(np.float32)

    def export(self, path: PathName) -> None:
        """Writes an ONNX model, from `observation`, float32 (worlds, *observation_shape), to `action`, float32 (worlds,
        *action_shape). `smartsurf run --controller` runs it, where the observation is that of an `Env`. Needs the package onnx.
        """
        graph = OnnxGraph()
        constant, apply = graph.constant, graph.apply
        sensed = apply("Sub", "observation", constant(self.mean)) if self.mean.any() else "observation"
        value = apply("Div", sensed, constant(self.scale))
        for number, (weights, biases) in enumerate(self.layers):
            if weights.ndim == 4:
                value = apply("Conv", value, constant(weights), constant(biases), pads=[1, 1, 1, 1], kernel_shape=[3, 3])
            else:
                value = apply("Gemm", apply("Flatten", value), constant(weights), constant(biases), transB=1)
            if number + 1 < len(self.layers):
                value = apply("Relu", value)
        value = apply("Reshape", value, constant([0, *self.action_shape] if self.action_shape else [0], np.int64))
        value = apply("Add", apply("Mul", value, constant((self.high - self.low) / 2)), constant((self.high + self.low) / 2))
        apply("Min", apply("Max", value, constant(self.low)), constant(self.high), output="action")
        graph.write(path, {"observation": self.observation_shape}, {"action": self.action_shape})
