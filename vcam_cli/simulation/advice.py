"""Notes on settings that run as they are, and that cost whoever meant something else hours."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from vcam_cli.effects.base import of_kind
from vcam_cli.effects.pixel_signal import Gain
from vcam_cli.image_formation.pixel_response import axis_levels
from vcam_cli.simulation.preparation import Prepared

INFRARED = 700e-9
"""Wavelength above which the eye sees next to nothing, and silicon much [m]."""
VISIBLE_INFRARED = 0.1
"""Part of a color's signal of white that shifts colors so that it is worth a word."""
DARK_WHITE = 0.5
"""Saturation, over the signal of the scene's white, below which clipped highlights look gray."""
VISIBLE_SATURATION = 0.01
"""Part of the pixels that is worth a word when it is saturated."""
UNUSED_WELL = 0.1
"""Part of the full well beyond the ADC's end that is worth a word."""


def advice(ready: Prepared) -> Iterator[str]:
    """Yield notes on infrared light, dark renders, wells that the ADC ends, and irradiance.

    Parameters
    ----------
    ready : Prepared
        Camera that is ready for its frame.

    Yields
    ------
    str
        Note for the user.
    """
    yield from _infrared(ready)
    yield from _dark_render(ready)
    yield from _unused_well(ready)
    yield from _even_irradiance(ready)


def _infrared(ready: Prepared) -> Iterator[str]:
    """Yield how much of a color picture's signal no eye sees, where nothing cuts it off."""
    band = ready.solved.scene.wavelengths
    if len(ready.mosaic.colors) == 1 or band.stop <= INFRARED or not ready.white_rate.any():
        return
    beyond = replace(ready.solved.response, start=max(INFRARED, band.start))
    levels = axis_levels(beyond, [ready.scene.white], of_kind(ready.plan.active, Gain))
    known = ready.white_rate > 0
    summed = ready.layout.binning_groups.summed_charges
    shares = np.where(known, summed * levels[0] / np.where(known, ready.white_rate, 1), 0.0)
    most = int(shares.argmax())
    if shares[most] > VISIBLE_INFRARED:
        yield (
            f"nothing cuts off infrared light: {100 * shares[most]:.2g} % of the signal of"
            f" {ready.mosaic.colors[most]} is light beyond {INFRARED * 1e9:.0f} nm, which no eye"
            " sees; for a camera with a filter write optics.transmittance: [0.95, ir-cut-650]"
        )


def _dark_render(ready: Prepared) -> Iterator[str]:
    """Yield why the render of an overexposed frame is dark."""
    camera, circuit = ready.solved, ready.electrical
    shown = [step.value.white for step in camera.processing if step.name == "tone"]
    if camera.output.render is None or "sensor" in shown or ready.times:
        return
    if not camera.processing or circuit.linearized:
        return
    time, dark = ready.exposure_time, ready.dark_rate * ready.exposure_time
    white = float(ready.white_rate.max()) * time
    held = ready.chain.saturation - dark
    if not 0 < held < DARK_WHITE * white:
        return
    if float((ready.rate * time + dark >= ready.chain.saturation).mean()) < VISIBLE_SATURATION:
        return
    yield (
        f"the scene's white is {white / held:.3g} times the saturation level: saturated pixels"
        f" are {100 * held / white:.2g} % of white in the render, which is dark; shorten the"
        " exposure, or write the step tone: {white: sensor} in processing"
    )


def _unused_well(ready: Prepared) -> Iterator[str]:
    """Yield how much of the well the ADC does not convert at the lowest gain."""
    circuit = ready.electrical
    share = circuit.adc_full_scale / circuit.full_well
    if ready.solved.gain != 1 or share > 1 - UNUSED_WELL:
        return
    codes = circuit.highest_code - circuit.offset
    yield (
        f"the ADC is full at {circuit.adc_full_scale:.4g} e, {100 * share:.3g} % of the full well:"
        " it, and not the well, ends the dynamic range; to convert all of the well write"
        f" adc.gain: {codes / circuit.full_well:.4g} DN/e"
    )


def _even_irradiance(ready: Prepared) -> Iterator[str]:
    """Yield that the irradiance in front of the filters lacks a falloff measured behind them."""
    output = ready.solved.output
    by_color = any(not gain.is_neutral for gain in of_kind(ready.plan.active, Gain))
    if by_color and (output.irradiance or output.isetcam):
        yield (
            "the irradiance is the light in front of the filters: the tables of optics.off_axis by"
            " color, which are measured behind them, are not in it"
        )
