"""Loads and declares the C library: the only module that uses ctypes and the header's structures."""
import ctypes as c
import os
import pathlib

_NAME = "libshm_protocol_c.so.1"
MAX_CHANNELS = 32


def _candidates():
    """Candidate paths of the library, the caller's choice first."""
    if os.environ.get("SHM_PROTOCOL_LIBRARY"):
        yield os.environ["SHM_PROTOCOL_LIBRARY"]
        return
    here = pathlib.Path(__file__).resolve()
    for folder in here.parents:
        yield str(folder / _NAME)  # installed: lib/python3/dist-packages/shm_protocol …
        if folder.name == "lib":
            yield from map(str, folder.glob(f"*/{_NAME}"))  # … beside lib/x86_64-linux-gnu
        for preset in ("release", "ci", "debug"):
            yield str(folder / "build" / preset / "shm-protocol" / _NAME)  # in the source tree
    yield _NAME  # the loader's search path


def _load():
    tried = []
    chosen = os.environ.get("SHM_PROTOCOL_LIBRARY")
    if chosen and "/" in chosen and not os.path.exists(chosen):
        raise ImportError(f"SHM_PROTOCOL_LIBRARY names {chosen}, which does not exist")
    for path in _candidates():
        if "/" in path and not os.path.exists(path):
            continue
        try:
            return c.CDLL(path)
        except OSError as e:
            tried.append(str(e))
    raise ImportError(f"{_NAME} was not found: build it (cmake --build build/release --target shm_protocol_c) or "
                      f"name it in SHM_PROTOCOL_LIBRARY. {' '.join(tried)}")


class ChannelSpec(c.Structure):
    _fields_ = [("name", c.c_char_p), ("unit", c.c_char_p), ("direction", c.c_uint32), ("dtype", c.c_uint32),
                ("components", c.c_uint32), ("reserved0", c.c_uint32), ("minimum", c.c_double),
                ("maximum", c.c_double), ("safe", c.c_double), ("reserved", c.c_uint64 * 4)]


class SurfaceConfig(c.Structure):
    _fields_ = [("name", c.c_char_p), ("rows", c.c_uint32), ("columns", c.c_uint32), ("pitch", c.c_double),
                ("period_ns", c.c_uint64), ("mode", c.c_uint32), ("slots", c.c_uint32),
                ("channels", c.POINTER(ChannelSpec)), ("channel_count", c.c_uint32),
                ("safe_when_alone", c.c_uint32), ("positions", c.POINTER(c.c_float)), ("reserved", c.c_uint64 * 8)]


class Description(c.Structure):
    _fields_ = [("name", c.c_char * 64), ("version_major", c.c_uint32), ("version_minor", c.c_uint32),
                ("session", c.c_uint64), ("layout_hash", c.c_uint64), ("rows", c.c_uint32),
                ("columns", c.c_uint32), ("pitch", c.c_double), ("period_ns", c.c_uint64), ("mode", c.c_uint32),
                ("channel_count", c.c_uint32), ("surface_pid", c.c_uint32), ("reserved0", c.c_uint32),
                ("positions", c.POINTER(c.c_float)), ("reserved", c.c_uint64 * 8)]


class ChannelInfo(c.Structure):
    _fields_ = [("name", c.c_char * 32), ("unit", c.c_char * 16), ("direction", c.c_uint32), ("dtype", c.c_uint32),
                ("components", c.c_uint32), ("reserved0", c.c_uint32), ("minimum", c.c_double),
                ("maximum", c.c_double), ("safe", c.c_double), ("bytes", c.c_uint64), ("reserved", c.c_uint64 * 4)]


class FrameInfo(c.Structure):
    _fields_ = [("frame", c.c_uint64), ("tick", c.c_uint64), ("time_s", c.c_double), ("answers", c.c_uint64),
                ("status", c.c_uint32), ("reserved0", c.c_uint32), ("reserved", c.c_uint64 * 5)]


class Counters(c.Structure):
    _fields_ = [("skipped", c.c_uint64), ("repeated", c.c_uint64), ("clamped", c.c_uint64),
                ("deadline_misses", c.c_uint64), ("reserved", c.c_uint64 * 4)]


