"""NumPy arrays over the mapped memory: without copies, with the right lifetimes and flags."""
import collections.abc
import ctypes

import numpy as np

DTYPES = {1: np.dtype("<f4"), 2: np.dtype("<u4"), 3: np.dtype("u1")}


class Handle:
    """A handle of the C library. Every array keeps it, and with it the mapping, alive: memory is unmapped
    only when the endpoint and the last array are gone, so no array can dangle."""

    def __init__(self, pointer, free):
        self.pointer, self._free = pointer, free

    def __del__(self):
        if self.pointer:
            self._free(self.pointer)
            self.pointer = None


def array_at(handle, address, nbytes, dtype, shape, writable):
    memory = (ctypes.c_ubyte * nbytes).from_address(address)
    memory.owner = handle
    buffer = memory if writable else memoryview(memory).toreadonly()  # cannot be made writable again
    return np.frombuffer(buffer, dtype=dtype).reshape(shape)


class Arrays(collections.abc.Mapping):
    """The current arrays of one direction by channel name. Shape: (rows, columns), or
    (components, rows, columns) for channels of several components."""

    def __init__(self, handle, channels, rows, columns, address_of, writable):
        self._handle, self._address_of, self._writable = handle, address_of, writable
        self._channels = {c.name: c for c in channels}
        self._rows, self._columns = rows, columns
        self._made = {}  # (name, address) → array; the ring reuses a few slots
        self._current = []

    def __getitem__(self, name):
        channel = self._channels.get(name)
        if channel is None:
            raise KeyError(f"there is no channel {name!r} here, only {', '.join(self._channels)}")
        address = self._address_of(self._handle.pointer, channel.number, None)
        if not address:
            raise ValueError(f"{name}: no frame was taken yet")
        array = self._made.get((name, address))
        if array is None:
            shape = (self._rows, self._columns)
            if channel.components > 1:
                shape = (channel.components, *shape)
            nbytes = int(np.prod(shape)) * channel.dtype.itemsize
            array = array_at(self._handle, address, nbytes, channel.dtype, shape, self._writable)
            self._made[name, address] = array
        if self._writable and not array.flags.writeable:
            array.flags.writeable = True
        if self._writable:
            self._current.append(array)
        return array

    def __setitem__(self, name, values):
        """Writes a whole array: arrays["height"] = values means arrays["height"][:] = values."""
        self[name][...] = values

    def __iter__(self):
        return iter(self._channels)

    def __len__(self):
        return len(self._channels)

    def freeze(self):
        """Makes the arrays handed out read-only: after publication they belong to the peer."""
        for array in self._current:
            array.flags.writeable = False
        self._current.clear()

    def close(self):
        """No array can be written any more, whether fetched before or after."""
        self.freeze()
        self._writable = False

    def copies(self):
        return {name: self[name].copy() for name in self}
