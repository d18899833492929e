"""NumPy's counterparts of the mathematical functions on float32, one thread: numpy_mathematics_peer.py FUNCTION SIZE REPETITIONS
prints the least microseconds of processor time."""
import sys
import time

import numpy

workload, n, repetitions = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
a, b = (numpy.random.uniform(0.1, 1, (n, n)).astype(numpy.float32) for _ in range(2))
c = numpy.empty_like(a)
JOBS = {"exp": numpy.exp, "ln": numpy.log, "pow": numpy.power, "sin": numpy.sin, "cos": numpy.cos, "tan": numpy.tan,
        "tanh": numpy.tanh, "atan2": numpy.arctan2, "sqrt": numpy.sqrt}
function = JOBS[workload]
arguments = (a, b) if workload in ("pow", "atan2") else (a,)
function(*arguments, out=c)
least = 1e300
for _ in range(repetitions):
    start = time.thread_time()
    function(*arguments, out=c)
    least = min(least, time.thread_time() - start)
print(least * 1e6)
