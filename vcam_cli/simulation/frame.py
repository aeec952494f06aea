"""One simulated frame: from the light in every pixel to raw numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.scene.sources import Layers
from vcam_cli.effects.base import Effect, Gain, Transport, of_kind
from vcam_cli.effects.signal_chain import NoiseSource, Quantizer, electron_effects
from vcam_cli.floats import own_float_errors
from vcam_cli.image_formation.pixel_response import axis_levels
from vcam_cli.progress import Stages
from vcam_cli.readout import binned_readout, exposure, nondestructive_samples
from vcam_cli.scenes.depth_scene import DepthScene
from vcam_cli.scenes.layered import LayeredScene
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.spectra import Spectrum, colorchecker


@dataclass(frozen=True)
class Frame(Prepared):
    """A raw frame and all that is known of how it came about.

    Where the camera takes several samples of one integration, it is the last of them.
    """

    electrons: Array
    """(rows, columns) noisy signal, clipped at the full well [electrons]"""
    dn: Array
    """(rows, columns) [DN]"""
    samples_electrons: Array | None = None
    """(N, rows, columns) as `electrons`; None of a single exposure."""
    samples_dn: Array | None = None
    """(N, rows, columns) as `dn`; None of a single exposure."""
    photocurrent: Array | None = None
    """(rows, columns) what the samples tell of the light [e/s]; None of a single exposure."""

    def sample(self, number: int) -> Frame:
        """Return one of the samples, from 0, as a frame of its own."""
        assert self.samples_electrons is not None and self.samples_dn is not None
        return replace(
            self,
            exposure_time=self.times[number],
            electrons=self.samples_electrons[number],
            dn=self.samples_dn[number],
            times=(),
            samples_electrons=None,
            samples_dn=None,
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
            return self.dn
        return self._unclipped_codes(self.photocurrent)

    @property
    def picture_saturated_dn(self) -> float:
        """The value of `picture_dn` from which on a pixel is saturated in all its samples [DN]."""
        if not self.times:
            return self.saturated_dn
        linear = float(self.adc.linear(np.array([self.saturated_dn]))[0])
        charge = (linear - self.electrical.offset) * self.electrical.electrons_per_dn
        # Not all of it: the photocurrent is rounded to 32 bits, and so is its code.
        least = charge / self.times[0] * (1 - 1e-6) - self.dark_rate
        return float(self._unclipped_codes(np.array([least]))[0])

    def _unclipped_codes(self, photocurrent: Array) -> Array:
        """Return codes of a photocurrent [e/s], neither rounded nor clipped [DN]."""
        return self.to_dn((photocurrent + self.dark_rate) * self.exposure_time)

    @property
    def mean_electrons(self) -> Array:
        """Noise-free signal before saturation, photo and dark, (rows, columns) [electrons]."""
        mean = exposure.mean_electrons(self.rate, self.exposure_time, self.plan.active)
        return self.layout.binning_groups.join(mean)

    @property
    def adc(self) -> Quantizer:
        """The ADC."""
        return self.solved.adc

    @property
    def black_dn(self) -> float:
        """Code of the mean dark signal, offset included [DN]."""
        dark = self.dark_rate * self.exposure_time * self.summed_codes
        return float(self.to_dn(np.array([dark]))[0])

    @property
    def black_steps(self) -> Array:
        """How far the black level of each color is from that of `black_dn` (C,) [DN]."""
        steps = dict(self.electrical.black_steps)
        return np.array([steps.get(color, 0.0) for color in self.mosaic.colors])

    @property
    def summed_codes(self) -> int:
        """Pixels whose codes are added."""
        return self.layout.binning_groups.summed_codes

    def to_dn(self, electrons: Array) -> Array:
        """Return the ADC's curve before rounding and clipping; added codes are equal [DN]."""
        n = self.summed_codes
        return self.adc.response(electrons) if n == 1 else n * self.adc.response(electrons / n)

    def linear(self, dn: Array) -> Array:
        """Return what a linear ADC has for these codes, added where `to_dn` adds them [DN]."""
        n = self.summed_codes
        return self.adc.linear(dn) if n == 1 else n * self.adc.linear(dn / n)

    @property
    def white_dn(self) -> Array:
        """Codes (C,) of perfect white on the axis, noise-free, with dark, not clipped [DN]."""
        electrons = (self.white_rate + self.dark_rate) * self.exposure_time
        return np.asarray(self.to_dn(electrons * self.summed_codes))

    @property
    def saturated_dn(self) -> float:
        """The lowest code of a saturated pixel: of a full well, or the ADC's highest [DN].

        Of pixels that are read as one, and of a ccd that defers charge, where all of them are.
        """
        well, highest = self.electrical.full_well, float(self.electrical.highest_code)
        # Amid full pixels the first one loses most: no packet before it has left it any charge.
        for transport in of_kind(self.plan.active, Transport):
            well *= float(transport.timely_share(1, 1)[0, 0])
        well -= binned_readout.SURE * self.noise_of_full
        # In both float types: where the well lies half way between two codes they round apart.
        codes = [self.adc.apply(np.full(1, well, kind))[0] for kind in (np.float32, np.float64)]
        return self.summed_codes * float(min(*codes, highest))

    @property
    def noise_of_full(self) -> float:
        """Noise behind full wells, not clipped with them [e rms].

        It is the ADC's; of joined voltages all of the readout's.
        """
        well = self.electrical.full_well
        effects: Sequence[Effect] = electron_effects(self.plan.active, behind_well=True)
        if self.layout.binning_groups.binning.kind == "voltage":
            effects = binned_readout.effects_in_readout(self.plan.active)
        sources = of_kind(effects, NoiseSource)
        return float(np.sqrt(sum(e.variance(well) for e in sources)))

    def patches_dn(self) -> Array:
        """Return the codes (C, 24) of a ColorChecker in the scene's light, as `white_dn` [DN]."""
        lit = [self.scene.white.multiply(reflectance) for _, reflectance in colorchecker()]
        rate = self.axis_rate(lit) + self.dark_rate * self.summed_codes
        return self.to_dn(rate * self.exposure_time)

    def primaries_dn(self) -> Array:
        """Return the codes (C, 3) of each channel of a picture that emits, as `white_dn` [DN]."""
        rate = self.axis_rate(self.scene.spectra) + self.dark_rate * self.summed_codes
        return self.to_dn(rate * self.exposure_time)

    def axis_rate(
        self, spectra: Sequence[Spectrum], band: tuple[float, float] | None = None
    ) -> Array:
        """Return electrons per second (C, K) of K radiances on the axis, as they are read out.

        Electrons of pixels whose codes are added are, too. `band` has the shortest and the longest
        wavelength [m] in place of the camera's own.
        """
        response = self.solved.response
        if band is not None:
            response = replace(response, start=band[0], stop=band[1])
        levels = axis_levels(response, spectra, of_kind(self.plan.active, Gain))
        return np.asarray(levels.T * self.layout.binning_groups.signal_ratio)

    @property
    def clean_dn(self) -> Array:
        """Codes without noise and without rounding, in the shape of `dn` [DN].

        They end where the well and the ADC are full, as those of `dn` do.
        """
        held = self.layout.binning_groups.join(self.held_electrons)
        return np.clip(self.to_dn(held), 0, self.summed_codes * self.electrical.highest_code)

    def depth(self) -> Array:
        """Return how far away is what the pixels' centers see, along the axis (rows, columns) [m].

        Of layers the nearest one counts that covers half of a place or more.
        """
        layout, source = self.layout, self.solved.scene.source
        if isinstance(self.scene, LayeredScene) and isinstance(source, Layers):
            distances = np.array([layer.distance for layer in source.layers])
            return distances[self.scene.nearest_at(layout.picture_x, layout.picture_y)]
        if isinstance(self.scene, DepthScene):
            return self.scene.depth_at(layout.picture_x, layout.picture_y)
        return np.full(layout.picture_shape, self.solved.scene.distance)

    def ideal_dn(self) -> Array:
        """Return the scene point-sampled at the pixels' centers, all colors everywhere [DN].

        It is (C, rows, columns) of the picture, without blur, falloff and noise; black is included.
        Where the processing leaves the readout's curve in, it is straight from black to white.
        """
        layout = self.layout
        level = self.transfer.level.T * self.exposure_time * layout.binning_groups.signal_ratio
        photo = self.scene.values_at(layout.picture_x, layout.picture_y, level)
        if self.electrical.curve is not None and not self.electrical.curve.corrected:
            white = self.white_rate * self.exposure_time * self.summed_codes
            span = np.where(white > 0, self.white_dn - self.black_dn, 0.0)
            return self.black_dn + photo * (span / np.where(white > 0, white, 1))[:, None, None]
        return self.to_dn(photo + self.dark_rate * self.exposure_time * self.summed_codes)


