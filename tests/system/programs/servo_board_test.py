"""The example of a board, servo_board.c: built by avr-gcc; in simavr, behind the bridge."""
import shutil

from programs import *

FOLDER = ROOT / "shm-protocol/hardware/boards"
FIRMWARE = ROOT / "shm-protocol/hardware/firmware"
BRIDGE = BIN / "surface_bridge"


@unittest.skipUnless(shutil.which("avr-gcc"), "no avr-gcc")
class ServoBoard(ProgramTest):
    def setUp(self):
        super().setUp()
        self.elf = self.folder / "board.elf"
        built = subprocess.run(["avr-gcc", "-mmcu=atmega2560", "-DF_CPU=16000000UL", "-Os", "-std=gnu99", "-Wall", "-Wextra", "-Werror",
                                f"-I{ROOT}", f"-I{FIRMWARE}", FOLDER / "servo_board.c", FIRMWARE / "device.c", FIRMWARE / "wire.c",
                                "-o", self.elf], capture_output=True, text=True)
        self.assertEqual((built.returncode, built.stderr), (0, ""))

    def test_fits_the_microcontroller(self):
        self.assertLessEqual(len((FOLDER / "servo_board.c").read_text().splitlines()), 200)
        sizes = subprocess.run(["avr-size", self.elf], capture_output=True, text=True).stdout.splitlines()[1].split()
        text, data, bss = map(int, sizes[:3])
        self.assertLess(text + data, 24 * 1024)
        self.assertLess(data + bss, 2560)  # of 8 kB: the rest is the stack's

    def simulated(self):
        """The board in simavr, and the name of its line; skips the test where simavr is missing."""
        flags = subprocess.run(["pkg-config", "--cflags", "--libs", "simavr"], capture_output=True, text=True)
        program = self.folder / "simulated"
        if flags.returncode or subprocess.run(["cc", "-O2", "-std=gnu11", FOLDER / "servo_board_simavr.c", "-o", program, *flags.stdout.split(),
                                               "-lsimavrparts", "-lelf", "-lpthread", "-lutil"], capture_output=True).returncode:
            self.skipTest("no libsimavr-dev")
        board = self.start(str(program), str(self.elf))
        for line in board.stdout:
            if line.startswith("device "):
                return board, line.split()[1]
        self.fail("the emulator ended")

    def test_pins_go_where_they_are_sent_and_stop_by_the_line(self):
        board, line = self.simulated()
        self.write("two.aps", "!register(H)\nwhile(1)\n  H = 4 + cell.col * 2 + cell.row\n  surface.actuate('height', H)\n  surface.step\nendwhile\n")
        bridge = self.start(str(BRIDGE), line, "--baud", "115200", "--shm", self.shm)
        self.start(APRON, "run", str(self.folder / "two.aps"), "--shm", self.shm, "--wait", "30")
        # Load cells feel 20 mV for each raw height of 0.08 mm: 5 V are 1023 raw values of 0.02 N.
        wanted = [(4 + column * 2 + row) / 0.08 * 0.020 / 5 * 1024 * 0.02 for row in range(2) for column in range(4)]

        def await_forces(wanted, seconds=60):
            force = None
            until = time.monotonic() + seconds
            while time.monotonic() < until:
                status, out, _ = self.run_program(str(BIN / "shm_dump"), self.shm, "--json", "--numbers", "--channel", "force")
                channels = json.loads(out)["channels"] if status == 0 else []
                force = next((flat(c["values"]) for c in channels if c["name"] == "force" and "values" in c), None)
                if force and max(abs(f - w) for f, w in zip(force, wanted)) < 0.25:
                    return
                time.sleep(0.2)
            self.fail(f"{force} instead of {wanted}")

        await_forces(wanted)
        board.send_signal(signal.SIGUSR1)
        await_forces([0] * 8)
        status, out, _ = self.run_program(str(BRIDGE), "status", self.shm)
        self.assertIn("emergency_stop by ", out)
        self.run_program(str(BRIDGE), "arm", self.shm)
        await_forces(wanted)
        self.assertIsNone(bridge.poll())


def flat(values):
    return [x for v in values for x in flat(v)] if isinstance(values, list) else [values]


if __name__ == "__main__":
    unittest.main()
