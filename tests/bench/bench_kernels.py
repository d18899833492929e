#!/usr/bin/env python3
"""Kernels of image processing and automata: APRON beside NumPy, OpenCV, Numba, JAX, Halide and plain C++, on one thread.

  bench_kernels.py [--json] [--cases sobel,life,…] [--sizes 64,1024] [--seconds S]

Every peer is called from Python as its users call it: compiled before the first measurement, results written in place
where it can; JAX's are new arrays, awaited. The figure is processor time, the least of several spells. Results are compared
with NumPy's, or with OpenCV's where NumPy has none. Needs the package apron; the peers are those of
build/arrays (scripts/setup --arrays) that are there, and the loops of bench_kernels.cpp, which c++ compiles first.
"""
import argparse
import ctypes
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS", "HL_NUM_THREADS"):
    os.environ[name] = "1"
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
os.environ["JAX_PLATFORMS"] = "cpu"

import numpy as np  # noqa: E402

import apron  # noqa: E402

STEPS = 8            # of the automata
THRESHOLD = 20       # of FAST-9
CIRCLE = ((0, -3), (1, -3), (2, -2), (3, -1), (3, 0), (3, 1), (2, 2), (1, 3), (0, 3), (-1, 3), (-2, 2), (-3, 1), (-3, 0), (-3, -1),
          (-2, -2), (-1, -3))  # columns, rows
FEED, KILL, SPREAD_U, SPREAD_V = (np.float32(value) for value in (0.035, 0.065, 0.16, 0.08))
CHANNELS, SEEN, HIDDEN = 16, 48, 32  # of the neural automaton


