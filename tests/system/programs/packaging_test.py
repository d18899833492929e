"""An installation works without the checkout."""
import csv
import pty
import re
import select
import shutil

from programs import *

CMAKE = os.environ.get("SMARTSURF_CMAKE", "cmake")


class Packaging(ProgramTest):
    @classmethod
    def setUpClass(cls):
        cls._prefix = tempfile.TemporaryDirectory(prefix="smartsurf-prefix-")
        cls.prefix = pathlib.Path(cls._prefix.name)
        subprocess.run([CMAKE, "--install", str(BIN.parent), "--prefix", str(cls.prefix)], check=True,
                       stdout=subprocess.DEVNULL)
        cls.share = cls.prefix / "share/smartsurf"

    @classmethod
    def tearDownClass(cls):
        cls._prefix.cleanup()

    def installed(self, program, *arguments):
        return self.run_program(str(self.prefix / "bin" / program), *map(str, arguments))

    def test_installed_case_study_runs(self):
        status, _, err = self.installed("smartsurf", "run", self.share / "case-study/sort.lua", "--controller",
                                        self.share / "case-study/sort.aps", "--ticks", 20, "--stats", "stats.json")
        self.assertEqual(status, 0, err)
        self.assertEqual(json.loads((self.folder / "stats.json").read_text())["ticks"], 20)

    def test_demo_runs_the_installed_case_study(self):
        # Modifies the installed copy, to tell it from the one of the checkout.
        script = self.share / "case-study/sort.lua"
        script.write_text(script.read_text() + "\nprint('installed here')\n")
        status, out, err = self.installed("smartsurf", "demo", "--headless")
        self.assertEqual(status, 0, err)
        self.assertIn("installed here", out)

    def test_programs_find_installed_library(self):
        # Modifies the installed copy, to tell it from the one of the checkout.
        library = self.share / "apron/apron.aps"
        library.write_text(library.read_text() + "\n!define(INSTALLED_HERE, 7)\n")
        program = self.write("p.aps", "!include('apron.aps')\nprint(INSTALLED_HERE)\n")
        status, out, err = self.installed("apron", "run", program)
        self.assertEqual((status, out.strip()), (0, "7"), err)

    def test_fake_hardware_finds_shared_library(self):
        status, out, err = self.installed("fake_surface", "--help")
        self.assertEqual(status, 0, err)
        self.assertIn("fake_surface", out + err)

    def test_manual_pages_list_every_flag(self):
        pages = sorted((self.prefix / "share/man/man1").glob("*.1"))
        self.assertEqual(sorted(p.stem for p in pages),
                         ["apron", "device_emulator", "fake_surface", "shm_dump", "smartsurf", "smartsurf-doctor", "surface_bridge"])
        for page in pages:
            text = page.read_text().replace("\\-", "-")
            helps = [self.installed(page.stem, "--help")[1]]
            for command in re.findall(r"^  ([a-z]+) {2,}", helps[0], re.MULTILINE):
                if page.stem in ("smartsurf", "apron"):
                    helps.append(self.installed(page.stem, command, "--help")[1])
            flags = set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", " ".join(helps)))
            self.assertTrue(flags or page.stem == 'smartsurf-doctor', page)
            self.assertEqual(sorted(f for f in flags if f not in text), [], page)

    def test_links_of_installed_pages_are_valid(self):
        pages = sorted((self.prefix / "share/doc/smartsurf").glob("*.md"))
        self.assertGreater(len(pages), 20)
        links = 0
        for page in pages:
            prose = re.sub(r"```.*?```|^    .*?$", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
            for target in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", prose):
                links += 1
                self.assertTrue((page.parent / target).resolve().is_relative_to(self.prefix.resolve()), f"{page} {target}")
                self.assertTrue((page.parent / target).exists(), f"{page.name} links to {target}")
        self.assertGreater(links, 60)
        # Installation changes links only.
        self.assertEqual((self.prefix / "share/doc/smartsurf/tasks.md").read_text(), (ROOT / "docs/tasks.md").read_text())

    def test_completion_offers_commands_and_flags(self):
        script = self.prefix / "share/bash-completion/completions/smartsurf"
        ask = ("source {0}; PATH={1}:$PATH; COMP_WORDS=({2}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); _smartsurf; "
               "echo ${{COMPREPLY[*]}}")
        for typed, expected in (("smartsurf rep", "replay"), ("smartsurf run --scr", "--screenshot"),
                                ("smartsurf run --mode p", "passive"), ("apron di", "disasm")):
            out = subprocess.run(["bash", "-c", ask.format(script, self.prefix / "bin", typed)], text=True,
                                 stdout=subprocess.PIPE, check=True).stdout
            self.assertEqual(out.strip(), expected)

    @unittest.skipUnless(shutil.which("fish"), "fish is not installed")
    def test_fish_completion_offers_commands_and_flags(self):
        for typed, expected in (("smartsurf rep", "replay"), ("smartsurf run --scr", "--screenshot"),
                                ("smartsurf run --mode p", "passive"), ("apron di", "disasm"), ("shm_dump --fo", "--follow")):
            script = self.prefix / "share/fish/vendor_completions.d" / (typed.split()[0] + ".fish")
            out = subprocess.run(["fish", "--no-config", "-c", f"source {script}; complete -C '{typed}'"], text=True,
                                 env={**os.environ, "PATH": f"{self.prefix}/bin:{os.environ['PATH']}"},
                                 stdout=subprocess.PIPE, check=True).stdout
            self.assertEqual([line.split("\t")[0] for line in out.splitlines()], [expected])

    @unittest.skipUnless(shutil.which("zsh"), "zsh is not installed")
    def test_zsh_completion_offers_commands_and_flags(self):
        folder = self.prefix / "share/zsh/site-functions"
        for typed, expected in (("smartsurf rep", b"replay"), ("smartsurf run --scr", b"--screenshot"),
                                ("smartsurf run --mode p", b"passive"), ("apron di", b"disasm")):
            child, terminal = pty.fork()
            if child == 0:
                os.environ.update(PATH=f"{self.prefix}/bin:{os.environ['PATH']}", TERM="dumb")
                os.execvp("zsh", ["zsh", "-f", "-i"])
            os.write(terminal, f"fpath=({folder} $fpath); autoload -Uz compinit; compinit -u -D; print RE''ADY\n".encode())
            self.wait_for_output(terminal, b"READY")
            os.write(terminal, typed.encode() + b"\t")
            self.wait_for_output(terminal, expected)
            os.close(terminal)
            os.waitpid(child, 0)

    def wait_for_output(self, terminal, expected):
        shown = b""

        def is_shown():
            nonlocal shown
            if select.select([terminal], [], [], 0.1)[0]:
                shown += os.read(terminal, 4096)
            return expected in shown
        self.wait_for(is_shown, expected)

    def test_notices_name_all_that_is_linked_or_included(self):
        with open(ROOT / "packaging/third-party.csv", newline="") as file:
            components = [row for row in csv.DictReader(file) if row["use"] != "wheel"]
        folder = self.prefix / "share/doc/smartsurf"
        notices, spdx = (folder / "THIRD-PARTY.txt").read_text(), json.loads((folder / "smartsurf.spdx.json").read_text())
        self.assertEqual({p["name"] for p in spdx["packages"]} - {"smartsurf"}, {row["name"] for row in components})
        for row in components:
            self.assertIn(f"{row['name']} ({row['license']}; {row['use']})", notices)
        self.assertIn("three.js authors", notices)
        libraries = [word for row in components for word in row["library"].split("|") if word]
        for file in [p for p in self.prefix.rglob("*") if p.is_file() and p.read_bytes()[:4] == b"\x7fELF"]:
            needed = subprocess.run(["readelf", "-d", str(file)], text=True, capture_output=True, check=True).stdout
            for library in re.findall(r"\(NEEDED\).*\[(.*)\]", needed):
                own = library.startswith(("libsmartsurf", "libshm_protocol"))
                self.assertTrue(own or library.startswith(tuple(libraries)), f"{file} needs {library}, which no notice names")
        includes = tuple(word for row in components for word in row["include"].split("|") if word)
        rules = (ROOT / "tests/architecture/include_rules.py").read_text()
        private = re.findall(r'r"\^\(?([A-Za-z0-9_]+/?)', rules[rules.index("PRIVATE = ["):rules.index("INCLUDE = ")])
        self.assertGreater(len(private), 8)
        for header in private:
            if header not in ("bt", "EGL", "GL"):
                self.assertTrue(header.startswith(includes) or any(i.startswith(header) for i in includes), header)

    def test_notices_of_a_wheel_name_what_the_linker_took(self):
        link_map, out = self.folder / "smartsurf.map", self.folder / "notices"
        command = [str(ROOT / "packaging/notices"), "--version", "1", "--out", str(out), "--wheel", str(self.folder), "--maps", str(self.folder)]
        link_map.write_text("/prefix/lib/libz.a(inflate.o)\n    common/libcommon_text.a(Printable.o)\n"
                            "/usr/lib/gcc/12/libgcc.a(cpuinfo.o)\nLOAD /prefix/lib/libpng16.a\n")
        self.assertEqual(self.run_program(*command)[0], 0)
        named = set(re.findall(r"(?m)^(.*) \(.*; contained\)$", (out / "THIRD-PARTY.txt").read_text()))
        self.assertEqual(named & {"zlib", "Eigen", "libpng", "Embree"}, {"zlib", "Eigen"})
        link_map.write_text("/prefix/lib/libnew.a(new.o)\n")
        status, _, err = self.run_program(*command)
        self.assertEqual(status, 1)
        self.assertRegex(err, r"\Anotices: packaging/third-party.csv does not name libnew\.a[^\n]*\n\Z")

    def test_doctor_reports_healthy_machine_and_missing_program(self):
        status, out, err = self.installed("smartsurf-doctor")
        self.assertEqual(status, 0, out + err)
        self.assertIn(str(self.prefix / "bin/smartsurf"), out)
        self.assertRegex(out, r"ok    python +numpy \S+ with \S*/lib/python3/dist-packages/shm_protocol\n")
        self.assertNotIn("scripts/", out)
        lonely = self.folder / "bin"
        lonely.mkdir()
        shutil.copy(self.prefix / "bin/smartsurf-doctor", lonely / "doctor")
        shutil.copy(self.prefix / "bin/smartsurf", lonely / "smartsurf")
        status, out, _ = self.finish(subprocess.Popen(
            [str(lonely / "doctor")], env={**os.environ, "PATH": "/usr/bin:/bin"}, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE))
        self.assertEqual(status, 1, out)
        self.assertRegex(out, r"WRONG apron +not found")


if __name__ == "__main__":
    unittest.main()
