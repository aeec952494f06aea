"""What a frame costs with a graphics processor, by stage, and what stays with the processor.

The constants are of one measured card: no device has to be there to estimate its time.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from vcam_cli.effects.base import of_kind
from vcam_cli.effects.signal_chain import ElectronEffect, Quantizer
from vcam_cli.image_formation.estimates.light_cost import filter_work
from vcam_cli.image_formation.optical_path import SpectrumReport
from vcam_cli.records import dataclass
from vcam_cli.simulation.cost_model import slowness, threads
from vcam_cli.simulation.preparation import Prepared

CARD = "NVIDIA H100"
"""Card that the constants were measured on, by `make bench-gpu`."""
START = 2.5
"""Opening the device and compiling its kernels, once in a process [s]."""
LIGHT = 3.2e-11
"""One sample of one plane transformed and filtered, or one pixel of one color evaluated: 2.3 ms for
a batch of one 12-megapixel picture of three planes and three colors [s]."""
CHARGE = 8.3e-11
"""One pixel through noise and ADC: a further exposure of 12 megapixels takes 1.0 ms [s]."""
COPY = 2e-11
"""One byte from or to pinned memory: pairs of 512 x 512 pixels that are copied, at 6 bytes a pixel,
take 32 us longer than those that are not [s]."""
REAL, CODE, PLACE = 4, 2, 16
"""Bytes of a number, of a code, and of a place of a moving image."""


@dataclass(frozen=True)
class DeviceCost:
    """Seconds of a frame with a graphics processor."""

    card: str
    """Card of the constants."""
    start: float
    """Opening the device, once in a process [s]."""
    light: float
    """Transforms and filters [s]."""
    charge: float
    """Charge, noise and codes [s]."""
    copies: float
    """Copies between the device and the processor [s]."""
    processor: float
    """All that stays with the processor of this machine [s]."""
    stays: tuple[str, ...]
    """Names of what stays with it."""

    @property
    def further(self) -> float:
        """A frame that is not the first of its process [s]."""
        return self.light + self.charge + self.copies + self.processor

    @property
    def first(self) -> float:
        """The first frame [s]."""
        return self.start + self.further

    def report(self) -> dict[str, Any]:
        """Return what `vcam plan --json` prints."""
        return asdict(self)


def device_cost(ready: Prepared, workers: int) -> DeviceCost:
    """Return the seconds of a frame with a graphics processor.

    Parameters
    ----------
    ready : Prepared
        The camera, ready to take its frame.
    workers : int
        Number of threads of the processor.
    """
    lattice, plan = ready.layout.lattice, ready.plan
    pixels, colors = lattice.rows * lattice.columns, len(ready.layout.mosaic.colors)
    work = filter_work(lattice, colors, ready.spectrum)
    acting: tuple[ElectronEffect | Quantizer, ...] = of_kind(plan.active, ElectronEffect, Quantizer)
    moved = work.seconds + pixels * sum(effect.pixel_seconds for effect in acting)
    # Samples go there and light comes back; light goes there again, electrons and codes come back.
    copied = REAL * (work.samples + work.values) + PLACE * work.looks
    copied += pixels * (2 * REAL + CODE)
    return DeviceCost(
        card=CARD,
        start=START,
        light=LIGHT * (work.samples + work.values),
        charge=CHARGE * pixels,
        copies=COPY * copied,
        processor=max(plan.seconds - moved * slowness() / threads(workers), 0.0),
        stays=left_to_processor(ready),
    )


def left_to_processor(ready: Prepared) -> tuple[str, ...]:
    """Return what the processor computes of a frame whatever the device, in the order of the light.

    Parameters
    ----------
    ready : Prepared
        The camera, ready to take its frame.
    """
    report = ready.spectrum
    every = _reports(report)
    filtered = [own for own in every if own.terms]
    named = {
        "light in closed form": not (filtered or report.sub_exposures),
        "painting through distortion": any(own.warped_cells for own in every),
        "painting of charts": any(own.is_painted and not own.warped_cells for own in every),
        "spectra in closed form": any(not (own.cells or own.is_averaged) for own in filtered),
        "surroundings of the array": any(own.far_parts for own in every),
        "occlusion by layers": bool(report.depth or report.cut),
        "tables of transfer functions": bool(filtered),
        "crosstalk": ready.sharing is not None,
        "picture, metrics and files": True,
    }
    return tuple(name for name, is_left in named.items() if is_left)


def _reports(report: SpectrumReport) -> list[SpectrumReport]:
    """Return a report and those of all its parts."""
    return [report, *(own for *_, part in report.parts for own in _reports(part))]


def device_note(ready: Prepared, light: str) -> str:
    """Return what a run says of its device, in a line.

    Parameters
    ----------
    ready : Prepared
        The camera, ready to take its frame.
    light : str
        Where its light was computed.
    """
    there = "noise and readout" if light == "cpu" else "light, noise and readout"
    left = ", ".join(left_to_processor(ready))
    return f"{there} are computed on the graphics processor; {left} by the processor"
