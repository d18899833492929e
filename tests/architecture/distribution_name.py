#!/usr/bin/env python3
"""Fails where a message or a page has the reader install `smartsurf` or `apron` of the package index, which are other projects, or
`smartsurf-apron`, which no index is known to have: it is installed from a wheel or a checkout.

usage: distribution_name.py SOURCE_ROOT
"""
import pathlib
import re
import sys

FOLDERS = ("common", "smartsurf", "apron", "shm-protocol", "scripts", "docs", "packaging")
FOREIGN = re.compile(r"pip install (?:-\S+ )*['\"]?(?:smartsurf(?:-apron)?|apron)(?![\w-])")


def main(root):
    bad = []
    for path in sorted([root / "README.md", *(path for folder in FOLDERS for path in (root / folder).rglob("*"))]):
        if path.suffix in (".cpp", ".py", ".md", "") and path.is_file() and path.name != "changelog.md":
            for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1):
                if FOREIGN.search(line):
                    bad.append(f"{path.relative_to(root)}:{number}: install the wheel or the checkout: {line.strip()}")
    print("\n".join(bad))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1])))
