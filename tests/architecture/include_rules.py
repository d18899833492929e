#!/usr/bin/env python3
"""Fails on an include that the architecture does not allow (see docs/architecture.md), and on one of Eigen's
decompositions outside the unit that compiles them.

usage: include_rules.py SOURCE_ROOT
"""
import pathlib
import re
import sys

# module -> modules whose headers it may include, besides its own. "common" stands for all of common/.
MODULES = {
    "common/arithmetic": set(),
    "common/error": set(),
    "common/hash": set(),
    "common/index": set(),
    "common/memory": set(),
    "common/controller": set(),
    "common/color": {"common/error"},
    "common/axis": set(),
    "common/chart": {"common/axis", "common/color", "common/index", "common/text"},
    "common/csv": set(),
    "common/state": {"common/error"},
    "common/files": {"common/error"},
    "common/confine": {"common/error", "common/files"},
    "common/process": {"common/confine", "common/error", "common/files", "common/text"},
    "common/text": set(),
    "common/cli": {"common/files", "common/text"},
    "common/gl": {"common/error", "common/image"},
    "common/threads": {"common/arithmetic", "common/error"},
    "common/image": {"common/error", "common/files"},
    "common/video": {"common/error", "common/files", "common/image", "common/process"},
    "shm-protocol": set(),
    "shm-protocol/tools": {"common", "shm-protocol"},
    "shm-protocol/hardware/bridge": {"common", "shm-protocol"},
    "shm-protocol/hardware/fake": {"common", "shm-protocol"},
    "smartsurf/scene": {"common"},
    "smartsurf/mesh": {"common", "smartsurf/scene"},
    "smartsurf/model": {"common", "smartsurf/scene"},
    "smartsurf/script": {"common", "smartsurf/scene", "smartsurf/model"},
    "smartsurf/surface": {"common", "smartsurf/scene"},
    "smartsurf/world": {"common", "smartsurf/scene", "smartsurf/surface"},
    "smartsurf/extension": {"common", "smartsurf/scene", "smartsurf/surface"},
    "smartsurf/library": {"common", "smartsurf/scene", "smartsurf/extension", "smartsurf/simulation"},
    "smartsurf/record": {"common", "smartsurf/scene"},
    "smartsurf/view": {"common", "smartsurf/scene"},
    "smartsurf/web": {"common", "smartsurf/scene", "smartsurf/record", "smartsurf/view"},
    "smartsurf/web/live": {"common", "smartsurf/scene", "smartsurf/simulation", "smartsurf/web", "apron/library"},
    "smartsurf/simulation": {"common", "smartsurf/scene", "smartsurf/mesh", "smartsurf/script", "smartsurf/surface",
                             "smartsurf/world"},
    "smartsurf/python": {"common", "smartsurf/scene", "smartsurf/extension", "smartsurf/record", "smartsurf/simulation", "smartsurf/view"},
    "smartsurf/run": {"common", "smartsurf/scene", "smartsurf/mesh", "smartsurf/extension", "smartsurf/script", "smartsurf/surface",
                      "smartsurf/world", "smartsurf/simulation", "smartsurf/record", "smartsurf/view", "smartsurf/web", "shm-protocol"},
    "apron/program": {"common"},
    "apron/syntax": {"common"},
    "apron/compiler": {"common", "apron/syntax", "apron/program"},
    "apron/target_c": {"common", "apron/program"},
    "apron/vm": {"common", "apron/program"},
    "apron/library": {"common", "apron/syntax", "apron/program", "apron/compiler", "apron/vm"},
    "apron/language_server": {"common", "apron/syntax", "apron/program", "apron/compiler"},
    "apron/python": {"common", "apron/program", "apron/vm", "apron/library"},
    "apron/debugger": {"common", "apron/vm", "apron/program"},
    "apron/ui": {"common", "apron/debugger", "apron/vm", "apron/program"},
    "apron/run": {"common", "apron/syntax", "apron/program", "apron/compiler", "apron/target_c", "apron/vm", "apron/library",
                  "apron/language_server", "apron/debugger", "apron/ui", "shm-protocol"},
}

# The layers of a module: its sub-folders from the lowest to the highest, "" for its own loose files. A file may include those
# of its own layer and of the layers before it.
LAYERS = {
    "smartsurf/world": ["simd", "body", "parallel", "broadphase", "contact", "narrowphase", "field", "solver", "", "bullet"],
}

