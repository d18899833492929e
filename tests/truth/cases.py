"""The closed-form cases of scripts/truth: what is measured, what is right, and where that stands.

A case runs one experiment of this folder with its settings. A quantity is a metric of the experiment beside a closed
form: a Python expression over the settings, the constants of the case, g and t (the simulated seconds).
"""
import dataclasses
import math

G = 9.81


@dataclasses.dataclass(frozen=True)
class Quantity:
    metric: str
    label: str
    formula: str
    tolerance: float  # of the error at 1/240 s
    unit: str = ""
    # The error is divided by this expression; None: by the closed form itself.
    scale: str | None = None
    shown: str | None = None  # on the page, instead of the formula
    # The error may exceed the recorded one by this factor: chaotic motion differs between machines' libraries.
    margin: float = 1.25


@dataclasses.dataclass(frozen=True)
class Case:
    name: str
    title: str
    script: str  # without .lua
    seconds: float
    quantities: list
    source: str
    settings: dict = dataclasses.field(default_factory=dict)
    constants: dict = dataclasses.field(default_factory=dict)
    mujoco: str | None = None  # why MuJoCo does not model it
    overlap: str | None = None  # measured in the recording: of bodies with "pins" or with "bodies"
    seeds: int = 1  # runs; the quantity is the greatest of them
    quick: bool = True  # is part of the test `truth`
    slow: bool = False  # takes Bullet minutes: it runs at 60 and 240 steps per second only


def absolute(metric, label, formula, tolerance, unit, **more):
    return Quantity(metric, label, formula, tolerance, unit, scale="1", **more)


def relative(metric, label, formula, tolerance, unit="", **more):
    return Quantity(metric, label, formula, tolerance, unit, **more)


def elliptic_k(k2):
    """Complete elliptic integral of the first kind by the arithmetic-geometric mean."""
    a, b = 1.0, math.sqrt(1.0 - k2)
    while abs(a - b) > 1e-15 * a:
        a, b = (a + b) / 2, math.sqrt(a * b)
    return math.pi / (2 * a)


def half_period_of_flips(moments, w_greatest, w_middle):
    """Time between zeros of the spin about the middle axis, from a start with these two components."""
    c, b, a = sorted(moments, reverse=True)
    energy2 = c * w_greatest**2 + b * w_middle**2
    momentum2 = (c * w_greatest)**2 + (b * w_middle)**2
    k2 = (b - a) * (energy2 * c - momentum2) / ((c - b) * (momentum2 - energy2 * a))
    return 2 * elliptic_k(k2) * math.sqrt(a * b * c / ((c - b) * (momentum2 - energy2 * a)))


def domino_speed(h, d, gap, n=60):
    """Of a long row without friction between dominoes, each of which leans on the next once it has hit it.

    A train has one degree of freedom, the angle of its head; a hit is inelastic and keeps the momentum along the motion
    that is possible after it.
    """
    hit = math.asin(gap / h)
    moment = (h * h + d * d) / 3  # about the edge, per mass

    def behind(angle):
        """Of the domino that leans on one at this angle."""
        return angle + math.asin(((gap + d) * math.cos(angle) - d) / h)

    def state(head, count):
        """Sum of the squared rates and of the heights of a train, per rate and mass of its head; the head comes first."""
        angle, rate, squares, height = head, 1.0, 0.0, 0.0
        for _ in range(count):
            squares += rate * rate
            height += (h * math.cos(angle) + d * math.sin(angle)) / 2
            rate *= 1 - (gap + d) * math.sin(angle) / math.sqrt(h * h - ((gap + d) * math.cos(angle) - d)**2)
            angle = behind(angle)
        return squares, height

    rate, duration, steps = 0.5, 0.0, 400
    for count in range(1, n):
        squares, height = state(0.0, count)
        energy = moment * squares * rate * rate / 2 + G * height
        duration = 0.0
        for k in range(steps):
            inner, at = state((k + 0.5) * hit / steps, count)
            duration += hit / steps / math.sqrt(2 * (energy - G * at) / (moment * inner))
        squares, height = state(hit, count)
        rate = math.sqrt(2 * (energy - G * height) / (moment * squares))
        # The next domino starts with the train at the same rates but for its own.
        rate *= squares / (squares + 1)
    return (gap + d) / duration


def transfer(v1, v2, mu, length):
    """How far a box is ahead of one that went on at v2, once it has gone from a belt at v1 to one at v2.

    The first belt holds it until half of it is over the seam. Then the belts' loads differ by 2·s/length of the weight, s
    being how far its middle is over: s" = ±k²·s, until it has the speed or is over; then it slips at µ·g.
    """
    k, sign = math.sqrt(2 * mu * G / length), math.copysign(1, v2 - v1)
    inverse = math.acosh if v2 > v1 else math.acos
    way, time = math.sqrt(abs(v2 * v2 - v1 * v1)) / k, inverse(v2 / v1) / k
    if way > length / 2:
        over = math.sqrt(v1 * v1 + sign * (k * length / 2)**2)
        time = inverse(over / v1) / k + abs(v2 - over) / (mu * G)
        way = length / 2 + abs(v2 * v2 - over * over) / (2 * mu * G)
    return way - v2 * time


