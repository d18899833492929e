"""Command lines whose mistakes are one line. Needs the standard library only."""
from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import NoReturn


class Parser(argparse.ArgumentParser):
    """Raises ValueError, of one line, instead of ending the process with several."""

    def error(self, message: str) -> NoReturn:
        raise ValueError(message.removeprefix("argument "))


def whole(least: int, most: int = 2**31 - 1) -> Callable[[str], int]:
    """The type of an argument that is a whole number."""
    def parse(text: str) -> int:
        if text.isascii() and text.isdigit() and least <= int(text) <= most:
            return int(text)
        raise argparse.ArgumentTypeError(f"{text}: must be a whole number, {least} to {most}")
    return parse


def _number(text: str) -> float:
    """NaN if the text is no number."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def positive(text: str) -> float:
    """The type of an argument that is a number above 0."""
    if 0 < _number(text) < math.inf:
        return float(text)
    raise argparse.ArgumentTypeError(f"{text}: must be a finite number above 0")


def non_negative(text: str) -> float:
    """The type of an argument that is a number, 0 or above."""
    if 0 <= _number(text) < math.inf:
        return float(text)
    raise argparse.ArgumentTypeError(f"{text}: must be a finite number, 0 or above")


def share(text: str) -> float:
    """The type of an argument that is a number from 0 to 1."""
    if 0 <= _number(text) <= 1:
        return float(text)
    raise argparse.ArgumentTypeError(f"{text}: must be a number, 0 to 1")