def data(n):
    """What the kernels read: a grey picture as floats and bytes, blobs, cells of Life, and two chemicals."""
    draw = np.random.default_rng(40)
    rough = draw.random((n // 4, n // 4), np.float32).repeat(4, 0).repeat(4, 1)
    grey = np.float32(0.8) * rough + np.float32(0.2) * draw.random((n, n), np.float32)
    u, v = np.ones((n, n), np.float32), np.zeros((n, n), np.float32)
    u[n // 4:n // 2, n // 4:n // 2], v[n // 4:n // 2, n // 4:n // 2] = 0.5, 0.25
    return {"grey": grey, "bytes": (grey * 255).astype(np.uint8), "blobs": (rough > 0.4).astype(np.uint8),
            "cells": (draw.random((n, n)) < 0.4).astype(np.uint8), "u": u, "v": v,
            "kernel": draw.random((11, 11), np.float32) / 60, **seed_and_mask(rough), "state": draw.random((CHANNELS, n, n), np.float32),
            "inner": draw.normal(0, 0.1, (HIDDEN, SEEN)).astype(np.float32), "outer": draw.normal(0, 0.1, (CHANNELS, HIDDEN)).astype(np.float32)}


def seed_and_mask(rough):
    """A winding region, in which a flood from one cell covers most of the mask."""
    mask = (rough > 0.35).astype(np.uint8)
    y, x = np.argwhere(mask)[np.abs(np.argwhere(mask) - len(mask) / 2).sum(1).argmin()]
    seed = np.zeros_like(mask)
    seed[y, x] = 1
    return {"seed": seed, "mask": mask}


# --- a function a peer: given the data, {case: function without arguments that returns the result} -------------------------

def with_apron(of):
    shape = of["grey"].shape

    def job(text, out, **arguments):
        function = apron.compile(text, results=list(out), shape=shape)
        given = {}
        for name, array in arguments.items():
            given[name] = apron.empty(shape, array.dtype)
            given[name][...] = array
        return lambda: function(**given, out=out)[next(iter(out))]

    def plane(dtype=np.float32):
        return apron.empty(shape, dtype)
    elements = "".join(f"filter.setElement('k', {x}, {y}, {of['kernel'][y, x]:.9g})\n" for y in range(11) for x in range(11))
    gray_scott = f"""!register(U, V, F, G, L, M, R)
boundary('wrap')
F = U + 0
G = V + 0
repeat({STEPS})
  L = near.sum(F, 4) - 4 * F
  M = near.sum(G, 4) - 4 * G
  R = F * G * G
  F = F + ({SPREAD_U} * L - R + {FEED} * (1 - F))
  G = G + ({SPREAD_V} * M + R - {FEED + KILL} * G)
endrepeat
"""
    life = f"""!uint8(A, B, N)
boundary('wrap')
B = A
repeat({STEPS})
  N = near.sum(B, 8)
  B = (N == 3) | (N == 2) & B
endrepeat
"""
    state = {f"s[{k}]": plane() for k in range(CHANNELS)}
    automaton = """!register(s[16], p[48], h[32], change[16], alive)
!scalar(inner[1536], outer[512])
filter.create('slope.x', 3, 3)
filter.fill3x3('slope.x', -1 / 8, 0, 1 / 8, -2 / 8, 0, 2 / 8, -1 / 8, 0, 1 / 8)
filter.create('slope.y', 3, 3)
filter.fill3x3('slope.y', -1 / 8, -2 / 8, -1 / 8, 0, 0, 0, 1 / 8, 2 / 8, 1 / 8)
""" + "".join(f"{name}[{k}] = {weight:.9g}\n" for name in ("inner", "outer") for k, weight in enumerate(of[name].ravel())) + """
alive = max(s[3], near.max(s[3], 8)) > 0.1
!for(c, 0, 15)
  p[3 * c] = s[c]
  p[3 * c + 1] = filter.do(s[c], 'slope.x')
  p[3 * c + 2] = filter.do(s[c], 'slope.y')
!endfor
matrix.product(h, p, inner)
!for(k, 0, 31)
  h[k] = max(h[k], 0)
!endfor
matrix.product(change, h, outer)
!for(c, 0, 15)
  s[c] = select(alive, clamp(s[c] + change[c], -1, 1), 0)
!endfor
"""
    return {"flood": job("!uint8(S, M, B)\nB = flood(S, M)\n", {"B": plane(np.uint8)}, S=of["seed"], M=of["mask"]),
            "automaton": job(automaton, state, **dict(zip(state, of["state"]))),
            "sobel": job("!include('filters.aps')\n!register(A, B)\nB = sobel(A)\n", {"B": plane()}, A=of["grey"]),
            "filter11": job(f"!register(A, B)\nfilter.create('k', 11, 11)\n{elements}B = filter.do(A, 'k')\n", {"B": plane()}, A=of["grey"]),
            "fast9": job(f"!include('integers.aps')\n!uint8(A, B)\nB = fast9(A, {THRESHOLD})\n", {"B": plane(np.uint8)}, A=of["bytes"]),
            "histogram": job("!uint8(A)\n!create('H', REGISTER, 256, 1, int32)\nr[H] = histogram(A)\n", {"H": apron.empty((1, 256), np.int32)},
                             A=of["bytes"]),
            "labels": job("!include('morphology.aps')\n!uint8(A)\n!int32(B)\nB = label.int32(A)\n", {"B": plane(np.int32)}, A=of["blobs"]),
            "gray-scott": job(gray_scott, {"F": plane(), "G": plane()}, U=of["u"], V=of["v"]),
            "life": job(life, {"B": plane(np.uint8)}, A=of["cells"])}


def with_numpy(of):
    n = len(of["grey"])
    padded, bordered = np.zeros((n + 2, n + 2), np.float32), np.zeros((n + 10, n + 10), np.float32)
    slope = [np.empty((n, n), np.float32) for _ in range(2)]
    out, product = np.empty((n, n), np.float32), np.empty((n, n), np.float32)

    def sobel():
        padded[1:-1, 1:-1] = of["grey"]
        at = [[padded[y:y + n, x:x + n] for x in range(3)] for y in range(3)]
        for y, (a, b) in zip(slope, (((at[0][2], at[1][2], at[2][2]), (at[0][0], at[1][0], at[2][0])),
                                     ((at[2][0], at[2][1], at[2][2]), (at[0][0], at[0][1], at[0][2])))):
            np.subtract(a[1], b[1], out=y)
            np.multiply(y, 2, out=y)
            np.add(y, a[0], out=y)
            np.add(y, a[2], out=y)
            np.subtract(y, b[0], out=y)
            np.subtract(y, b[2], out=y)
            np.multiply(y, y, out=y)
        np.add(*slope, out=out)
        return np.sqrt(out, out=out)

    def filter11():
        bordered[5:-5, 5:-5] = of["grey"]
        out.fill(0)
        for y in range(11):
            for x in range(11):
                np.multiply(bordered[y:y + n, x:x + n], of["kernel"][y, x], out=product)
                np.add(out, product, out=out)
        return out

    def fast9():
        wide = np.zeros((n + 6, n + 6), np.int16)
        wide[3:-3, 3:-3] = of["bytes"]
        centre = wide[3:-3, 3:-3]
        result = np.zeros((n, n), bool)
        around = [wide[3 + y:3 + y + n, 3 + x:3 + x + n] for x, y in CIRCLE]
        for beyond in ([a > centre + THRESHOLD for a in around], [a < centre - THRESHOLD for a in around]):
            length = np.zeros((n, n), np.uint8)
            for k in range(24):  # the longest arc crosses the first cell at most once
                length = (length + 1) * beyond[k % 16]
                result |= length >= 9
        return result.view(np.uint8)

    def gray_scott():
        u, v = of["u"].copy(), of["v"].copy()
        for _ in range(STEPS):
            around = [np.pad(c, 1, mode="wrap") for c in (u, v)]
            lu, lv = (a[:-2, 1:-1] + a[2:, 1:-1] + a[1:-1, :-2] + a[1:-1, 2:] - 4 * a[1:-1, 1:-1] for a in around)
            reaction = u * v * v
            u += SPREAD_U * lu - reaction + FEED * (1 - u)
            v += SPREAD_V * lv + reaction - (FEED + KILL) * v
        return u

    def life():
        a = of["cells"]
        for _ in range(STEPS):
            w = np.pad(a, 1, mode="wrap")
            rows = w[:-2] + w[1:-1] + w[2:]
            around = rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:] - a
            a = ((around == 3) | (around == 2) & (a == 1)).view(np.uint8)
        return a

    seen, around = np.empty((SEEN, n, n), np.float32), np.zeros((CHANNELS, n + 2, n + 2), np.float32)

    def automaton():
        around[:, 1:-1, 1:-1] = state = of["state"]
        at = [[around[:, y:y + n, x:x + n] for x in range(3)] for y in range(3)]
        seen[0::3] = state
        seen[1::3] = ((at[0][2] - at[0][0]) + 2 * (at[1][2] - at[1][0]) + (at[2][2] - at[2][0])) / 8
        seen[2::3] = ((at[2][0] - at[0][0]) + 2 * (at[2][1] - at[0][1]) + (at[2][2] - at[0][2])) / 8
        alive = np.max([at[y][x][3] for y in range(3) for x in range(3)], 0) > np.float32(0.1)
        hidden = np.maximum(of["inner"] @ seen.reshape(SEEN, n * n), 0)
        change = (of["outer"] @ hidden).reshape(CHANNELS, n, n)
        return np.where(alive, np.clip(state + change, -1, 1), 0)[0]
    return {"sobel": sobel, "filter11": filter11, "fast9": fast9, "histogram": lambda: np.bincount(of["bytes"].ravel(), minlength=256),
            "gray-scott": gray_scott, "life": life, "automaton": automaton}


def with_opencv(of):
    import cv2
    cv2.setNumThreads(1)
    zero, wrap = cv2.BORDER_CONSTANT, cv2.BORDER_WRAP
    x, y, out, float_out = (np.empty_like(of["grey"]) for _ in range(4))
    labels = np.empty(of["grey"].shape, np.int32)
    detector = cv2.FastFeatureDetector_create(THRESHOLD, False, cv2.FAST_FEATURE_DETECTOR_TYPE_9_16)
    table = np.array([3 == k or k in (11, 12) for k in range(256)], np.uint8)  # 9 cells, the centre counted 9 times
    nine = np.array([[1, 1, 1], [1, 9, 1], [1, 1, 1]], np.float32)

    def sobel():
        cv2.Sobel(of["grey"], -1, 1, 0, x, borderType=zero)
        cv2.Sobel(of["grey"], -1, 0, 1, y, borderType=zero)
        return cv2.magnitude(x, y, out)

    def life():
        a = of["cells"]
        for _ in range(STEPS):
            n = len(a)
            wide = cv2.copyMakeBorder(a, 1, 1, 1, 1, wrap)
            a = cv2.LUT(np.ascontiguousarray(cv2.filter2D(wide, -1, nine)[1:n + 1, 1:n + 1]), table)
        return a
    filled, (y_seed, x_seed) = np.empty_like(of["mask"]), (int(k) for k in np.argwhere(of["seed"])[0])

    def flood():
        np.copyto(filled, of["mask"])
        cv2.floodFill(filled, None, (x_seed, y_seed), 2, 0, 0, 4)
        return filled
    return {"flood": flood, "sobel": sobel, "filter11": lambda: cv2.filter2D(of["grey"], -1, of["kernel"], float_out, borderType=zero),
            "fast9": lambda: detector.detect(of["bytes"]),
            "histogram": lambda: cv2.calcHist([of["bytes"]], [0], None, [256], [0, 256]),
            "labels": lambda: cv2.connectedComponents(of["blobs"], labels, 4)[1], "life": life}


def with_numba(of):
    import numba
    jit = numba.njit(fastmath=False, cache=False)
    n = len(of["grey"])
    out, labels = np.empty((n, n), np.float32), np.empty((n, n), np.int32)
    binary, bins = np.empty((n, n), np.uint8), np.empty(256, np.int32)
    kernel, columns, rows = of["kernel"], np.array([c for c, _ in CIRCLE]), np.array([r for _, r in CIRCLE])
    padded, bordered = np.zeros((n + 2, n + 2), np.float32), np.zeros((n + 10, n + 10), np.float32)
    parents, waiting, at_seed = np.empty(n * n // 2 + 2, np.int32), np.empty(n * n, np.int32), np.argwhere(of["seed"])[0]

    @jit
    def sobel(a, p, y):
        p[1:-1, 1:-1] = a
        for r in range(n):
            for c in range(n):
                east = (p[r, c + 2] - p[r, c]) + 2 * (p[r + 1, c + 2] - p[r + 1, c]) + (p[r + 2, c + 2] - p[r + 2, c])
                south = (p[r + 2, c] - p[r, c]) + 2 * (p[r + 2, c + 1] - p[r, c + 1]) + (p[r + 2, c + 2] - p[r, c + 2])
                y[r, c] = np.sqrt(east * east + south * south)
        return y

    @jit
    def filter11(a, p, k, y):
        p[5:-5, 5:-5] = a
        for r in range(n):
            y[r, :] = 0
            for j in range(11):
                for i in range(11):
                    element, row = k[j, i], p[r + j]
                    for c in range(n):
                        y[r, c] += element * row[c + i]
        return y

    @jit
    def has_arc(bits):
        bits |= bits << 16
        bits &= bits >> 1
        bits &= bits >> 2
        bits &= bits >> 4
        return bits & (bits >> 1) & 0xFFFF != 0  # 8 and one more

    @jit
    def fast9(a, y):
        y[:, :] = 0
        for r in range(3, n - 3):
            for c in range(3, n - 3):
                high, low = np.int32(a[r, c]) + THRESHOLD, np.int32(a[r, c]) - THRESHOLD
                north, south = np.int32(a[r - 3, c]), np.int32(a[r + 3, c])
                if low <= north <= high and low <= south <= high:
                    continue
                brighter = darker = np.int64(0)
                for k in range(16):
                    value = np.int32(a[r + rows[k], c + columns[k]])
                    brighter |= np.int64(value > high) << k
                    darker |= np.int64(value < low) << k
                y[r, c] = has_arc(brighter) or has_arc(darker)
        return y

    @jit
    def histogram(a, y):
        y[:] = 0
        for value in a.ravel():
            y[value] += 1
        return y

    @jit
    def root(of, k):
        while of[k] != k:
            of[k] = of[of[k]]
            k = of[k]
        return k

    @jit
    def label(a, of, y):
        of[0], count = 0, 1
        for r in range(n):
            for c in range(n):
                if a[r, c] == 0:
                    y[r, c] = 0
                    continue
                north, west = y[r - 1, c] if r > 0 else 0, y[r, c - 1] if c > 0 else 0
                if north == 0 and west == 0:
                    of[count], y[r, c] = count, count
                    count += 1
                elif north == 0 or west == 0 or north == west:
                    y[r, c] = max(north, west)
                else:
                    p, q = root(of, north), root(of, west)
                    of[max(p, q)] = min(p, q)
                    y[r, c] = min(p, q)
        for k in range(1, count):
            of[k] = of[of[k]]
        for r in range(n):
            for c in range(n):
                y[r, c] = of[y[r, c]]
        return y

    @jit
    def flood(m, r, c, stack, y):
        y[:, :] = 0
        y[r, c], stack[0], last = 1, r * n + c, 1
        while last > 0:
            last -= 1
            r, c = stack[last] // n, stack[last] % n
            for i, j in ((r - 1, c), (r + 1, c), (r, c - 1), (r, c + 1)):
                if 0 <= i < n and 0 <= j < n and m[i, j] and not y[i, j]:
                    y[i, j], stack[last] = 1, i * n + j
                    last += 1
        return y

    @jit
    def wrapped(a, p):
        p[1:-1, 1:-1] = a
        p[0, 1:-1], p[-1, 1:-1] = a[-1], a[0]
        p[:, 0], p[:, -1] = p[:, -2], p[:, 1]

    @jit
    def gray_scott(u, v, p, q):
        for _ in range(STEPS):
            wrapped(u, p)
            wrapped(v, q)
            for r in range(n):
                for c in range(n):
                    a, b = p[r + 1, c + 1], q[r + 1, c + 1]
                    reaction = a * b * b
                    u[r, c] = a + (SPREAD_U * (p[r, c + 1] + p[r + 2, c + 1] + p[r + 1, c] + p[r + 1, c + 2] - np.float32(4) * a) - reaction +
                                   FEED * (np.float32(1) - a))
                    v[r, c] = b + (SPREAD_V * (q[r, c + 1] + q[r + 2, c + 1] + q[r + 1, c] + q[r + 1, c + 2] - np.float32(4) * b) + reaction -
                                   (FEED + KILL) * b)
        return u

    @jit
    def life(a, p):
        for _ in range(STEPS):
            wrapped(a, p)
            for r in range(n):
                for c in range(n):
                    around = np.uint8(p[r, c] + p[r, c + 1] + p[r, c + 2] + p[r + 1, c] + p[r + 1, c + 2] + p[r + 2, c] + p[r + 2, c + 1] + p[r + 2, c + 2])
                    a[r, c] = (around == 3) | ((around == 2) & (p[r + 1, c + 1] == 1))
        return a
    u, v, cells = of["u"].copy(), of["v"].copy(), of["cells"].copy()
    p, q, w = (np.empty((n + 2, n + 2), kind) for kind in (np.float32, np.float32, np.uint8))

    def from_start(function, pairs, *arguments):
        for to, start in pairs:
            np.copyto(to, start)
        return function(*arguments)
    return {"sobel": lambda: sobel(of["grey"], padded, out), "filter11": lambda: filter11(of["grey"], bordered, kernel, out),
            "fast9": lambda: fast9(of["bytes"], binary), "histogram": lambda: histogram(of["bytes"], bins),
            "labels": lambda: label(of["blobs"], parents, labels), "flood": lambda: flood(of["mask"], *at_seed, waiting, binary),
            "gray-scott": lambda: from_start(gray_scott, ((u, of["u"]), (v, of["v"])), u, v, p, q),
            "life": lambda: from_start(life, ((cells, of["cells"]),), cells, w)}


def with_jax(of):
    import jax
    import jax.numpy as jnp
    n = len(of["grey"])

    def padded(a, width, mode="constant"):
        return jnp.pad(a, width, mode=mode)

    @jax.jit
    def sobel(a):
        p = padded(a, 1)
        at = [[p[y:y + n, x:x + n] for x in range(3)] for y in range(3)]
        east = (at[0][2] - at[0][0]) + 2 * (at[1][2] - at[1][0]) + (at[2][2] - at[2][0])
        south = (at[2][0] - at[0][0]) + 2 * (at[2][1] - at[0][1]) + (at[2][2] - at[0][2])
        return jnp.sqrt(east * east + south * south)

    @jax.jit
    def filter11(a, k):
        return jax.lax.conv_general_dilated(a[None, None], k[None, None], (1, 1), "SAME")[0, 0]

    @jax.jit
    def fast9(a):
        p, c = padded(a.astype(jnp.int16), 3), a.astype(jnp.int16)
        around = [p[3 + y:3 + y + n, 3 + x:3 + x + n] for x, y in CIRCLE]

        def has_arc(beyond):
            m = sum(b.astype(jnp.uint16) << k for k, b in enumerate(beyond))
            for k in (1, 2, 4):
                m = m & (m << k | m >> (16 - k))
            return m & (m << 1 | m >> 15)
        return ((has_arc([b > c + THRESHOLD for b in around]) | has_arc([b < c - THRESHOLD for b in around])) != 0).astype(jnp.uint8)

    @jax.jit
    def gray_scott(u, v):
        def step(_, planes):
            u, v = planes
            lu, lv = (jnp.roll(a, 1, 0) + jnp.roll(a, -1, 0) + jnp.roll(a, 1, 1) + jnp.roll(a, -1, 1) - 4 * a for a in (u, v))
            reaction = u * v * v
            return u + (SPREAD_U * lu - reaction + FEED * (1 - u)), v + (SPREAD_V * lv + reaction - (FEED + KILL) * v)
        return jax.lax.fori_loop(0, STEPS, step, (u, v))[0]

    @jax.jit
    def life(a):
        def step(_, a):
            rows = jnp.roll(a, 1, 0) + a + jnp.roll(a, -1, 0)
            around = jnp.roll(rows, 1, 1) + rows + jnp.roll(rows, -1, 1) - a
            return ((around == 3) | (around == 2) & (a == 1)).astype(jnp.uint8)
        return jax.lax.fori_loop(0, STEPS, step, a)
    @jax.jit
    def automaton(state, inner, outer):
        around = jnp.pad(state, ((0, 0), (1, 1), (1, 1)))
        at = [[around[:, y:y + n, x:x + n] for x in range(3)] for y in range(3)]
        east = ((at[0][2] - at[0][0]) + 2 * (at[1][2] - at[1][0]) + (at[2][2] - at[2][0])) / 8
        south = ((at[2][0] - at[0][0]) + 2 * (at[2][1] - at[0][1]) + (at[2][2] - at[0][2])) / 8
        seen = jnp.stack([state, east, south], 1).reshape(SEEN, n * n)
        alive = jnp.stack([at[y][x][3] for y in range(3) for x in range(3)]).max(0) > 0.1
        change = (outer @ jnp.maximum(inner @ seen, 0)).reshape(CHANNELS, n, n)
        return jnp.where(alive, jnp.clip(state + change, -1, 1), 0)
    histogram = jax.jit(lambda a: jnp.bincount(a.ravel(), length=256))
    on = {name: jnp.asarray(array) for name, array in of.items()}
    return {"sobel": lambda: sobel(on["grey"]).block_until_ready(), "filter11": lambda: filter11(on["grey"], on["kernel"]).block_until_ready(),
            "fast9": lambda: fast9(on["bytes"]).block_until_ready(), "histogram": lambda: histogram(on["bytes"]).block_until_ready(),
            "gray-scott": lambda: gray_scott(on["u"], on["v"]).block_until_ready(), "life": lambda: life(on["cells"]).block_until_ready(),
            "automaton": lambda: automaton(on["state"], on["inner"], on["outer"]).block_until_ready()}


def with_halide(of):
    import halide as hl
    n = len(of["grey"])
    x, y = hl.vars("x y")
    float_out, cells_out = np.empty((n, n), np.float32), np.empty((n, n), np.uint8)

    def job(function, out):
        buffer = hl.Buffer(out)
        function.compile_jit()

        def run():
            function.realize(buffer)
            return out
        return run

    def padded(array):
        return hl.BoundaryConditions.constant_exterior(hl.Buffer(array), 0)

    def in_strips(function, *stages):
        """Strips of 32 rows and vectors of 16 cells; stages before it are computed for each strip."""
        yo, yi = hl.vars("yo yi")
        function.split(y, yo, yi, 32, hl.TailStrategy.GuardWithIf).vectorize(x, 16, hl.TailStrategy.GuardWithIf)
        for stage in stages:
            stage.compute_at(function, yo).vectorize(x, 16)
        return function
    grey = padded(of["grey"])
    at = hl.Func("at")
    at[x, y] = grey[x, y]
    east, south, sobel = (hl.Func(name) for name in ("east", "south", "sobel"))
    east[x, y] = sum(weight * (at[x + 1, y + d] - at[x - 1, y + d]) for d, weight in ((-1, 1.0), (0, 2.0), (1, 1.0)))
    south[x, y] = sum(weight * (at[x + d, y + 1] - at[x + d, y - 1]) for d, weight in ((-1, 1.0), (0, 2.0), (1, 1.0)))
    sobel[x, y] = hl.sqrt(east[x, y] * east[x, y] + south[x, y] * south[x, y])
    around, filter11 = hl.Func("around"), hl.Func("filter11")
    around[x, y] = grey[x, y]
    kernel, over = hl.Buffer(of["kernel"]), hl.RDom([(0, 11), (0, 11)])
    filter11[x, y] = 0.0
    filter11[x, y] += kernel[over.x, over.y] * around[x + over.x - 5, y + over.y - 5]
    blocks = hl.Func("blocks")
    blocks[x, y] = filter11[x, y]
    yo, xo, yi, xi = hl.vars("yo xo yi xi")
    blocks.tile(x, y, xo, yo, xi, yi, 32, 4).vectorize(xi, 16).unroll(xi).unroll(yi)
    filter11.compute_at(blocks, xo).vectorize(x, 16).unroll(x).unroll(y)
    filter11.update().reorder(x, y, over.x, over.y).vectorize(x, 16).unroll(x).unroll(y)
    around.compute_at(blocks, yo).vectorize(x, 16)

    near, fast9 = hl.Func("near"), hl.Func("fast9")
    near[x, y] = hl.u16(padded(of["bytes"])[x, y])

    def has_arc(beyond):
        m = hl.u16(0)
        for k, (column, row) in enumerate(CIRCLE):
            m |= hl.u16(beyond(near[x + column, y + row])) << hl.u16(k)
        for k in (1, 2, 4):
            m &= m << hl.u16(k) | m >> hl.u16(16 - k)
        return m & (m << hl.u16(1) | m >> hl.u16(15))
    high, low = near[x, y] + hl.u16(THRESHOLD), hl.max(near[x, y], hl.u16(THRESHOLD)) - hl.u16(THRESHOLD)
    fast9[x, y] = hl.u8((has_arc(lambda a: a > high) | has_arc(lambda a: a < low)) != hl.u16(0))

    histogram, pixels, counts = hl.Func("histogram"), hl.RDom([(0, n), (0, n)]), np.empty(256, np.int32)
    histogram[x] = 0
    histogram[hl.i32(hl.Buffer(of["bytes"])[pixels.x, pixels.y])] += 1

    def wrapped(before):
        """The cells of a stage and those beyond its edges, which are computed first."""
        everywhere = hl.Func("everywhere")
        everywhere[x, y] = hl.BoundaryConditions.repeat_image(before, [(0, n), (0, n)])[x, y]
        everywhere.compute_root().vectorize(x, 16)
        return everywhere

    def root(name, value, lanes):
        stage = hl.Func(name)
        stage[x, y] = value
        stage.compute_root().vectorize(x, lanes, hl.TailStrategy.GuardWithIf)
        return stage
    life, u, v = (root(name, hl.Buffer(of[array])[x, y], 16) for name, array in (("life", "cells"), ("u", "u"), ("v", "v")))
    for _ in range(STEPS):
        a, b, c = wrapped(life), wrapped(u), wrapped(v)
        total = sum((a[x + i, y + j] for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j), hl.u8(0))
        life = root("life", hl.u8((total == hl.u8(3)) | ((total == hl.u8(2)) & (a[x, y] == hl.u8(1)))), 64)
        lu, lv = (p[x, y - 1] + p[x, y + 1] + p[x - 1, y] + p[x + 1, y] - 4.0 * p[x, y] for p in (b, c))
        reaction = b[x, y] * c[x, y] * c[x, y]
        v = root("v", c[x, y] + (float(SPREAD_V) * lv + reaction - float(FEED + KILL) * c[x, y]), 16)
        u = root("u", b[x, y] + (float(SPREAD_U) * lu - reaction + float(FEED) * (1.0 - b[x, y])), 16)
    return {"sobel": job(in_strips(sobel, at), float_out), "filter11": job(blocks, float_out), "fast9": job(in_strips(fast9, near), cells_out),
            "histogram": job(histogram, counts), "gray-scott": job(u, float_out), "life": job(life, cells_out)}


CPP_FLAGS = ("-std=c++20", "-O3", "-march=native", "-fno-math-errno")


def compiled_loops():
    """bench_kernels.cpp as a library."""
    with tempfile.TemporaryDirectory(prefix="bench-kernels-") as folder:
        library = f"{folder}/kernels.so"
        try:
            subprocess.run(["c++", *CPP_FLAGS, "-shared", "-fPIC", "-o", library, pathlib.Path(__file__).with_suffix(".cpp")], check=True)
        except (OSError, subprocess.CalledProcessError) as error:
            raise ImportError(error) from None
        return ctypes.CDLL(library)


def with_cpp(of):
    loops, n = compiled_loops(), len(of["grey"])

    def job(name, *arguments, out, start=()):
        """Calls the function of n and the arguments after it has copied the pairs of `start`."""
        function = getattr(loops, name)
        function.restype = None
        kinds = {np.ndarray: lambda array: ctypes.c_void_p(array.ctypes.data), np.float32: ctypes.c_float, int: ctypes.c_int}
        converted = [ctypes.c_int(n), *(kinds[type(one)](one) for one in arguments)]

        def run(kept=arguments):  # the memory at the addresses
            for to, first in start:
                np.copyto(to, first)
            function(*converted)
            return out
        return run
    out, padded, state = np.empty((n, n), np.float32), np.zeros((n + 10, n + 42), np.float32), np.empty((CHANNELS, n, n), np.float32)
    binary, bins, numbers = np.empty((n, n), np.uint8), np.empty(256, np.int32), np.empty((n, n), np.int32)
    parents, waiting = np.empty(n * n // 2 + 2, np.int32), np.empty(n * n, np.int32)
    (u, p), (v, q), (cells, other) = ((np.empty_like(of[name]), np.empty_like(of[name])) for name in ("u", "v", "cells"))
    return {"sobel": job("sobel", of["grey"], out, out=out), "filter11": job("filter11", of["grey"], of["kernel"], padded, out, out=out),
            "fast9": job("fast9", THRESHOLD, of["bytes"], binary, out=binary), "histogram": job("histogram", of["bytes"], bins, out=bins),
            "labels": job("labels", of["blobs"], parents, numbers, out=numbers),
            "flood": job("flood", of["mask"], *(int(k) for k in np.argwhere(of["seed"])[0]), waiting, binary, out=binary),
            "gray-scott": job("gray_scott", STEPS, FEED, KILL, SPREAD_U, SPREAD_V, u, v, p, q, out=u, start=((u, of["u"]), (v, of["v"]))),
            "life": job("life", STEPS, cells, other, out=cells, start=((cells, of["cells"]),)),
            "automaton": job("automaton", of["state"], of["inner"], of["outer"], state, out=state)}


PEERS = {"apron": with_apron, "numpy": with_numpy, "opencv": with_opencv, "numba": with_numba, "jax": with_jax, "halide": with_halide, "c++": with_cpp}
CASES = ("sobel", "filter11", "fast9", "histogram", "labels", "flood", "gray-scott", "life", "automaton")


# --- comparing and measuring -----------------------------------------------------------------------------------------------

def comparable(case, result, n):
    """An array that does not depend on the way in which a peer states its result."""
    if case == "fast9":
        if isinstance(result, tuple):  # key points
            corners = np.zeros((n, n), np.uint8)
            for point in result:
                corners[int(point.pt[1]), int(point.pt[0])] = 1
            result = corners
        return np.asarray(result)[3:-3, 3:-3]
    if case == "labels":  # numbered by the first cell of each object
        _, first, number = np.unique(result, return_index=True, return_inverse=True)
        return np.where(np.asarray(result) == 0, -1, first[number].reshape(n, n))
    if case == "flood":
        return np.asarray(result) == np.max(result)  # 1, or 2 where the mask is filled
    if case == "automaton" and np.ndim(result) > 2:
        return np.asarray(result)[0]
    return np.asarray(result).ravel() if case == "histogram" else np.asarray(result)


def microseconds(job, seconds):
    """The least mean of five spells."""
    job()
    start = time.process_time()
    job()
    count = max(1, int(seconds / 5 / max(time.process_time() - start, 1e-7)))
    least = np.inf
    for _ in range(5):
        start = time.process_time()
        for _ in range(count):
            job()
        least = min(least, 1e6 * (time.process_time() - start) / count)
    return least


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="one object a line")
    parser.add_argument("--cases", default=",".join(CASES), metavar="CASE,…", help=f"of {', '.join(CASES)}")
    parser.add_argument("--sizes", default="64,1024", metavar="N,…", help="rows and columns [64,1024]; multiples of 4, 16 or more")
    parser.add_argument("--seconds", type=float, default=0.5, metavar="S", help="processor time of each figure [0.5]")
    how = parser.parse_args()
    cases = how.cases.split(",")
    if unknown := set(cases) - set(CASES):
        parser.error(f"--cases {min(unknown)}: there are {', '.join(CASES)}")
    try:
        sizes = [int(size) for size in how.sizes.split(",")]
    except ValueError:
        sizes = [0]
    if any(n < 16 or n % 4 for n in sizes):
        parser.error(f"--sizes {how.sizes}: must be multiples of 4, 16 or more")
    for n in sizes:
        jobs, of = {}, data(n)
        for who, make in PEERS.items():
            try:
                jobs[who] = make(of)
            except ImportError as error:
                remedy = "scripts/setup installs g++" if who == "c++" else "scripts/setup --arrays installs it"
                print(f"bench_kernels: {who} is left out ({error}); {remedy}", file=sys.stderr)
        for case in cases:
            taking = {who: job[case] for who, job in jobs.items() if case in job}
            results = {who: comparable(case, job(), n).copy() for who, job in taking.items()}
            reference = results["numpy" if "numpy" in results else next(iter(results))].astype(np.float64)
            ours = None
            for who, job in taking.items():
                agrees = bool(np.allclose(results[who], reference, rtol=1e-4, atol=1e-4))
                us = microseconds(job, how.seconds)
                ours = us if who == "apron" else ours
                if how.json:
                    print(json.dumps({"benchmark": "kernels", "case": f"{case} {n}", "who": who, "least_us": us, "agrees": agrees}), flush=True)
                else:
                    print(f"{case:11}{n:5} {who:7}{us:11.1f} µs{us / ours:8.2f} of apron's" + ("" if agrees else "   RESULTS DIFFER"), flush=True)


if __name__ == "__main__":
    main()
