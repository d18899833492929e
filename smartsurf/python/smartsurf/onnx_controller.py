"""Commands a live surface by an ONNX model; `smartsurf run --controller POLICY.onnx` starts it.

  python -m smartsurf.onnx_controller POLICY.onnx --shm NAME

The model is one of `export_onnx`, whose inputs and outputs are channels and memory, or of the whole surface, from `observation`
(worlds, planes, rows, columns) to `action` (worlds, channels, rows, columns), as of `Env`; float32.
"""
from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._printable import guard_output, printable
from .policy import _plane, plane_names

FloatArray = NDArray[np.float32]


def _times(shape: Sequence[Any]) -> str:
    return " x ".join(str(n) for n in shape)


class OnnxPolicy:
    """A model as a function of one frame.

    path: of the model. channels: the names of the surface's sensor and actuator channels, which the model's inputs and outputs
    must have. Raises ValueError for a model that does not fit, ImportError without onnxruntime."""

    def __init__(self, path: str, sensors: Mapping[str, int], actuators: tuple[str, ...]):
        try:
            import onnxruntime
        except ImportError as error:
            raise ImportError(f"{path}: an ONNX model needs onnxruntime: pip install onnxruntime") from error
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1  # the same bits for any number of cores
        try:
            self._session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # onnxruntime's classes have no common one of their own
            raise ValueError(f"{path}: {str(error).splitlines()[0]}") from error
        self._path = path
        self._inputs = [i.name for i in self._session.get_inputs()]
        self._outputs = [o.name for o in self._session.get_outputs()]
        planes = [plane for name, count in sensors.items() for plane in plane_names(name, count)]
        numbered = [f"{name}[{k}]" for name, count in sensors.items() if count > 1 for k in range(count)]
        for name in self._inputs:
            if name not in ("observation", *planes, *numbered) and not name.startswith("MEMORY"):
                raise ValueError(f"{path}: its input '{name}' is no sensor channel: there are observation, "
                                 f"{', '.join(sorted(planes))}")
        for name in self._outputs:
            if name not in ("action", *actuators) and not name.startswith("NEXT_MEMORY"):
                raise ValueError(f"{path}: its output '{name}' is no actuator channel: there are action, {', '.join(actuators)}")
        self._actuators = actuators
        self.reset()

    def reset(self) -> None:
        """Forgets: the memory is 0 again."""
        self._memory: dict[str, FloatArray] = {}

    def __call__(self, observation: FloatArray, sensors: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """observation: planes × rows × columns, sensors: the same by channel. Returns rows × columns by actuator channel."""
        shape = observation.shape[1:]

        def value(name: str) -> FloatArray:
            if name == "observation":
                return observation
            if name.startswith("MEMORY"):
                return self._memory.get(name, np.zeros(shape, np.float32))
            return _plane(sensors, name)
        feed = {name: np.ascontiguousarray(value(name), np.float32)[None] for name in self._inputs}
        commands: dict[str, FloatArray] = {}
        for given in self._session.get_inputs():
            here = feed[given.name].shape
            if len(given.shape) != len(here) or any(isinstance(of, int) and of != n for of, n in zip(given.shape, here)):
                raise ValueError(f"{self._path}: its input '{given.name}' is {_times(given.shape[1:])}, "
                                 f"that of this surface {_times(here[1:])}")
        try:
            results: list[Any] = self._session.run(None, feed)
        except Exception as error:  # onnxruntime's classes have no common one of their own
            raise ValueError(f"{self._path}: {str(error).splitlines()[0]}") from error
        for name, result in zip(self._outputs, results):
            wanted = (1, len(self._actuators), *shape) if name == "action" else (1, *shape)
            if result.shape != wanted:
                raise ValueError(f"{self._path}: its output '{name}' is {_times(result.shape[1:])}, not {_times(wanted[1:])}")
            if name == "action":
                commands.update(zip(self._actuators, result[0]))
            elif name.startswith("NEXT_"):
                self._memory[name[len("NEXT_"):]] = result[0]
            else:
                commands[name] = result[0]
        return commands


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policy", metavar="POLICY.onnx")
    parser.add_argument("--shm", required=True, metavar="NAME")
    how = parser.parse_args()
    from ._live import LiveSurface
    with LiveSurface(how.shm) as surface:
        policy = OnnxPolicy(how.policy, {c.name: c.components for c in surface.sensor_channels},
                            tuple(c.name for c in surface.actuator_channels))
        while not surface.closed:
            surface.step(policy(surface._observation, surface.sensors))


if __name__ == "__main__":
    guard_output()
    try:
        main()
    except (ImportError, ValueError) as failed:
        print(f"smartsurf: {printable(failed)}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
