from __future__ import annotations

import re

_PLACE = re.compile(r"(?P<file>.+?):(?P<line>\d+)(?::(?P<column>\d+))?: ")


class Error(ValueError):
    """An error in a program, or of a program while it runs. The text is that of the command `apron`:
    "file:line:column: error: …", for the compiler's errors with the line and a caret below the column.

    file, line, column: the place of the first error; None where there is none, as column is for errors of a run."""

    def __init__(self, message: str):
        super().__init__(message)
        place = _PLACE.match(message)
        self.file: str | None = place and place["file"]
        self.line: int | None = place and int(place["line"])
        self.column: int | None = int(place["column"]) if place and place["column"] else None