def slip_way(v1, v2, mu, angle):
    """The way along x and y of a box on a belt at v2 along x, fed at v1 under that angle (degrees), in the belt's frame."""
    x, y = v1 * math.cos(math.radians(angle)) - v2, v1 * math.sin(math.radians(angle))
    slip = math.hypot(x, y)
    return x * slip / (2 * mu * G), y * slip / (2 * mu * G)


FLIPS = half_period_of_flips([13 / 12, 10 / 12, 5 / 12], 0.01, 10.0)
LANDAU = "Landau and Lifshitz, Mechanics, §37"
GOLDSTEIN = "Goldstein, Classical Mechanics"
COULOMB = "Coulomb friction"
COMPLIANCE = "equal, small compliances: least squares among the loads in equilibrium"
ROUTH = "Routh's impact with Coulomb friction (Stronge, Impact Mechanics, ch. 3)"
NEWTON = "Newton's impact law"
NO_CELLS = "it has no such actuator"
NO_PINS = "moving pins are not set up"
NO_LIMIT = "pins of limited force are not set up"
# A cell's centre from the middle of a 5 × 5 box, in the mean.
MEAN_R = sum(math.hypot(x, y) for x in range(-2, 3) for y in range(-2, 3)) / 25
TOP = {"l": 0.75, "I3": 0.3, "I1": 0.15 + 0.0375 + 0.75**2}
JET = 0.5 * 0.001 * 1.2 * 0.64


def roll_case(name, title, share, **settings):
    return Case(name, title, "roll", 3, [
        relative("distance", "distance", "g*sin(rad(angle))*t**2/2/(1 + c)", 0.005, "u"),
        absolute("slip", "slip at the end", "0", 0.02, "u/s"),
        absolute("hop", "greatest hop", "0", 0.005, "u")],
        f"{GOLDSTEIN}: rolling down an incline, c = I/(m·r²)", {"shape": "sphere", "angle": 5.0, **settings},
        {"c": share})


def plate_case(name, title, tolerance=0.01, slow=False, **settings):
    settings = {"n": 5, "slope": 0.0, "rider": 0.0, **settings}
    return Case(name, title, "plate_loads", 2, [
        relative("load", "sum of the loads", "(n**2 + rider)*g*cos(rad(slope))", 0.001, "mass·u/s²"),
        absolute("worst", "worst cell, of the mean load", "0", tolerance, ""),
        absolute("cells", "cells that bear", "n**2", 0.5, "")], COMPLIANCE, settings, slow=slow)


def limited_case(name, title, full, **settings):
    return Case(name, title, "limited_loads", 4.5, [
        relative("load", "sum of the loads", "25*g + force", 0.002, "mass·u/s²"),
        absolute("worst", "worst cell, of the limit", "0", 0.01, ""),
        absolute("full", "pins that give all", str(full), 0.5, "")], f"{COMPLIANCE} within the limits",
        {"force": 300.0, "lever": 1.0, "limit": 40.0, **settings}, mujoco=NO_LIMIT)


def conveyor_cases():
    """Of boxes on belts whose tops leave no gaps. tests/system/programs/conveyors_test.py draws others."""
    fast, slow = {"v1": 1.0, "v2": 3.0, "mu": 0.5, "length": 4.0}, {"v1": 3.0, "v2": 1.0, "mu": 0.4, "length": 3.0}
    feed = {"v1": 2.0, "v2": 1.5, "mu": 0.4, "angle": 60.0}
    ways = slip_way(**feed)
    half = {"v1": 40.0, "mu": 0.5, "length": 4.0, "width": 3.0}
    common = {"script": "conveyor", "slow": True}
    return [
        *[Case(f"conveyor_{name}", f"Box from a belt to a {name}er one", seconds=6, settings={"kind": "transfer", **values},
               constants={"way": transfer(**values)}, source="the belts' loads differ by how far the box is over the seam; Coulomb friction",
               quantities=[absolute("ahead", "ahead of a box that went on at the second speed", "way", 0.01, "u"),
                           absolute("v", "speed", "v2", 0.001, "u/s")], **common) for name, values in (("fast", fast), ("slow", slow))],
        Case("conveyor_feed", "Box fed under 60° onto a belt", seconds=2, settings={"kind": "feed", **feed},
             constants={"way_x": ways[0], "way_y": ways[1]}, source="Coulomb friction in the belt's frame",
             quantities=[absolute("aside", "slip aside", "way_y", 0.01, "u"), absolute("ahead", "slip along", "way_x", 0.01, "u"),
                         absolute("spin", "spin", "0", 0.001, "rad/s")], **common),
        Case("conveyor_centre", "Box between belts that drive it to the seam", seconds=8,
             settings={"kind": "centre", "v1": 1.0, "v2": 20.0, "mu": 0.5, "width": 3.0, "offset": 0.7},
             source="the belts' loads differ by the offset: a friction oscillator (Timoshenko)",
             quantities=[relative("period", "period of its swing", "2*pi*sqrt(width/(2*mu*g))", 0.01, "s"),
                         absolute("ahead", "ahead of the belts", "0", 0.01, "u")], **common),
        Case("conveyor_straddle", "Box half on each of two belts that run apart", seconds=0.05, settings={"kind": "straddle", **half},
             source="Coulomb friction at full slip; moment of inertia m·(l² + w²)/12",
             quantities=[relative("rate", "mean angular acceleration", "3*mu*g*width/(length**2 + width**2)", 0.01, "rad/s²")], **common),
        Case("conveyor_straddle_disc", "Disc half on each of two belts that run apart", seconds=0.1, settings={"kind": "straddle_disc", **half},
             source="Coulomb friction at full slip; moment of inertia m·r²/2",
             quantities=[relative("rate", "mean angular acceleration", "16*mu*g/(3*pi*width)", 0.02, "rad/s²")], **common),
        Case("conveyor_turntable", "Box rides on a turntable", seconds=6,
             settings={"kind": "turntable", "v2": 1.0, "offset": 3.0, "mu": 0.5, "length": 3.0, "width": 2.0}, source="it does not slip: ω²·r < µ·g",
             quantities=[absolute("turned", "turned about the middle", "v2*t", 0.02, "rad"), relative("radius", "distance from the middle", "offset", 0.01, "u"),
                         absolute("spin", "spin", "v2", 0.001, "rad/s")], **common)]


