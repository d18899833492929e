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

    def simulated(self, *arguments):
        """The board in simavr, behind the bridge and led by a program; skips the test where simavr is missing."""
        flags = subprocess.run(["pkg-config", "--cflags", "--libs", "simavr"], capture_output=True, text=True)
        program = self.folder / "simulated"
        if flags.returncode or subprocess.run(["cc", "-O2", "-std=gnu11", FOLDER / "servo_board_simavr.c", "-o", program, *flags.stdout.split(),
                                               "-lsimavrparts", "-lelf", "-lpthread", "-lutil"], capture_output=True).returncode:
            self.skipTest("no libsimavr-dev")
        board = self.start(str(program), str(self.elf), *arguments)
        line = next((text.split()[1] for text in board.stdout if text.startswith("device ")), None)
        self.assertIsNotNone(line, "the emulator ended")
        self.write("two.aps", "!register(H)\nwhile(1)\n  H = 4 + cell.col * 2 + cell.row\n  surface.actuate('height', H)\n  surface.step\nendwhile\n")
        self.bridge = self.start(str(BRIDGE), line, "--baud", "115200", "--shm", self.shm)
        self.start(APRON, "run", str(self.folder / "two.aps"), "--shm", self.shm, "--wait", "30")
        return board

    def forces(self):
        status, out, _ = self.run_program(str(BIN / "shm_dump"), self.shm, "--json", "--numbers", "--channel", "force")
        channels = json.loads(out)["channels"] if status == 0 else []
        return next((flat(c["values"]) for c in channels if c["name"] == "force" and "values" in c), None)

    def await_forces(self, wanted, seconds=60):
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            force = self.forces()
            if force and max(abs(f - w) for f, w in zip(force, wanted)) < 0.25:
                return
            time.sleep(0.2)
        self.fail(f"{force} instead of {wanted}")

    def status(self):
        return self.run_program(str(BRIDGE), "status", self.shm)[1]

    def arm_in_vain(self):
        """The pins stay safe for the half second in which the bridge arms, and until it stops all boards again."""
        self.run_program(str(BRIDGE), "arm", self.shm)
        until = time.monotonic() + 3
        while time.monotonic() < until:
            self.assertLess(max(self.forces()), 0.25)
        self.assertIn("emergency_stop by board ", self.status())

    def release_and_arm(self, board):
        board.send_signal(signal.SIGUSR2)
        self.run_program(str(BRIDGE), "arm", self.shm)
        self.await_forces(self.LED)

    # Load cells feel 20 mV for each raw height of 0.08 mm: 5 V are 1023 raw values of 0.02 N.
    LED = [(4 + column * 2 + row) / 0.08 * 0.020 / 5 * 1024 * 0.02 for row in range(2) for column in range(4)]
    SAFE = [0] * 8

    def test_pins_go_where_they_are_sent_and_stop_by_the_line(self):
        board = self.simulated()
        self.await_forces(self.LED)
        board.send_signal(signal.SIGUSR1)
        self.await_forces(self.SAFE)
        self.assertIn("emergency_stop by ", self.status())
        self.arm_in_vain()
        self.release_and_arm(board)
        self.assertIsNone(self.bridge.poll())

    def test_line_that_is_pressed_at_power_up_stops(self):
        board = self.simulated("pressed")
        self.await_forces(self.SAFE)
        self.assertIn("emergency_stop by board ", self.status())
        self.arm_in_vain()
        self.release_and_arm(board)


def flat(values):
    return [x for v in values for x in flat(v)] if isinstance(values, list) else [values]


if __name__ == "__main__":
    unittest.main()
