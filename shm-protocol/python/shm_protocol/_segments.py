"""The segments in /dev/shm."""
import ctypes
import dataclasses

from . import _library as _c
from ._endpoint import check, text
from ._values import c_text

_lib = _c.lib
_OWNERSHIP = ("living", "orphan", "foreign")


@dataclasses.dataclass(frozen=True)
class Segment:
    name: str
    bytes: int
    ownership: str  # "living", "orphan", "foreign"
    version: tuple
    surface_pid: int
    controller_pid: int


def _segments(call):
    capacity, count = 1024, ctypes.c_size_t()
    found = (_c.SegmentInfo * capacity)()
    check(call(found, capacity, ctypes.byref(count)))
    return [Segment(text(s.name), s.bytes, _OWNERSHIP[s.ownership], (s.version_major, s.version_minor), s.surface_pid,
                    s.controller_pid) for s in found[:min(capacity, count.value)]]


def list_surfaces():
    """All segments in /dev/shm, by name."""
    return _segments(_lib.ssp_list)


def clean(prefix=""):
    """Removes the segments of dead surfaces and returns their names."""
    return _segments(lambda *to: _lib.ssp_clean(c_text("prefix", prefix), *to))
