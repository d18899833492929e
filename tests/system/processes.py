"""What a process is doing, so that tests wait for it and not for a time."""
import os
import pathlib


def handles(pid, number):
    """Whether the process has a handler for the signal."""
    try:
        status = pathlib.Path(f"/proc/{pid}/status").read_text()
    except OSError:  # it has ended
        return False
    caught = next(line for line in status.splitlines() if line.startswith("SigCgt:"))
    return bool(int(caught.split()[1], 16) >> (number - 1) & 1)


def fields(pid):
    """What /proc/PID/stat says after the name, from the state on; nothing if the process is gone."""
    try:
        return pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return []


def ended(pid):
    """Whether the process has ended, be it reaped or not."""
    return fields(pid)[:1] in ([], ["Z"])


def children(pid):
    """The processes that its threads have started; none if it is gone."""
    found = []
    for thread in pathlib.Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            found += map(int, thread.read_text().split())
        except OSError:  # it has ended
            pass
    return found


def processor_time(pid):
    """Seconds that the process and those below it have spent in their own code; 0 for those that are gone."""
    found = fields(pid)
    own = int(found[11]) / os.sysconf("SC_CLK_TCK") if found else 0
    return own + sum(map(processor_time, children(pid)))
