#!/usr/bin/env python3
"""The tables of docs/tasks.md and docs/case-study.md are made as the test plan says, and by today's physics, or say that not."""
import sys

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
        self.assertEqual({table for table, _, _ in tables()}, {"tasks", "vary", "waves", "faults", "case_study", "conditions", "radii", "crowding"})
        for table, _, (made_with, _, _) in tables():
            self.assertIn(made_with, plan.plans_of(table),
                          f"{table}: made with another plan: run scripts/tasks/table --only {table}; a change of the plan gets a new date")

    def test_scenes_are_those_of_the_plan(self):
        now = plan.scene_digests()
        for scene, planned in plan.load()["scenes"].items():
            self.assertEqual(now[scene], planned, f"{scene}.lua differs from the scene of scripts/tasks/frozen.toml: a changed scene gets a new date there")

    def test_a_table_of_another_physics_says_so(self):
        physics = plan.physics_digest(SMARTSURF)
        for table, text, (_, made_by, programs) in tables():
            if (made_by, programs) != (physics, plan.table_programs_digest(table)):
                self.assertIn(plan.OLDER, text, f"{table}: run scripts/tasks/table --only {table}, or --mark")

    def test_comments_do_not_change_a_scene_and_numbers_do(self):
        scene = "local n = 3 -- cells\nsurface { rows = n }\n"
        self.assertEqual(plan.without_comments(scene), plan.without_comments("local n = 3\nsurface { rows = n } -- all\n"))
        self.assertNotEqual(plan.without_comments(scene), plan.without_comments(scene.replace("3", "4")))


if __name__ == "__main__":
    unittest.main()
