"""The cases of scripts/truth on MuJoCo's newest wheel, set up as its users would.

  mujoco_peer.py SCRIPT RATE SECONDS SEED SETTINGS     prints the metrics of tests/truth/SCRIPT.lua as JSON
  mujoco_peer.py --version                             prints MuJoCo's version and the scripts that are here

Newton's solver, elliptic cones; implicitfast integration, RK4 where there is no floor. Level cells are a plane; where single cells matter they are
boxes. Contacts are as stiff as the step allows: a time constant of two steps, or, where a case needs restitution, a
spring that swings for eight steps with the damping that gives the coefficient of restitution.
"""
import json
import math
import sys

import mujoco
import numpy

import overlap

G = 9.81


def damping_ratio(e):
    """Of a contact that pushes but does not pull, for a coefficient of restitution."""
    def restitution(z):
        w = math.sqrt(1 - z * z)
        phase = math.atan2(2 * z * w, 2 * z * z - 1)
        return math.exp(-z * phase / w) * -(math.cos(phase) - z / w * math.sin(phase))
    low, high = 0.0, 0.999
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if restitution(middle) > e else (low, middle)
    return low


def contact_of(e, dt):
    """Attributes of a geom."""
    if e <= 0:
        return f'solref="{2 * dt} 1"'
    spring = (math.pi / (8 * dt))**2
    return f'solref="{-spring} {-2 * damping_ratio(e) * math.sqrt(spring)}" solimp="0.9999 0.9999 0.001"'


def body(kind, size, position, mass=None, turn=(0, 1, 0, 0), velocity=(0, 0, 0), spin=(0, 0, 0), mu=None):
    """A free body; `turn` is an angle and an axis, `spin` is in world axes, full edges and heights as in Lua."""
    return dict(kind=kind, size=size, position=position, mass=mass, turn=turn, velocity=velocity, spin=spin, mu=mu)


def geom_of(b, i):
    if b["kind"] == "sphere":
        shape = f'type="sphere" size="{b["size"]}"'
    elif b["kind"] == "box":
        shape = 'type="box" size="' + " ".join(str(v / 2) for v in b["size"]) + '"'
    else:
        shape = f'type="{b["kind"]}" size="{b["size"][0]} {b["size"][1] / 2}"'
    mass = f'mass="{b["mass"]}"' if b["mass"] else 'density="1"'
    friction = f'friction="{b["mu"]} 0 0"' if b["mu"] else ""
    if "raised" in b:
        x, y, z = b["size"] if b["kind"] == "box" else (b["size"][0] * 3**0.5, b["size"][0] * 3**0.5, b["size"][1])
        volume = x * y * z if b["kind"] == "box" else math.pi * b["size"][0]**2 * z
        inertia = " ".join(str(volume / 12 * v) for v in (y * y + z * z, x * x + z * z, x * x + y * y))
        return (f'<inertial pos="0 0 0" mass="{volume}" diaginertia="{inertia}"/>'
                f'<geom name="body{i}" {shape} pos="0 0 {b["raised"]}" {friction}/>')
    return f'<geom name="body{i}" {shape} {mass} {friction}/>'


class Sim:
    def __init__(self, s, bodies, gravity=(0, 0, -G), mu=0.5, e=0.0, lever=0.0, floor=True, world="", belt=None):
        self.dt, self.seconds = 1 / s["rate"], s["seconds"]
        belt = f'surfacevel="{belt[0]} {belt[1]} 0 0 0 0"' if belt else ""
        plane = f'<geom name="floor" type="plane" size="200 200 1" {belt}/>' if floor else ""
        # A pair has a second law for friction: an elastic contact would have undamped, that is no, friction.
        pairs = "".join(f'<pair geom1="floor" geom2="body{i}" condim="3" friction="{mu} {mu} 0 0 0" {contact_of(e, self.dt)} '
                        f'solreffriction="{2 * self.dt} 1"/>' for i in range(len(bodies))) if floor and e and mu else ""
        text = "".join(
            f'<body pos="{" ".join(map(str, b["position"]))}" axisangle="{" ".join(map(str, b["turn"][1:]))} {b["turn"][0]}">'
            f"<freejoint/>{geom_of(b, i)}</body>" for i, b in enumerate(bodies))
        friction = f'friction="{mu} 0 {lever}" condim="{6 if lever else 3 if mu else 1}"'
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{self.dt!r}" gravity="{" ".join(map(str, gravity))}" cone="elliptic" impratio="10" '
            f'integrator="{"implicitfast" if floor or world else "RK4"}" iterations="100" tolerance="1e-10"/><compiler angle="radian"/>'
            f"<default><geom {friction} {contact_of(e, self.dt)}/></default><contact>{pairs}</contact>"
            f"<worldbody>{plane}{world}{text}</worldbody></mujoco>")
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self.first = self.model.nbody - len(bodies)
        for i, b in enumerate(bodies):
            at = 6 * i
            self.data.qvel[at:at + 3] = b["velocity"]
            self.data.qvel[at + 3:at + 6] = self.axes(i).T @ numpy.array(b["spin"], float)
        mujoco.mj_forward(self.model, self.data)

    def position(self, i=0):
        return self.data.xpos[self.first + i].copy()

    def velocity(self, i=0):
        return self.data.qvel[6 * i:6 * i + 3].copy()

    def axes(self, i=0):
        return self.data.xmat[self.first + i].reshape(3, 3).copy()

    def body_spin(self, i=0):
        return self.data.qvel[6 * i + 3:6 * i + 6].copy()

    def spin(self, i=0):
        return self.axes(i) @ self.body_spin(i)

    def run(self, sample=None, seconds=None, before_step=None):
        """Calls sample(t) with every state, the first and the last included."""
        steps = round((seconds or self.seconds) / self.dt)
        for k in range(steps):
            if sample:
                sample(k * self.dt)
            if before_step:
                before_step()
            mujoco.mj_step(self.model, self.data)
            # The positions that the sample reads are those of the state.
            mujoco.mj_kinematics(self.model, self.data)
        if sample:
            sample(steps * self.dt)
        return self

    def loads(self):
        """The normal force on each geom of the world, by its id."""
        mujoco.mj_forward(self.model, self.data)
        loads, force = numpy.zeros(self.model.ngeom), numpy.zeros(6)
        for k in range(self.data.ncon):
            mujoco.mj_contactForce(self.model, self.data, k, force)
            for geom in self.data.contact[k].geom:
                if self.model.geom_bodyid[geom] == 0:
                    loads[geom] += force[0]
        return loads


