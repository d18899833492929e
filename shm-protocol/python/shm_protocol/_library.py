"""Loads and declares the C library: the only module that uses ctypes and the header's structures."""
import ctypes as c
import os
import pathlib

_NAME = "libshm_protocol_c.so.1"


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
            yield from map(str, (folder / "build" / preset).glob(f"lib*/**/{_NAME}"))  # in the source tree
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
    handle, result, pointer, size = c.c_void_p, c.c_int, c.POINTER, c.c_size_t
    number, timeout, stop, array = c.c_uint32, c.c_int64, c.c_void_p, c.c_void_p

    def say(names, restype, *arguments):
        for name in names.split():
            function = getattr(lib, "ssp_" + name)
            function.restype, function.argtypes = restype, arguments

    say("text", c.c_char_p, result)
    say("last_error", c.c_char_p)
    say("last_error_pid", number)
    say("state_text", c.c_char_p, number)
    say("list", result, pointer(SegmentInfo), size, pointer(size))
    say("clean", result, c.c_char_p, pointer(SegmentInfo), size, pointer(size))
    say("surface_create", result, pointer(SurfaceConfig), pointer(handle))
    say("controller_attach observer_attach", result, c.c_char_p, timeout, stop, pointer(handle))
    say("surface_close controller_close surface_destroy controller_destroy observer_destroy", None, handle)
    say("surface_describe controller_describe observer_describe", result, handle, pointer(Description))
    say("surface_channel controller_channel observer_channel", result, handle, c.c_int, pointer(ChannelInfo))
    say("surface_counters controller_counters observer_counters", result, handle, pointer(Counters), pointer(Counters))
    say("surface_frame controller_frame", result, handle, pointer(FrameInfo))
    say("observer_frame", result, handle, number, pointer(FrameInfo))
    say("surface_sensor surface_actuator controller_sensor controller_actuator observer_array",
        array, handle, c.c_int, pointer(size))
    say("surface_write controller_write", result, handle, c.c_int, size, array, size)
    say("surface_next controller_next", array, handle, c.c_int, timeout, stop, pointer(size))
    say("surface_publish", result, handle, c.c_uint64, c.c_double, number)
    say("controller_publish surface_latest controller_latest controller_surface_status surface_miss_deadline", result, handle)
    say("observer_latest surface_set_state controller_set_state", result, handle, number)
    say("surface_await", result, handle, c.c_uint64, timeout, stop)
    say("controller_await surface_await_controller", result, handle, timeout, stop)
    say("observer_await", result, handle, number, timeout, stop)
    say("surface_controller_pid surface_controller_state controller_surface_state observer_surface_state "
        "observer_controller_state observer_controller_pid", number, handle)
    return lib


lib = _declare(_load())
