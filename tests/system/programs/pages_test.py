"""The pages are consistent with each other and with the programs: links, files, flags and Lua names."""
import re

from programs import *

PAGES = ["README.md", "shm-protocol/PROTOCOL.md", "shm-protocol/hardware/BYTE-PROTOCOL.md"] + sorted(str(p.relative_to(ROOT)) for p in (ROOT / "docs").glob("*.md"))
# Flags of third-party programs in commands on the pages.
FOREIGN = {"--build", "--preset", "--target", "--install", "--prefix", "--component", "--cflags", "--libs", "--shm-size",
           "--time", "--partition", "--exclusive", "--strict"}
# Written by the commands of the pages.
MADE = ("build/", "out/")


def text_of(page):
    return (ROOT / page).read_text()


def prose_of(page):
    """The page without code, because a C++ lambda looks like a link."""
    return re.sub(r"```.*?```|^    .*?$", "", text_of(page), flags=re.DOTALL | re.MULTILINE)


def anchors_of(page):
    """The anchors that web sites generate for Markdown headings."""
    found = set()
    for heading in re.findall(r"^#+ +(.*)$", re.sub(r"```.*?```", "", text_of(page), flags=re.DOTALL), re.MULTILINE):
        plain = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).lower()
        found.add(re.sub(r"[^\w\- ]", "", plain).replace(" ", "-"))
    return found


class Pages(ProgramTest):
    def test_links_lead_to_existing_files_and_headings(self):
        links = 0
        for page in PAGES:
            for target, anchor in re.findall(r"\]\(([^)#:\s]*)(?:#([^)]*))?\)", prose_of(page)):
                links += 1
                file = (ROOT / page).parent / target if target else ROOT / page
                self.assertTrue(file.exists(), f"{page} links to {target}")
                if anchor:
                    self.assertIn(anchor, anchors_of(file.resolve().relative_to(ROOT)), f"{page} links to {target}#{anchor}")
        self.assertGreater(links, 60)

    def test_pictures_are_small(self):
        for picture in sorted((ROOT / "docs/images").iterdir()):
            self.assertLess(picture.stat().st_size, 1_000_000, picture.name)

    def test_every_page_is_in_the_index(self):
        index = text_of("docs/README.md")
        for page in PAGES[3:]:
            if page != "docs/README.md":
                self.assertIn(f"({pathlib.Path(page).name})", index, page)

    def test_architecture_lists_the_stages_of_a_step(self):
        table = re.findall(r'^    {"([a-z ]+)", ', text_of("smartsurf/world/NativeEngineStep.cpp"), re.MULTILINE)
        listed = re.findall(r"^\d\. \*(?:Inputs|Contacts|Motion|Outputs)\*: (.*?)\.$", text_of("docs/architecture.md"),
                            re.MULTILINE | re.DOTALL)
        stages = re.sub(r"\s+", " ", ", ".join(listed)).split(", ")
        self.assertGreater(len(table), 20)
        self.assertEqual(stages, table)

    def test_named_files_exist(self):
        for page in PAGES:
            for path in re.findall(r"(?<![\w./-])((?:scripts|docs|tests|smartsurf|apron|shm-protocol|packaging|cmake)/[\w./-]*\w)",
                                   text_of(page)):
                if re.fullmatch(r"smartsurf/[A-Z]\w*-v\d+", path):  # an environment's id
                    continue
                there = (ROOT / path).exists() or list(ROOT.glob(f"{path}.*"))
                self.assertTrue(there, f"{page} names {path}")

    def test_named_flags_exist(self):
        known = set(FOREIGN)
        for program, commands in (("smartsurf", "run record replay info plot export check clean compare new demo train identify fmu"),
                                  ("apron", "run check compile disasm fmt repl debug lsp")):
            for command in commands.split():
                known |= self.flags_of(str(BIN / program), command, "--help")
        for program in ("shm_dump", "fake_surface", "surface_bridge", "device_emulator"):
            known |= self.flags_of(str(BIN / program), "--help")
        scripts = [p for p in (ROOT / "scripts").iterdir() if p.is_file()]
        for folder in ("scripts/boards", "scripts/cluster", "scripts/hardware", "scripts/learn", "scripts/tasks"):
            scripts += [p for p in (ROOT / folder).iterdir() if p.is_file()]
        scripts += (ROOT / "tests/bench").rglob("*.cpp")
        for script in scripts:
            known |= set(re.findall(r"--[a-z][a-z-]*", script.read_text()))
        for page in PAGES:
            named = set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", text_of(page)))
            self.assertEqual(sorted(named - known), [], page)

    def test_command_line_page_lists_exactly_all_flags(self):
        rows = re.findall(r"^\| `(\w+)(?: ([a-z]+))?[^`]*` \|.*\|([^|]*)\|$", text_of("docs/cli.md"), re.MULTILINE)
        self.assertEqual(len(rows), 27)
        for program, command, flags in rows:
            there = self.flags_of(str(BIN / program), *([command] if command else []), "--help")
            shown = set(re.findall(r"--[a-z][a-z-]*", flags))
            self.assertEqual(shown - {"--help"}, there - {"--help"}, f"{program} {command}")

    def test_manual_page_has_every_command_and_flag_of_the_command_line_page(self):
        manual = text_of("packaging/man/smartsurf.1").replace("\\-", "-")
        rows = re.findall(r"^\| `smartsurf ([a-z]+)[^`]*` \|.*\|([^|]*)\|$", text_of("docs/cli.md"), re.MULTILINE)
        self.assertGreater(len(rows), 12)
        for command, flags in rows:
            self.assertRegex(manual, rf"(?m)^\.B smartsurf {command}\b", "synopsis")
            self.assertRegex(manual, rf"(?m)^\.B {command}$", "commands")
            for flag in re.findall(r"--[a-z][a-z-]*", flags):
                self.assertRegex(manual, rf"{flag}(?![\w-])", command)

    def flags_of(self, *command):
        status, out, err = self.run_program(*command)
        self.assertEqual(status, 0, err)
        return set(re.findall(r"--[a-z][a-z-]*", out))