def slope_gravity(angle):
    a = math.radians(angle)
    return (G * math.sin(a), 0, -G * math.cos(a))


def flight(s):
    sim = Sim(s, [body("sphere", 0.5, (1, 1, 60), velocity=(s["vx"], 0, s["vz"]))], floor=False).run()
    p = sim.position()
    return {"x": p[0] - 1, "z": p[2] - 60, "vz": sim.velocity()[2]}


def push(s):
    sim = Sim(s, [body("box", (1, 1, 1), (0, 0, 5), s["mass"]), body("box", (1, 1, 1), (0, 0, 10), s["mass"])],
              gravity=(0, 0, 0), floor=False)
    sim.data.xfrc_applied[1, 0] = s["force"]
    sim.data.xfrc_applied[2, 5] = s["force"]
    sim.run()
    return {"v": sim.velocity(0)[0], "x": sim.position(0)[0], "spin": sim.spin(1)[2]}


def tumble(s):
    sim = Sim(s, [body("box", (1, 2, 3), (0, 0, 50), spin=(s["wx"], s["wy"], 0))], gravity=(0, 0, 0), floor=False)
    moments = numpy.array([13, 10, 5]) / 2
    out = {"momentum": 0.0, "energy": 0.0, "flips": 0, "first_flip": 0.0}
    keep = {"before": s["wy"], "last": 0.0}

    def sample(t):
        w = sim.body_spin()
        momentum, energy = sim.axes() @ (moments * w), float(moments @ w**2) / 2
        keep.setdefault("first", (momentum, energy))
        l0, e0 = keep["first"]
        out["momentum"] = max(out["momentum"], float(numpy.linalg.norm(momentum - l0) / numpy.linalg.norm(l0)))
        out["energy"] = max(out["energy"], abs(energy / e0 - 1))
        if (keep["before"] < 0) != (w[1] < 0):
            at = t - sim.dt * w[1] / (w[1] - keep["before"])
            out["first_flip"] = out["first_flip"] or at
            out["flips"] += 1
            keep["last"] = at
        keep["before"] = w[1]

    sim.run(sample)
    out["between_flips"] = (keep["last"] - out["first_flip"]) / (out["flips"] - 1) if out["flips"] > 1 else 0.0
    return out


class Turning:
    """Sums the changes of an angle."""

    def __init__(self):
        self.angle, self.before = 0.0, None

    def add(self, now):
        if self.before is not None:
            self.angle += math.remainder(now - self.before, 2 * math.pi)
        self.before = now


def precession(s):
    sim = Sim(s, [body("cylinder", (1, 0.4), (0, 0, 50), spin=(s["across"], 0, s["along"]))], gravity=(0, 0, 0), floor=False)
    l = numpy.array([3.16 / 12 * s["across"], 0, 0.5 * s["along"]])
    ez = l / numpy.linalg.norm(l)
    ex, turning = numpy.array([ez[2], 0, -ez[0]]), Turning()

    def sample(t):
        axis = sim.axes()[:, 2]
        turning.add(math.atan2(axis[1], axis @ ex))

    sim.run(sample)
    return {"rate": turning.angle / s["seconds"]}


