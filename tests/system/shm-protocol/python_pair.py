"""What the tests of the Python client share: channels, unique names, a pair in one process."""
import os
import pathlib
import sys

try:
    import numpy as np
except ImportError:
    print("SKIPPED: python3-numpy is not installed")
    sys.exit(77)

from shm_protocol import Channel, Controller, Surface

ROOT = pathlib.Path(os.environ["SOURCE_ROOT"])
EXAMPLES = ROOT / "shm-protocol" / "examples"

SENSORS = [Channel("distance", 0, 8, 8, unit="u"), Channel("state", 0, 3, dtype=np.dtype("u1")),
           Channel("force", -5, 5, components=3)]
ACTUATORS = [Channel("height", 0, 4, 1), Channel("lamp", 0, 1000, 0, np.dtype("<u4"))]
_count = 0


def unique(what):
    global _count
    _count += 1
    return f"python-{what}-{os.getpid()}-{_count}"


def pair(what, **more):
    surface = Surface(unique(what), 5, 7, 0.01, SENSORS, ACTUATORS, **more)
    return surface, Controller(surface.description.name)