def drive_case(name, title, vx, vy, **settings):
    settings = {"a": 0.0, "b": 5.0, "radius": 0.4, "mu": 0.5, **settings}
    return Case(name, title, "drive", 1.5, [
        relative("gain", "acceleration at first", "mu*g", 0.02, "u/s²"),
        absolute("vx", "speed east", vx, 0.01, "u/s"), absolute("vy", "speed north", vy, 0.01, "u/s")],
        "docs/actuators.md: the surface velocity; Coulomb friction", settings)


def pattern_case(name, title, drive, brake):
    return Case(name, title, "pattern", 0.4, [
        Quantity("gain", "acceleration", f"mu*g*({drive} - {brake})/49", 0.03, "u/s²", scale="mu*g/49")],
        f"{COMPLIANCE}; {COULOMB} of each cell against its own surface velocity",
        {"pattern": name.removeprefix("pattern_"), "mu": 0.5})


def oblique_case(name, title, speed_right, spin_right, **settings):
    settings = {"mu": 0.3, "e": 1.0, "vx": 12.0, "vz": 4.43, "spin": 0.0, **settings}
    return Case(name, title, "oblique", 0.6, [
        relative("vx", "speed along the cells", speed_right, 0.02, "u/s"),
        relative("vz", "rebound", "e*vz", 0.01, "u/s"),
        relative("spin", "spin", spin_right, 0.02, "rad/s")], ROUTH, settings)


def cradle_case(name, title, **settings):
    settings = {"n": 6, "e": 1.0, "gap": 0.0, "v": 1.0, **settings}
    return Case(name, title, "cradle", 2, [
        relative("last", "speed of the last sphere", "v*((1 + e)/2)**(n - 1)", 0.03, "u/s"),
        relative("momentum", "momentum", "1", 0.001, "of the first")],
        "a sequence of Newton's impacts (Herrmann and Schmälzle, Am. J. Phys. 49, 1981)", settings)


def stack_case(name, title, seconds, drift=0.005, slow=False, **settings):
    return Case(name, title, "stack", seconds, [
        absolute("height", "height", "n", 0.002 * settings.get("n", 10), "u"), absolute("drift", "greatest drift aside", "0", drift, "u"),
        absolute("buzz", "rms speed after 4 s", "0", 0.002, "u/s"),
        relative("load", "load of the cells", "(n - 1 + ratio)*g", 0.002, "mass·u/s²")], "statics",
        {"n": 10, "ratio": 1.0, **settings}, slow=slow)


def hold_case(name, title, **settings):
    return Case(name, title, "hold", 8, [
        absolute("z", "height of the ball's centre", "height + 3", 0.01, "u"),
        absolute("lowest", "deepest below its start", "0", 0.01, "u")], "statics: no pin is overloaded",
        {"g": G, "force": 1000.0, "speed": 0.5, "height": 2.0, **settings}, mujoco=NO_LIMIT)


def bounce_case(e):
    return Case(f"bounce_{e}", f"Bounce, e = {e}", "bounce", 1.2 + e, [
        Quantity("ratio", "height after / before, mean of eight heights", "e**2", 0.01, scale="1"),
        Quantity("worst", "worst of the eight", "0", 0.03, scale="1")], NEWTON, {"e": e})