def slide(s):
    v, heading, unit = s["v"], math.radians(s.get("heading", 0)), s.get("unit", 1)
    sim = Sim(s, [body("box", (3 * unit, 3 * unit, unit), (0, 0, unit / 2),
                       velocity=(v * unit * math.cos(heading), v * unit * math.sin(heading), 0))], (0, 0, -G * unit), s["mu"])
    keep = {"stop": 0.0}

    def sample(t):
        if numpy.linalg.norm(sim.velocity()) > 0.01 * v * unit:
            keep["stop"] = t

    sim.run(sample)
    x, y = sim.position()[:2]
    return {"distance": math.hypot(x, y) / unit, "aside": (math.cos(heading) * y - math.sin(heading) * x) / unit,
            "stops": keep["stop"], "turned": math.degrees(abs(math.atan2(sim.axes()[1, 0], sim.axes()[0, 0])))}


def threshold(s):
    angle, offsets = s["angle"], [-0.5 + 0.05 * (i + 0.5) for i in range(20)]
    bodies = [body("box", (2, 2, 0.5), (14 * (i // 10), 6 * (i % 10), 0.25), mu=math.tan(math.radians(angle + o)))
              for i, o in enumerate(offsets)]
    # The greater of two frictions holds.
    sim = Sim(s, bodies, slope_gravity(angle), mu=0.001)
    sim.run(seconds=1)
    start = [sim.position(i)[0] for i in range(20)]
    sim.run(seconds=s["seconds"] - 1)
    moved = [sim.position(i)[0] - start[i] > 0.002 for i in range(20)]
    return {"angle": angle + max([-0.5] + [o + 0.025 for o, m in zip(offsets, moved) if m])}


def slope(s):
    sim = Sim(s, [body("box", (3, 3, 1), (0, 0, 0.5))], slope_gravity(s["angle"]), s["mu"]).run()
    return {"distance": sim.position()[0], "v": sim.velocity()[0]}


def roll(s):
    shape, r, lying, top = s["shape"], 1.5, (math.pi / 2, 1, 0, 0), s.get("top", 1) / 2
    b = body("sphere", r, (0, 0, r)) if shape == "sphere" else body(shape, (r, 4), (0, 0, r), turn=lying)
    cells = "".join(f'<geom type="box" size="{top} {top} 1" pos="{x} {y} -1"/>' for x in range(-3, 60) for y in (-1, 0, 1))
    gaps = dict(floor=False, world=cells) if top != 0.5 else {}
    sim, keep = Sim(s, [b], slope_gravity(s["angle"]), **gaps), {"highest": 0.0}

    def sample(t):
        keep["highest"] = max(keep["highest"], sim.position()[2])

    sim.run(sample)
    return {"distance": sim.position()[0], "slip": sim.velocity()[0] - r * sim.spin()[1], "hop": keep["highest"] - r}


def coast(s):
    r = 1.5
    sim = Sim(s, [body("sphere", r, (0, 0, r), velocity=(s["v"], 0, 0), spin=(0, s["v"] / r, 0))], lever=s["lever"]).run()
    return {"v": sim.velocity()[0], "x": sim.position()[0]}


def skid(s):
    v, spin = s["v"], s.get("spin", 0)
    sim = Sim(s, [body("sphere", 1, (0, 0, 1), velocity=(v, 0, 0), spin=(0, spin, 0))], mu=s["mu"])
    keep = {"slipped": 0.0}

    def sample(t):
        if abs(sim.velocity()[0] - sim.spin()[1]) > 0.01 * abs(v - spin):
            keep["slipped"] = t

    sim.run(sample)
    return {"v": sim.velocity()[0], "spin": sim.spin()[1], "slips": keep["slipped"]}


def topple(s):
    h, d, lean = s["h"], s["d"], math.radians(s["start"])
    at = (math.sin(lean) * h / 2 - math.cos(lean) * d / 2, 0, math.cos(lean) * h / 2 + math.sin(lean) * d / 2)
    sim = Sim(s, [body("box", (d, 3, h), at, turn=(lean, 0, 1, 0))], mu=1.0)
    keep = {"before": None, "spin": 0.0}

    def sample(t):
        up, w, before = sim.axes()[:, 2], sim.spin()[1], keep["before"]
        now = math.degrees(math.atan2(up[0], up[2]))
        if before and not keep["spin"] and before[0] < s["angle"] <= now:
            keep["spin"] = before[1] + (w - before[1]) * (s["angle"] - before[0]) / (now - before[0])
        keep["before"] = now, w

    sim.run(sample)
    return {"spin": keep["spin"]}


def dominoes(s):
    h, d, gap, n, first, last = s["h"], s["d"], s["gap"], 34, 21, 31
    bodies = []
    for i in range(n):
        lean = 0.0 if i else 0.3
        at = ((d + gap) * i + math.sin(lean) * h / 2 - math.cos(lean) * d / 2, 0, math.cos(lean) * h / 2 + math.sin(lean) * d / 2)
        bodies.append(body("box", (d, 3, h), at, turn=(lean, 0, 1, 0), mu=0.01))
    sim, passed, before = Sim(s, bodies, mu=1.0), {}, {}

    def sample(t):
        for i in (first, last):
            up = sim.axes(i)[:, 2]
            now = math.atan2(up[0], up[2])
            if i in before and i not in passed and now >= 0.1:
                passed[i] = t - sim.dt * (now - 0.1) / (now - before[i])
            before[i] = now

    sim.run(sample)
    return {"speed": (last - first) * (d + gap) / (passed[last] - passed[first]) if last in passed else 0.0}


def bounce(s):
    drop = [3 + 0.17 * i for i in range(1, 9)]
    sim = Sim(s, [body("sphere", 1, (4.3 * i, 0, 1 + h)) for i, h in enumerate(drop)], e=s["e"])
    apex, rises = [0.0] * 8, [False] * 8

    def sample(t):
        for i in range(8):
            rises[i] |= bool(sim.velocity(i)[2] > 0)
            apex[i] = max(apex[i], sim.position(i)[2] - 1) if rises[i] else 0.0

    sim.run(sample)
    ratios = [a / h for a, h in zip(apex, drop)]
    return {"ratio": sum(ratios) / 8, "worst": max(abs(r - s["e"]**2) for r in ratios)}


def bouncing(s):
    sim = Sim(s, [body("sphere", 1, (0, 0, 4))], e=1.0).run()
    v = sim.velocity()
    return {"energy": (v @ v / 2 + G * (sim.position()[2] - 1)) / (G * 3)}


def oblique(s):
    sim = Sim(s, [body("sphere", 1, (0, 0, 2.013), velocity=(s["vx"], 0, -s["vz"]), spin=(0, s["spin"], 0))], (0, 0, 0),
              s["mu"], s["e"]).run()
    return {"vx": sim.velocity()[0], "vz": sim.velocity()[2], "spin": sim.spin()[1]}


def collide(s):
    sim = Sim(s, [body("sphere", 0.5, (0, 0, 20), 1, velocity=(s["v"], 0, 0)),
                  body("sphere", 0.5, (2.013, s.get("offset", 0), 20), s.get("m", 1))], (0, 0, 0), 0, s.get("e", 1), floor=False).run()
    w = sim.velocity(1)
    return {"v1": sim.velocity(0)[0], "v2": w[0], "v2y": w[1], "speed2": float(numpy.linalg.norm(w))}


def cradle(s):
    bodies = [body("sphere", 0.5, (0, 0, 20), velocity=(s["v"], 0, 0))]
    bodies += [body("sphere", 0.5, (1.2 + i * (1 + s["gap"]), 0, 20)) for i in range(s["n"] - 1)]
    sim = Sim(s, bodies, (0, 0, 0), 0, s["e"], floor=False).run()
    speeds = [sim.velocity(i)[0] for i in range(s["n"])]
    return {"last": speeds[-1], "first": speeds[0], "momentum": sum(speeds) / s["v"]}


def offcentre(s):
    sim = Sim(s, [body("sphere", 0.5, (0, s["lever"], 20), 1, velocity=(s["v"], 0, 0)),
                  body("box", (1, 2.4, 1), (2.013, 0, 20), 2)], (0, 0, 0), 0, s["e"], floor=False).run()
    return {"v1": sim.velocity(0)[0], "v2": sim.velocity(1)[0], "spin": sim.spin(1)[2]}


def superball(s):
    sim = Sim(s, [body("sphere", 1, (0, 0, 2), 1), body("sphere", 0.5, (0, 0, 3.52), s["m"])], mu=0, e=s["e"])
    keep = {"after": 0.0}

    def sample(t):
        keep["after"] = max(keep["after"], sim.velocity(1)[2])

    sim.run(sample)
    return {"ratio": keep["after"] / math.sqrt(2 * G)}


def flat_drop(s):
    sim = Sim(s, [body("box", (3, 3, 1), (0, 0, 2.013), velocity=(0, 0, -s["v"]))], e=s["e"])
    keep = {"aside": 0.0, "spin": 0.0, "up": 0.0}

    def sample(t):
        u = sim.velocity()
        for name, value in (("aside", math.hypot(u[0], u[1])), ("spin", numpy.linalg.norm(sim.spin())), ("up", u[2])):
            keep[name] = max(keep[name], float(value))

    sim.run(sample)
    return keep


def rest_sphere(s):
    unit, r = s["unit"], 2.0 * s["unit"]
    sim = Sim(s, [body("sphere", r, (0, 0, r), 3)], (0, 0, -G * unit))
    keep, loads = {"deepest": 0.0}, []

    def sample(t):
        keep["deepest"] = max(keep["deepest"], r - sim.position()[2])
        if t > 1:
            loads.append(sim.loads().sum())

    sim.run(sample)
    return {"depth": keep["deepest"] / r, "load": sum(loads) / len(loads) / unit}


def cells_of(n, belts=lambda r, c: 0.0):
    """n × n boxes with tops of 0.8 at z = 0, row by row from the north; the middle is the origin."""
    text = ""
    for r in range(n):
        for c in range(n):
            x, y, v = c - (n - 1) / 2, (n - 1) / 2 - r, belts(r, c)
            belt = f'surfacevel="{v} 0 0 0 0 0"' if v else ""
            text += f'<geom type="box" size="0.4 0.4 1" pos="{x} {y} -1" {belt}/>'
    return text


def mean_loads(s, bodies, n, **how):
    sim, sums, ticks = Sim(s, bodies, floor=False, world=cells_of(n), **how), numpy.zeros(n * n), 0
    sim.run(seconds=1)
    # The mean of every fourth step of the second second.
    for _ in range(round((s["seconds"] - 1) / sim.dt / 4)):
        sim.run(seconds=4 * sim.dt)
        sums += sim.loads()[:n * n]
        ticks += 1
    return (sums / ticks).reshape(n, n)


def plate_loads(s):
    n, tilt, rider = s["n"], s["slope"], s["rider"]
    mass, gravity = n * n, slope_gravity(tilt)
    bodies = [body("box", (n, n, 1), (0, 0, 0.5), mass)] + ([body("box", (1, 1, 1), (1, 0, 1.5), rider)] if rider else [])
    loads = mean_loads(s, bodies, n, gravity=gravity, mu=0.8)
    gx, gz = gravity[0], -gravity[2]
    moment = mass * gx / 2 + rider * (gx * 1.5 + gz)
    x = numpy.arange(n) - (n - 1) / 2
    right = (mass + rider) * gz / (n * n) + moment * x[None, :] / (n * (x**2).sum())
    return {"load": loads.sum(), "worst": abs(loads - right).max() * n * n / ((mass + rider) * gz),
            "cells": float((loads > 0).sum())}


def spin_brake(s):
    n = s["n"]
    sim = Sim(s, [body("box", (n, n, 1), (0, 0, 0.5), spin=(0, 0, s["spin"]))], mu=s["mu"], floor=False, world=cells_of(n + 4))
    states = []
    sim.run(lambda t: states.append((t, sim.spin()[2])))
    chosen = [state for state in states if 0.0166 <= state[0] <= 0.0501]
    return {"slowing": (chosen[0][1] - chosen[-1][1]) / (chosen[-1][0] - chosen[0][0])}


def stack(s):
    n, ratio = s["n"], s["ratio"]
    sim = Sim(s, [body("box", (2, 2, 1), (0, 0, i + 0.5), ratio if i == n - 1 else 1) for i in range(n)])
    squares, loads = [], []

    def sample(t):
        if t >= 4:
            squares.extend(float(sim.velocity(i) @ sim.velocity(i)) for i in range(n))
            loads.append(sim.loads().sum())

    sim.run(sample)
    return {"height": sim.position(n - 1)[2] + 0.5, "drift": max(math.hypot(*sim.position(i)[:2]) for i in range(n)),
            "buzz": math.sqrt(sum(squares) / len(squares)), "load": sum(loads) / len(loads)}


def drive(s):
    r, a, b, turn = s["radius"], s["a"], s["b"], math.radians(s.get("angle", 0))
    if s["model"] == "ball":
        belt = (r * b, -r * a)
    elif s["model"] == "wheels":
        belt = (r * (a * math.cos(turn) - b * math.sin(turn)), r * (a * math.sin(turn) + b * math.cos(turn)))
    else:
        belt = (r * a, 0)
    sim, early = Sim(s, [body("box", (3, 3, 1), (0, 0, 0.5))], mu=s["mu"], belt=belt), {}

    def sample(t):
        if t <= 0.1 + 1e-9:
            early["gain"] = float(numpy.linalg.norm(sim.velocity())) / max(t, 1e-9)

    sim.run(sample)
    return {"gain": early["gain"], "vx": sim.velocity()[0], "vy": sim.velocity()[1], "z": sim.position()[2] - 0.5}


def driven_sphere(s):
    r = s["radius"]
    sim = Sim(s, [body("sphere", r, (0, 0, r))], belt=(s["v"], 0)).run()
    return {"v": sim.velocity()[0], "spin": sim.spin()[1]}


def pattern(s):
    drives = {"inner": lambda x, y: max(x, y) <= 2, "rim": lambda x, y: max(x, y) == 3}
    inside = lambda r, c: r % 2 == 1 if s["pattern"] == "half" else drives[s["pattern"]](abs(c - 6), abs(r - 6))
    sim = Sim(s, [body("box", (7, 7, 1), (0, 0, 0.5))], mu=s["mu"], floor=False,
              world=cells_of(13, lambda r, c: 5.0 if inside(r, c) else 0.0))
    states = {}

    def sample(t):
        for name, until in (("a", 0.1), ("b", 0.4)):
            if t <= until + 1e-9:
                states[name] = t, sim.velocity()[0]

    sim.run(sample)
    (ta, va), (tb, vb) = states["a"], states["b"]
    return {"gain": (vb - va) / (tb - ta), "v": sim.velocity()[0]}


def pins_of(pins, half=0.4):
    """Columns with square tops: x, y and height of each."""
    return "".join(f'<geom type="box" size="{half} {half} 0.5" pos="{x} {y} {z - 0.5}"/>' for x, y, z in pins)


def uneven(s):
    pins = [(4, 4, 1.3), (8, 4, 1.32), (6, 8, 1.35)]
    sim = Sim(s, [body("box", (5, 5, 1), (6, 6, 1.85), 25)], floor=False, world=pins_of(pins))
    # The box comes after a second.
    loads, keep, weight = [], {}, 25 * G

    def sample(t):
        if t >= 6:
            keep.setdefault("from", sim.position())
            loads.append(sim.loads()[:3])

    sim.run(sample, s["seconds"] - 1)
    up, middle = sim.axes()[:, 2], sim.position()
    x, y = ([p[k] + math.copysign(0.4, up[k]) - middle[k] for p in pins] for k in (0, 1))
    shares = numpy.linalg.solve(numpy.array([[1, 1, 1], x, y]), [weight, 0, 0])
    mean = numpy.mean(loads, axis=0)
    return {"load": mean.sum(), "worst": abs(mean - shares).max() / weight,
            "creep": numpy.linalg.norm(middle - keep["from"])}


def bed(s):
    random = numpy.random.default_rng(s["seed"])
    pins = [(x, y, 1 + random.uniform(-0.1, 0.1)) for x in range(12) for y in range(12)]
    sim = Sim(s, [body("box", (5, 5, 1), (5.5, 5.5, 1.7), 25)], floor=False, world=pins_of(pins))
    loads, keep = [], {}

    def sample(t):
        if t >= 9:
            keep.setdefault("from", sim.position())
        if t >= 19:
            loads.append(sim.loads().sum())

    sim.run(sample, s["seconds"] - 1)
    if not loads:
        return {}  # a shorter run has nothing to measure
    return {"load": sum(loads) / len(loads), "creep": numpy.linalg.norm(sim.position() - keep["from"])}


def chain(s):
    n, h = s["n"], s["h"]
    lying, standing = (0.5, 0, 0), (0, 0, 0.5)
    text = ""
    for i in range(n):
        at, half = ((50, 0, 50), (0.5, h / 2, h / 2)) if i == 0 else ((1, 0, 0) if i == 1 else (0, 0, 1), (h / 2, h / 2, 0.5))
        text += (f'<body pos="{at[0]} {at[1]} {at[2]}"><joint type="hinge" axis="0 1 0"/><geom type="box" mass="1" contype="0" '
                 f'conaffinity="0" size="{half[0]} {half[1]} {half[2]}" pos="{" ".join(map(str, lying if i == 0 else standing))}"/>')
    text += "</body>" * n
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{1 / s["rate"]!r}" gravity="0 0 {-G}" integrator="RK4"><flag energy="enable"/></option>'
        f"<worldbody>{text}</worldbody></mujoco>")
    data, worst, first = mujoco.MjData(model), 0.0, None
    for _ in range(round(s["seconds"] * s["rate"]) + 1):
        mujoco.mj_forward(model, data)
        first = data.energy.sum() if first is None else first
        worst = max(worst, abs(data.energy.sum() - first))
        mujoco.mj_step(model, data)
    # In the coordinates of the hinges nothing can leave the plane.
    return {"energy": worst / (n * G), "out": 0.0}


def top(s):
    """On a ball joint: what the closed form is about. MuJoCo has no cones."""
    tilt, spin, l = math.radians(s["tilt"]), s["spin"], 0.75
    i3, i1 = 0.3, 0.15 + 0.0375
    about_tip = i1 + l * l
    a, b = about_tip * math.cos(tilt), i3 * spin
    rate = (b - math.sqrt(b * b - 4 * a * G * l)) / (2 * a)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{1 / s["rate"]!r}" gravity="0 0 {-G}" integrator="RK4"/><compiler angle="radian"/><worldbody>'
        f'<body axisangle="0 1 0 {tilt}"><joint type="ball"/><inertial pos="0 0 {l}" mass="1" diaginertia="{i1} {i1} {i3}"/></body>'
        f"</worldbody></mujoco>")
    data, turning, least, greatest = mujoco.MjData(model), Turning(), 180.0, 0.0
    # In body axes: ω = rate·z + (spin − rate·cos(tilt))·axis.
    data.qvel[:] = (-rate * math.sin(tilt), 0, spin)
    for _ in range(round(s["seconds"] * s["rate"]) + 1):
        mujoco.mj_kinematics(model, data)
        axis = data.xmat[1].reshape(3, 3)[:, 2]
        degrees = math.degrees(math.acos(min(1, axis[2])))
        least, greatest = min(least, degrees), max(greatest, degrees)
        turning.add(math.atan2(axis[1], axis[0]))
        mujoco.mj_step(model, data)
    return {"least": least, "greatest": greatest, "rate": turning.angle / s["seconds"]}


def landing(s):
    sim, keep = Sim(s, [body("box", (2, 2, 2), (0, 0, 1)), body("box", (2, 2, 2), (0.1, 0, 7.5))]), {"tilt": 0.0, "spin": 0.0}

    def sample(t):
        keep["tilt"] = max(keep["tilt"], math.degrees(math.acos(min(1, sim.axes(1)[2, 2]))))
        keep["spin"] = max(keep["spin"], float(numpy.linalg.norm(sim.spin(1))))

    sim.run(sample)
    return keep


def towers(s):
    random, bodies, tops = numpy.random.default_rng(s["seed"]), [], []
    for k in range(9):
        height, side = 0.0, random.uniform(1.5, 3)
        for i in range(1, 13):
            bodies.append(body("box", (side, side, side), (16 * (k % 3) + random.uniform(-0.1, 0.1), 16 * (k // 3) + random.uniform(-0.1, 0.1),
                                                           height + 3 * i + side / 2)))
            height += side
        tops.append(height - side / 2)
    sim = Sim(s, bodies).run()
    return {"fallen": sum(sim.position(12 * k + 11)[2] < height - 0.5 for k, height in enumerate(tops))}


def seams(s):
    world = "".join(f'<geom type="box" size="1.25 2 0.5" pos="{1.25 + 2.5 * i} 1.5 5.5"/>' for i in range(12))
    speed, is_ball = s["speed"], s["body"] == "ball"
    rest = 6.4 if is_ball else 6.3
    b = (body("sphere", 0.4, (1, 1.5, rest), velocity=(speed, 0, 0), spin=(0, speed / 0.4, 0)) if is_ball else
         body("box", (1.3, 1, 0.6), (1, 1.5, rest), velocity=(speed, 0, 0)))
    sim, keep = Sim(s, [b], mu=0.2, floor=False, world=world), {"hop": 0.0}

    def sample(t):
        keep["hop"] = max(keep["hop"], sim.position()[2] - rest)

    sim.run(sample)
    p = sim.position()
    return {"v": sim.velocity()[0], "x": p[0] - 1, "y": p[1] - 1.5, "hop": keep["hop"],
            "turned": 0.0 if is_ball else math.degrees(math.acos(min(1, abs(sim.axes()[0, 0]))))}


def wall(s):
    speed, thickness = s["speed"], s["thickness"]
    balls = [body("sphere", 0.1, (5 + speed / 720 * i, 2 * i - 1, 20), velocity=(speed, 0, 0)) for i in range(1, 13)]
    sim = Sim(s, balls, (0, 0, 0), e=s.get("e", 0.0), floor=False,
              world=f'<geom type="box" size="{thickness / 2} 15 2" pos="10 12 20"/>').run()
    away = [-sim.velocity(i)[0] for i in range(12)]
    return {"passed": sum(sim.position(i)[0] > 10 for i in range(12)), "least": min(away), "greatest": max(away)}


def legs(s):
    at = [(x, y, 0.5) for x in (-2, 2) for y in (-2, 2)]
    sim = Sim(s, [body("box", (1, 1, 1), p, 1) for p in at] + [body("box", (6, 6, 1), (0, 0, 1.5), s["mass"])]).run()
    return {"load": sim.loads().sum(), "sink": 1.5 - sim.position(4)[2], "speed": numpy.linalg.norm(sim.velocity(4))}


def ratio(s):
    n, greatest = s.get("n", 5), s["ratio"]
    masses = [greatest**(i / (n - 1)) if s.get("growing") else greatest if i == n - 1 else 1 for i in range(n)]
    sim = Sim(s, [body("box", (2, 2, 1), (0, 0, i + 0.5), m) for i, m in enumerate(masses)])
    keep = {"speed": 0.0}

    def sample(t):
        if t >= 8:
            keep["speed"] = max(keep["speed"], *(float(numpy.linalg.norm(sim.velocity(i))) for i in range(n)))

    sim.run(sample)
    return {"sink": n - 0.5 - sim.position(n - 1)[2], "speed": keep["speed"]}


def heap(s):
    random = numpy.random.default_rng(s["seed"])
    # The pit is 12 u wide, with its middle at (5.5, 5.5).
    walls = "".join(f'<geom type="box" size="{1 if x else 8} {1 if y else 8} 3" pos="{5.5 + 7 * x} {5.5 + 7 * y} 3"/>'
                    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)))
    size = numpy.array([1.4, 1.2, 1])
    sim = Sim(s, [body("box", size, (2.4 + 1.8 * (k % 4) + random.uniform(0, 0.2), 2.4 + 1.8 * (k // 4 % 4), 1 + 1.7 * (k // 16)),
                       turn=(random.uniform(0, 3), 0, 0, 1)) for k in range(60)], world=walls).run()
    depths = [overlap.box_depth(sim.position(i), sim.axes(i), size / 2, sim.position(k), sim.axes(k), size / 2)
              for i in range(60) for k in range(i) if numpy.linalg.norm(sim.position(i) - sim.position(k)) < 2.1]
    depths = [d for d in depths if d > 0]
    return {"mean": sum(depths) / max(1, len(depths)), "deepest": max(depths, default=0.0)}


def disc_loads(s):
    n, radius, mass = 9, 2.2, s["mass"]
    loads = mean_loads(s, [body("cylinder", (radius, 1), (0, 0, 0.5), mass)], n)
    at = (numpy.arange(100) + 0.5) / 100 - 0.5

    def share(x, y):
        return numpy.mean((x + 0.8 * at[:, None])**2 + (y + 0.8 * at[None, :])**2 <= radius**2)

    shares = numpy.array([[share(c - 4, r - 4) for c in range(n)] for r in range(n)])
    right = mass * G * shares / shares.sum()
    return {"load": loads.sum(), "worst": abs(loads - right).max() * shares.sum() / (mass * G)}


def conveyor(s):
    """Belts are boxes with a surface velocity; the body's centre of mass is at its underside."""
    kind, v1, v2, mu = s["kind"], s.get("v1", 1.0), s.get("v2", 3.0), s["mu"]
    length, width, offset, height = s.get("length", 4.0), s.get("width", 3.0), s.get("offset", 0.5), 0.4
    angle = math.radians(s.get("angle", 30.0))

    def belt(x, y, sx, sy, vx, vy, turn=0.0):
        return f'<geom type="box" size="{sx} {sy} 1" pos="{x} {y} -1" surfacevel="{vx} {vy} 0 0 0 {turn}"/>'

    def carry(world, x, y, velocity=(0, 0, 0), spin=0.0):
        if kind == "straddle_disc":
            b = body("cylinder", (width / 2, height), (x, y, 0), velocity=velocity)
        else:
            b = body("box", (length, width, height), (x, y, 0), velocity=velocity, spin=(0, 0, spin))
        b["raised"] = height / 2
        return Sim(s, [b], mu=mu, floor=False, world=world)

    if kind == "transfer":
        sim = carry(belt(-30, 0, 30, 8, v1, 0) + belt(30, 0, 30, 8, v2, 0), -length / 2 - 0.5, 0, (v1, 0, 0)).run()
        return {"ahead": sim.position()[0] - v2 * (s["seconds"] - (length / 2 + 0.5) / v1), "v": sim.velocity()[0]}
    if kind == "feed":
        sim = carry(belt(0, 0, 60, 8, v2, 0), 0, 0, (v1 * math.cos(angle), v1 * math.sin(angle), 0)).run()
        return {"aside": sim.position()[1], "ahead": sim.position()[0] - v2 * s["seconds"], "spin": sim.spin()[2]}
    if kind == "centre":
        sim = carry(belt(0, -8, 60, 8, v1, v2) + belt(0, 8, 60, 8, v1, -v2), 0, offset, (v1, 0, 0))
        before, crossings = offset, []

        def sample(t):
            nonlocal before
            y = sim.position()[1]
            if (before < 0) != (y < 0):
                crossings.append(t - sim.dt * y / (y - before))
            before = y

        sim.run(sample)
        period = 2 * (crossings[-1] - crossings[0]) / (len(crossings) - 1) if len(crossings) > 1 else 0.0
        return {"period": period, "ahead": sim.position()[0] - v1 * s["seconds"]}
    if kind in ("straddle", "straddle_disc"):
        sim = carry(belt(0, -8, 60, 8, v1, 0) + belt(0, 8, 60, 8, -v1, 0), 0, 0).run()
        return {"rate": sim.spin()[2] / s["seconds"]}
    x, y = offset * math.cos(angle), offset * math.sin(angle)
    sim, turning = carry(belt(0, 0, 12, 12, 0, 0, v2), x, y, (-v2 * y, v2 * x, 0), v2), Turning()
    sim.run(lambda t: turning.add(math.atan2(sim.position()[1], sim.position()[0])))
    return {"turned": turning.angle, "radius": math.hypot(*sim.position()[:2]), "spin": sim.spin()[2]}


SCRIPTS = {f.__name__: f for f in (flight, push, tumble, precession, slide, threshold, slope, roll, coast, skid, topple, dominoes, bounce,
                                   bouncing, oblique, collide, cradle, offcentre, superball, flat_drop, rest_sphere,
                                   plate_loads, spin_brake, stack, drive, driven_sphere, pattern, uneven, bed, chain, top, landing,
                                   towers, seams, wall, legs, ratio, heap, disc_loads, conveyor)}


def main():
    if sys.argv[1:] == ["--version"]:
        print(mujoco.__version__, *SCRIPTS)
        return
    script, rate, seconds, seed, settings = sys.argv[1:]
    s = {"rate": int(rate), "seconds": float(seconds), "seed": int(seed), **json.loads(settings)}
    print(json.dumps({name: float(value) for name, value in SCRIPTS[script](s).items()}))


if __name__ == "__main__":
    main()
