"""Notes of a run: what it chose, left out or took for granted where the file left that open."""

import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import overload

import numpy as np

from vcam_cli.camera.derived.camera_angles import camera_angles
from vcam_cli.camera.processing import SHOWN
from vcam_cli.camera.scene.scene_files import ImageFile
from vcam_cli.camera.sensor.architecture import ARCHITECTURES
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.pixel_signal import ColumnSpread, Overflow
from vcam_cli.effects.signal_chain import SIGMAS
from vcam_cli.effects.warps import ImageMotion
from vcam_cli.floats import own_float_errors
from vcam_cli.image_formation.light_plan import BLURS
from vcam_cli.scenes.base import ChartScene
from vcam_cli.scenes.build import picture_model
from vcam_cli.scenes.depth_scene import DepthScene
from vcam_cli.scenes.hyperspectral import CubeScene
from vcam_cli.scenes.image import ImageScene
from vcam_cli.scenes.layered import AnyScene, LayeredScene
from vcam_cli.scenes.light import visible_range
from vcam_cli.simulation.advice import advice
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.spectra import luminance

VISIBLE_CLIPPING = 0.01
"""Part of the pixels whose noise is worth a word when it is clipped."""
VISIBLE_OVERFLOW = 0.01
"""Charge beyond the wells that is worth a word, over what all wells hold."""
PIXELS_AT_ONCE = 1 << 20
"""Pixels that are looked at together, so that no copy of the frame is needed."""
FAR_OVEREXPOSED = 1e5
"""Brightest light, over what fills a pixel, up to which the accuracy promise was found to hold:
beyond it, ringing of less than a hundred-thousandth of that light is a pixel's full signal."""
VISIBLE_CROP = 5e-4
"""Part of a picture that is worth a word when it is cut off."""


class Notes(Sequence[str]):
    """Notes for the user, found when they are first read: a sweep of frames reads none.

    Parameters
    ----------
    ready : Prepared
        The camera, or its frame.
    earlier : tuple of str
        Notes on what came before, which are the first.
    """

    def __init__(self, ready: Prepared, earlier: tuple[str, ...] = ()) -> None:
        self._ready, self._earlier = ready, earlier

    @cached_property
    @own_float_errors
    def _all_remarks(self) -> tuple[str, ...]:
        return self._earlier + remarks(self._ready)

    @overload
    def __getitem__(self, index: int) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[str, ...]: ...
    def __getitem__(self, index: int | slice) -> str | tuple[str, ...]:
        """Return one note, or several."""
        return self._all_remarks[index]

    def __iter__(self) -> Iterator[str]:
        """Return an iterator over the notes."""
        return iter(self._all_remarks)

    def __len__(self) -> int:
        """Return the number of notes."""
        return len(self._all_remarks)


def remarks(ready: Prepared) -> tuple[str, ...]:
    """Return notes on the silicon, on times that the camera chose, and on a scene of spectra.

    Parameters
    ----------
    ready : Prepared
        Camera that is ready for its frame.

    Returns
    -------
    tuple of str
        Notes for the user.
    """
    scene, band = _picture(ready), ready.solved.scene.wavelengths
    before = (
        *ready.solved.notes,
        *_scheduled_times(ready),
        *_blind_colors(ready),
        *_noise_beyond_table(ready),
        *_clipped_dark(ready),
        *_unused_codes(ready),
        *_overflow(ready),
        *_far_overexposed(ready),
        *advice(ready),
        *_colors_of_picture(ready),
        *_cropped(ready),
        *_sampled(ready),
        *_prescription(ready),
        *_motion(ready),
        *_depth(ready),
        *_edge_without_blur(ready),
        *_steps_not_shown(ready),
    )
    if not isinstance(scene, CubeScene):
        return before
    level = luminance(scene.white, *visible_range(scene.white, band.start, band.stop))
    notes = [f"white is assumed to be {level:.4g} cd/m2"]
    if 0 < ready.spectrum.planes < len(scene.spectra):
        notes.append(
            f"{len(scene.spectra)} bands are simulated as {ready.spectrum.planes} mixtures of them;"
            f" no transfer function is off by more than {ready.settings.mixing_tolerance:g}"
            " of the largest"
        )
    return before + tuple(notes)


def _picture(ready: Prepared) -> AnyScene:
    """Return the scene; of a picture with depth the picture."""
    return ready.scene.flat if isinstance(ready.scene, DepthScene) else ready.scene


