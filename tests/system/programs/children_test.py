"""Processes that a program starts: none of them hangs, or stays behind, whichever of them is killed or misbehaves."""
import shutil

from programs import *

WAVE = str(ROOT / "scripts/examples/wave.lua")
TABLE = "surface { rows = 4, columns = 4, actuator = pin {} }\nsphere { radius = 1, position = {1, 1, 3} }\n"


class Process:
    """A process of the tree, told from a later one of the same number."""

    def __init__(self, pid):
        self.pid = pid
        self.started = self._fields()[1]
        self.command = pathlib.Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")

    def _fields(self):
        after_name = fields(self.pid)
        return after_name[0], int(after_name[19])

    def lives(self):
        try:
            state, started = self._fields()
        except (OSError, IndexError):
            return False
        return started == self.started and state not in "ZX"


def tree(root):
    """The process and all below it, each after its parent."""
    found, pids = [], [root]
    for pid in pids:
        try:
            found.append(Process(pid))
        except (OSError, IndexError):  # it has ended
            continue
        pids += children(pid)
    return found


class ChildrenTest(ProgramTest):
    # Programs in the place of ffmpeg; $last is the file.
    STALLS_HALFWAY = 'head -c 200000 > "$last"; sleep 1000000; exit 0'  # as a child of the shell

    def setUp(self):
        super().setUp()
        self.path = os.environ["PATH"]
        (self.folder / "work").mkdir()

    def tearDown(self):
        self.kill_all()  # or what a failed test leaves would hold the pipes
        super().tearDown()

    def kill_all(self):
        """All that works in the test's folder."""
        killed = True
        while killed:  # what was killed may have started another meanwhile
            killed = False
            for entry in pathlib.Path("/proc").iterdir():
                try:
                    if entry.name.isdigit() and (entry / "cwd").readlink() == self.folder / "work":
                        os.kill(int(entry.name), signal.SIGKILL)
                        killed = True
                except OSError:
                    pass

    def ffmpeg(self, body, folder="bin"):
        program = self.folder / folder / "ffmpeg"
        program.parent.mkdir(exist_ok=True)
        program.write_text(f"#!/bin/sh\nfor last; do :; done\n{body}\n")
        program.chmod(0o755)
        self.path = f"{program.parent}:{os.environ['PATH']}"

    def start(self, *command, stderr=subprocess.PIPE, limit_kib=None):
        if limit_kib:
            command = ("/bin/sh", "-c", f'ulimit -v {limit_kib}; exec "$@"', "sh", *command)
        child = subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE, stderr=stderr, text=True,
                                 cwd=self.folder / "work", env={**os.environ, "PATH": self.path})
        self.children.append(child)
        return child

    def left(self):
        return sorted(path.name for path in (self.folder / "work").iterdir())

    def wave(self, until="0.25"):
        recording = self.folder / "wave.h5"
        if not recording.exists():
            status, _, err = self.run_program(SMARTSURF, "run", WAVE, "--no-controller", "--record", recording, "--until", until)
            self.assertEqual(status, 0, err)
        return recording

    def start_video(self, name, *command):
        return self.start(*command, "--video", name, *SMALL_PICTURE)

    def fails(self, reason, child, patience=PATIENCE):
        status, _, err = self.finish(child, patience)
        self.assertEqual(status, 2, err)
        self.assertRegex(err, f"^smartsurf: {reason}[^\n]*\n$")


