"""The commands and messages in the README and the guides are correct."""
import re
import shlex
import sys

from programs import *

PAGES = ["README.md"] + sorted(str(p.relative_to(ROOT)) for p in (ROOT / "docs").glob("*.md"))
PROGRAMS = ["smartsurf", "apron", "shm_dump", "fake_surface", "device_emulator", "surface_bridge"]
LEARNER = "build/venv/bin/python"
LEARNS = any((ROOT / "build/venv").glob("lib/python3*/site-packages/gymnasium"))
PYTHON_CLIENT = {**os.environ, "PYTHONPATH": "build/release/python:shm-protocol/python", "PYTHONDONTWRITEBYTECODE": "1", "SMARTSURF": SMARTSURF,
                 "SHM_PROTOCOL_LIBRARY": str(next(BIN.parent.glob("lib*/**/libshm_protocol_c.so.1")))}


def steps(page):
    """Yields the steps of a page in order: ("write", (file, text)) for a code block that follows a line `file`:, and
    (program, arguments) for indented lines that run our programs, a Python program with our client, or mkdir. A trailing
    backslash joins lines; a trailing & is kept as an argument."""
    text = re.sub(r"\\\n\s*", "", (ROOT / page).read_text())
    for match in re.finditer(r"^`((?:out/)?[\w-]+\.(?:lua|aps|py))`:\n\n```\w*\n(.*?)^```$|"
                             r"^    (?:build/release/bin/(" + "|".join(PROGRAMS) + r")|PYTHONPATH=[\w/:-]*python (python3)|"
                             r"(build/venv/bin/python)(?= scripts/hardware/)|(mkdir)) ([^#\n]*)",
                             text, re.DOTALL | re.MULTILINE):
        file, content, *programs, arguments = match.groups()
        yield ("write", (file, content)) if file else (next(filter(None, programs)), shlex.split(arguments))


def without_pictures(arguments):
    """Removes the flags that a build without the view rejects."""
    flags = ("--screenshot", "--video", "--geometry", "--show")
    drawn = {i + k for i, word in enumerate(arguments) if word in flags for k in (0, 1)}
    return [word for i, word in enumerate(arguments) if i not in drawn]


def datasets(group, path=""):
    for name, item in group.items():
        if hasattr(item, "items"):
            yield from datasets(item, path + "/" + name)
        else:
            yield path + "/" + name, item


