"""The shared-memory protocol between a surface and its controller, for Python.

    with shm_protocol.Controller("surface", timeout=10) as table:
        while table.wait():
            table.actuators["height"][:] = 4 * (table.sensors["proximity_hit"] == 0)
            table.publish()

The arrays are NumPy arrays over the mapped memory itself. Surface and Observer are the other two roles;
SurfaceEnv wraps a controller as a Gymnasium-style environment, and can start the simulator.
"""
from ._controller import Controller
from ._observer import Observer
from ._segments import Segment, clean, list_surfaces
from ._surface import Surface
from ._values import Channel, Counters, Description, Error, Frame, NotFound, Result, SurfaceDied
from .environment import SurfaceEnv

__all__ = ["Channel", "Controller", "Counters", "Description", "Error", "Frame", "NotFound", "Observer", "Result",
           "Segment", "Surface", "SurfaceDied", "SurfaceEnv", "clean", "list_surfaces"]
