from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str
max_cells: int

class Function:
    """A program as a function. Create it with apron.compile().

    f(A=array, B=array, gain=0.5) runs the program from its first line and returns a dict of its results by name:
    registers as arrays of float32 or of their integers (int32, uint16, uint8), scalars as floats.

    An argument is a register or a slider or switch, by its name; the program's `inputs` may also be given without a
    name, in their order. A register takes an array of (rows, columns), row 0 north, column 0 west, or a number for all
    cells. Float32 is taken as it is; booleans, integers and other floats are converted as NumPy's astype(float32)
    does, which rounds integers beyond 2**24 to the nearest float32. A register of integers takes arrays of its own type,
    and those that NumPy casts to it safely: a TypeError otherwise. Registers without an argument are 0; those that
    the program only reads must have one.

    Batches: if arguments have a leading axis, (n, rows, columns), the program runs n times, each time with the next
    plane, and with those arguments as they are that have none. Results then have that axis too, scalars are arrays of
    float64. Each run is what a call of its own would be.

    out: a dict of arrays into which results are written: of the register's type, writable, of the result's shape, of any strides.
    They may share memory with arguments.

    Arguments are never changed. Arrays of apron.empty() and results of 128×128 cells or more are taken without a copy
    where the program permits it: where it does not write the register, has no boundary other than 'zero', and the
    width is a multiple of 64 bytes. Results of that size are given without a copy: their rows lie farther apart than they
    are wide. Smaller ones, and those of batches, are C-contiguous.

    Other Python threads run while the program does, and may call the same function. Ctrl-C ends a run. A child process
    may go on calling after fork(), and a function can be pickled. Errors of a run raise apron.Error with file and line.
    """
    def __init__(self, file: str, text: str | None, include: list[str], library: str, original: str,
                 results: list[str] | None, shape: tuple[int, int] | None, threads: int, ticks: int | None, isa: str) -> None: ...
    def __call__(self, *inputs: ArrayLike, out: Mapping[str, NDArray[Any]] | None = None,
                 **arguments: ArrayLike) -> dict[str, Any]: ...
    def run(self, arguments: dict[str, ArrayLike], out: Mapping[str, NDArray[Any]] | None = None) -> dict[str, Any]:
        """As a call with these arguments, for names that Python's syntax does not allow, such as 'mask.on' and 'out'."""
    @property
    def inputs(self) -> tuple[str, ...]:
        """The registers that the program reads and never writes."""
    @property
    def outputs(self) -> tuple[str, ...]:
        """The registers that the program writes, and its scalars."""
    @property
    def results(self) -> tuple[str, ...]:
        """What a call returns."""
    @property
    def parameters(self) -> dict[str, tuple[float, float, float]]:
        """The sliders and switches: their initial value, lowest and highest."""
    @property
    def file(self) -> str: ...
    @property
    def warnings(self) -> str:
        """What the compiler warns of; "" for nothing."""
    @property
    def threads(self) -> int: ...

def make_array(rows: int, columns: int, dtype: str) -> NDArray[Any]: ...
def make_controllers(file: str, library_path: str, include_paths: list[str], parameters: list[tuple[str, float]]) -> Any: ...