class Docs(ProgramTest):
    def test_programs_of_the_language_page_give_what_their_comments_say(self):
        page = (ROOT / "docs/apron-language.md").read_text()
        results = 0
        for number, (language, program) in enumerate(re.findall(r"^```(\w*)\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)):
            if language:
                continue
            file = self.folder / f"{number}.aps"
            file.write_text(program)
            status, out, err = self.finish(self.start(APRON, "check", "--size", "8x8", str(file)))
            self.assertEqual((status, err), (0, ""), program)
            wanted = re.findall(r"^\s*println.*// (.*)$", program, re.MULTILINE)
            results += len(wanted)
            if wanted:
                status, out, err = self.finish(self.start(APRON, "run", "--size", "8x8", str(file)))
                self.assertEqual((status, err, out.splitlines()), (0, "", wanted), program)
        self.assertGreaterEqual(results, 4)

    def test_the_language_page_begins_with_a_program_that_does_what_its_comments_say(self):
        import h5py
        import numpy as np
        page = (ROOT / "docs/apron-language.md").read_text()
        (self.folder / "first.aps").write_text(re.search(r"^```\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)[1])
        (self.folder / "first.lua").write_text(
            "surface { rows = 20, columns = 24, actuator = pin { range = {0, 4} }, sensors = { proximity { range = 6 } } }\n"
            "sphere { radius = 4.6, position = {11, 9, 9}, fixed = true }\nrecord { sensors = true, actuators = true }\n")
        status, _, err = self.run_program(SMARTSURF, "run", "first.lua", "--controller", "first.aps", "--ticks", "3", "--record", "first.h5")
        self.assertEqual(status, 0, err)
        with h5py.File(self.folder / "first.h5") as file:
            def last(name):
                return np.squeeze([item[-1] for path, item in datasets(file) if path.endswith(name)][0])
            seen, height = last("proximity_hit") > 0, last("actuators/height")
        steps, inside = np.zeros(seen.shape), seen
        while inside.any():  # steps to the border, beyond which there is nothing
            steps += inside
            padded = np.pad(inside, 1)
            inside = inside & padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
        self.assertTrue(20 < seen.sum() < 200 and (steps > 2).any())
        np.testing.assert_array_equal(height, np.where(steps > 2, 0, 4))

    def test_commands_of_pages_run_in_order(self):
        # Runs each page in a separate folder with links to the checkout's scripts.
        total = 0
        for page in PAGES:
            folder = self.folder / page.replace("/", "_")
            folder.mkdir()
            for name in ("scripts", "shm-protocol", "smartsurf"):
                (folder / name).symlink_to(ROOT / name)
            (folder / "build").mkdir()
            (folder / "build/release").symlink_to(BIN.parent)
            waiting, behind = None, []
            fresh = 0  # index in `behind` of the first that belongs to the next command
            for program, arguments in steps(page):
                if program == "write":
                    (folder / arguments[0]).write_text(arguments[1])
                    continue
                if program == "mkdir":
                    subprocess.run([program, *arguments], cwd=folder, check=True)
                    continue
                if program == LEARNER and not LEARNS:
                    break  # what follows needs what was learned
                if not WITH_VIEW:
                    if arguments[0] == "replay" and {"--screenshot", "--video"} & set(arguments):
                        continue
                    arguments = without_pictures(arguments)
                if arguments[0] == "compare" and not has_bullet():
                    continue
                total += 1
                if program == "smartsurf" and "--screenshot" in arguments and "--picture-size" not in arguments:
                    arguments += SMALL_PICTURE
                if "--generations" in arguments:  # learning itself is tested elsewhere
                    arguments[arguments.index("--generations") + 1] = "1"
                if "--frames" in arguments:  # identification too; its costs grow with the frames
                    arguments[arguments.index("--frames") + 1] = "200"
                    self.wait_for_claim(arguments[arguments.index("--shm") + 1])  # by what moves the cells
                if "--window" in arguments:
                    arguments[arguments.index("--window")] = "--headless" if program == "smartsurf" else "--threads=1"
                # A surface without a controller waits for the command that follows it. The default name may be in use.
                waits = program == "smartsurf" and arguments[0] == "run" and not {
                    "--controller", "--no-controller", "--help"} & set(arguments)
                if waits and "--shm" not in arguments:
                    arguments += ["--shm", self.shm]
                elif "--shm surface" in " ".join(arguments):
                    arguments[arguments.index("--shm") + 1] = self.shm
                executable = {"python3": sys.executable, LEARNER: str(ROOT / LEARNER)}.get(program, str(BIN / program))
                command = [executable, *(a for a in arguments if a != "&")]

                environment = {**PYTHON_CLIENT, "SMARTSURF_PYTHON": sys.executable} if arguments[0] == "identify" else PYTHON_CLIENT

                def start(command):
                    child = subprocess.Popen(command, cwd=folder, text=True, env=environment, stdout=subprocess.PIPE,
                                             stderr=subprocess.PIPE)
                    self.children.append(child)
                    return child

                child = start(command)
                if arguments[-1] == "&":
                    behind.append(child)
                    continue
                if waits:
                    waiting = child
                    continue
                status, _, err = self.finish(child, 5 * PATIENCE)
                for _ in range(3):
                    if "calibrate again" in err:  # the host was busy for too long; the device has ended with the bridge
                        (folder / arguments[1]).unlink()  # its table: another device has another port
                        for i in range(fresh, len(behind)):
                            behind[i].terminate()
                            behind[i].communicate(timeout=PATIENCE)
                            behind[i] = start(behind[i].args)
                        status, _, err = self.finish(start(command), 5 * PATIENCE)
                if status != 0:  # what began before may tell why
                    for other in behind[fresh:]:
                        other.terminate()
                        err += f"{other.args[0]}: status {other.wait(PATIENCE)}\n{other.communicate()[1]}"
                fresh = len(behind)
                self.assertEqual(status, 0, f"{page}: {program} {' '.join(arguments)}\n{err}")
                if waiting:
                    self.assertEqual(self.finish(waiting)[0], 0, page)
                    waiting = None
            for child in behind:
                status, _, err = self.finish(child)
                self.assertEqual(status, 0, f"{page}: {' '.join(child.args)}\n{err}")
        self.assertGreaterEqual(total, 6)

    def test_troubleshooting_messages_exist_in_sources(self):
        sources = "".join(p.read_text() for folder in ("common", "smartsurf", "apron", "shm-protocol")
                          for ending in ("cpp", "h", "c", "py") for p in sorted((ROOT / folder).rglob(f"*.{ending}")))
        sources += (ROOT / "scripts/setup").read_text()
        sources = re.sub(r'"\s*\n?\s*"', "", sources)  # joins adjacent literals
        page = (ROOT / "docs/troubleshooting.md").read_text()
        messages = re.findall(r"^\| `([^`]+)`", page, re.MULTILINE)
        self.assertGreaterEqual(len(messages), 25)
        for message in messages:
            # Skips the parts that the program fills in: names, numbers and the ellipsis.
            for part in re.split(r"\bNAME\b|\bN\b|\bP\b|…|\"|'\w+'|\d{4}", message):
                self.assertTrue(part.strip(" ?()'") in sources, f"{message}: '{part}' is in no source")


if __name__ == "__main__":
    unittest.main()
