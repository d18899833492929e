"""SmartSurf in this process: simulations of actuator tables as NumPy arrays, and environments for learning.

    import smartsurf
    simulation = smartsurf.Simulation("plate.lua", seed=3)
    simulation.step({"height": 1.0})
    simulation.sensors["proximity"]            # rows × columns, row 0 north, column 0 west

`Simulation` is one experiment; `attach` gives a surface that another process runs, such as hardware, the same interface.
`Env` and `VectorEnv` are Gymnasium environments of one and of many worlds, and `parallel_env` is a PettingZoo environment
whose agents are blocks of cells; they need those packages. `Env(shm=NAME)` is that of a live surface. Importing this
package registers its tasks with Gymnasium, if that is installed: gymnasium.make("smartsurf/Relocate-v0").

`run` is one run of the program smartsurf, with a controller, as a function. `LocalPolicy` is a network that every cell
executes alike, and `export_policy` writes it as an APRON program.
"""
import importlib

from ._tasks import TASKS, task_file
from .run import RunError, run

__all__ = ["Channel", "Env", "Error", "LocalPolicy", "RunError", "Simulation", "TASKS", "VectorEnv", "__version__",
           "attach", "export_policy", "load_extension", "parallel_env", "run", "task_file"]

# Imported at their first use: runs and sweeps need neither the compiled part nor NumPy, live surfaces not the former.
_MODULES = {"Channel": "._surface", "Error": "._core", "LocalPolicy": ".policy", "Simulation": "._simulation",
            "__version__": "._core", "attach": "._live", "export_policy": ".policy",
            "load_extension": "._simulation"}

_NEEDS = {"Env": ("gymnasium", "._env"), "VectorEnv": ("gymnasium", "._vector"),
          "parallel_env": ("pettingzoo", "._parallel")}


def __getattr__(name):
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


def _register():
    try:
        import gymnasium
    except ImportError:
        return
    for task in TASKS:
        if task.id not in gymnasium.registry:
            gymnasium.register(task.id, entry_point="smartsurf._env:make", vector_entry_point="smartsurf._vector:make",
                               kwargs={"task": task.id})


_register()