class SegmentInfo(c.Structure):
    _fields_ = [("name", c.c_char * 128), ("bytes", c.c_uint64), ("ownership", c.c_uint32),
                ("version_major", c.c_uint32), ("version_minor", c.c_uint32), ("surface_pid", c.c_uint32),
                ("controller_pid", c.c_uint32), ("reserved0", c.c_uint32), ("reserved", c.c_uint64 * 4)]


def _declare(lib):
    handle, result, pointer = c.c_void_p, c.c_int, c.POINTER

    def say(name, restype, *arguments):
        function = getattr(lib, name)
        function.restype, function.argtypes = restype, arguments

    say("ssp_text", c.c_char_p, result)
    say("ssp_last_error", c.c_char_p)
    say("ssp_last_error_pid", c.c_uint32)
    say("ssp_state_text", c.c_char_p, c.c_uint32)
    say("ssp_list", result, pointer(SegmentInfo), c.c_size_t, pointer(c.c_size_t))
    say("ssp_clean", result, c.c_char_p, pointer(SegmentInfo), c.c_size_t, pointer(c.c_size_t))
    for role in ("surface", "controller", "observer"):
        say(f"ssp_{role}_describe", result, handle, pointer(Description))
        say(f"ssp_{role}_channel", result, handle, c.c_int, pointer(ChannelInfo))
        say(f"ssp_{role}_counters", result, handle, pointer(Counters), pointer(Counters))
    for role in ("surface", "controller"):
        say(f"ssp_{role}_write", result, handle, c.c_int, c.c_size_t, c.c_void_p, c.c_size_t)
        say(f"ssp_{role}_next", c.c_void_p, handle, c.c_int, c.c_int64, c.c_void_p, pointer(c.c_size_t))
    say("ssp_surface_create", result, pointer(SurfaceConfig), pointer(handle))
    say("ssp_surface_close", None, handle)
    say("ssp_surface_destroy", None, handle)
    say("ssp_surface_sensor", c.c_void_p, handle, c.c_int, pointer(c.c_size_t))
    say("ssp_surface_actuator", c.c_void_p, handle, c.c_int, pointer(c.c_size_t))
    say("ssp_surface_publish", result, handle, c.c_uint64, c.c_double, c.c_uint32)
    say("ssp_surface_await", result, handle, c.c_uint64, c.c_int64, c.c_void_p)
    say("ssp_surface_latest", result, handle)
    say("ssp_surface_await_controller", result, handle, c.c_int64, c.c_void_p)
    say("ssp_surface_frame", result, handle, pointer(FrameInfo))
    say("ssp_surface_set_state", result, handle, c.c_uint32)
    say("ssp_surface_miss_deadline", result, handle)
    say("ssp_surface_controller_pid", c.c_uint32, handle)
    say("ssp_surface_controller_state", c.c_uint32, handle)
    for role, ending in (("controller", "attach"), ("observer", "open")):
        say(f"ssp_{role}_{ending}", result, c.c_char_p, c.c_int64, c.c_void_p, pointer(handle))
        say(f"ssp_{role}_surface_state", c.c_uint32, handle)
    say("ssp_controller_leave", None, handle)
    say("ssp_controller_detach", None, handle)
    say("ssp_controller_await", result, handle, c.c_int64, c.c_void_p)
    say("ssp_controller_latest", result, handle)
    say("ssp_controller_sensor", c.c_void_p, handle, c.c_int, pointer(c.c_size_t))
    say("ssp_controller_actuator", c.c_void_p, handle, c.c_int, pointer(c.c_size_t))
    say("ssp_controller_frame", result, handle, pointer(FrameInfo))
    say("ssp_controller_publish", result, handle)
    say("ssp_controller_set_state", result, handle, c.c_uint32)
    say("ssp_observer_close", None, handle)
    say("ssp_observer_latest", result, handle, c.c_uint32)
    say("ssp_observer_await", result, handle, c.c_uint32, c.c_int64, c.c_void_p)
    say("ssp_observer_array", c.c_void_p, handle, c.c_int, pointer(c.c_size_t))
    say("ssp_observer_frame", result, handle, c.c_uint32, pointer(FrameInfo))
    say("ssp_observer_controller_state", c.c_uint32, handle)
    say("ssp_observer_controller_pid", c.c_uint32, handle)
    return lib


lib = _declare(_load())
