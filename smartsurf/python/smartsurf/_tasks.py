"""The tasks of scripts/tasks, which are part of the package, as Gymnasium ids."""
import dataclasses
import pathlib


@dataclasses.dataclass(frozen=True)
class RegisteredTask:
    """A task: its Gymnasium id and its script, which declares surface, reward, success and length of an episode."""
    id: str
    script: str


TASKS = tuple(RegisteredTask(f"smartsurf/{name}-v0", script) for name, script in (
    ("SizeSort", "size_sort.lua"), ("ColourSort", "colour_sort.lua"), ("PartSort", "part_sort.lua"),
    ("Relocate", "relocate.lua"), ("Track", "track.lua"), ("Parallel", "parallel.lua"), ("Packages", "packages.lua"),
    ("Air", "air.lua"), ("Magnets", "magnets.lua"), ("Squeeze", "squeeze.lua"), ("Excitable", "excitable.lua"),
    ("Rain", "rain.lua"), ("Waves", "waves.lua"), ("Parcels", "parcels.lua"),
    ("PushT", "push_t.lua"), ("PushTPins", "push_t_pins.lua"), ("ArraybotLift", "arraybot_lift.lua"), ("ArraybotFlip", "arraybot_flip.lua"),
    ("ArraybotRelocate", "arraybot_relocate.lua"), ("DeltaAlign", "delta_align.lua"), ("SheetCircle", "sheet_circle.lua")))


def task_file(id: str) -> str:
    """The path of a task's script, by its id."""
    for task in TASKS:
        if task.id == id:
            return str(pathlib.Path(__file__).parent / "tasks" / task.script)
    raise ValueError(f"there is no task '{id}'; known: {', '.join(task.id for task in TASKS)}")
