#!/usr/bin/env python3
"""Fails if parts of a folder include each other in a circle, at any level of the tree.

The parts of a folder are its sub-folders and its units; a unit is a source together with its headers (Foo.cpp, Foo.h,
Foo-inl.h). Where no circle exists, the parts lie in layers, each of which uses only what lies below it.

usage: layers.py SOURCE_ROOT
"""
import graphlib
import pathlib
import re
import sys

PROGRAMS = ("common", "shm-protocol", "smartsurf", "apron")
# Folders from which an include is looked up, besides that of the file that contains it.
SEARCH = ("", "shm-protocol/include", "shm-protocol/src", "shm-protocol")
INCLUDE = re.compile(r'^\s*#\s*include\s*"([^"]+)"', re.M)


def unit_or_folder(folder, path):
    """The part of `folder` that contains the file `path`."""
    first, *rest = path.relative_to(folder).parts
    return first + "/" if rest else re.sub(r"(-inl)?\.[a-z]+$", "", first)


def included_files(root, path, files):
    for name in INCLUDE.findall(path.read_text(errors="replace")):
        for folder in (path.parent, *(root / place for place in SEARCH)):
            target = pathlib.Path(folder / name).resolve()
            if target in files:
                yield target
                break


def circles(root):
    """For each folder with a circle: the folder, and the parts in the circle's order, the first one last again."""
    files = {path for program in PROGRAMS for path in (root / program).rglob("*")
             if path.suffix in (".h", ".cpp", ".c")}
    includes = {path: list(included_files(root, path, files)) for path in files}
    for folder in sorted({parent for path in files for parent in path.parents if parent.is_relative_to(root)}):
        graph = {}
        for path, targets in includes.items():
            if path.is_relative_to(folder):
                part = unit_or_folder(folder, path)
                used = {unit_or_folder(folder, target) for target in targets if target.is_relative_to(folder)}
                graph.setdefault(part, set()).update(used - {part})
        try:
            graphlib.TopologicalSorter(graph).prepare()
        except graphlib.CycleError as error:
            yield folder.relative_to(root), error.args[1]


def main():
    root = pathlib.Path(sys.argv[1]).resolve()
    found = list(circles(root))
    for folder, parts in found:
        print(f"{folder}: {' <- '.join(parts)}: these include each other in a circle")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
