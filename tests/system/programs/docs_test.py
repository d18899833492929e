"""Every command that the README and the guides show works as shown."""
import re

from programs import *

PAGES = ["README.md"] + sorted(str(p.relative_to(ROOT)) for p in (ROOT / "docs").glob("*.md"))


def steps(page):
    """What a reader of the page does, in order: ("write", file, text) where a line `file`: stands before a block of
    code, and (program, arguments) for the indented lines that call our programs; a trailing backslash joins lines."""
    text = re.sub(r"\\\n\s*", "", (ROOT / page).read_text())
    for match in re.finditer(r"^`([\w-]+\.(?:lua|aps|py))`:\n\n```\w*\n(.*?)^```$|^    build/release/bin/(smartsurf|apron) ([^#\n]*)",
                             text, re.DOTALL | re.MULTILINE):
        file, content, program, arguments = match.groups()
        yield ("write", (file, content)) if file else (program, arguments.split())


class Docs(ProgramTest):
    def test_the_commands_of_the_pages_run_in_the_order_shown(self):
        # Each page is followed in a folder of its own that holds the checkout's scripts.
        total = 0
        for page in PAGES:
            folder = self.folder / page.replace("/", "_")
            folder.mkdir()
            (folder / "scripts").symlink_to(ROOT / "scripts")
            waiting = None
            for program, arguments in steps(page):
                if program == "write":
                    (folder / arguments[0]).write_text(arguments[1])
                    continue
                total += 1
                if "--window" in arguments:
                    arguments[arguments.index("--window")] = "--headless"
                child = subprocess.Popen([str(BIN / program), *arguments], cwd=folder, text=True,
                                         stdout=subprocess.PIPE, stderr=subprocess.PIPE)
                self.children.append(child)
                # A surface without a controller waits for the command that follows it.
                if program == "smartsurf" and arguments[0] == "run" and not {
                        "--controller", "--no-controller", "--help"} & set(arguments):
                    waiting = child
                    continue
                status, _, err = self.finish(child)
                self.assertEqual(status, 0, f"{page}: {program} {' '.join(arguments)}\n{err}")
                if waiting:
                    self.assertEqual(self.finish(waiting)[0], 0, page)
                    waiting = None
        self.assertGreaterEqual(total, 6)

    def test_the_messages_of_the_troubleshooting_page_are_in_the_programs(self):
        sources = "".join(p.read_text() for house in ("smartsurf", "apron", "shm-protocol")
                          for p in sorted((ROOT / house).rglob("*.cpp")))
        sources = re.sub(r'"\s*\n?\s*"', "", sources)  # texts that go on in the next line
        page = (ROOT / "docs/troubleshooting.md").read_text()
        messages = re.findall(r"^\| `([^`]+)`", page, re.MULTILINE)
        self.assertGreaterEqual(len(messages), 8)
        for message in messages:
            # What a program fills in is left out: names, numbers, and the ellipsis.
            for part in re.split(r"\bNAME\b|\bN\b|\bP\b|…|\"|'\w+'", message):
                self.assertIn(part.strip(" ?()'"), sources, message)

    def test_links_between_the_pages_lead_somewhere(self):
        for page in PAGES + ["shm-protocol/PROTOCOL.md"]:
            # Code is not prose: a C++ lambda looks like a link.
            prose = re.sub(r"```.*?```|^    .*?$", "", (ROOT / page).read_text(), flags=re.DOTALL | re.MULTILINE)
            for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", prose):
                self.assertTrue(((ROOT / page).parent / target).exists(), f"{page} links to {target}")


if __name__ == "__main__":
    unittest.main()
