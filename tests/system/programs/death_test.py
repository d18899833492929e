"""Either program is stopped or killed at an arbitrary time: no hang, no unusable segment, a one-line message."""
import random
import re
import sys

from programs import *

PYTHON_CLIENT = {**os.environ, "PYTHONPATH": str(ROOT / "shm-protocol/python"),
                 "SHM_PROTOCOL_LIBRARY": str(next(BIN.parent.glob("lib*/**/libshm_protocol_c.so.1")))}
# Controllers one after another, each a process that answers so many ticks and then ends in that way.
SHORT_LIVED = """
import os, pathlib, signal, sys, time
import shm_protocol
name, log, plan = sys.argv[1], pathlib.Path(sys.argv[2]), sys.argv[3:]
for answers, end in zip(map(int, plan[::2]), plan[1::2]):
    if child := os.fork():
        os.waitpid(child, 0)
        continue
    with shm_protocol.Controller(name, timeout=60) as table:
        while f"controller attached (process {os.getpid()})" not in log.read_text():
            time.sleep(0.002)
        for _ in range(answers):
            assert table.wait(60)
            table.actuators["height"][:] = 1
            table.publish()
        if end == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        if end == "exit":
            os._exit(1)
    os._exit(0)
"""
DEATHS = int(os.environ.get("SMARTSURF_DEATHS", "1"))  # of each shell command


