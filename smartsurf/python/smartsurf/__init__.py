"""SmartSurf in this process: simulations of actuator tables as NumPy arrays, and environments for learning.

    import smartsurf
    simulation = smartsurf.Simulation("plate.lua", seed=3)
    simulation.step({"height": 1.0})
    simulation.sensors["proximity"]            # rows × columns, row 0 north, column 0 west

`Simulation` is one experiment; `attach` gives a surface that another process runs, such as hardware, the same interface.
`Task` is a task in Python: reward, observation and randomisation of many worlds as functions of arrays. `Env` and `VectorEnv`
are Gymnasium environments of one and of many worlds, and `parallel_env` is a PettingZoo environment
whose agents are blocks of cells; they need those packages. `Env(shm=NAME)` is that of a live surface. Importing this
package registers its tasks with Gymnasium, if that is installed: gymnasium.make("smartsurf/Relocate-v0").

`run` is one run of the program smartsurf, with a controller, as a function, and `plot` draws a chart. `LocalPolicy` is a
network that every cell executes alike, and `export_policy` writes it as an APRON program.
"""
from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from ._tasks import TASKS, task_file
from .run import RunError, plot, run

if TYPE_CHECKING:
    from . import fmu as fmu, formats as formats, sb3 as sb3, torchrl as torchrl
    from ._core import Error, __version__
    from ._env import Env
    from ._live import attach
    from ._minari import MinariCollector
    from ._network import NetworkPolicy
    from ._parallel import ParallelEnv, parallel_env
    from ._picture import Camera, Video
    from ._simulation import Simulation, load_extension
    from ._surface import Channel
    from ._task import State, Task, TaskEnv, TaskVectorEnv, planes
    from ._vector import VectorEnv
    from .policy import LocalPolicy, export_onnx, export_policy

__all__ = ["Camera", "Channel", "Env", "Error", "LocalPolicy", "MinariCollector", "NetworkPolicy", "ParallelEnv", "RunError",
           "Simulation", "State", "TASKS", "Task", "TaskEnv", "TaskVectorEnv", "VectorEnv", "Video", "__version__", "attach",
           "export_onnx", "export_policy", "load_extension", "parallel_env", "planes", "plot", "run", "task_file"]

# Imported at their first use: runs and sweeps need neither the compiled part nor NumPy, live surfaces not the former.
_MODULES = {"Camera": "._picture", "Video": "._picture", "Channel": "._surface", "Error": "._core",
            "LocalPolicy": ".policy", "NetworkPolicy": "._network", "Simulation": "._simulation",
            "__version__": "._core", "attach": "._live", "export_onnx": ".policy", "export_policy": ".policy",
            "load_extension": "._simulation"}

_SUBMODULES = ("fmu", "formats", "sb3", "torchrl")

_NEEDS = {"Env": ("gymnasium", "._env"), "MinariCollector": ("gymnasium", "._minari"),
          "VectorEnv": ("gymnasium", "._vector"), "State": ("gymnasium", "._task"),
          "Task": ("gymnasium", "._task"), "TaskEnv": ("gymnasium", "._task"), "TaskVectorEnv": ("gymnasium", "._task"),
          "planes": ("gymnasium", "._task"),
          "ParallelEnv": ("pettingzoo", "._parallel"), "parallel_env": ("pettingzoo", "._parallel")}


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


if not TYPE_CHECKING:  # a name that does not exist is then an error of type checkers
    def __getattr__(name: str) -> Any:
        if name in _SUBMODULES:
            return importlib.import_module(f".{name}", __name__)
        if name in _MODULES:
            return getattr(importlib.import_module(_MODULES[name], __name__), name)
        # Gymnasium and PettingZoo are imported by those who use them.
        if name not in _NEEDS:
            raise AttributeError(f"module 'smartsurf' has no attribute '{name}'")
        package, module = _NEEDS[name]
        try:
            importlib.import_module(package)
        except ModuleNotFoundError as error:
            raise ImportError(f"smartsurf.{name} needs {package}: pip install {package}") from error
        return getattr(importlib.import_module(module, __name__), name)


def _register() -> None:
    try:
        import gymnasium
    except ImportError:
        return
    for task in TASKS:
        if task.id not in gymnasium.registry:
            gymnasium.register(task.id, entry_point="smartsurf._env:make", vector_entry_point="smartsurf._vector:make",
                               kwargs={"task": task.id})


_register()