def _prescription(ready: Prepared) -> tuple[str, ...]:
    """Return which data of a traced lens the simulation ignores, and how many rays fail."""
    if ready.solved.optics.prescription is None:
        return ()
    from vcam_cli.effects.optics.traced_blur import TracedBlur

    found = (effect for effect in ready.solved.effects.found.values() if effect is not None)
    notes: list[str] = []
    for blur in of_kind(found, TracedBlur):
        notes += blur.view.lens.remarks
        if failing := blur.failing:
            height, lost = max(failing, key=lambda place: place[1])
            notes.append(
                f"{100 * lost:.2g} % of the rays through the stop fail {height * 1e3:.4g} mm off"
                " axis: the pupil ends where they do"
            )
    return tuple(notes)


def _blind_colors(ready: Prepared) -> tuple[str, ...]:
    """Return which colors see nothing of a perfect white, which may be a mistake of a spectrum."""
    white = zip(ready.mosaic.colors, ready.white_rate, strict=True)
    blind = [color for color, rate in white if rate == 0]
    if len(blind) == len(ready.mosaic.colors):
        return ("no light reaches the electrons: this is a dark frame",)
    return (f"no light reaches the electrons of {', '.join(blind)}",) if blind else ()


def _motion(ready: Prepared) -> tuple[str, ...]:
    """Return notes on effects of motion that the file does not have, and on skipped ones."""
    g, turn = ready.geometry, ready.solved.scene.camera_motion
    notes = []
    pixels = sum((e.travel for e in of_kind(ready.plan.active, ImageMotion)), 0.0) / g.pitch_x
    if pixels >= 1 and isinstance(_picture(ready), ImageScene):
        notes.append(
            f"the picture ends at the border: up to {pixels:.0f} pixels move in and are mirrored"
        )
    if ready.spectrum.sub_exposures:
        notes.append(_sub_exposures(ready))
    if ready.solved.exposure.is_timed_by_scene and pixels:
        notes.append("the automatic exposure meters the scene without motion")
    if turn is not None and turn.file is not None:
        read = camera_angles(turn.file)
        left = f"; {', '.join(read.ignored)} are ignored" if read.ignored else ""
        notes.append(f"{Path(turn.file).name}: the camera moves by {', '.join(read.columns)}{left}")
    if pixels and turn is not None and (turn.pan or turn.tilt or turn.file):
        corner = float(np.hypot(g.sensor_width, g.sensor_height)) / 2 / g.image_distance
        notes.append(
            "rotation uses the on-axis approximation: corner motion is underestimated by up to"
            f" {100 * corner**2:.2g} %"
        )
    return tuple(notes)


def _sub_exposures(ready: Prepared) -> str:
    """Return of how many sub-exposures the light is a mean, and the error that they leave."""
    found = ready.spectrum
    many = f"{found.sub_exposures} sub-exposures" if found.sub_exposures > 1 else "one exposure"
    return (
        f"motion is computed as {many} of the still image, known at {found.places_per_pixel} places"
        " along each side of a pixel; they leave an error of"
        f" {100 * found.sub_exposure_error:.2g} % of full signal"
    )


def _edge_without_blur(ready: Prepared) -> tuple[str, ...]:
    """Return that a straight edge, from which an MTF is measured, lacks a blur."""
    scene = ready.scene
    profile = scene.chart.profile() if isinstance(scene, ChartScene) else None
    if profile is None or len(profile.places) != 1:
        return ()
    omitted = {d.name for d in ready.plan.decisions if d.state == "off" and d.by == "plan"}
    wanted = ready.solved.effects.enabled
    names = [blur.name for blur in of_kind(wanted, *BLURS) if blur.name in omitted]
    if not names:
        return ()
    wish = ", ".join(f"{name}: on" for name in names)
    return (
        f"an MTF measured from this edge lacks {' and '.join(names)}, which this array hardly"
        f" shows; to measure one, write effects: {{{wish}}}",
    )


