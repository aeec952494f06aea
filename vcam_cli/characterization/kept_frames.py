"""The frames of the bench as TIFF files, with descriptor files of the EMVA 1288 program.

A descriptor lists images by exposure time [ns] and photons per pixel, in the format of version 1.0
of the reference implementation of the standard (https://github.com/EMVA1288/emva1288): `n` bits,
width and height; `b` light, `d` dark; `i` an image. Two images of a kind are for temporal noise,
more for nonuniformity. That program measures one color on one grid, so every color of a mosaic has
a folder and a descriptor of its own; one with several pixels in the block has one for each.

The program wants light for every exposure time, and one pair of dark frames at each, so that dark
frames of other times and further pairs stand there as comments.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal, Protocol

from vcam_cli.arrays import Array
from vcam_cli.characterization.bench import Bench
from vcam_cli.files.atomic import write_text
from vcam_cli.files.images.tiff import whole_numbers, write_tiff

DESCRIPTOR = "emva1288.txt"
Kind = Literal["pair", "stack", "dark"]


class Keeper(Protocol):
    """What is shown the frames of flat fields as they are taken."""

    def add(self, bench: Bench, kind: Kind, electrons: float, time: float, frame: Array) -> None:
        """Take a frame (rows, columns) [DN] of a mean signal [e] and an exposure time [s]."""

    def finish(self) -> None:
        """Take note that there are no more."""


class NoFrames:
    """A keeper that keeps nothing."""

    def add(self, bench: Bench, kind: Kind, electrons: float, time: float, frame: Array) -> None:
        """Do nothing."""

    def finish(self) -> None:
        """Do nothing."""


class FrameFiles:
    """A keeper that writes files.

    Parameters
    ----------
    new_file : function
        What gives a path to write to for a name.
    """

    def __init__(self, new_file: Callable[[str], Path]) -> None:
        self._new_file = new_file
        self._groups: dict[tuple[Kind, float, float], int] = {}
        self._texts: dict[str, list[str]] = {}
        self._last: tuple[Kind, float, float] | None = None

    def add(self, bench: Bench, kind: Kind, electrons: float, time: float, frame: Array) -> None:
        """Write the pixels of every color of a frame."""
        group = kind, electrons, time
        number = self._groups[group] = self._groups.get(group, -1) + 1
        level = list(self._groups).index(group)
        bits = (2**bench.ready.camera.adc.bits - 1 + bench.pedestal).bit_length()
        for color in bench.colors:
            slices = list(bench.color_slices(color))
            for place, (rows, columns) in enumerate(slices, start=1):
                pixels = frame[rows, columns]
                folder = f"frames/{color}{place if len(slices) > 1 else ''}"
                text = self._texts.setdefault(
                    folder, [f"n {bits} {pixels.shape[1]} {pixels.shape[0]}"]
                )
                photons = electrons / bench.efficiency(color)
                comment = "# " if kind == "dark" else ""
                if group != self._last:
                    light = f"b {time * 1e9:.12g} {photons:.12g}"
                    text.append(comment + (light if electrons else f"d {time * 1e9:.12g}"))
                name = f"{kind}_{level:03d}_{number:02d}.tif"
                text.append(f"{comment}i {name}")
                codes = whole_numbers(pixels, 2.0**bits)
                said = f"{time:.9g} s, {photons:.9g} photons, {electrons:.9g} e"
                write_tiff(self._new_file(f"{folder}/{name}"), codes, said)
        self._last = group

    def finish(self) -> None:
        """Write the descriptors."""
        head = "# simulated; image, exposure [ns], photons per pixel\nv 4.0\n"
        for folder, lines in self._texts.items():
            write_text(self._new_file(f"{folder}/{DESCRIPTOR}"), head + "\n".join(lines) + "\n")
