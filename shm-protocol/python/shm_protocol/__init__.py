"""The shared-memory protocol between a surface and its controller, for Python.

    with shm_protocol.Controller("surface", timeout=10) as table:
        while table.wait():
            table.actuators["height"][:] = 4 * (table.sensors["proximity_hit"] == 0)
            table.publish()

The arrays are NumPy arrays over the mapped memory itself. Surface and Observer are the other two roles. A constructor
creates or attaches, close() ends the role, and the memory is unmapped when the last array is collected.
smartsurf.Env(shm=NAME) is a controller as a Gymnasium environment.
"""
from ._controller import Controller
from ._observer import Observer
from ._segments import Segment, clean, list_surfaces
from ._surface import Surface
from ._values import Channel, Counters, Description, Error, Frame, NotFound, Result, SurfaceDied

__all__ = ["Channel", "Controller", "Counters", "Description", "Error", "Frame", "NotFound", "Observer", "Result",
           "Segment", "Surface", "SurfaceDied", "clean", "list_surfaces"]


def __getattr__(name):
    if name == "SurfaceEnv":
        raise ImportError("shm_protocol.SurfaceEnv is now smartsurf.Env(shm=NAME), or smartsurf.Env(EXPERIMENT)")
    raise AttributeError(f"module 'shm_protocol' has no attribute {name!r}")