class Death(ProgramTest):
    def start_surface(self, *flags):
        surface = self.start(SMARTSURF, "run", SORT_LUA, "--shm", self.shm, *flags)
        self.wait_for(self.segment().exists, "the segment")
        return surface

    def start_pair(self, *flags):
        # hold=0: the run does not end early when the objects are sorted.
        surface = self.start_surface(*flags, "--set", "hold=0")
        return surface, self.start(APRON, "run", SORT_APS, "--shm", self.shm, "--wait", "30")

    def test_killed_surface_ends_the_controller_with_status_3(self):
        for delay in (0, 0.05, 0.3):
            surface, controller = self.start_pair("--until", "600")
            self.wait_for_claim()
            time.sleep(delay)
            surface.kill()
            surface.communicate()
            status, _, err = self.finish(controller, 20)
            self.assertEqual(status, 3, err)
            self.assertEqual(len(err.strip().splitlines()), 1, err)
            # The next surface reuses the name without a clean-up.
            again, second = self.start_pair("--ticks", "60")
            self.assertEqual(self.finish(again)[0], 0)
            self.assertEqual(self.finish(second)[0], 0)
            self.assertFalse(self.segment().exists())

    def test_killed_controller_can_be_replaced(self):
        chance = random.Random(5)
        surface, controller = self.start_pair("--until", "200")
        killed = 0  # the claim of the last one
        for _ in range(4):
            self.wait_for(lambda: self.words("claim") not in (0, killed) or surface.poll() is not None, "the claim")
            time.sleep(0.3 * chance.random())
            if surface.poll() is not None:
                break
            killed = self.words("claim")
            controller.kill()
            controller.communicate()
            controller = self.start(APRON, "run", SORT_APS, "--shm", self.shm)
        status, _, err = self.finish(surface)
        self.assertEqual(status, 0, err)
        self.assertIn("the controller is gone", err)
        self.assertIn("controller attached", err)
        self.assertEqual(self.finish(controller)[0], 0)

    def test_each_controller_that_leaves_is_reported_however_early(self):
        plan = [(answers, end) for answers in range(3) for end in ("kill", "exit", "close")]
        random.Random(17).shuffle(plan)
        log, ticks = self.folder / "log", sum(answers for answers, _ in plan) + 30
        with log.open("w") as err:
            surface = self.start(SMARTSURF, "run", str(ROOT / "scripts/examples/pin.lua"), "--shm", self.shm, "--ticks", str(ticks), stderr=err)
        clients = subprocess.run([sys.executable, "-B", "-c", SHORT_LIVED, self.shm, str(log),
                                  *(str(word) for client in (*plan, (30, "close")) for word in client)],
                                 capture_output=True, text=True, timeout=PATIENCE, env=PYTHON_CLIENT)
        self.assertEqual((clients.returncode, clients.stderr), (0, ""))
        self.assertEqual(self.finish(surface)[0], 0, log.read_text())
        said = re.findall("smartsurf: (waiting for|controller attached|the controller is gone)", log.read_text())
        self.assertEqual(said, ["waiting for", "controller attached", "the controller is gone"] * len(plan) + ["waiting for", "controller attached"])

    def test_killed_child_controller_gives_status_3(self):
        surface = self.start(SMARTSURF, "run", SORT_LUA, "--shm", self.shm, "--controller", "exec sleep 600", "--until", "600")
        # The controller is a child of the run's broker, or of an unconfined run itself.
        self.wait_for(self.processes_of_run, "the controller")
        broker = subprocess.run(["pgrep", "-P", str(surface.pid)], capture_output=True, text=True).stdout.split()[0]
        if subprocess.run(["pkill", "-9", "-P", broker], check=False).returncode:
            os.kill(int(broker), signal.SIGKILL)
        status, _, err = self.finish(surface, 20)
        self.assertEqual(status, 3, err)
        self.assertIn("signal 9", err)

    def test_killed_broker_ends_the_run_and_the_controller(self):
        surface = self.start(SMARTSURF, "run", SORT_LUA, "--shm", self.shm, "--controller", "exec sleep 600", "--until", "600")
        self.wait_for(self.processes_of_run, "the controller")
        subprocess.run(["pkill", "-9", "-P", str(surface.pid)], check=False)
        status, _, err = self.finish(surface, 20)
        self.assertEqual((status, err), (1, "smartsurf: the process that names the outputs has ended\n"))

    def test_killed_broker_ends_a_run_without_a_controller(self):
        for signal_number in (signal.SIGKILL, signal.SIGSEGV):
            run = self.start(SMARTSURF, "run", SORT_LUA, "--no-controller", "--until", "1000000", "--stats", "s.json")
            self.wait_for((self.folder / f"s.json.part{run.pid}").exists, "the broker")
            subprocess.run(["pkill", f"-{int(signal_number)}", "-P", str(run.pid)], check=True)
            status, _, err = self.finish(run, 20)
            self.assertEqual((status, err), (1, "smartsurf: the process that names the outputs has ended\n"))

    def processes_of_run(self):
        """The processes that a run's controller has started: they inherit the segment's name."""
        name = f"SMARTSURF_SHM={self.shm}".encode()
        found = []
        for folder in pathlib.Path("/proc").iterdir():
            try:
                if folder.name.isdigit() and name in (folder / "environ").read_bytes().split(b"\0"):
                    found.append((folder / "cmdline").read_bytes())
            except OSError:  # it has ended, or is not ours
                pass
        return [line for line in found if line]

    def test_killed_surface_leaves_no_process_of_a_shell_command(self):
        chance = random.Random(41)
        commands = ("sleep 600; true", "sleep 600 | sleep 600", "sleep 600 & sleep 600", "setsid sleep 600 & wait",
                    "(setsid sleep 600 &); sleep 600", "trap '' TERM; sleep 600; sleep 600")
        for command in commands:
            for _ in range(DEATHS):
                surface = self.start(SMARTSURF, "run", SORT_LUA, "--shm", self.shm, "--controller", command, "--until", "600")
                if chance.random() < 0.8:
                    self.wait_for(self.processes_of_run, "the controller")
                time.sleep(0.3 * chance.random())
                surface.kill()
                surface.communicate()
                self.wait_for(lambda: not self.processes_of_run(), f"the end of what '{command}' has started")

    def test_what_a_shell_command_leaves_ends_with_it(self):
        for command, expected, said in (("setsid sleep 600 & sleep 0.2; exit 7", 1, "status 7"),
                                        ("sleep 600 & sleep 0.2; kill -9 $$", 3, "signal 9")):
            status, _, err = self.run_program(SMARTSURF, "run", SORT_LUA, "--shm", self.shm, "--controller", command, "--until", "600")
            self.assertEqual(status, expected, err)
            self.assertIn(said, err)
            self.assertEqual(self.processes_of_run(), [])

    def test_stopped_surface_ends_what_a_shell_command_has_started(self):
        surface = self.start(SMARTSURF, "run", SORT_LUA, "--shm", self.shm, "--controller", "trap '' TERM; sleep 600 | sleep 600",
                             "--until", "600")
        self.wait_for(self.processes_of_run, "the controller")
        surface.terminate()
        self.assertEqual(self.finish(surface, 20)[0], 143)
        self.assertEqual(self.processes_of_run(), [])

    def test_silent_controller_is_reported_by_both_programs(self):
        program = self.folder / "silent.aps"
        program.write_text("!register(D)\n#again\nD = surface.sense('proximity')\njump(#again)\n")
        log = self.folder / "log"
        with log.open("w") as err:
            surface = subprocess.Popen([SMARTSURF, "run", SORT_LUA, "--shm", self.shm, "--controller", str(program),
                                        "--until", "600"], stdout=err, stderr=err)
        self.children.append(surface)
        self.wait_for(lambda: re.search(r"the controller \(process \d+\) has not answered tick 0 for 2 s", log.read_text()),
                      "the simulator's message")
        self.wait_for(lambda: "the surface has waited 2 s for surface.step" in log.read_text(), "the controller's message")
        surface.terminate()
        surface.wait(120)

    def test_ctrl_c_removes_segment(self):
        for victim in (0, 1):
            pair = self.start_pair("--until", "600")
            self.wait_for_claim()
            self.wait_for_handler(pair[victim], signal.SIGINT)
            pair[victim].send_signal(signal.SIGINT)
            self.assertEqual(self.finish(pair[victim], 20)[0], 130)
            pair[0].send_signal(signal.SIGINT)  # the surface waits for another controller
            self.finish(pair[0], 20)
            self.finish(pair[1], 20)
            self.assertFalse(self.segment().exists())

    def test_sighup_removes_segment_and_finishes_recording(self):
        recording = self.folder / "run.h5"
        pair = self.start_pair("--until", "6000", "--record", str(recording), "--set", "hold=0")
        self.wait_for(lambda: recording.exists() and recording.stat().st_size > 100000, "a recording")
        for child in reversed(pair):
            child.send_signal(signal.SIGHUP)
        for child in pair:
            self.assertEqual(self.finish(child, 20)[0], 129)
        self.assertFalse(self.segment().exists())
        status, out, err = self.run_program(SMARTSURF, "info", str(recording))
        self.assertEqual(status, 0, err)
        self.assertIn("stopped by the user", out)

    def test_sighup_stops_fake_hardware_cleanly(self):
        fake = self.start(str(BIN / "fake_surface"), "--shm", self.shm)
        self.wait_for(self.segment().exists, "the segment")
        self.wait_for_handler(fake, signal.SIGHUP)
        fake.send_signal(signal.SIGHUP)
        self.assertEqual(self.finish(fake, 20)[0], 129)
        self.assertFalse(self.segment().exists())

    def test_nohup_survives_sighup(self):
        pair = (self.start("nohup", SMARTSURF, "run", SORT_LUA, "--shm", self.shm, "--ticks", "120"),
                self.start("nohup", APRON, "run", SORT_APS, "--shm", self.shm, "--wait", "30"))
        for child in pair:  # which ignores SIGHUP from nohup on, and handles SIGTERM
            self.wait_for_handler(child, signal.SIGTERM)
            child.send_signal(signal.SIGHUP)
        for child in pair:
            self.assertEqual(self.finish(child)[0], 0)

    def test_sigterm_of_simulator_ends_its_controller(self):
        recording = self.folder / "run.h5"
        surface = self.start(SMARTSURF, "run", SORT_LUA, "--controller", SORT_APS, "--until", "6000",
                             "--record", str(recording), "--set", "hold=0")
        self.wait_for_claim(f"run-{surface.pid}")
        self.wait_for(recording.exists, "the recording")
        surface.send_signal(signal.SIGTERM)
        self.assertEqual(self.finish(surface, 20)[0], 143)
        self.assertEqual(list(pathlib.Path("/dev/shm").glob(f"smartsurf.run-{surface.pid}*")), [])
        status, out, err = self.run_program(SMARTSURF, "info", str(recording))
        self.assertEqual(status, 0, err)
        self.assertIn("stopped by the user", out)

    def test_killed_run_leaves_readable_recording_and_removable_segment(self):
        recording = self.folder / "run.h5"
        surface, controller = self.start_pair("--until", "6000", "--record", str(recording), "--set", "hold=0")
        self.wait_for_claim()
        self.wait_for(recording.exists, "the recording")
        surface.kill()
        surface.communicate()
        self.assertEqual(self.finish(controller, 20)[0], 3)
        self.assertTrue(self.segment().exists())
        status, out, err = self.run_program(SMARTSURF, "info", str(recording))
        self.assertEqual(status, 0, err)
        for command, message in (((SMARTSURF, "clean", ""), "smartsurf: clean '': must be"), ((str(BIN / "shm_dump"), "--clean="), "--clean=: must be")):
            status, out, err = self.run_program(*command)
            self.assertEqual((status, out), (2, ""))
            self.assertIn(message, err)
        self.assertTrue(self.segment().exists())
        status, out, err = self.run_program(SMARTSURF, "clean", self.shm)
        self.assertEqual(status, 0, err)
        self.assertIn(f"removed {self.shm} ", out)
        self.assertFalse(self.segment().exists())
        for name in (self.shm, "x" * 200):
            self.assertEqual(self.run_program(SMARTSURF, "clean", name), (0, "nothing to remove\n", ""))

    def test_second_surface_and_controller_errors_name_first_process(self):
        surface, controller = self.start_pair("--until", "6000", "--set", "hold=0")
        self.wait_for_claim()
        status, _, err = self.run_program(SMARTSURF, "run", SORT_LUA, "--shm", self.shm)
        self.assertEqual(status, 2)
        self.assertIn(str(surface.pid), err)
        status, _, err = self.run_program(APRON, "run", SORT_APS, "--shm", self.shm)
        self.assertEqual(status, 2)
        self.assertIn(str(controller.pid), err)

    def test_a_filter_of_minutes_hears_the_stop(self):
        for kind in ("register", "int32"):
            program = self.write("filter.aps", f"!{kind}(A, B)\nfilter.create('k', 255, 255)\n"
                                 "for(y, 0, 254)\nfor(x, 0, 254)\nfilter.setElement('k', x, y, 1)\nendfor\nendfor\n"
                                 "A = cell.x\nB = filter.do(A, 'k')\n")
            child = self.start(APRON, "run", program, "--size", "8192x4096")
            self.wait_for_work(child, 2)
            child.send_signal(signal.SIGTERM)
            self.assertEqual(self.finish(child, 60)[0], 128 + signal.SIGTERM)


if __name__ == "__main__":
    unittest.main()
