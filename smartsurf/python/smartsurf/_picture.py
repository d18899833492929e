"""Cameras, and pictures and films for notebooks. Needs NumPy only."""
from __future__ import annotations

import base64
import dataclasses
import io
import os
import struct
import zlib
from collections.abc import Iterable, Sequence
from typing import Any, Union

import numpy as np
from numpy.typing import NDArray

from ._files import replaced
from ._surface import real_array

Pixels = NDArray[np.uint8]
Point = tuple[float, float, float]


@dataclasses.dataclass(frozen=True)
class Camera:
    """What a picture shows.

    view: "iso", "top" or "side", from which the whole table fills the picture, or (position, target), two points, u; the
    position is above the target. follow: the label or id of an object that stays in the middle; the camera keeps its direction
    and distance.
    """
    view: Union[str, tuple[Point, Point]] = "iso"
    follow: Union[str, int, None] = None


CameraLike = Union[Camera, str, tuple[Point, Point]]


def core_camera(given: Any, labels: Sequence[str]) -> tuple[str, int]:
    """A camera as the core takes it: its view as text, the id of the object to follow or −1."""
    from ._parameters import object_ids
    camera = given if isinstance(given, Camera) else Camera(given)
    follow = -1
    if camera.follow is not None:
        ids, _ = object_ids(labels, camera.follow)
        if len(ids) > 1:
            raise ValueError(f"camera: {len(ids)} objects are called {camera.follow!r}: follow one, by its id")
        follow = ids[0]
    if isinstance(camera.view, str):
        return camera.view, follow
    try:
        points = np.asarray(camera.view)
    except ValueError:  # rows of different lengths
        points = np.empty(0)
    if points.shape != (2, 3) or points.dtype.kind not in "iuf" or not np.isfinite(points).all():
        raise ValueError(f"camera = {camera.view!r}: must be 'iso', 'top', 'side' or (position, target), two points")
    return ":".join(",".join(repr(float(value)) for value in point) for point in points), follow


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def _lines(pixels: Pixels) -> bytes:
    """The compressed lines of a picture, each after its filter type 0."""
    height, width, _ = pixels.shape
    lines = np.zeros((height, 1 + 3 * width), np.uint8)
    lines[:, 1:] = pixels.reshape(height, 3 * width)
    return zlib.compress(lines.tobytes(), 6)


def png(frames: Sequence[Pixels], period: float = 0.0) -> bytes:
    """A PNG file; of several frames an animated one, which browsers play, each frame for `period` seconds."""
    height, width, _ = _shape(frames)
    out = [b"\x89PNG\r\n\x1a\n", _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))]
    if len(frames) > 1:
        out.append(_chunk(b"acTL", struct.pack(">II", len(frames), 0)))
    number = 0
    for i, frame in enumerate(frames):
        if len(frames) > 1:
            shown = struct.pack(">IIIIIHHBB", number, width, height, 0, 0, round(1000 * period), 1000, 0, 0)
            out.append(_chunk(b"fcTL", shown))
            number += 1
        lines = _lines(np.asarray(frame, np.uint8))
        if i == 0:
            out.append(_chunk(b"IDAT", lines))
        else:
            out.append(_chunk(b"fdAT", struct.pack(">I", number) + lines))
            number += 1
    return b"".join([*out, _chunk(b"IEND", b"")])


def _shape(frames: Sequence[Pixels]) -> tuple[int, int, int]:
    """The shape of all frames; ValueError if they differ."""
    height, width, colours = np.shape(frames[0])
    for i, frame in enumerate(frames):
        if np.shape(frame) != (height, width, colours):
            raise ValueError(f"frame {i} has shape {np.shape(frame)}: must be that of the first, {np.shape(frames[0])}")
    return height, width, colours


def _webp(frames: Sequence[Pixels], period: float) -> bytes:
    """An animated WebP file, which is lossy. Raises ImportError without Pillow."""
    from PIL import Image
    first, *others = (Image.fromarray(frame) for frame in frames)
    file = io.BytesIO()
    first.save(file, "WEBP", save_all=True, append_images=others, duration=round(1000 * period), loop=0)
    return file.getvalue()


def html(data: bytes, width: int, kind: str = "png") -> str:
    return f'<img width="{width}" src="data:image/{kind};base64,{base64.b64encode(data).decode()}"/>'


MAX_PERIOD_S = 65.535  # which an animated PNG has in ms, in 16 bits


def _period(seconds: Any) -> float:
    """The number, or ValueError."""
    if isinstance(seconds, (int, float, np.integer, np.floating)) and not isinstance(seconds, bool) and 0 < seconds <= MAX_PERIOD_S:
        return float(seconds)
    raise ValueError(f"period = {seconds!r}: must be above 0 and at most {MAX_PERIOD_S}, in seconds")


def _picture(frame: Any) -> Pixels:
    """A copy of the picture, or ValueError."""
    array = real_array("frame", frame)
    if array.dtype != np.uint8 or array.ndim != 3 or array.shape[2] != 3 or 0 in array.shape:
        raise ValueError(f"frame has shape {array.shape} and type {array.dtype}: must be height × width × 3, uint8")
    return array.copy()


class Video:
    """Pictures one after the other, such as those of render(): shown by a notebook, as WebP where Pillow is, and written as an
    animated PNG.

    frames: height × width × 3, uint8. period: how long each is shown, s, at most 65.535.
    """

    def __init__(self, frames: Iterable[Pixels] = (), period: float = 1 / 30):
        self.frames: list[Pixels] = [_picture(frame) for frame in frames]
        self.period = _period(period)

    def add(self, frame: Pixels) -> None:
        """Appends a copy of the picture."""
        self.frames.append(_picture(frame))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes an animated PNG, which browsers and notebooks play."""
        if not self.frames:
            raise ValueError("the video has no frames")
        if not os.fsdecode(path).lower().endswith(".png"):
            raise ValueError(f"path = {os.fsdecode(path)!r}: must end in .png: a video is written as an animated PNG")
        with replaced(path) as part:
            part.write_bytes(png(self.frames, self.period))

    def _repr_html_(self) -> str:
        if not self.frames:
            return "a video without frames"
        width = _shape(self.frames)[1]
        try:  # an eighth of the size
            return html(_webp(self.frames, self.period), width, "webp")
        except ImportError:
            return html(png(self.frames, self.period), width)