GROUPS = [
    ("Free motion", [
        Case("free_fall", "Free fall", "flight", 2, [
            relative("z", "fall", "-g*t**2/2", 0.01, "u"), relative("vz", "speed", "-g*t", 1e-4, "u/s")], "Galilei",
            {"vx": 0.0, "vz": 0.0}),
        Case("projectile", "Projectile", "flight", 2, [
            relative("x", "range", "vx*t", 1e-4, "u"), relative("z", "height", "vz*t - g*t**2/2", 0.01, "u")],
            "Galilei", {"vx": 3.0, "vz": 4.0}),
        Case("push", "Force and couple", "push", 1, [
            relative("v", "speed", "force*t/mass", 1e-3, "u/s"),
            relative("x", "distance", "force*t**2/(2*mass)", 0.01, "u"),
            relative("spin", "spin by the couple", "force*t/(mass/6)", 1e-3, "rad/s")], "Newton and Euler",
            {"force": 4.0, "mass": 2.0}),
        Case("tumble", "Tumbling box 1 × 2 × 3, one minute", "tumble", 60, [
            absolute("momentum", "angular momentum, greatest relative error", "0", 1e-3, ""),
            absolute("energy", "energy, greatest relative error", "0", 0.01, ""),
            relative("first_flip", "first flip", "flips/2", 0.01, "s", shown="K(k)·√(I₁I₂I₃ / ((I₁ − I₂)(L² − 2E·I₃)))"),
            relative("between_flips", "time between flips", "flips", 0.03, "s",
                     shown="2·K(k)·√(I₁I₂I₃ / ((I₁ − I₂)(L² − 2E·I₃)))")], LANDAU,
            {"wx": 0.01, "wy": 10.0}, {"flips": FLIPS}),
        Case("precession", "Free precession of a disc", "precession", 10, [
            relative("rate", "rate of the axis", "sqrt((I1*across)**2 + (I3*along)**2)/I1", 1e-3, "rad/s")],
            f"{GOLDSTEIN}, 5.6", {"across": 3.0, "along": 20.0}, {"I1": 3.16 / 12, "I3": 0.5}),
        Case("top", "Spinning top on its tip", "top", 10, [
            absolute("least", "least tilt", "tilt", 1.0, "°"), absolute("greatest", "greatest tilt", "tilt", 1.0, "°"),
            relative("rate", "precession", "(I3*spin - sqrt((I3*spin)**2 - 4*I1*cos(rad(tilt))*g*l))/(2*I1*cos(rad(tilt)))",
                     0.03, "rad/s")], f"{GOLDSTEIN}, 5.7: steady precession about a fixed tip", {"spin": 60.0, "tilt": 20.0},
            TOP),
    ]),
    ("Sliding", [
        *[Case(f"slide_{mu}", f"Sliding box, µ = {mu}", "slide", 3, [
            relative("distance", "braking distance", "v**2/(2*mu*g)", 0.01, "u"),
            relative("stops", "stops after", "0.99*v/(mu*g)", 0.02, "s"),
            absolute("aside", "drift aside", "0", 0.01, "u")], COULOMB, {"mu": mu, "v": 8.0}) for mu in (0.3, 0.6)],
        Case("slide_oblique", "Sliding box, 40° from the rows", "slide", 2, [
            relative("distance", "braking distance", "v**2/(2*mu*g)", 0.01, "u"),
            absolute("aside", "drift aside", "0", 0.02, "u"),
            absolute("turned", "turned by", "0", 0.5, "°")], COULOMB, {"mu": 0.5, "v": 8.0, "heading": 40.0}),
        *[Case(f"slide_unit_{unit}", f"Sliding box, all lengths × {unit}", "slide", 2, [
            relative("distance", "braking distance / unit", "v**2/(2*mu*g)", 0.01, "u"),
            relative("stops", "stops after", "0.99*v/(mu*g)", 0.02, "s")], COULOMB, {"mu": 0.5, "v": 8.0, "unit": unit})
          for unit in (0.01, 100.0)],
        Case("threshold", "Angle of friction: twenty boxes of graded friction", "threshold", 3, [
            absolute("angle", "steepest angle at which a box rests", "degrees(atan(0.5))", 0.1, "°")], COULOMB,
            {"angle": 26.565}, slow=True),
        Case("slope_slides", "Box on a slope, tan 25° > µ", "slope", 2, [
            relative("distance", "distance", "g*(sin(rad(angle)) - mu*cos(rad(angle)))*t**2/2", 0.01, "u"),
            relative("v", "speed", "g*(sin(rad(angle)) - mu*cos(rad(angle)))*t", 0.01, "u/s")], COULOMB,
            {"mu": 0.3, "angle": 25.0}),
        Case("slope_rests", "Box on a slope, tan 25° < µ", "slope", 3, [
            absolute("distance", "distance", "0", 0.001, "u")], COULOMB, {"mu": 0.6, "angle": 25.0}),
        Case("spin_brake", "Box on 5 × 5 cells turns about the vertical", "spin_brake", 0.1, [
            relative("slowing", "slows by", "mu*g*r/(n**2/6)", 0.03, "rad/s²", shown="Σ µ·N·r / I over the cells")],
            f"{COMPLIANCE}; {COULOMB} at each cell's centre", {"n": 5, "spin": 2.0, "mu": 0.5}, {"r": MEAN_R}),
    ]),
    ("Rolling", [
        roll_case("roll_sphere", "Sphere down 5°", 0.4),
        roll_case("roll_sphere_steep", "Sphere down 17°", 0.4, angle=17.0),
        roll_case("roll_sphere_gaps", "Sphere down 5°, over gaps of 0.2 u", 0.4, top=0.8),
        roll_case("roll_cylinder", "Cylinder down 5°", 0.5, shape="cylinder"),
        roll_case("roll_capsule", "Capsule down 5°", (4 * 0.5 + 2 * 0.4) / 6, shape="capsule"),
        Case("creep", "Sphere down 0.3°, 20 s", "roll", 20, [
            relative("distance", "distance", "5/7*g*sin(rad(angle))*t**2/2", 0.005, "u")], GOLDSTEIN,
            {"shape": "sphere", "angle": 0.3, "top": 0.8}),
        Case("coast", "Sphere on the level", "coast", 6, [
            relative("v", "speed", "v", 0.001, "u/s"), relative("x", "distance", "v*t", 0.001, "u")], "Newton's first law",
            {"v": 6.0, "lever": 0.0, "top": 0.8}),
        Case("rolling_friction", "Sphere with rolling friction", "coast", 6, [
            relative("v", "speed", "v - 5/7*g*lever/radius*t", 0.01, "u/s"),
            relative("x", "distance", "v*t - 5/7*g*lever/radius*t**2/2", 0.01, "u")],
            "rolling resistance: a lever arm of the load", {"v": 6.0, "lever": 0.1, "radius": 1.5}),
        Case("skid", "Sliding sphere ends rolling", "skid", 1.5, [
            relative("v", "speed", "5/7*v", 0.005, "u/s"),
            relative("slips", "slips for", "0.99*2*v/(7*mu*g)", 0.03, "s")], f"{GOLDSTEIN}: the billiard ball",
            {"v": 7.0, "mu": 0.5}),
        Case("backspin", "Sphere with backspin", "skid", 2.5, [
            relative("v", "speed", "(5*v + 2*spin)/7", 0.01, "u/s"),
            relative("slips", "slips for", "0.99*2*(v - spin)/(7*mu*g)", 0.03, "s")], f"{GOLDSTEIN}: the billiard ball",
            {"v": 3.0, "spin": -20.0, "mu": 0.5}),
        Case("dominoes", "Wave in a row of dominoes", "dominoes", 9, [
            relative("speed", "speed", "c", 0.03, "u/s", shown="a train of one degree of freedom, inelastic hits")],
            "van Leeuwen, The domino effect, Am. J. Phys. 78, 2010, without friction", {"h": 4.0, "d": 0.5, "gap": 1.5},
            {"c": domino_speed(4.0, 0.5, 1.5)}, slow=True),
        Case("topple", "Slender box falls over its edge", "topple", 1.5, [
            relative("spin", "spin at 60°",
                     "sqrt(6*g*(h/2*(cos(rad(start)) - cos(rad(angle))) + d/2*(sin(rad(start)) - sin(rad(angle))))/(h**2 + d**2))",
                     0.01, "rad/s")], "energy about the fixed edge",
            {"h": 4.0, "d": 0.5, "start": 15.0, "angle": 60.0}),
    ]),
    ("Impacts", [
        *[bounce_case(e) for e in (0.2, 0.5, 0.8, 0.95)],
        Case("bouncing", "Elastic ball bounces for a minute", "bouncing", 60, [
            relative("energy", "energy", "1", 0.01, "of the first")], "energy"),
        oblique_case("oblique_slides", "Oblique bounce that slides", "vx - mu*(1 + e)*vz", "5/2*mu*(1 + e)*vz"),
        oblique_case("oblique_slides_half", "… with e = 0.5", "vx - mu*(1 + e)*vz", "5/2*mu*(1 + e)*vz", e=0.5),
        oblique_case("oblique_rolls", "Oblique bounce that ends in rolling", "5/7*vx", "5/7*vx", mu=1.0, vx=4.0),
        oblique_case("oblique_topspin", "… with topspin, e = 0.5", "(5*vx + 2*spin)/7", "(5*vx + 2*spin)/7", mu=1.0, vx=4.0,
                     spin=20.0, e=0.5),
        *[Case(name, title, "collide", 1.5, [
            absolute("v1", "the first's speed", "v*(1 - e*m)/(1 + m)", 0.02, "u/s"),
            relative("v2", "the second's speed", "v*(1 + e)/(1 + m)", 0.005, "u/s")], NEWTON, {"v": 4.0, "e": e, "m": m})
          for name, title, e, m in (("collide", "Two equal spheres, e = 1", 1.0, 1.0),
                                    ("collide_heavy", "Sphere against a threefold one, e = 1", 1.0, 3.0),
                                    ("collide_half", "Two equal spheres, e = 0.5", 0.5, 1.0))],
        Case("collide_aside", "Two equal spheres, e = 1, half a radius aside", "collide", 1.5, [
            relative("speed2", "the second's speed", "v*sqrt(1 - offset**2)", 0.02, "u/s"),
            relative("v2y", "its part across", "v*sqrt(1 - offset**2)*offset", 0.05, "u/s")], NEWTON,
            {"v": 4.0, "offset": 0.25}),
        Case("offcentre", "Sphere hits a free box beside its centre", "offcentre", 0.35, [
            relative("v1", "the sphere's speed", "v - J", 0.02, "u/s"), relative("v2", "the box's speed", "J/2", 0.02, "u/s"),
            relative("spin", "the box's spin", "-lever*J/I", 0.02, "rad/s")],
            f"{NEWTON}; J = (1 + e)·v/(1/m₁ + 1/m₂ + lever²/I)", {"v": 4.0, "e": 0.5, "lever": 0.8},
            {"I": 2 * 6.76 / 12, "J": 1.5 * 4 / (1.5 + 0.64 / (2 * 6.76 / 12))}),
        cradle_case("cradle", "Newton's cradle, five touching spheres, e = 1"),
        cradle_case("cradle_gaps", "… with gaps of 0.001 u", gap=0.001),
        cradle_case("cradle_lossy", "… e = 0.8, gaps of 0.001 u", e=0.8, gap=0.001),
        cradle_case("cradle_wide", "… e = 0.8, gaps of 0.05 u", e=0.8, gap=0.05),
        Case("superball", "Small ball on a large one, e = 1", "superball", 0.9, [
            relative("ratio", "speed after / before", "(1 + 2*e - m)/(1 + m)", 0.03)],
            "two impacts in sequence (Harter, Am. J. Phys. 39, 1971)", {"e": 1.0, "m": 0.25}),
        Case("flat_drop", "Box dropped flat at 20 u/s", "flat_drop", 0.5, [
            absolute("aside", "greatest speed aside", "0", 0.02, "u/s"), absolute("spin", "greatest spin", "0", 0.02, "rad/s"),
            relative("up", "rebound", "e*sqrt(v**2 + 2*g*1.513)", 0.02, "u/s")], f"{NEWTON}; symmetry",
            {"v": 20.0, "e": 0.2}),
    ]),
    ("Loads and rest", [
        *[Case(name, title, "rest_sphere", 2, [
            absolute("depth", "depth, of its radius", "0", 0.001, ""),
            relative("load", "load", "3*g", 0.001, "mass·u/s²")], "statics", {"unit": unit})
          for name, title, unit in (("rest_sphere", "Sphere at rest", 1.0), ("rest_sphere_metres", "… all lengths × 0.01", 0.01),
                                    ("rest_sphere_large", "… all lengths × 100", 100.0))],
        plate_case("plate", "Box on 5 × 5 level cells"),
        plate_case("plate_slope", "… on a slope of 10°", slope=10.0),
        plate_case("plate_rider", "… with a box of its mass beside the middle", rider=25.0),
        plate_case("plate_20", "Box on 20 × 20 level cells", slow=True, n=20),
        Case("disc", "Cylinder upright on 21 cells, 12 of them in part", "disc_loads", 2, [
            relative("load", "sum of the loads", "mass*g", 0.001, "mass·u/s²"),
            absolute("worst", "worst cell, of the mean load", "0", 0.01, "")], COMPLIANCE, {"mass": 21.0}),
        stack_case("stack", "Stack of ten boxes", 5),
        stack_case("stack_ratio", "Box of mass 100 on four of mass 1", 6, n=5, ratio=100.0),
        stack_case("tower", "Tower of thirty boxes", 6, drift=0.02, slow=True, n=30),
    ]),
    ("Surface velocities", [
        drive_case("balls", "Box on balls", "radius*b", "-radius*a", model="ball", a=-3.0),
        drive_case("wheels", "Box on wheels", "radius*a", "radius*b", model="wheels", a=3.0),
        drive_case("wheels_turned", "Box on wheels at 45°", "radius*(a - b)*sqrt(0.5)", "radius*(a + b)*sqrt(0.5)", model="wheels",
                   a=5.0, b=2.0, angle=45.0),
        drive_case("rotor", "Box on round rotors", "radius*a", "0", model="rotor", a=5.0),
        Case("rotor_lift", "Elliptic rotors lower a box", "rotor_lift", 3, [
            absolute("z", "height", "axle + sqrt(a**2*sin(rad(angle))**2 + c**2*cos(rad(angle))**2)", 0.002, "u")],
            "docs/actuators.md: the support function of an ellipse", {"a": 0.4, "c": 0.6, "angle": 60.0, "axle": -0.5},
            mujoco=NO_PINS),
        Case("driven_sphere", "Sphere on tops that move", "driven_sphere", 2.5, [
            relative("v", "speed", "2/7*v", 0.01, "u/s"), relative("spin", "spin", "(2/7*v - v)/radius", 0.01, "rad/s")],
            "docs/actuators.md; the billiard ball seen from the tops", {"v": 2.0, "radius": 2.0}),
        pattern_case("pattern_inner", "Plate on 7 × 7 cells, the inner 25 drive", 25, 24),
        pattern_case("pattern_rim", "… the 24 cells of the rim drive", 0, 0),
        pattern_case("pattern_half", "… 28 of 49 cells drive, every other row", 28, 21),
        *conveyor_cases(),
    ]),
    ("Fields of force", [
        Case("force_field", "Nine cells of a force field push a box", "field", 0.5, [
            relative("v", "speed", "9*fx*t/mass", 0.005, "u/s"), relative("x", "distance", "9*fx*t**2/(2*mass)", 0.02, "u")],
            "docs/actuators.md", {"fx": 2.0, "mass": 60.0}, mujoco=NO_CELLS),
        Case("levitation", "Box floats on a force field", "field", 5, [
            relative("period", "period of its oscillation", "2*pi*sqrt(reach/(3*g))", 0.01, "s")],
            "docs/actuators.md: a spring of 3·m·g/reach", {"lift": True, "reach": 1.0}, mujoco=NO_CELLS),
        Case("magnet_pole", "Coil repels a pole", "magnet", 1.2, [
            relative("v", "speed at 5 u", "sqrt(2*k*current*charge*(1/start - 1/finish))", 0.005, "u/s")],
            "docs/actuators.md: energy in the field of a pole",
            {"law": "pole", "k": 100.0, "current": 1.0, "charge": 1.0, "start": 3.0, "finish": 5.0}, mujoco=NO_CELLS),
        Case("magnet_dipole", "Coil attracts a dipole", "magnet", 3, [
            relative("v", "speed at 3 u", "-sqrt(4*k*current*charge*(1/finish**3 - 1/start**3))", 0.005, "u/s")],
            "docs/actuators.md: energy in the field of a dipole",
            {"law": "dipole", "k": 100.0, "current": 1.0, "charge": 1.0, "start": 5.0, "finish": 3.0}, mujoco=NO_CELLS),
        Case("hover", "Sheet hovers over air jets", "hover", 20, [
            relative("gap", "gap", "2*(flow/sqrt(mass*g/(25*k)) - 1)", 0.01, "u")], "docs/actuators.md",
            {"flow": 50.0, "mass": 1.0}, {"k": JET}, mujoco=NO_CELLS),
    ]),
    ("Pins", [
        *[Case(f"lift_{shape}", f"Rising pins carry a {shape}", "lift", 4, [
            relative("at_1", "height after 1 s", "speed - speed**2/(2*acceleration)", 0.01, "u"),
            absolute("apex", "greatest height above the pins' target", "0", 0.005, "u"),
            absolute("end", "height at the end", "height", 0.002, "u")], "docs/actuators.md: the motion profile",
            {"shape": shape, "height": 4.0, "speed": 2.0, "acceleration": 5.0}, mujoco=NO_PINS)
          for shape in ("box", "sphere")],
        *[Case(f"throw_{shape}", f"Pins throw a {shape}", "lift", 1.6, [
            relative("apex", "height of the throw", "speed**2/(2*g)", 0.03, "u")], "docs/actuators.md: v²/2g",
            {"shape": shape, "height": 3.0, "speed": 4.0, "acceleration": 10000.0}, mujoco=NO_PINS)
          for shape in ("box", "sphere")],
        Case("motor", "Half of what nine pins of limited force bear", "motor", 3, [
            relative("v", "speed", "speed*(1 - share)", 0.02, "u/s")], "docs/actuators.md: the motor's line",
            {"share": 0.5, "speed": 2.0}, mujoco=NO_LIMIT),
        Case("motor_stall", "Load of 1.1 of what nine pins bear", "motor", 3, [
            absolute("rise", "rise", "0", 0.02, "u")], "docs/actuators.md", {"share": 1.1}, mujoco=NO_LIMIT),
        Case("motor_sinks", "Raised pins under 1.25 of what they bear", "motor", 5.5, [
            relative("rise", "sinks by", "-(1 - 1/share)*g*0.5**2/2", 0.05, "u")], "docs/actuators.md",
            {"share": 1.25, "raised": True}, mujoco=NO_LIMIT),
        Case("motor_holds", "Raised pins under 0.9 of what they bear", "motor", 5.5, [
            absolute("rise", "sinks by", "0", 0.02, "u")], "docs/actuators.md", {"share": 0.9, "raised": True},
            mujoco=NO_LIMIT),
        limited_case("limited", "Box on 5 × 5 pins of force 40, a force beside its middle", 0),
        limited_case("limited_column", "… with one column that gives all", 5, force=400.0),
        hold_case("hold", "Ball of mass 10 on pins of force 1000"),
        hold_case("hold_between", "… in the middle of four pins", x=7.5),
        hold_case("hold_heavy", "… at g = 981, force 10⁵", g=981.0, force=1e5),
        hold_case("hold_fast", "… at 20 u/s", speed=20.0),
        *[Case(f"jam_{shape}", f"Fourteen {title} shovelled into a corner, three seeds", "jam", 5, [
            absolute("pins", "deepest in a pin", "0", 0.05, "u", margin=2.0)], "no penetration", {"shape": shape},
            overlap="pins", seeds=3, quick=False, slow=True, mujoco=NO_PINS)
          for shape, title in (("box", "boxes"), ("sphere", "spheres"))],
        Case("ring", "Eighteen mixed objects inside a ring of pins that rise and fall at 4 u/s, three seeds", "ring", 7, [
            absolute("pins", "deepest in a pin", "0", 0.05, "u", margin=2.0)], "no penetration", overlap="pins", seeds=3,
            quick=False, slow=True, mujoco=NO_PINS),
        Case("heap", "Sixty boxes in a pit", "heap", 6, [
            absolute("mean", "mean overlap of touching boxes, at rest", "0", 0.002, "u", margin=2.0),
            absolute("deepest", "greatest overlap, at rest", "0", 0.02, "u", margin=2.0)], "no penetration",
            overlap="bodies", quick=False, slow=True),
    ]),
    ("Springs that yield", [
        Case("tips", "Box on four compliant tips swings", "tips", 8, [
            relative("decrement", "logarithmic decrement", "2*pi*zeta/sqrt(1 - zeta**2)", 0.02),
            relative("period", "period", "2*pi*sqrt(mass/stiffness/(1 - zeta**2))", 0.002, "s")],
            "the damped oscillator, ζ = c/2√(k·m)", {"stiffness": 200.0, "damping": 0.36, "mass": 2.0}, {"zeta": 0.009},
            mujoco=NO_CELLS),
        Case("sheet", "Square sheet with clamped edges swings", "sheet", 20, [
            absolute("rate", "decay of its lowest mode", "ratio*w2/2", 2e-4, "1/s", shown="c·ω²/2T"),
            relative("period", "its period", "2*pi/sqrt(w2)", 0.01, "s", shown="2π/ω, ω = π·√(2·T/ρ)/8")],
            "the damped membrane", {"tension": 63.0, "density": 1.0, "ratio": 1e-4},
            {"w2": 2 * math.pi**2 / 64 * 63}, mujoco=NO_CELLS),
    ]),
    ("Uneven beds, bodies on bodies, chains and seams", [
        Case("uneven", "Box on three pins of different heights", "uneven", 9, [
            relative("load", "sum of the loads", "25*g", 0.01, "mass·u/s²"),
            absolute("worst", "worst pin, of the weight", "0", 0.01, ""),
            absolute("creep", "moves in 2 s", "0", 0.001, "u")], "the lever law at the pose in which it lies", quick=False),
        Case("bed", "Box on pins at random heights, three beds", "bed", 25, [
            relative("load", "sum of the loads", "25*g", 0.01, "mass·u/s²"),
            absolute("creep", "moves in 15 s", "0", 0.001, "u")], "a body at rest stays so", seeds=3,
            quick=False, slow=True),
        *[Case(f"chain_{name}", title, "chain", 20, [
            absolute("energy", "energy, of n·m·g·l", "0", 0.01, ""),
            absolute("out", "spin out of the plane", "0", 0.01, "rad/s")], "conservation; symmetry",
            {"n": n, "h": h})
          for name, title, n, h in (("thick", "Two hinged rods of 0.2", 2, 0.2), ("thin", "… of 0.1", 2, 0.1),
                                    ("thinner", "… of 0.05", 2, 0.05))],
        Case("landing", "Box dropped flat on a box, 0.1 u beside its middle", "landing", 4, [
            absolute("tilt", "greatest tilt", "0", 0.1, "°"), absolute("spin", "greatest spin", "0", 0.1, "rad/s")],
            "its middle is over the lower box", quick=False),
        Case("towers", "Nine towers of twelve dropped boxes, three seeds", "towers", 16, [
            absolute("fallen", "towers that fall", "0", 0.5, "", margin=2.0)], "every middle is over the box below", seeds=3, quick=False, slow=True),
        Case("seam_roll", "Ball rolls over fixed boxes side by side", "seams", 3, [
            relative("v", "speed", "speed", 0.005, "u/s"), absolute("hop", "greatest hop", "0", 0.002, "u")],
            "one level plane", {"body": "ball", "speed": 7.0}, quick=False),
        Case("seam_slide", "Box slides over fixed boxes side by side", "seams", 4, [
            relative("x", "distance", "speed**2/(2*0.2*g)", 0.005, "u"), absolute("turned", "turned by", "0", 0.5, "°"),
            absolute("hop", "greatest hop", "0", 0.002, "u")], "Coulomb: v²/2µg on one level plane",
            {"body": "box", "speed": 7.0}),
        *[Case(f"wall_{name}", f"Twelve balls of 0.1 at {speed} u/s against a wall of {thickness}", "wall", 1, [
            absolute("passed", "balls that pass", "0", 0.5, "")], "no penetration",
            {"speed": float(speed), "thickness": thickness})
          for name, speed, thickness in (("30", 30, 0.05), ("100", 100, 0.05), ("200", 200, 0.05), ("thin", 200, 0.002))],
        Case("wall_rebound", "… at 150 u/s against a wall of 0.05, e = 0.8", "wall", 1, [
            absolute("passed", "balls that pass", "0", 0.5, ""),
            relative("least", "slowest rebound", "e*speed", 0.002, "u/s"),
            relative("greatest", "fastest rebound", "e*speed", 0.002, "u/s")], NEWTON,
            {"speed": 150.0, "thickness": 0.05, "e": 0.8}),
        Case("legs", "Plate of mass 1000 on four boxes of mass 1", "legs", 8, [
            relative("load", "sum of the loads", "(mass + 4)*g", 0.001, "mass·u/s²"),
            absolute("sink", "sinks by", "0", 0.01, "u"), absolute("speed", "speed", "0", 0.001, "u/s")],
            "equilibrium", {"mass": 1000.0}, quick=False),
        *[Case(f"ratio_{name}", title, "ratio", 10, [
            absolute("sink", "sinks by", "0", 0.01, "u"), absolute("speed", "speed in the last 2 s", "0", 0.001, "u/s")],
            "equilibrium", settings, quick=False)
          for name, title, settings in (
              ("light", "Box of mass 1000 on four of mass 1", {"ratio": 1000.0}),
              ("growing", "Five boxes whose masses grow from 1 to 1000", {"ratio": 1000.0, "growing": True}),
              ("iterations", "Twelve equal boxes, 40 iterations", {"ratio": 1.0, "n": 12, "iterations": 40}))],
    ]),
]
CASES = [case for _, cases in GROUPS for case in cases]


def value(case, text):
    """A closed form as a number."""
    names = {name: getattr(math, name) for name in ("sqrt", "sin", "cos", "tan", "atan", "degrees", "pi")}
    return float(eval(text, {"__builtins__": {}},
                      {**names, "rad": math.radians, "g": G, "t": case.seconds, **case.settings, **case.constants}))


def error(case, quantity, measured):
    """The error of a measured value, divided by its scale."""
    right = value(case, quantity.formula)
    scale = abs(right) if quantity.scale is None else value(case, quantity.scale)
    return abs(measured - right) / scale
