"""NumPy peer. numpy_peer.py WORKLOAD SIZE prints the minimum and median time in microseconds and the checksum."""
import sys
import time

import numpy as np

f = np.float32


def hash32(x):
    x = x ^ (x >> np.uint64(16))
    x = (x * np.uint64(0x7FEB352D)) & np.uint64(0xFFFFFFFF)
    x = x ^ (x >> np.uint64(15))
    x = (x * np.uint64(0x846CA68B)) & np.uint64(0xFFFFFFFF)
    return x ^ (x >> np.uint64(16))


def at(r, c, a, b, k):
    u = np.uint64
    return hash32((r.astype(u) * u(a) + c.astype(u) * u(b) + u(k)) & u(0xFFFFFFFF))


def grid(n):
    return np.arange(n)[:, None], np.arange(n)[None, :]


def uniform(n, which):
    r, c = grid(n)
    h = at(r, c, 9781, 6271 * 17, which * 7919 * 131) >> np.uint64(8)
    return f(0.1) + f(0.9) * h.astype(f) * f(1 / 16777216)


def soup(n):
    r, c = grid(n)
    return ((at(r, c, 4001, 77, 99) & np.uint64(7)) < 3).astype(f)


def blob(n):
    y, x = grid(n)
    image = np.zeros((n, n), f)
    for i in (-1, 0, 1):
        for j in (-1, 0, 1):
            r, c = y // 32 + i, x // 32 + j
            h = at((r & 0xFFFFFFFF), (c & 0xFFFFFFFF), 131, 7777, 5).astype(np.int64)
            dy, dx = y - (r * 32 + 8 + (h & 15)), x - (c * 32 + 8 + ((h >> 4) & 15))
            image[dy * dy + dx * dx < (4 + ((h >> 8) & 7)) ** 2] = 1
    return image


def padded(a):
    return np.pad(a, 1)


I = (slice(1, -1), slice(1, -1))
N = (slice(0, -2), slice(1, -1))
S = (slice(2, None), slice(1, -1))
E = (slice(1, -1), slice(2, None))
W = (slice(1, -1), slice(0, -2))


def nine(op, a, h, o):
    op(a[:, 2:], a[:, :-2], out=h[:, 1:-1])
    op(h[:, 1:-1], a[:, 1:-1], out=h[:, 1:-1])
    op(h[:-2, 1:-1], h[2:, 1:-1], out=o[I])
    op(o[I], h[I], out=o[I])


def addition(n):
    r = [uniform(n, 0), uniform(n, 1), np.empty((n, n), f)]
    return lambda: np.add(r[0], r[1], out=r[2]), lambda: r[2:]


def chain(n):
    r = [uniform(n, 0), uniform(n, 1), np.empty((n, n), f), np.empty((n, n), f)]
    on = np.empty((n, n), bool)

    def run():
        np.add(r[0], r[1], out=r[2])
        np.multiply(r[2], f(0.5), out=r[3])
        np.greater(r[3], r[0], out=on)
        np.copyto(r[1], r[3], where=on)
        np.maximum(r[0], r[1], out=r[2])
        np.minimum(r[0], r[1], out=r[0])
        np.subtract(r[2], r[0], out=r[3])
        np.multiply(r[2], r[3], out=r[2])

    return run, lambda: r


def morphology(n):
    a = padded(blob(n))
    h, e, o = (np.zeros_like(a) for _ in range(3))

    def run():
        nine(np.minimum, a, h, e)
        nine(np.maximum, e, h, o)

    return run, lambda: [o[I]]


def life(n):
    a = padded(soup(n))
    h, s = np.zeros_like(a), np.zeros_like(a)
    o = np.empty((n, n), f)

    def run():
        nine(np.add, a, h, s)
        np.copyto(o, (s[I] == 3) | ((s[I] == 4) & (a[I] != 0)))

    return run, lambda: [o]


def diffusion(n):
    a = padded(uniform(n, 0))
    b = [np.zeros_like(a), np.zeros_like(a)]
    t, u = np.empty((n, n), f), np.empty((n, n), f)

    def run():
        x = a
        for i in range(16):
            y = b[i & 1]
            np.add(x[N], x[S], out=t)
            np.add(x[E], x[W], out=u)
            np.add(t, u, out=t)
            np.multiply(t, f(0.2), out=t)
            np.multiply(x[I], f(0.2), out=u)
            np.add(t, u, out=y[I])
            x = y

    return run, lambda: [b[1][I]]


def case_study(n):
    a = padded(blob(n))
    h, e, d, m, c, o = (np.zeros_like(a) for _ in range(6))
    t, u = np.empty((n, n), f), np.empty((n, n), f)

    def run():
        nine(np.minimum, a, h, e)
        on = e[I] != 0
        d[I] = e[I]
        for _ in range(8):
            np.minimum(d[N], d[S], out=t)
            np.minimum(d[E], d[W], out=u)
            np.minimum(t, u, out=t)
            np.add(t, f(1), out=t)
            np.copyto(d[I], t, where=on)
        m[I] = d[I]
        for _ in range(16):
            np.maximum(m[N], m[S], out=t)
            np.maximum(m[E], m[W], out=u)
            np.maximum(t, u, out=t)
            np.maximum(t, m[I], out=t)
            np.copyto(m[I], t, where=on)
        np.multiply(d[I] >= m[I], e[I], out=c[I])
        nine(np.maximum, c, h, o)
        np.multiply(o[I] != 0, m[I], out=o[I])

    return run, lambda: [o[I]]


def checksum(arrays):
    r, c = grid(arrays[0].shape[0])
    return sum(float((a.astype(np.float64) * (1 + (r * 7 + c * 3) % 11 * 0.1)).sum()) for a in arrays)


def main():
    workload, n = int(sys.argv[1]), int(sys.argv[2])
    run, results = {1: addition, 2: chain, 3: morphology, 4: life, 5: diffusion, 6: case_study}[workload](n)
    run()
    total = checksum(results())
    start = time.perf_counter()
    run()
    once = time.perf_counter() - start
    count = max(1, int(0.02 / once))
    times = []
    for _ in range(7 if once < 0.3 else 3):
        start = time.perf_counter()
        for _ in range(count):
            run()
        times.append((time.perf_counter() - start) / count * 1e6)
    times.sort()
    print(times[0], times[len(times) // 2], repr(total))


main()
