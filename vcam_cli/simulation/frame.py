"""One simulated frame: from the light in every pixel to raw numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, fields, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.electrical import Electrical
from vcam_cli.camera.scene.sources import Layers
from vcam_cli.devices.processor import Processor
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.pixel_signal import Gain
from vcam_cli.errors import CannotDo
from vcam_cli.floats import own_float_errors
from vcam_cli.image_formation import warps
from vcam_cli.image_formation.pixel_response import axis_levels
from vcam_cli.progress import Stages
from vcam_cli.readout import binned_readout, exposure
from vcam_cli.readout.layout import Layout
from vcam_cli.records import dataclass
from vcam_cli.scenes.depth_scene import DepthScene
from vcam_cli.scenes.layered import LayeredScene
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.spectra import Spectrum, colorchecker


@dataclass(frozen=True)
class Frame(Prepared):
    """A raw frame and all that is known of how it came about.

    Where the camera takes several samples of one integration, it is the last of them; of a bracket
    the longest exposure.
    """

    electrons: Array
    """(rows, columns) noisy signal, clipped at the full well [electrons]"""
    dn: Array
    """(rows, columns) [DN]"""
    samples_electrons: Array | None = None
    """(N, rows, columns) as `electrons`; None of a single exposure."""
    samples_dn: Array | None = None
    """(N, rows, columns) as `dn`; None of a single exposure."""
    readouts_dn: Mapping[str, Array] = field(default_factory=dict)
    """Codes of every readout of an exposure by its name, as `dn`; {} where there is one."""
    phase_dn: tuple[Array, Array] | None = None
    """Codes (rows, columns) of the left and right halves of pixels [DN]; None of whole pixels."""
    photocurrent: Array | None = None
    """(rows, columns) what the samples tell of the light [e/s]; None of a single exposure."""
    device: str = "cpu"
    """What charge, noise and codes were computed on; all else is the processor's."""

    def sample(self, number: int) -> Frame:
        """Return one of the samples as a frame of its own.

        Parameters
        ----------
        number : int
            Index of the sample, from 0.

        Returns
        -------
        Frame
            Frame without samples.
        """
        assert self.samples_electrons is not None and self.samples_dn is not None
        return replace(
            self,
            exposure_time=self.times[number],
            electrons=self.samples_electrons[number],
            dn=self.samples_dn[number],
            times=(),
            samples_electrons=None,
            samples_dn=None,
            readouts_dn={},
            photocurrent=None,
        )

    @cached_property
    @own_float_errors
    def picture_dn(self) -> Array:
        """What is made into a picture, in the shape of `dn` [DN].

        Of several samples: the codes of the photocurrent in the last one's time, as if neither
        well nor ADC had an end, and without rounding. So the scale is that of the last sample.
        """
        if self.photocurrent is None:
            phase = self.solved.pixel.phase_detection
            if phase is None or phase.masked is None:
                return self.dn
            from vcam_cli.image_formation import half_images

            return half_images.unmasked(self.dn, phase.masked, len(self.mosaic.block[0]))
        return self._unclipped_codes(self.photocurrent)

    @property
    def picture_saturated_dn(self) -> float:
        """The value of `picture_dn` above which a pixel is saturated in all its samples [DN]."""
        if not self.times:
            return self.chain.saturated_dn
        charge = float(self.chain.to_electrons(np.array([self.chain.saturated_dn]))[0])
        # Not all of it: the photocurrent is rounded to 32 bits, and so is its code.
        least = charge / min(self.times) * (1 - 1e-6) - self.dark_rate
        return float(self._unclipped_codes(np.array([least]))[0])

    def _unclipped_codes(self, photocurrent: Array) -> Array:
        """Return codes of a photocurrent [e/s], neither rounded nor clipped [DN]."""
        return self.chain.to_dn((photocurrent + self.dark_rate) * self.exposure_time)

    @property
    def mean_electrons(self) -> Array:
        """Noise-free signal before saturation, photo and dark, (rows, columns) [electrons]."""
        mean = exposure.mean_electrons(self.rate, self.exposure_time, self.plan.active)
        if self.sharing is not None:
            mean = self.sharing.coupled(mean)
        return self.layout.binning_groups.join(mean)

    @property
    def black_dn(self) -> float:
        """Code of the mean dark signal, offset included [DN]."""
        return self.chain.black_dn(self.dark_rate * self.exposure_time)

    @property
    def white_dn(self) -> Array:
        """Codes (C,) of perfect white on the axis, noise-free, with dark, not clipped [DN]."""
        electrons = (self.white_rate + self.dark_rate) * self.exposure_time
        return np.asarray(self.chain.to_dn(electrons * self.chain.summed_codes))

    def patches_dn(self) -> Array:
        """Return the codes (C, 24) of a ColorChecker in the scene's light, as `white_dn` [DN]."""
        lit = [self.scene.white.multiply(reflectance) for _, reflectance in colorchecker()]
        rate = self.axis_rate(lit) + self.dark_rate * self.chain.summed_codes
        return self.chain.to_dn(rate * self.exposure_time)

    def primaries_dn(self) -> Array:
        """Return the codes (C, 3) of each channel of a picture that emits, as `white_dn` [DN]."""
        rate = self.axis_rate(self.scene.spectra) + self.dark_rate * self.chain.summed_codes
        return self.chain.to_dn(rate * self.exposure_time)

    def axis_rate(
        self, spectra: Sequence[Spectrum], band: tuple[float, float] | None = None
    ) -> Array:
        """Return the rates of radiances on the axis, as pixels are read out.

        Electrons of pixels whose codes are added are added, too.

        Parameters
        ----------
        spectra : sequence of Spectrum
            Spectral radiances (K of them).
        band : tuple of float or None, optional
            Shortest and longest wavelength [m], by default the camera's own.

        Returns
        -------
        Array
            Rates (C, K) [e/s].
        """
        response = self.solved.response
        if band is not None:
            response = replace(response, start=band[0], stop=band[1])
        levels = axis_levels(response, spectra, of_kind(self.plan.active, Gain))
        return self._mixed(levels.T) * self.layout.binning_groups.signal_ratio

    def _mixed(self, levels: Array) -> Array:
        """Return the signals of colors (C, ...) as crosstalk mixes them, in their unit."""
        return levels if self.sharing is None else np.asarray(self.sharing.matrix @ levels)

    @property
    def clean_dn(self) -> Array:
        """Codes without noise and without rounding, in the shape of `dn` [DN].

        They end where the well and the ADC are full, as those of `dn` do.
        """
        held = self.layout.binning_groups.join(self.held_electrons)
        return self.chain.clipped(self.chain.to_dn(held))

    def depth(self) -> Array:
        """Return how far away is what the pixels' centers see, along the axis (rows, columns) [m].

        Of layers the nearest one counts that covers half of a place or more. It is distorted, or
        corrected, as the picture is.
        """
        layout, source = self.layout, self.solved.scene.source
        if isinstance(self.scene, LayeredScene) and isinstance(source, Layers):
            distances = np.array([layer.distance for layer in source.layers])
            zoom, layers = 1.0, self.scene
            if (correction := self.solved.lens_correction) is not None:
                zoom = correction.zoom
            else:
                layers = warps.ideal_layers(layers, self.plan.active, layout.grid)
            return distances[layers.nearest_at(layout.picture_x / zoom, layout.picture_y / zoom)]
        if isinstance(self.scene, DepthScene):
            return self.scene.depth_at(layout.picture_x, layout.picture_y)
        return np.full(layout.picture_shape, self.solved.scene.distance)

    def _ideal_light(self, x: Array, y: Array, level: Array) -> Array:
        """Return the scene at points as the picture shows it: distorted, or corrected."""
        if (correction := self.solved.lens_correction) is not None:
            zoom = correction.zoom
            return self.scene.values_at(x / zoom, y / zoom, level)
        effects, grid = self.plan.active, self.layout.grid
        return warps.ideal_values(self.scene, effects, grid, x, y, level)

    def ideal_dn(self) -> Array:
        """Return the scene point-sampled at the pixels' centers, all colors everywhere [DN].

        It is (C, rows, columns) of the picture, without blur, falloff and noise; black is included.
        Where the processing leaves the readout's curve in, it is straight from black to white.
        """
        layout = self.layout
        level = self._mixed(self.transfer.level.T)
        level = level * self.exposure_time * layout.binning_groups.signal_ratio
        photo = self._ideal_light(layout.picture_x, layout.picture_y, level)
        if self.electrical.curve is not None and not self.electrical.curve.corrected:
            white = self.white_rate * self.exposure_time * self.chain.summed_codes
            span = np.where(white > 0, self.white_dn - self.black_dn, 0.0)
            return self.black_dn + photo * (span / np.where(white > 0, white, 1))[:, None, None]
        dark = self.dark_rate * self.exposure_time * self.chain.summed_codes
        return self.chain.to_dn(photo + dark)


