#!/usr/bin/env python3
"""Fails where a program prints other than through common/text/Printable.h, and where a Python program does not start with
guard_output(), which keep control characters from terminals.

usage: printing.py SOURCE_ROOT
"""
import pathlib
import re
import sys

FOLDERS = ("common", "smartsurf", "apron", "shm-protocol/tools", "shm-protocol/hardware/bridge")
RAW = re.compile(r"std::(cout|cerr|clog)\b|\bfmt::print\(|(?<!\w)(printf|puts|perror)\(|\bf(printf|puts|write)\([^;]*\bstd(out|err)\b")
# Files that print constants, numbers or sequences that are meant to control the terminal, and why.
ALLOWED = {
    "common/text/Printable.cpp": "the functions themselves",
    "smartsurf/run/output/Progress.cpp": "redraws its line",
    "apron/run/cli/TerminalMonitor.cpp": "draws a register",
    "apron/run/cli/LanguageServerCommand.cpp": "speaks JSON, which has no control characters",
    "apron/run/main.cpp": "asks whether the output could be written",
    "shm-protocol/tools/shm_dump.cpp": "clears the screen, prints its help",
    "shm-protocol/hardware/bridge/main.cpp": "prints its help and counters",
}


def main(root):
    bad = []
    for folder in FOLDERS:
        for path in sorted((root / folder).rglob("*")):
            name = str(path.relative_to(root))
            if path.suffix in (".cpp", ".h") and name not in ALLOWED:
                for number, line in enumerate(path.read_text().splitlines(), 1):
                    if RAW.search(line.split("//")[0]) and not line.startswith(" *"):
                        bad.append(f"{name}:{number}: prints past common/text/Printable.h: {line.strip()}")
    for path in (*sorted((root / "smartsurf/python/smartsurf").glob("*.py")), root / "scripts/sweep"):
        _, main_part, rest = path.read_text().partition('if __name__ == "__main__":\n')
        if main_part and not rest.startswith("    guard_output()\n"):
            bad.append(f"{path.relative_to(root)}: does not start with guard_output()")
    print("\n".join(bad))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1])))
