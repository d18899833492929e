"""OpenCV's counterparts of filters/*.aps on one thread: opencv_peer.py WORKLOAD SIZE REPETITIONS prints the least
microseconds of processor time, or fails where OpenCV has none."""
import sys
import time

import cv2
import numpy

workload, n, repetitions = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
cv2.setNumThreads(1)
a, b = numpy.random.rand(n, n).astype(numpy.float32), numpy.empty((n, n), numpy.float32)
zero = cv2.BORDER_CONSTANT


def filtered(side):
    kernel = numpy.random.rand(side, side).astype(numpy.float32)
    return lambda: cv2.filter2D(a, -1, kernel, b, borderType=zero)


JOBS = {"filter3": filtered(3), "filter5": filtered(5), "filter7": filtered(7), "filter11": filtered(11),
        "gauss": lambda: cv2.GaussianBlur(a, (7, 7), 1.0, b, borderType=zero),
        "sobel": lambda: cv2.magnitude(cv2.Sobel(a, -1, 1, 0, borderType=zero), cv2.Sobel(a, -1, 0, 1, borderType=zero), b),
        "uniform": lambda: cv2.randu(b, 0, 1), "normal": lambda: cv2.randn(b, 0, 1)}
job = JOBS[workload]
job()
least = 1e300
for _ in range(repetitions):
    start = time.thread_time()
    job()
    least = min(least, time.thread_time() - start)
print(least * 1e6)
