#!/usr/bin/env python3
"""The tables of docs/tasks.md and docs/case-study.md are made as the test plan says, and by the current physics, or say that not."""
import fnmatch
import importlib.machinery
import importlib.util
import re
import sys
from unittest import mock

from programs import *

sys.path.insert(0, str(ROOT / "scripts/tasks"))
import plan  # noqa: E402


def tables():
    """Of each table: its text on the page, and the plan, physics and programs that made it."""
    for name in ("tasks.md", "case-study.md"):
        page = (ROOT / "docs" / name).read_text()
        for table, mark in plan.marks(page).items():
            yield table, page.partition(f"<!-- {table}: written")[2].partition(f"<!-- end of {table}")[0], mark


class Tables(unittest.TestCase):
    def test_every_table_has_its_plan(self):
        self.assertEqual({table for table, _, _ in tables()},
                         {"tasks", "logistics", "vary", "nuisances", "waves", "faults", "case_study", "conditions", "radii", "crowding"})
        for table, _, (made_with, _, _) in tables():
            self.assertIn(made_with, plan.plans_of(table),
                          f"{table}: made with another plan: run scripts/tasks/table --only {table}; a change of the plan gets a new date")

    def test_a_horizon_belongs_to_every_table_that_is_made_with_it(self):
        before = {table: plan.section_digest(table) for table in ("tasks", "vary", "nuisances", "logistics")}
        for section, task, tables in (("tasks", "relocate", {"tasks", "vary", "nuisances"}), ("small", "movers", {"vary", "nuisances"})):
            changed = plan.load()
            changed[section][task]["until_s"] += 1
            with mock.patch.object(plan, "load", return_value=changed):
                self.assertEqual({table for table, digest in before.items() if plan.section_digest(table) != digest}, tables)

    def test_scenes_are_those_of_the_plan(self):
        now = plan.scene_digests()
        for scene, planned in plan.load()["scenes"].items():
            self.assertEqual(now[scene], planned, f"{scene}.lua differs from the scene of scripts/tasks/frozen.toml: a changed scene gets a new date there")

    def test_a_table_of_another_physics_says_so(self):
        for table, text, (_, made_by, programs) in tables():
            if (made_by, programs) != (plan.physics_digest(SMARTSURF, table), plan.table_programs_digest(table)):
                self.assertIn(plan.OUTDATED, text, f"{table}: run scripts/tasks/table --only {table}, or --mark")

    def test_a_change_of_the_plan_is_said_once_below_a_table(self):
        changed = {entry["table"] for entry in plan.load()["changed"]}
        for table, text, _ in tables():
            self.assertEqual(text.count(plan.CHANGED), int(table in changed), f"{table}: run scripts/tasks/table --mark")
        with tempfile.TemporaryDirectory() as folder:
            page = pathlib.Path(folder) / "case-study.md"
            text = (ROOT / "docs/case-study.md").read_text()
            at = text.index("\n" + plan.CHANGED, text.index("<!-- radii: written"))
            for lines in ("", 2 * ("\n" + plan.CHANGED)):
                page.write_text(text[:at] + lines + text[at + 1 + len(plan.CHANGED):])
                plan.mark_outdated(page.parent, [page.name], SMARTSURF)
                block = page.read_text().partition("<!-- radii: written")[2].partition("<!-- end of radii")[0]
                self.assertEqual(block.count(plan.CHANGED), 1)

    def test_marks_of_tables_that_others_write_stay(self):
        with tempfile.TemporaryDirectory() as folder:
            page = pathlib.Path(folder) / "a.md"
            for name, _, _ in tables():
                mark = f"<!-- {name}: written by scripts/tasks/table -->\n<!-- made with plan 0, physics 0, programs 0 -->\n"
                page.write_text(f"<!-- x: written by me -->\n\n{plan.OUTDATED}\n<!-- end of x -->\n{mark}\n{plan.OUTDATED}\n<!-- end of {name} -->\n")
                plan.mark_outdated(page.parent, [page.name], SMARTSURF)
                self.assertEqual(page.read_text().count(plan.OUTDATED), 2, name)

    def test_comments_do_not_change_a_scene_and_numbers_do(self):
        scene = "local n = 3 -- cells\nsurface { rows = n }\n"
        self.assertEqual(plan.what_counts(scene), plan.what_counts("local n = 3\nsurface { rows = n } -- all\n"))
        self.assertNotEqual(plan.what_counts(scene), plan.what_counts(scene.replace("3", "4")))

    def test_a_range_of_an_option_does_not_change_a_scene_and_a_default_does(self):
        scene = "local n, m = option('n', 3, 'rows', { 1, 9 }), option('m', 1.5)\n"
        self.assertEqual(plan.what_counts(scene), plan.what_counts("local n, m = option('n', 3, 'rows'), option('m', 1.5)\n"))
        self.assertNotEqual(plan.what_counts(scene), plan.what_counts(scene.replace("3", "4")))


