"""The folder of built programs, --bin, of the scripts that run them."""
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