def _pedestal(ready: Prepared) -> Array | None:
    """Return what black levels by color add to each pixel [electrons]; None without them."""
    steps = dict(ready.electrical.black_steps)
    if not steps:
        return None
    listed = np.array([steps[color] for color in ready.mosaic.colors], ready.rate.dtype)
    pedestal: Array = listed[ready.layout.color] * ready.rate.dtype.type(
        ready.electrical.electrons_per_dn
    )
    return pedestal


def take_frame(ready: Prepared, workers: int, stages: Stages | None = None) -> Frame:
    """Return one frame of a camera that is ready for it."""
    stages, solved = stages or Stages(), ready.solved
    with stages("capture"):
        active, adc = ready.plan.active, solved.adc
        seeds = {"sensor": solved.seed.sensor, "frame": solved.seed.frame}
        known = {field.name: getattr(ready, field.name) for field in fields(ready)}
        times, coarse = ready.times, ready.settings.coarse_normals
        if not times:
            take = partial(
                exposure.capture,
                adc=adc,
                seeds=seeds,
                workers=workers,
                coarse_normals=coarse,
                pedestal=_pedestal(ready),
            )
            groups, time = ready.layout.binning_groups, ready.exposure_time
            electrons, dn = binned_readout.read(
                groups, ready.rate, time, active, take, adc.bits, ready.full_charge
            )
            return Frame(**known, electrons=electrons, dn=dn)
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
            active,
            adc,
            ready.electrical,
            last.saturated_dn,
            workers,
        )
    return replace(last, samples_electrons=electrons, samples_dn=dn, photocurrent=light)
