"""The live page: states are those of the programs, in Node and in headless Chromium. Nothing is built here."""
import importlib.machinery
import importlib.util
import random
import shutil

from browser import CHROMIUM, Browser
from programs import *

PAGE, BUILT = ROOT / "build/live.html", ROOT / "build/web/bin/live.js"
NODE = shutil.which("node")
needs_page = unittest.skipUnless(PAGE.exists() and BUILT.exists(), "the live page is not built: scripts/live-page")


def load_script():
    path = str(ROOT / "scripts/live-page")
    loader = importlib.machinery.SourceFileLoader("live_page", path)
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("live_page", loader))
    loader.exec_module(module)
    return module


EXPERIMENTS = load_script().EXPERIMENTS


class LivePage(ProgramTest):
    def native_hash(self, script, program, seed, seconds):
        stats = self.folder / "stats.json"
        status, _, err = self.run_program(SMARTSURF, "run", str(ROOT / script), *(["--controller", str(ROOT / program), "--shm", self.shm] if program else
                                          ["--no-controller"]), "--seed", str(seed), "--until", str(seconds), "--stats", str(stats))
        self.assertEqual(status, 0, err)
        return json.loads(stats.read_text())["state_hash"]

    @needs_page
    @unittest.skipUnless(NODE, "node is not installed")
    def test_node_reaches_the_states_of_the_programs(self):
        draw = random.Random(42)
        for title, script, program, _ in EXPERIMENTS:
            seed, seconds = draw.randrange(1, 10**6), draw.choice([2, 3, 4])  # air.lua has its least gap after a second
            with self.subTest(title, seed=seed, seconds=seconds):
                ran = subprocess.run([NODE, ROOT / "smartsurf/web/live/node.js", BUILT, str(seconds), str(seed), script,
                                      *([program] if program else [])], cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE)
                self.assertEqual(ran.returncode, 0, ran.stderr)
                self.assertEqual(json.loads(ran.stdout.splitlines()[-1])["hash"], self.native_hash(script, program, seed, seconds))

    @needs_page
    @unittest.skipUnless(CHROMIUM, "chromium is not installed")
    def test_browser_runs_edits_and_ends_scripts(self):
        browser = Browser(self.folder, PAGE)
        try:
            self.wait_for(lambda: browser.value("!!window.live && live.time > 0.2"), "the case study runs by itself")
            self.wait_for(lambda: browser.value("live.scene.rows === 64 && live.scene.objects.length === 40 && live.shown === 0"),
                          "its table is drawn")
            self.assertGreater(len(browser.screenshot()), 30_000, "the picture is empty")
            browser.click("#play")
            # A busy browser answers before it has handled the click.
            self.wait_for(lambda: browser.value("[live.running, document.getElementById('play').textContent]") == [False, "Run"], "it pauses")
            for index, seconds in ((0, 1), (1, 2)):
                _, script, program, _ = EXPERIMENTS[index]
                browser.value(f"live.until({index}, '9', {seconds})")
                self.wait_for(lambda: browser.value("live.hash && live.hash.hash"), f"{script} arrives")
                self.assertEqual(browser.value("live.hash.hash"), self.native_hash(script, program, 9, seconds))
            self.check_errors(browser)
            self.assertEqual(browser.errors, [])
        finally:
            browser.close()

    def run_texts(self, browser, script, program):
        browser.value(f"document.getElementById('script').value = {json.dumps(script)}")
        browser.value(f"document.getElementById('program').value = {json.dumps(program)}")
        browser.click("#apply")

    def check_errors(self, browser):
        """The line is the programs', but for their name and the folder."""
        plate = "surface { rows = 4, columns = 4, actuator = pin {}, sensors = { proximity {} } }\n"
        for script in ("surface { rows = 0, columns = 4, actuator = pin {} }", plate + "on_tick(function() no_such() end)\n"):
            path = self.write("magnets.lua", script)
            status, _, err = self.run_program(SMARTSURF, "run", path, "--no-controller", "--until", "1")
            self.assertNotEqual(status, 0)
            self.run_texts(browser, script, "")
            self.wait_for(lambda: browser.value("live.errors.length === 1"), "the error is shown")
            line = browser.value("live.errors[0]")
            self.assertTrue(line.startswith("scripts/tasks/magnets.lua"), line)
            self.assertIn(line.removeprefix("scripts/tasks/"), err)
            self.assertEqual(browser.value("document.getElementById('program-name').textContent"), "no program")
            self.assertLess(browser.value("live.time"), 0.1, "the clock of the run before")
        self.run_texts(browser, plate, "!register(A)\nA = ;\n")
        self.wait_for(lambda: browser.value("live.errors.length === 1"), "the program's error is shown")
        self.assertEqual(browser.value("document.getElementById('program-name').textContent"), "scripts/tasks/magnets.aps")
        self.assertRegex(browser.value("live.errors[0]"), r"^scripts/tasks/magnets.aps:\d+:\d+: error: ")


if __name__ == "__main__":
    unittest.main()
