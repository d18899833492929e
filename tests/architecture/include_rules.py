#!/usr/bin/env python3
"""Fails on an include that the house does not allow (docs/architecture.md holds the same list in words).

usage: include_rules.py SOURCE_ROOT
"""
import pathlib
import re
import sys

# room -> rooms whose headers it may include. Its own are always allowed.
ROOMS = {
    "shm-protocol": set(),
    "smartsurf/scene": set(),
    "smartsurf/mesh": {"smartsurf/scene"},
    "smartsurf/script": {"smartsurf/scene"},
    "smartsurf/surface": {"smartsurf/scene"},
    "smartsurf/world": {"smartsurf/scene", "smartsurf/surface"},
    "smartsurf/record": {"smartsurf/scene"},
    "smartsurf/view": {"smartsurf/scene"},
    "smartsurf/web": {"smartsurf/scene", "smartsurf/record"},
    "smartsurf/run": {"smartsurf/scene", "smartsurf/mesh", "smartsurf/script", "smartsurf/surface", "smartsurf/world",
                      "smartsurf/record", "smartsurf/view", "smartsurf/web", "shm-protocol"},
    "apron/program": set(),
    "apron/syntax": set(),
    "apron/compiler": {"apron/syntax", "apron/program"},
    "apron/vm": {"apron/program"},
    "apron/debugger": {"apron/vm", "apron/program"},
    "apron/ui": {"apron/debugger", "apron/vm", "apron/program"},
    "apron/run": {"apron/syntax", "apron/program", "apron/compiler", "apron/vm", "apron/debugger", "apron/ui",
                  "shm-protocol"},
}

# third-party headers -> the only rooms that may see them.
PRIVATE = [
    (r"^(lua|lauxlib|lualib)", {"smartsurf/script"}),
    (r"^(bt[A-Z]|Bullet|LinearMath/)", set()),  # the physics is our own; benchmarks alone compare it with Bullet
    (r"^(epoxy|GLFW|EGL|GL|imgui)", {"smartsurf/view", "apron/ui"}),
    (r"^(hdf5|H5)", {"smartsurf/record"}),
    (r"^(assimp|libqhull)", {"smartsurf/mesh"}),
    (r"^boost/", {"shm-protocol"}),
    (r"^hwy/", {"apron/vm", "smartsurf/surface", "smartsurf/world"}),
    (r"^xbyak/", {"apron/vm"}),
    (r"^zlib", {"smartsurf/web"}),
    (r"^CLI/", {"smartsurf/run", "apron/run"}),
]

INCLUDE = re.compile(r'^\s*#\s*include\s*["<]([^">]+)[">]')


def room_of(path):
    parts = path.parts
    return "shm-protocol" if parts[0] == "shm-protocol" else "/".join(parts[:2])


def room_of_include(name):
    if name.startswith("shm_protocol/"):
        return "shm-protocol"
    match = re.match(r"(smartsurf|apron)/[a-z]+", name)
    return match.group(0) if match else None


def offences(root):
    files = [p for house in ("shm-protocol", "smartsurf", "apron") for p in (root / house).rglob("*")
             if p.suffix in {".h", ".cpp", ".c", ".def"}]
    if len(files) < 50:
        yield f"only {len(files)} sources found under {root}: wrong folder?"
    for path in sorted(files):
        relative = path.relative_to(root)
        room = room_of(relative)
        if room not in ROOMS:
            yield f"{relative}: '{room}' is not a room of the house"
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            match = INCLUDE.match(line)
            if not match:
                continue
            name = match.group(1)
            target = room_of_include(name)
            if target and target != room and target not in ROOMS[room]:
                yield f"{relative}:{number}: {room} may not include {name}"
            for pattern, allowed in PRIVATE:
                if re.match(pattern, name) and room not in allowed:
                    yield f"{relative}:{number}: {name} belongs to {' and '.join(sorted(allowed))} alone"


def main():
    found = list(offences(pathlib.Path(sys.argv[1])))
    for offence in found:
        print(offence)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
