"""The test plan of docs/tasks.md, docs/case-study.md and docs/learning.md, frozen.toml, and the mark under the tables of the
first two that says what made them.

    python3 scripts/tasks/plan.py            prints the digests of all scenes, for frozen.toml
"""
import functools
import hashlib
import json
import pathlib
import re
import sys
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent.parent / "smartsurf/python"))

from smartsurf.run import run  # noqa: E402

CASE_STUDY = HERE.parent / "case-study"
FILE = HERE / "frozen.toml"
OUTDATED = "*Outdated: made with another version of the physics or the programs.*\n"


def load():
    with FILE.open("rb") as file:
        return tomllib.load(file)


def what_counts(text):
    """The text of a Lua or APRON file with comments, spaces and ranges of options left out: what can change a result."""
    text = re.sub(r"--\[\[.*?\]\]|--[^\n]*|//[^\n]*", "", text, flags=re.DOTALL)
    text = re.sub(r"\s+", " ", text)
    return re.sub(r"(\boption\([^(){}]*), \{[^{}]*\}\)", r"\1)", text)


def digest(*texts):
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:16]


def with_included(path, known):
    """Adds to the list `known` the file and those that it requires, loads or includes."""
    if path.is_file() and path not in known:
        known.append(path)
        pattern = r"['\"]([\w./-]+)['\"]" if path.suffix == ".lua" else r"(?m)^!include\('([^']+)'\)"
        for word in re.findall(pattern, path.read_text()):
            for name in (word, f"{word}.lua"):
                with_included((path.parent / name).resolve(), known)
    return known


def scene_files():
    """The files of each experiment of the plan: its own, and those that it requires or loads."""
    return {name: with_included((CASE_STUDY if name == "sort" else HERE) / f"{name}.lua", []) for name in load()["scenes"]}


def scene_digests():
    return {name: digest(*(what_counts(path.read_text()) for path in files)) for name, files in scene_files().items()}


def table_programs_digest(name):
    """The digest of the programs that control a table's runs."""
    plan = load()
    names = {"tasks": plan["tasks"], "vary": [*plan["tasks"], *plan["small"]], "nuisances": [*plan["nuisances"]["tasks"], *plan["small"]],
             "waves": ["waves"], "faults": ["relocate", "size_sort"], "logistics": ["hexsort"]}.get(name)
    programs = [HERE / f"{task}.aps" for task in names] if names else sorted(CASE_STUDY.glob("*.aps"))
    files = []
    for program in programs:
        with_included(program, files)
    return digest(*(what_counts(file.read_text()) for file in files))


def section_digest(name):
    """The digest of the part of the plan that a table is made with: its section, the first seeds and its scenes."""
    plan = load()
    section = plan[name]
    rows = section.get("rows", section)
    scenes = {"tasks": list(rows), "vary": list(plan["tasks"]), "nuisances": plan["nuisances"]["tasks"], "waves": ["waves"], "faults": ["relocate", "size_sort"],
              "logistics": ["movers", "hexsort"]}.get(name, ["sort"])
    parts = [section]
    if name in ("vary", "nuisances"):  # with the horizons and successes of other sections
        parts += [{task: plan["tasks"][task] for task in scenes}, plan["small"]]
        scenes = [*scenes, *plan["small"]]
    return digest(json.dumps([*parts, plan["first_seed"], {scene: plan["scenes"][scene] for scene in scenes}], sort_keys=True))


PINS_ALONE = ("case_study", "conditions", "crowding", "radii", "faults")  # the tables whose scenes hold pins and nothing that drives


@functools.cache
def state_of(probe, smartsurf):
    return run(HERE / f"{probe}.lua", until=3, threads=1, smartsurf=smartsurf)["state_hash"]


def physics_digest(smartsurf, table=""):
    """The digest of the states that the probes end in: a change of the physics changes it."""
    pins = state_of("probe", smartsurf)
    return pins if table in PINS_ALONE else digest(pins, state_of("probe_driven", smartsurf))


CHANGED = "*`scripts/tasks/frozen.toml` lists the changes of this table's plan, with earlier results.*\n"


def changes(name):
    """The line below a table whose plan was changed."""
    return ["\n" + CHANGED] if any(entry["table"] == name for entry in load()["changed"]) else []


CHANGES = re.compile(f"(?:\n{re.escape(CHANGED[:-1])}\n)*(?=\n<!-- made with plan )")


def plans_of(name):
    """The digests of the plan with which a table may have been made: the current one, and one that a change names."""
    return {section_digest(name), *(entry["made_with"] for entry in load()["changed"] if entry["table"] == name and "made_with" in entry)}


def mark(name, smartsurf):
    """The line under a table."""
    return f"\n<!-- made with plan {section_digest(name)}, physics {physics_digest(smartsurf, name)}, programs {table_programs_digest(name)} -->\n"


MARK = re.compile(r"<!-- (\w+): written by scripts/tasks/table -->(?:(?!<!-- end of).)*?"
                  r"<!-- made with plan (\w+), physics (\w+), programs (\w+) -->\n", re.DOTALL)


def marks(page):
    """By the name of each table of a page: the plan, physics and programs that made it."""
    return {found[1]: found.groups()[1:] for found in MARK.finditer(page)}


def mark_outdated(docs, pages, smartsurf):
    """Adds a sentence to the tables that another physics or other programs made, and takes it from the others; renews the line
    about changes of the plan."""
    def marked(found):
        text = CHANGES.sub(lambda _: "".join(changes(found[1])), found[0].removesuffix("\n" + OUTDATED), count=1)
        is_current = found.groups()[2:] == (physics_digest(smartsurf, found[1]), table_programs_digest(found[1]))
        return text if is_current else text + "\n" + OUTDATED
    for page in pages:
        (docs / page).write_text(re.sub(f"{MARK.pattern}(?:\n{re.escape(OUTDATED)})?", marked, (docs / page).read_text(), flags=re.DOTALL))


if __name__ == "__main__":
    for scene, value in scene_digests().items():
        print(f'{scene} = "{value}"')