class Children(ChildrenTest):
    def kill_each(self, start, is_whole, killed_broker_leaves=()):
        """Runs the command, kills the process of that place in its tree, and expects nothing to stay."""
        place, places = 0, 1
        while place < places:
            child = start()
            self.wait_for(lambda: is_whole(tree(child.pid)), "the processes")
            processes = tree(child.pid)
            places = len(processes)
            killed = processes[place]
            place += 1
            if killed.command.startswith(("sleep", "head")):  # what a foreign program has started is its own affair
                self.clear(child)
                continue
            with self.subTest(killed=f"{place - 1}: {killed.command[:60]}", of=[p.command[:30] for p in processes]):
                os.kill(killed.pid, signal.SIGKILL)
                status, _, err = self.finish(child)
                self.assertNotEqual(status, 0)
                self.wait_for(lambda: not [p for p in processes if p.lives()],
                              lambda: f"the end of {[p.command for p in processes if p.lives()]}")
                # The broker names and removes files; nobody else may.
                may_stay = killed_broker_leaves if "smartsurf" in killed.command and place > 1 else ()
                self.wait_for(lambda: all(name.startswith(may_stay) for name in self.left()), lambda: f"the removal of {self.left()}")
            self.clear(child)
        return places

    def clear(self, child):
        """Ends the child with its tree, and removes what a killed one has left."""
        self.kill_all()
        child.wait(PATIENCE)
        for path in (self.folder / "work").iterdir():
            shutil.rmtree(path) if path.is_dir() else path.unlink()

    @staticmethod
    def runs(*commands):
        return lambda processes: all(any(p.command.startswith(command) for p in processes) for command in commands)

    @needs_view
    def test_replay_to_a_video(self):
        self.ffmpeg(self.STALLS_HALFWAY)
        recording = self.wave()
        self.assertGreaterEqual(self.kill_each(
            lambda: self.start(SMARTSURF, "replay", recording, "--video", "v.mp4", "--screenshot", "v.png@0.2", *SMALL_PICTURE),
            self.runs("sleep 1000000")), 5)

    @needs_view
    def test_run_to_a_video(self):
        self.ffmpeg(self.STALLS_HALFWAY)
        for free in ((), ("--unsafe",)) if NIGHTLY else ((),):
            with self.subTest(free=free):
                self.kill_each(lambda: self.start(SMARTSURF, "run", SORT_LUA, "--until", "1000", "--controller", SORT_APS, "--shm",
                                                  self.shm, "--video", "v.mp4", *SMALL_PICTURE, *free),
                               self.runs("sleep 1000000", APRON), ("v.mp4.part",))

    def test_controller_command(self):
        script = self.write("s.lua", TABLE)
        for free in ((), ("--unsafe",)):
            with self.subTest(free=free):
                self.kill_each(lambda: self.start(SMARTSURF, "run", script, "--controller",
                                                  "trap '' TERM; sleep 2000000 & sleep 3000000; exit 3", "--shm", self.shm, *free),
                               self.runs("sleep 2000000", "sleep 3000000"))


class Encoders(ChildrenTest):
    @needs_view
    def test_encoders_that_misbehave(self):
        """All at once, because most of them are waited for."""
        stalls, exits, ends = "ffmpeg made no progress", "ffmpeg", "ffmpeg failed"
        misbehaviours = (('cat > "$last"; sleep 1000000', stalls), ("exec sleep 1000000", stalls), (self.STALLS_HALFWAY, stalls),
                         ("exit 1", exits), ('cat > "$last"; exit 1', ends), ("kill -9 $$", exits))
        started = []
        for number, (body, reason) in enumerate(misbehaviours):
            self.ffmpeg(body, f"bin{number}")
            for command in ((SMARTSURF, "replay", self.wave()), (SMARTSURF, "run", WAVE, "--no-controller", "--until", "0.25")):
                name = f"{command[1]}{number}.mp4"
                started.append((body, command[1], f"{name}: {reason}", self.start_video(name, *command)))
        for body, command, reason, child in started:
            with self.subTest(ffmpeg=body, command=command):
                self.fails(reason, child)
        self.assertEqual(self.left(), [])

    @needs_view
    def test_slow_encoders_are_waited_for(self):
        self.ffmpeg('cat > "$last"; for i in 1 2 3 4 5 6 7 8 9 10 11 12 13; do timeout 0.1 sh -c "while :; do :; done"; sleep 0.9; done')
        status, _, err = self.run_program(SMARTSURF, "replay", self.wave(), "--video", "v.mp4", *SMALL_PICTURE)
        self.assertEqual((status, err, self.left()), (0, "", ["v.mp4"]))

    @needs_view
    @unittest.skipUnless(shutil.which("ffmpeg"), "needs ffmpeg")
    def test_little_memory(self):
        recording = self.wave()
        for limit_mib in (300, 320, 340, 360, 400):
            with self.subTest(mib=limit_mib):
                child = self.start(SMARTSURF, "replay", recording, "--video", "v.mp4", *SMALL_PICTURE, limit_kib=limit_mib * 1024)
                processes = []

                def ended():
                    processes.extend(p for p in tree(child.pid) if p.pid not in [q.pid for q in processes])
                    return child.poll() is not None
                self.wait_for(ended, "the end")
                _, err = child.communicate()
                self.assertIn(child.returncode, (0, 1, 2), err)
                if child.returncode != 0:
                    self.assertRegex(err, r"(?m)^smartsurf: .*\n\Z")
                self.assertEqual(self.left(), ["v.mp4"] if child.returncode == 0 else [])
                self.assertEqual([p.command for p in processes if p.lives()], [])
                for path in (self.folder / "work").iterdir():
                    path.unlink()


@needs_view
class EndlessEncoder(ChildrenTest):
    """Takes a minute of processor time."""

    def test_is_ended(self):
        self.ffmpeg("while :; do :; done")
        self.fails("v.mp4: ffmpeg made no progress", self.start_video("v.mp4", SMARTSURF, "replay", self.wave()), patience=900)
        self.assertEqual(self.left(), [])


if __name__ == "__main__":
    unittest.main()