def words_of_code(text):
    return set(re.findall(r"\w+(?:\.\w+)?", " ".join(re.findall(r"`[^`\n]+`|^    .*$|^```.*?^```", text, re.DOTALL | re.MULTILINE))))


class RecordingReference(ProgramTest):
    def test_every_name_in_a_recording_is_documented(self):
        import h5py
        path = self.write("all.lua", "surface { rows = 4, columns = 4, sensors = { colour {} }, border = { height = 2 },\n"
                                     "  skin = { edge = { height = 0 } } }\nrecord { sensors = true, actuators = true }\nvary { friction = {0, 1} }\nlocal n = option('n', 1)\nmetric('kept', 1)\n"
                                     "sphere { radius = 1, position = {1, 1, 2} }\n"
                                     "hull { points = {{0,0,0}, {1,0,0}, {0,1,0}, {0,0,1}}, position = {2, 2, 4} }\n")
        status, _, err = self.run_program(SMARTSURF, "run", path, "--no-controller", "--ticks", "2", "--record", "all.h5",
                                          "--set", "n=2")
        self.assertEqual(status, 0, err)
        names = set()
        with h5py.File(self.folder / "all.h5") as file:
            # Excludes names chosen by scripts and libraries.
            file.visititems(lambda name, item: names.update(
                [name.split("/")[-1]] + ([] if name.startswith(("meta/options", "meta/set", "meta/vary", "meta/varied", "meta/versions", "meta/metrics")) else list(item.attrs))))
        names -= {"0", "colour", "kept"}
        self.assertGreater(len(names), 60)
        self.assertEqual(sorted(names - words_of_code(text_of("docs/recordings.md"))), [])


