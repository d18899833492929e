"""What scripts that run built programs share: --bin, the folder of these programs, and the blocks of pages that they write."""
import argparse
import os
import pathlib
import shutil
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]


def add_to(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--bin", type=pathlib.Path, metavar="FOLDER", default=os.environ.get("SMARTSURF_BIN", ROOT / "build/release/bin"),
                        help="has the programs [$SMARTSURF_BIN or build/release/bin]")


def require(folder: pathlib.Path, *programs: str) -> None:
    """Ends the script with one line if the folder lacks one of the programs."""
    for program in programs:
        if shutil.which(folder / program) is None:
            print(f"{pathlib.Path(sys.argv[0]).name}: --bin {folder}: has no program {program}", file=sys.stderr)
            sys.exit(2)


def write_block(page: str, name: str, text: str) -> None:
    """Replaces what a page of docs/ has between its marks `<!-- NAME: … -->` and `<!-- end of NAME -->`."""
    path = ROOT / "docs" / page
    old = path.read_text(encoding="utf-8")
    begin = old.index("-->\n", old.index(f"<!-- {name}: ")) + len("-->\n")
    path.write_text(old[:begin] + "\n" + text.strip("\n") + "\n\n" + old[old.index(f"<!-- end of {name} -->"):], encoding="utf-8")
