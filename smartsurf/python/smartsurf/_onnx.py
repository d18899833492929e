"""Writes ONNX models of policies."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ._files import PathName, replaced


class OnnxGraph:
    """A model under construction. Values are float32 and are passed by name. Needs the package onnx."""

    def __init__(self) -> None:
        try:
            import onnx
        except ImportError as error:
            raise ImportError("export needs onnx: pip install onnx") from error
        self.onnx: Any = onnx
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def constant(self, value: Any, kind: Any = np.float32) -> str:
        name = f"constant{len(self.constants)}"
        self.constants.append(self.onnx.numpy_helper.from_array(np.asarray(value, kind, order="C"), name))
        return name

    def apply(self, operator: str, *inputs: str, output: str | None = None, **attributes: Any) -> str:
        name = output or f"value{len(self.nodes)}"
        self.nodes.append(self.onnx.helper.make_node(operator, list(inputs), [name], **attributes))
        return name

    def write(self, path: PathName, inputs: Mapping[str, Sequence[int | str]], outputs: Mapping[str, Sequence[int | str]]) -> None:
        """inputs, outputs: the shapes of the model's values, without the leading axis of worlds."""
        helper = self.onnx.helper

        def described(values: Mapping[str, Sequence[int | str]]) -> list[Any]:
            return [helper.make_tensor_value_info(name, self.onnx.TensorProto.FLOAT, ["worlds", *shape]) for name, shape in values.items()]
        graph = helper.make_graph(self.nodes, "policy", described(inputs), described(outputs), initializer=self.constants)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
        self.onnx.checker.check_model(model)
        with replaced(path) as part:
            part.write_bytes(model.SerializeToString())
