"""Fixtures for tests that run the programs as a user does."""
import ctypes
import json
import os
import pathlib
import platform
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.append(str(ROOT / "tests/system"))
from display import HAS_XVFB, Display  # noqa: E402
from processes import children, ended, fields, handles, processor_time  # noqa: E402

BIN = pathlib.Path(os.environ.get("SMARTSURF_BIN", ROOT / "build/release/bin"))
SMARTSURF, APRON = str(BIN / "smartsurf"), str(BIN / "apron")
SORT_LUA, SORT_APS = str(ROOT / "scripts/case-study/sort.lua"), str(ROOT / "scripts/case-study/sort.aps")
WITH_VIEW = os.environ.get("SMARTSURF_VIEW", "ON") == "ON"
needs_view = unittest.skipUnless(WITH_VIEW, "built without the view")
# Tests may take longer and repeat themselves in further modes: scripts/test --all.
NIGHTLY = bool(os.environ.get("SMARTSURF_NIGHTLY"))
# The processor draws: a picture of the usual size takes seconds.
SMALL_PICTURE = ("--picture-size", "320x200")
# Timeout in seconds, far longer than any of these runs: expiry means that a program hangs.
PATIENCE = 120


def program_seeds(usual):
    """The seeds of random programs, which scripts/check-language sets."""
    first = int(os.environ.get("APRON_PROGRAM_FIRST", "0"))
    return range(first, first + int(os.environ.get("APRON_PROGRAM_SEEDS", usual)))


def has_bullet():
    """Whether the program was built with the second engine."""
    with tempfile.NamedTemporaryFile(suffix=".lua") as scene:
        scene.write(b"surface { rows = 4, columns = 4, actuator = pin {} }")
        scene.flush()
        return subprocess.run([SMARTSURF, "check", scene.name, "--engine", "bullet"], capture_output=True).returncode == 0


CALLS = {"prctl": 157, "setrlimit": 160, "prlimit64": 302, "seccomp": 317, "landlock_create_ruleset": 444}  # of x86_64
needs_call_numbers = unittest.skipUnless(platform.machine() == "x86_64", "the filter has this machine's numbers")


def refusing(*names):
    """For preexec_fn: the filter of a container in which these calls fail with EPERM."""
    refusals = [words for name in names for words in ((0x15, 0, 1, CALLS[name]), (0x06, 0, 0, 0x00050001))]
    code = b"".join(struct.pack("HBBI", *words) for words in ((0x20, 0, 0, 0), *refusals, (0x06, 0, 0, 0x7FFF0000)))
    libc = ctypes.CDLL(None)

    def install():
        libc.prctl(38, 1, 0, 0, 0)  # PR_SET_NO_NEW_PRIVS, which the filter needs
        text = ctypes.create_string_buffer(code, len(code))
        libc.syscall(CALLS["seccomp"], 1, 0, ctypes.create_string_buffer(struct.pack("HxxxxxxQ", len(code) // 8, ctypes.addressof(text))))

    return install


class ProgramTest(unittest.TestCase):
    """A test with a scratch folder. Kills its child processes at the end."""

    def setUp(self):
        self._folder = tempfile.TemporaryDirectory(prefix="smartsurf-test-")
        self.folder = pathlib.Path(self._folder.name)
        self.children = []
        # Unique per test, so that tests can run in parallel.
        self.shm = f"test-{os.getpid()}-{self._testMethodName}"[:44]

    def tearDown(self):
        for child in self.children:
            if child.poll() is None:
                child.kill()
            child.communicate()
        self.segment().unlink(missing_ok=True)  # a killed surface leaves its segment
        self._folder.cleanup()

    def write(self, name, text):
        path = self.folder / name
        path.write_text(text)
        return str(path)

    def start(self, *command, stderr=subprocess.PIPE):
        child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stderr, text=True, cwd=self.folder)
        self.children.append(child)
        return child

    def finish(self, child, patience=PATIENCE):
        """Waits for the child and returns (status, stdout, stderr); fails if it hangs."""
        try:
            out, err = child.communicate(timeout=patience)
        except subprocess.TimeoutExpired:
            self.fail(f"hangs: {child.args}")
        return child.returncode, out, err

    def run_program(self, *command):
        return self.finish(self.start(*command))

    def run_sort(self, *flags, seed=1):
        """Runs the case study and returns its statistics."""
        stats = self.folder / f"stats-{time.monotonic_ns()}.json"
        status, _, err = self.run_program(SMARTSURF, "run", SORT_LUA, "--controller", SORT_APS, "--seed", str(seed),
                                          "--stats", str(stats), *flags)
        self.assertEqual(status, 0, err)
        return json.loads(stats.read_text())

    def wait_for(self, condition, what):
        deadline = time.monotonic() + PATIENCE
        while not condition():
            if time.monotonic() > deadline:
                self.fail(f"timed out waiting for: {what() if callable(what) else what}")
            time.sleep(0.01)

    def wait_for_handler(self, child, number):
        """Waits until the child would handle the signal, which before may end it or be ignored."""
        self.wait_for(lambda: handles(child.pid, number) or child.poll() is not None, f"the handler of signal {number}")

    def wait_for_work(self, child, seconds):
        """Waits until the child and those below it have computed for so long."""
        self.wait_for(lambda: processor_time(child.pid) > seconds or child.poll() is not None, f"{seconds} s of work")

    def wait_for_claim(self, name=None):
        """Waits until the surface has a controller."""
        self.wait_for(lambda: self.words("claim", name) != 0, "the claim")

    def words(self, which, name=None):
        """A word of the surface's header; 0 before there is one."""
        offset = {"claim": 512, "surface": 24, "sensors": 640}[which]
        try:
            with open(self.segment(name), "rb") as file:
                return struct.unpack("<Q", os.pread(file.fileno(), 8, offset))[0]
        except FileNotFoundError:
            return 0

    def segment(self, name=None):
        return pathlib.Path("/dev/shm") / f"smartsurf.{name or self.shm}"


__all__ = ["APRON", "BIN", "Display", "HAS_XVFB", "PATIENCE", "ProgramTest", "ROOT", "SMALL_PICTURE", "SMARTSURF", "SORT_APS", "SORT_LUA", "WITH_VIEW",
           "children", "ended", "fields", "has_bullet", "json", "needs_call_numbers", "needs_view", "NIGHTLY", "os", "pathlib", "program_seeds", "refusing",
           "signal", "subprocess", "tempfile", "time", "unittest"]
