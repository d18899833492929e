#!/usr/bin/env python3
"""Fails where a source of the live page uses what libc++ 13 and smartsurf/web/libcxx lack: a view, or an algorithm of std::ranges.

usage: web_library.py SOURCE_ROOT
"""
import pathlib
import re
import sys

USE = re.compile(r"std::(?:ranges::views|views|ranges)::(\w+)")
# Names of std::ranges that libc++ 13 has.
THERE = {"begin", "end", "data", "size", "empty", "range_value_t", "equal_to", "greater", "less"}


def main(root):
    web = (root / "cmake/Web.cmake").read_text()
    folders = re.findall(r"add_subdirectory\(((?:common|smartsurf|apron)\S*)\)", " ".join(web.split()))
    for each in re.findall(r"foreach\(\w+ ([^)]*)\)", " ".join(web.split())):
        folders += [name for name in each.split() if (root / name / "CMakeLists.txt").exists()]
    if not folders:
        print("web_library: cmake/Web.cmake names no folder")
        return 1
    added = (root / "smartsurf/web/libcxx/algorithm").read_text()
    known = THERE | set(re.findall(r"\w+", added))  # macros define some
    bad = []
    for folder in dict.fromkeys(folders):
        for path in sorted((root / folder).glob("**/*")):
            if path.suffix in (".cpp", ".h"):
                for number, line in enumerate(path.read_text().splitlines(), 1):
                    for found in USE.finditer(line.split("//")[0]):
                        if "views" in found[0] or found[1] not in known:
                            bad.append(f"{path.relative_to(root)}:{number}: the live page's library has no {found[0]} "
                                       "(smartsurf/web/libcxx/README.md)")
    print("\n".join(bad))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1])))