class Reproducing(unittest.TestCase):
    """docs/reproducing.md lists every table and picture, and a table of another physics is found."""

    @classmethod
    def setUpClass(cls):
        loader = importlib.machinery.SourceFileLoader("reproduce", str(ROOT / "scripts/reproduce"))
        spec = importlib.util.spec_from_loader("reproduce", loader)
        cls.reproduce = importlib.util.module_from_spec(spec)
        loader.exec_module(cls.reproduce)
        cls.tables = cls.reproduce.listing()["table"]

    def test_what_writes_a_table_writes_its_processor_time(self):
        # These make a table in parts, or are no Python: scripts/reproduce measures them.
        others = {"scripts/learn/table", "scripts/learn/curves", "scripts/truth", "scripts/tasks/engines", "scripts/bench", "scripts/hardware/blind",
                  "scripts/hardware/loop/loop", "scripts/check-bare-machine", "scripts/check-faults", "scripts/check-arm"}
        commands = {table["command"].split()[0] for table in self.tables}
        without = {name for name in commands if not re.search(r"built\.(write_block|stamp)\(", (ROOT / name).read_text())}
        self.assertEqual(without, others)
        with tempfile.TemporaryDirectory() as folder:
            script = (f"import pathlib, sys; sys.path.insert(0, {str(ROOT / 'scripts')!r}); import built; built.ROOT = pathlib.Path({folder!r})\n"
                      "while built.processor_time() < 0.6: pass\nbuilt.write_block('a.md', 'x', '| 1 |')")
            page = pathlib.Path(folder) / "docs/a.md"
            page.parent.mkdir()
            page.write_text("# A\n\n<!-- x: written by me -->\n\n| 0 |\n\n<!-- end of x -->\n\nEnd\n")
            subprocess.run([sys.executable, "-B", "-c", script], check=True)
            text = page.read_text()
            self.assertEqual(text, "# A\n\n<!-- x: written by me -->\n\n| 1 |\n\n<!-- reproduced: physics none, processor time 1 -->\n\n"
                                   "<!-- end of x -->\n\nEnd\n")
            self.assertEqual(self.reproduce.made_by(text), (("none"), "1"))

    def stale(self, docs):
        """The tables of a folder of pages that another physics made, or none knows which, and that do not say so."""
        found = []
        for table in self.tables:
            if "physics" not in table:
                continue
            text = (docs / table["page"]).read_text()
            begin, end = self.reproduce.block_of(text, table["block"])
            made_by, _ = self.reproduce.made_by(text[begin:end])
            today = plan.physics_digest(SMARTSURF, self.reproduce.PROBES[table["physics"]])
            if made_by != today and (made_by is None or plan.OUTDATED not in text[begin:end]):
                found.append(self.reproduce.name_of(table))
        return found

    def test_every_generated_block_is_listed(self):
        blocks = {f"{page.stem}/{name}" for page in (ROOT / "docs").glob("*.md")
                  for name in re.findall(r"<!-- ([\w-]+): written by ", page.read_text())}
        self.assertEqual(blocks - {"reproducing/list"}, {self.reproduce.name_of(table) for table in self.tables})

    def test_every_picture_is_listed(self):
        patterns = [image for entry in (*self.tables, self.reproduce.listing()["pictures"]) for image in entry.get("images", ())]
        for page in [*(ROOT / "docs").glob("*.md"), ROOT / "README.md"]:
            for image in re.findall(r"\]\((?:docs/)?images/([^)]+)\)", page.read_text()):
                self.assertTrue(any(fnmatch.fnmatch(image, pattern) for pattern in patterns), f"{page.name}: {image}")

    def test_commands_exist(self):
        for table in self.tables:
            self.assertTrue(os.access(ROOT / table["command"].split()[0], os.X_OK), table["command"])

    def test_no_table_is_outdated_unsaid(self):
        self.assertEqual(self.stale(ROOT / "docs"), [], "run scripts/reproduce NAME…, or scripts/reproduce --mark")

    def test_a_table_of_another_physics_is_found(self):
        with tempfile.TemporaryDirectory() as folder:
            docs = pathlib.Path(folder)
            for page in {table["page"] for table in self.tables}:
                text = (ROOT / "docs" / page).read_text().replace("\n" + plan.OUTDATED, "")
                (docs / page).write_text(re.sub(r"physics \w+(, p)", r"physics 0123456789abcdef\1", text))
            self.assertEqual(sorted(self.stale(docs)), sorted(self.reproduce.name_of(table) for table in self.tables if "physics" in table))

    def test_list_is_current(self):
        page = (ROOT / "docs/reproducing.md").read_text()
        for table in self.tables:
            self.assertIn(f"`{table['command']}`", page)


if __name__ == "__main__":
    unittest.main()