def _depth(ready: Prepared) -> tuple[str, ...]:
    """Return how layers were put one before the other, and where the lens was focused unasked."""
    found, camera, notes = ready.spectrum.depth, ready.solved, []
    if not isinstance(ready.scene, LayeredScene | DepthScene):
        return ()
    if camera.optics.focus_distance is None and "distance" not in camera.scene.model_fields_set:
        notes.append(
            f"the lens is focused at {camera.scene.distance:g} m, which is the default of"
            " scene.distance; give optics.focus_distance"
        )
    if found is not None:
        more = found.error > ready.settings.tolerance
        how = "every pixel's rays meet the same layers"
        if found.rays:
            size = f"{found.cells} x {found.cells} cells a pixel"
            how = f"around edges of layers, up to {found.rays} rays a pixel are traced on {size}"
        if found.left_out:
            how += f", elsewhere at most {100 * found.left_out:.2g} % of full signal is skipped"
        notes.append(
            f"{how}: predicted error {100 * found.error:.2g} % of full signal"
            + (", more than the tolerance" if more else "")
        )
    return (*notes, *_cut(ready))


def _cut(ready: Prepared) -> tuple[str, ...]:
    """Return how a picture with depth was cut into layers, and what is unknown of it."""
    found, scene = ready.spectrum.cut, ready.scene
    if found is None or not isinstance(scene, DepthScene):
        return ()
    near, far = (f"{d:.3g} m" for d in (scene.depth.min(), scene.depth.max()))
    pixels = [2 * abs(r) / ready.geometry.pitch_x for r in scene.cut.radii]
    how = ""
    if found.cell:
        how = f", composited ray by ray on cells of {found.cell * 1e6:.3g} um"
    more = ", more than the tolerance" if found.error > ready.settings.tolerance else ""
    notes = [
        f"depth from {near} to {far} is cut into {found.layers} layers: defocus blurs points to"
        f" {min(pixels):.3g} to {max(pixels):.3g} pixels{how}: predicted error"
        f" {100 * found.error:.2g} % of full signal{more}"
    ]
    if found.hidden_most:
        notes.append(
            "occluded background is extrapolated from its surroundings: unknown by up to"
            f" {100 * found.hidden_most:.2g} % of full signal, rms {100 * found.hidden_rms:.2g} %"
        )
    return tuple(notes)


def _noise_beyond_table(ready: Prepared) -> Iterator[str]:
    """Yield that a gain lies beyond those at which a noise of the readout is known."""
    gain = ready.solved.gain
    for path, noise in ready.solved.pixel.readout.noise_tables.items():
        (least, _), (most, _) = noise.points[0], noise.points[-1]
        if least <= gain <= most:
            continue
        yield (
            f"the noise at an exposure.gain of {gain:.4g} is assumed equal to that at"
            f" {min(max(gain, least), most):.4g}, {noise.at_gain(gain):.4g} e: the table of"
            f" {path} has gains from {least:.4g} to {most:.4g}"
        )


def _clipped_dark(ready: Prepared) -> tuple[str, ...]:
    """Return how many pixels are so dark that the ADC's offset clips their noise."""
    e, time = ready.electrical, min(ready.times, default=ready.exposure_time)
    step = ready.chain.adc.step(0.0)
    own = ready.solved.adc_keys.noise * step
    missing = SIGMAS * math.hypot(ready.solved.dark_noise, own) - e.offset * step
    if ready.solved.adc_keys.offset is None or missing <= 0:
        return ()
    threshold = missing / time - ready.dark_rate
    if float(ready.rate.min(initial=math.inf)) >= threshold:
        return ()
    largest = float(np.finfo(ready.rate.dtype).max)
    share = float((ready.rate < min(threshold, largest)).mean())
    if share < VISIBLE_CLIPPING:
        return ()
    what = "their mean is biased"
    if ready.times:
        what += ", and photocurrents of averaged samples with it"
    return (
        f"adc.offset of {e.offset:g} DN clips the noise of dark pixels ({100 * share:.3g} % of"
        f" all): {what}; write offset: auto",
    )


def _unused_codes(ready: Prepared) -> tuple[str, ...]:
    """Return why the ADC's highest codes are out of reach: at a low gain pixels are full before."""
    e, gain, iso = ready.electrical, ready.solved.gain, ready.solved.exposure.iso
    share = e.full_well / e.adc_full_scale
    if gain >= 1 or share > 1 - 1 / e.highest_code:
        return ()
    what = f"at an exposure.gain of {gain:.4g}"
    if iso is not None:
        what = f"ISO {iso:g} is below the base ISO of {ready.base_iso:.4g}: at a gain of {gain:.4g}"
    return (
        f"{what} pixels are full at {100 * share:.3g} % of the ADC's full scale; to avoid clipping,"
        " shorten the exposure: a lower gain does not help",
    )


