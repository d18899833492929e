"""What scripts that run built programs share: --bin, the folder of these programs, and the blocks of pages that they write, with what
made them."""
import argparse
import os
import pathlib
import resource
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


def processor_time() -> float:
    """Of this process and of those that it started and that have ended, in s."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def stamp(physics: str, seconds: float) -> str:
    """The line under a table that docs/reproducing.md reads: the physics that made it, "none" without, and its processor time."""
    return f"<!-- reproduced: physics {physics}, processor time {seconds:.0f} -->\n"


def write_block(page: str, name: str, text: str, physics: str = "none") -> None:
    """Replaces what a page of docs/ has between its marks `<!-- NAME: … -->` and `<!-- end of NAME -->`, with the stamp of this process."""
    path = ROOT / "docs" / page
    old = path.read_text(encoding="utf-8")
    begin = old.index("-->\n", old.index(f"<!-- {name}: ")) + len("-->\n")
    path.write_text(old[:begin] + "\n" + text.strip("\n") + "\n\n" + stamp(physics, processor_time()) + "\n" + old[old.index(f"<!-- end of {name} -->"):], encoding="utf-8")
