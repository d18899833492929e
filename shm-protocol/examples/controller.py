"""A controller in Python: pins under an object go down, all others up."""
import sys

import numpy as np
import shm_protocol

name = sys.argv[1] if len(sys.argv) > 1 else "surface"
try:
    with shm_protocol.Controller(name, timeout=10) as table:
        while table.wait():
            hit = table.sensors["proximity_hit"]
            table.actuators["height"][:] = np.where(hit > 0, 0, 4)
            table.publish()
except shm_protocol.Error as error:
    sys.exit(error.report())