def pedestal(electrical: Electrical, layout: Layout, dtype: np.dtype | type) -> Array | None:
    """Return what black levels by color add to each pixel.

    Parameters
    ----------
    electrical : Electrical
        The circuit.
    layout : Layout
        Where the pixels are.
    dtype : dtype
        Floating-point type.

    Returns
    -------
    Array or None
        Signal (rows, columns) [electrons]; None where all colors have one black level.
    """
    steps = dict(electrical.black_steps)
    if not steps:
        return None
    listed = np.array([steps[color] for color in layout.raw_mosaic.colors], dtype)
    found: Array = listed[layout.color] * listed.dtype.type(electrical.electrons_per_dn)
    return found


def _phase_codes(
    ready: Prepared, dn: Array, take: Callable[..., tuple[Array, Array]]
) -> tuple[Array, Array] | None:
    """Return the codes of the pixels' halves; those of masked pixels are in the raw frame.

    Halves have draws of their own, as further layers of a stack would: the raw frame's codes are of
    whole pixels, and not the sum of these.
    """
    phase = ready.solved.pixel.phase_detection
    if ready.halves is None or phase is None:
        return None
    if phase.masked is not None:
        from vcam_cli.image_formation import half_images

        of_left, of_right = half_images.sites(phase.masked)
        return dn[of_left], dn[of_right]
    time, active = ready.exposure_time, ready.plan.active
    left, right = (
        take(half, time, active, layer=number, settle=ready.settle)[1]
        for number, half in enumerate(ready.halves, 1)
    )
    return left, right