# Third-party headers and the only modules that may include them.
PRIVATE = [
    (r"^(lua|lauxlib|lualib)", {"smartsurf/script"}),
    (r"^(bt[A-Z]|Bullet|LinearMath/)", {"smartsurf/world"}),
    (r"^(GLFW|GL/|imgui)", {"smartsurf/view", "apron/ui"}),
    (r"^(epoxy|EGL)", {"common/gl", "smartsurf/view", "apron/ui"}),
    (r"^(hdf5|H5|fontconfig/)", {"smartsurf/record"}),
    (r"^(assimp|libqhull)", {"smartsurf/mesh"}),
    (r"^tinyxml2", {"smartsurf/model"}),
    (r"^toml\+\+", {"shm-protocol/hardware/bridge"}),
    (r"^cairo", {"common/chart", "smartsurf/record"}),
    (r"^boost/", {"shm-protocol"}),
    (r"^hwy/", {"apron/vm", "smartsurf/surface", "smartsurf/world"}),
    (r"^xbyak/", {"apron/vm"}),
    (r"^seccomp", {"common/confine"}),
    (r"^zlib", {"smartsurf/web"}),
    (r"^pybind11/", {"smartsurf/python", "apron/python"}),
    (r"^CLI/", {"common/cli", "smartsurf/run", "apron/run"}),
    (r"^nlohmann/", {"smartsurf/mesh", "smartsurf/record", "smartsurf/web", "smartsurf/run", "apron/language_server", "apron/run",
                     "shm-protocol/tools"}),
    (r"^png\.h", {"common/image", "apron/run"}),
    (r"^stb/", {"apron/run"}),
]

# Eigen's eigenvalue and singular-value decompositions, which are slow to compile, and the unit that calls them.
DECOMPOSITIONS = re.compile(r"FromTwoVectors|\b(?:SelfAdjointEigenSolver|JacobiSVD|BDCSVD)\b|\.eigenvalues\(")
DECOMPOSED_IN = "smartsurf/scene/Axes"

INCLUDE = re.compile(r'^\s*#\s*include\s*["<]([^">]+)[">]')


def module_of(path):
    folders = ["/".join(path.parts[:n]) for n in (3, 2, 1)]
    return next((folder for folder in folders if folder in MODULES), "/".join(path.parts[:2]))


def module_of_include(name):
    if name.startswith("shm_protocol/"):
        return "shm-protocol"
    match = re.match(r"(common|smartsurf|apron)/[a-z0-9_]+", name)
    return match.group(0) if match else None


def is_allowed(module, target):
    return target == module or target in MODULES[module] or target.split("/")[0] in MODULES[module]


def layer_of(module, path):
    """The layer of a module's file: the first folder of its path within the module."""
    folders = pathlib.PurePosixPath(path).relative_to(module).parts[:-1]
    return folders[0] if folders else ""


def layer_violation(module, source, target):
    """What is wrong with an include within a module of several layers, or None."""
    layers = LAYERS.get(module)
    if layers is None or not target.startswith(module + "/"):
        return None
    source_layer, target_layer = layer_of(module, source), layer_of(module, target)
    for layer in (source_layer, target_layer):
        if layer not in layers:
            return f"'{module}/{layer}' is not a layer"
    if layers.index(target_layer) > layers.index(source_layer):
        return f"{module}/{source_layer or '*.h'} may not include {target}, which is a layer above"
    return None


def violations(root):
    files = [p for folder in ("common", "shm-protocol", "smartsurf", "apron") for p in (root / folder).rglob("*")
             if p.suffix in {".h", ".hpp", ".cpp", ".c", ".def"}]
    if len(files) < 50:
        yield f"only {len(files)} sources found under {root}: wrong folder?"
    for path in sorted(files):
        relative = path.relative_to(root)
        module = module_of(relative)
        if module not in MODULES:
            yield f"{relative}: '{module}' is not a module"
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            match = INCLUDE.match(line)
            if not match:
                continue
            name = match.group(1)
            target = module_of_include(name)
            if target and not is_allowed(module, target):
                yield f"{relative}:{number}: {module} may not include {name}"
            if problem := layer_violation(module, relative.as_posix(), name):
                yield f"{relative}:{number}: {problem}"
            for pattern, allowed in PRIVATE:
                if re.match(pattern, name) and module not in allowed:
                    yield f"{relative}:{number}: {name} is private to {' and '.join(sorted(allowed)) or 'the benchmarks'}"


def decompositions(root):
    for path in sorted(p for folder in ("shm-protocol", "smartsurf", "tests") for p in (root / folder).rglob("*") if p.suffix in {".h", ".cpp"}):
        relative = path.relative_to(root).as_posix()
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            if (match := DECOMPOSITIONS.search(line)) and relative != DECOMPOSED_IN + ".cpp":
                yield f"{relative}:{number}: {match.group(0)} is slow to compile: call {DECOMPOSED_IN}.h instead"


def main():
    root = pathlib.Path(sys.argv[1])
    found = [*violations(root), *decompositions(root)]
    for violation in found:
        print(violation)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