class LuaReference(ProgramTest):
    """Obtains the valid names from the program: an unknown name makes it list them."""

    PAGES = ("experiments", "actuators", "sensors", "objects")
    TABLE = "surface { rows = 2, columns = 2 }\n"
    ACTUATORS = ("pin", "ball", "wheels", "conveyor", "rotor", "force_field", "magnet", "air_jet", "tile", "delta")
    SENSORS = ("proximity", "colour", "object_type", "light", "pressure", "camera", "pin_height", "joint_position", "tip_force",
               "skin_height", "skin_strain", "skin_contact")

    def names_known(self, script):
        path = self.write("asks.lua", script)
        _, _, err = self.run_program(SMARTSURF, "run", path, "--no-controller", "--ticks", "1")
        known = re.search(r"'qqqqqq'; known: (.*)$", err.strip())
        self.assertTrue(known, err)
        return known[1].split(", ")

    def assert_documented(self, what, names):
        pages = "".join(text_of(f"docs/{page}.md") for page in self.PAGES)
        self.assertGreater(len(names), 0)
        self.assertEqual(sorted(set(names) - words_of_code(pages)), [], what)

    def test_declarations(self):
        for name in ("world", "material", "surface", "faults", "record"):
            self.assert_documented(name, self.names_known(f"{name} {{ qqqqqq = 1 }}\n"))

    def test_nuisances(self):
        self.assert_documented("vary", self.names_known(f"{self.TABLE}vary {{ qqqqqq = {{0, 1}} }}\n"))

    def test_objects(self):
        for name in ("sphere", "box", "cylinder", "capsule", "cone", "hull", "mesh"):
            self.assert_documented(name, self.names_known(f"{self.TABLE}{name} {{ qqqqqq = 1 }}\n"))

    def test_actuators_and_sensors(self):
        for name in self.ACTUATORS:
            script = f"surface {{ rows = 2, columns = 2, actuator = {name} {{ qqqqqq = 1 }} }}\n"
            self.assert_documented(name, self.names_known(script))
        for name in self.SENSORS:
            script = f"surface {{ rows = 2, columns = 2, sensors = {{ {name} {{ qqqqqq = 1 }} }} }}\n"
            self.assert_documented(name, self.names_known(script))

    def test_methods(self):
        ball = self.TABLE + "sphere { radius = 1, position = {0, 0, 0} }\n"
        for call in ("cells.qqqqqq", "object(0).qqqqqq", "object(0):push { qqqqqq = 1 }", "object(0):teleport { qqqqqq = 1 }"):
            self.assert_documented(call, self.names_known(f"{ball}at(0, function() return {call} end)\n"))

    def test_globals(self):
        path = self.write("globals.lua", self.TABLE + "for name in pairs(_G) do print(name) end\n")
        status, out, err = self.run_program(SMARTSURF, "run", path, "--no-controller", "--ticks", "1")
        self.assertEqual(status, 0, err)
        lua = set("_G _VERSION assert collectgarbage coroutine debug error getmetatable io ipairs load math next os pairs "
                  "pcall rawequal rawget rawlen rawset select setmetatable string table tonumber tostring type utf8 warn "
                  "xpcall".split())
        ours = sorted(set(out.split()) - lua)
        self.assertLessEqual(set(self.ACTUATORS + self.SENSORS + ("option", "metric", "on_leave")), set(ours))
        self.assert_documented("globals", ours)


class Site(ProgramTest):
    @unittest.skipUnless((ROOT / "build/site-venv/bin/mkdocs").exists(), "no MkDocs: scripts/setup --site")
    def test_site_is_whole(self):
        for name in ("run.html", "live.html"):
            (self.folder / name).write_text("<p>a page</p>")
        site = str(ROOT / "scripts/site")
        status, out, err = self.run_program(site, "-o", str(self.folder / "site"), "--player", str(self.folder / "run.html"),
                                            "--live", str(self.folder / "live.html"))
        self.assertEqual((status, out), (0, f"wrote {self.folder}/site/index.html\n"), err)
        for page in (ROOT / "docs").glob("*.md"):
            name = "index" if page.stem == "README" else page.stem
            self.assertTrue((self.folder / f"site/{name}.html").exists(), name)
        self.assertIn("player.html", (self.folder / "site/index.html").read_text())
        self.assertIn('src="live.html"', (self.folder / "site/first-surface.html").read_text())
        self.assertIn("step(", re.sub("<[^>]*>", "", (self.folder / "site/api-smartsurf.html").read_text()))
        for page in (self.folder / "site").glob("*.html"):
            self.assertNotRegex(page.read_text(), r'<(script|link)[^>]*(src|href)="https?://(?!squidfunk)', page.name)
        status, out, err = self.run_program(site, "--player", "none.html")
        self.assertEqual((status, out, len(err.splitlines())), (2, "", 1), err)


if __name__ == "__main__":
    unittest.main()
