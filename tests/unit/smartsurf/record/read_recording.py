"""Reads a recording with h5py alone and prints the values that RecorderTest.cpp compares."""
import sys

import h5py
import numpy as np

with h5py.File(sys.argv[1], "r") as f:
    print(f["meta"].attrs["command_line"])
    print(int(f["meta"].attrs["seed"]), f["meta"].attrs["experiment"].splitlines()[1])
    print(dict(f["meta/options"].attrs))
    print(f["time"].shape, f["tick"].dtype, f["hash"].dtype, int(f["hash"][3]))
    print(f["objects/position"].shape, f["objects/position"].dtype, float(f["objects/position"][3, 1, 0]))
    print(f["objects/orientation"][2, 0].tolist())
    w = f["objects/angular_velocity"]
    print(w.shape, w.dtype, w[4, 1].tolist())
    print([s.decode() for s in f["objects/label"][:]], f["objects/shape"].asstr()[:].tolist())
    print(f["objects/radius"][:].tolist(), round(f["objects/mass"][0], 6))
    print(f["sensors/proximity"].shape, f["sensors/proximity"].compression, f["sensors/proximity"].shuffle)
    print(f["sensors/proximity"][5].tolist())
    print(int(f["surface"].attrs["rows"]), float(f["surface"].attrs["border"]), np.asarray(f["surface"].attrs["top"]).tolist())
