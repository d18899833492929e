"""A virtual display of one's own.

As a program, display.py COMMAND… runs a command on such a display and exits with its status, or on the user's display where
Xvfb is not installed. xvfb-run waits for a signal that it may miss; Xvfb says on a descriptor that it is ready.
"""
import os
import shutil
import subprocess
import sys

HAS_XVFB = shutil.which("Xvfb") is not None


class Display:
    """An X server with one screen, WIDTHxHEIGHT pixels; `name` is the value of DISPLAY."""

    def __init__(self, size="1280x1024"):
        for _ in range(5):  # of two servers that search for a free number at once, one may find none
            read, write = os.pipe()
            # Without -noreset, Xvfb resets when its last client leaves, and refuses connections meanwhile.
            self.server = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", f"{size}x24", "-noreset", "-nolisten",
                                            "tcp"], pass_fds=[write], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            os.close(write)
            with os.fdopen(read) as number:
                self.name = ":" + number.readline().strip()
            if self.name != ":":
                return
            self.close()
        raise RuntimeError("Xvfb does not start")

    def close(self):
        self.server.kill()
        self.server.wait()


if __name__ == "__main__":
    if not HAS_XVFB:
        sys.exit(subprocess.call(sys.argv[1:]))
    display = Display()
    try:
        sys.exit(subprocess.call(sys.argv[1:], env={**os.environ, "DISPLAY": display.name}))
    finally:
        display.close()