def _overflow(ready: Prepared) -> tuple[str, ...]:
    """Return where charge goes that wells do not hold, unless it spills."""
    if of_kind(ready.plan.active, Overflow):
        return ()
    well, rate = ready.electrical.full_well, ready.rate.reshape(-1)
    dark, time = ready.dark_rate * ready.exposure_time, ready.exposure_time
    if float(rate.max(initial=0.0)) * time + dark <= well:
        return ()
    blocks = (rate[i : i + PIXELS_AT_ONCE] for i in range(0, rate.size, PIXELS_AT_ONCE))
    beyond = sum(float(np.maximum(block * time + (dark - well), 0).sum()) for block in blocks)
    share = beyond / (well * rate.size)
    if share < VISIBLE_OVERFLOW:
        return ()
    ccd = ARCHITECTURES[ready.solved.pixel.architecture].transfers
    said = "give pixel.blooming to let it spill along columns"
    if ccd and not of_kind(ready.plan.active, ColumnSpread):
        said += ", and charge_transfer.smear for light on charge that moves"
    return (f"excess charge, {share:.3g} times the capacity of all wells, is discarded; {said}",)


def _far_overexposed(ready: Prepared) -> tuple[str, ...]:
    """Return that light is too far beyond the wells for the promise on dark pixels."""
    brightest = float(ready.rate.max(initial=0.0)) * ready.exposure_time
    times = brightest / ready.electrical.full_well
    if times <= FAR_OVEREXPOSED:
        return ()
    return (
        f"the brightest light would fill a pixel {times:.0f} times: beyond {FAR_OVEREXPOSED:.0f}"
        " times the mean of darker pixels may be off by more than the tolerance",
    )


def _scheduled_times(ready: Prepared) -> tuple[str, ...]:
    """Return the times of samples that the camera scheduled itself."""
    asked = ready.solved.exposure.schedule
    if asked is None:
        return ()
    listed = ", ".join(f"{1000 * time:.4g}" for time in ready.times)
    fewer = asked.count - len(ready.times)
    more = f"; {fewer} more of the {asked.count} would gain nothing" if fewer else ""
    return (f"best times for this scene: {listed} ms{more}",)


def _colors_of_picture(ready: Prepared) -> tuple[str, ...]:
    """Return what three channels are taken for, where the file does not say."""
    source, scene = ready.solved.scene.source, _picture(ready)
    if not isinstance(source, ImageFile) or source.model != "auto":
        return ()
    if not isinstance(scene, ImageScene):
        return ()
    model = picture_model(source.model, scene.picture.shape[2])
    if model == "reflectance":
        return ()
    return (f"three channels are read as reflectances with these sRGB colors (model: {model})",)


def _steps_not_shown(ready: Prepared) -> tuple[str, ...]:
    """Return why there are no pictures after the first steps, where they are requested."""
    if not (ready.solved.output.steps and ready.solved.processing):
        return ()
    colors = ready.mosaic.colors
    if len(colors) not in SHOWN and not ready.layout.full_color:
        names = ", ".join(colors)
        return (f"output.steps shows nothing between demosaic and color_correction: {names} are"
                " not the colors of a display",)  # fmt: skip
    if ready.layout.is_scattered and not ready.layout.full_color:
        return (
            "output.steps shows nothing before demosaic: the pixels are in no rows and columns",
        )
    return ()


def _sampled(ready: Prepared) -> tuple[str, ...]:
    """Return that a chart is simulated as the samples that are written."""
    scene = ready.scene
    if not isinstance(scene, ImageScene) or ready.solved.scene.source.kind != "chart":
        return ()
    per_pixel = ready.geometry.pitch_x / scene.pitch_x
    return (
        f"output.radiance: the chart is simulated as it is written, in {per_pixel:.3g} samples per"
        " pixel pitch; accuracy.oversampling sets their number",
    )


def _cropped(ready: Prepared) -> tuple[str, ...]:
    """Return how much of a picture lies beyond the array."""
    scene = _picture(ready)
    if not isinstance(scene, ImageScene) or ready.solved.scene.source.kind == "chart":
        return ()
    parts = zip(("height", "width"), scene.seen, strict=True)
    lost = [f"{1 - part:.1%} of its {side}" for side, part in parts if part < 1 - VISIBLE_CROP]
    if not lost:
        return ()
    why = "to the shape of the array"
    if ready.geometry.scene_width_on_sensor is not None:
        why = "by the array, which sees less than scene.extent"
    return (f"the picture is cropped {why}: {' and '.join(lost)} cut off",)