def take_frame(
    ready: Prepared, workers: int, stages: Stages | None = None, device: Processor | None = None
) -> Frame:
    """Return one frame of a camera that is ready for it.

    Parameters
    ----------
    ready : Prepared
        Camera that is ready for its frame.
    workers : int
        Number of threads; the result does not depend on it.
    stages : Stages or None, optional
        Stopwatch of the run's stages.
    device : Processor or None, optional
        Where charge, noise and codes are computed; by default by the processor's threads.

    Returns
    -------
    Frame
        Frame with electrons and codes.

    Raises
    ------
    CannotDo
        For a readout that a device does not compute.
    """
    stages, solved = stages or Stages(), ready.solved
    on_device = device is not None and device.name != "cpu"
    if on_device and (ready.chain.merge is not None or ready.times):
        what = "several samples of an exposure" if ready.times else "several readouts of a pixel"
        raise CannotDo(f"{what}: not computed on a graphics processor", "use --device cpu")
    with stages("capture"):
        active, adc = ready.plan.active, ready.chain.adc
        seeds = {"sensor": solved.seed.sensor, "frame": solved.seed.frame}
        known = {field.name: getattr(ready, field.name) for field in fields(ready)}
        times, coarse = ready.times, ready.settings.coarse_normals
        if ready.chain.merge is not None:
            from vcam_cli.readout import several_readouts

            several = several_readouts.capture(
                *(ready.rate, ready.exposure_time, ready.chain, seeds, workers, coarse)
            )
            known |= {"electrons": several.electrons, "dn": several.dn}
            return Frame(**known, readouts_dn=several.readouts)
        if not times:
            shared: dict[str, Any] = {
                "adc": adc,
                "seeds": seeds,
                "coarse_normals": coarse,
                "pedestal": pedestal(ready.electrical, ready.layout, ready.rate.dtype),
            }
            if device is not None and on_device:
                from vcam_cli.readout import device_capture

                take = partial(device_capture.capture, device=device, **shared)
                known |= {"device": device.describe()}
            else:
                take = partial(exposure.capture, workers=workers, **shared)
            groups, time = ready.layout.binning_groups, ready.exposure_time
            electrons, dn = binned_readout.read(
                *(groups, ready.rate, time, active, take, adc.bits, ready.full_charge),
                settle=ready.settle,
            )
            return Frame(
                **known, electrons=electrons, dn=dn, phase_dn=_phase_codes(ready, dn, take)
            )
        from vcam_cli.readout import nondestructive_samples

        electrons, dn = nondestructive_samples.samples(
            *(ready.rate, times, active, adc, seeds, workers),
            step_rates=ready.step_rates,
            coarse_normals=coarse,
        )
    last = Frame(**known, electrons=electrons[-1], dn=dn[-1])
    with stages("reconstruction"):
        light = nondestructive_samples.photocurrent(
            dn,
            times,
            solved.exposure.estimator,
            ready.chain,
            workers,
        )
    return replace(last, samples_electrons=electrons, samples_dn=dn, photocurrent=light)
