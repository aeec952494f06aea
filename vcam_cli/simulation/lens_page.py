"""`vcam plan --lens`: what a traced lens does, over the array of a camera."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.prescription import illumination
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.optics.traced_blur import TracedBlur
from vcam_cli.errors import bad
from vcam_cli.lenses.analysis import Drawing, Spots, drawing, ideal_ratio, spots
from vcam_cli.lenses.fields import View
from vcam_cli.lenses.paraxial import paraxial
from vcam_cli.records import dataclass
from vcam_cli.solve.solved import Solved

PLACES = 9
"""Image heights of the curves, from the center to the corner."""
SHOWN = (0, 3, 6, 8)
"""Which of them have spot diagrams."""
NYQUIST_PARTS = (0.25, 0.5, 1.0)
"""Frequencies of the MTF, over Nyquist's."""
COLORS = (0.15, 0.5, 0.85)
"""Wavelengths of spots and color errors, in parts of the camera's band."""
MTF_WAVELENGTHS = 7


@dataclass(frozen=True, eq=False)
class LensPage:
    """All that the page shows. SI."""

    view: View
    title: str
    facts: tuple[str, ...]
    remarks: tuple[str, ...]
    heights: Array
    """Image heights (F,)."""
    angles: Array
    """Field angles (F,) [rad]."""
    wavelengths: Array
    """Of spots and color (W,)."""
    drawing: Drawing
    spots: Spots
    """Of the fields of `SHOWN`."""
    spot_rms: Array
    """(F,)"""
    distortion: Array
    """Chief ray's height over the ideal one, less 1 (F,)."""
    color: Array
    """Chief rays' heights less that of the primary wavelength (F, W)."""
    illumination: Array
    """(F,)"""
    frequencies: tuple[float, ...]
    tangential: Array
    sagittal: Array
    """MTF (frequencies, F), in light even over the band."""
    focus: Array
    """Paraxial focus at `wavelengths` behind that at the primary one (W,)."""


def _traced(solved: Solved) -> tuple[TracedBlur, ...]:
    return of_kind((e for e in solved.effects.found.values() if e is not None), TracedBlur)


def lens_page(solved: Solved) -> LensPage:
    """Return the figures of a solved camera's lens.

    Parameters
    ----------
    solved : Solved
        Solved camera.

    Returns
    -------
    LensPage
        Illumination, distortion, spots, lateral color and MTF by image height.

    Raises
    ------
    BadInput
        For a camera whose lens is not given by its prescription, or forms no image.
    """
    traced = _traced(solved)
    if not traced:
        message = "is drawn only from its surfaces"
        remedy = "write optics: {prescription: double-gauss}; `vcam list lenses` shows what ships"
        raise bad("optics", message, remedy)
    [blur] = traced
    view, corner = blur.view, blur.half_diagonal
    heights = np.linspace(0, corner, PLACES)
    band = solved.scene.wavelengths
    waves = band.start + np.array(COLORS) * (band.stop - band.start)
    table = illumination(view, corner)
    places = blur.at_heights(heights)
    angles = places[0].wavefront.field.angles
    primary = np.array([view.lens.primary])
    ratio = np.ones(PLACES)
    ratio[1:] = ideal_ratio(view, angles[1:], primary)[:, 0]
    frequencies = tuple(part * 0.5 / solved.geometry.pitch_x for part in NYQUIST_PARTS)
    light = np.linspace(band.start, band.stop, MTF_WAVELENGTHS)
    mtf = np.array(
        [
            [
                np.abs(
                    np.mean([p.otf_along(np.array(frequencies), way, float(w)) for w in light], 0)
                )
                for p in places
            ]
            for way in ((1.0, 0.0), (0.0, 1.0))
        ]
    )
    first = view.paraxial
    focus = [paraxial(view.lens, float(w)).back_focus - first.back_focus for w in waves]
    shown = list(SHOWN)
    return LensPage(
        view,
        view.lens.title or view.lens.name,
        _facts(view, solved.geometry.f_number, corner, float(angles[-1])),
        view.lens.remarks,
        heights,
        angles,
        waves,
        drawing(view, angles[[0, PLACES * 3 // 5, PLACES - 1]]),
        spots(view, angles[shown], waves),
        spots(view, angles, waves).rms,
        ratio - 1,
        view.heights(angles, waves) - heights[:, None],
        np.interp(heights, table.heights, table.values),
        frequencies,
        np.moveaxis(mtf[0], 0, 1),
        np.moveaxis(mtf[1], 0, 1),
        np.array(focus),
    )


def _facts(view: View, f_number: float, corner: float, angle: float) -> tuple[str, ...]:
    first, lens = view.paraxial, view.lens
    return (
        f"f = {first.focal_length * 1e3:.4g} mm, f/{f_number:.3g}, {len(lens.surfaces)} surfaces",
        f"array to {corner * 1e3:.4g} mm, {np.degrees(angle):.3g} deg off the axis",
        f"entrance pupil {lens.pupil_diameter * 1e3:.4g} mm wide,"
        f" {first.entrance_pupil * 1e3:.4g} mm behind the first vertex",
        f"exit pupil {first.exit_pupil_diameter * 1e3:.4g} mm wide,"
        f" {view.exit_pupil * 1e3:.4g} mm before the sensor",
        f"back focus {first.back_focus * 1e3:.4g} mm, length {lens.length * 1e3:.4g} mm",
    )


def columns(page: LensPage) -> tuple[str, ...]:
    """Return the names of the columns of `lens.csv`.

    Parameters
    ----------
    page : LensPage
        Figures of the lens.

    Returns
    -------
    tuple of str
        Names with units.
    """
    mtf = [
        f"mtf_{way}_{f / 1e3:.4g}_lp_mm"
        for f in page.frequencies
        for way in ("tangential", "sagittal")
    ]
    colors = [f"lateral_color_{w * 1e9:.4g}_nm [um]" for w in page.wavelengths]
    return (
        "image_height [mm]",
        "field_angle [deg]",
        "relative_illumination",
        "distortion [%]",
        "spot_rms [um]",
        *colors,
        *mtf,
    )


def rows(page: LensPage) -> Iterator[tuple[float, ...]]:
    """Yield the rows of `lens.csv`, from the center to the corner.

    Parameters
    ----------
    page : LensPage
        Figures of the lens.

    Yields
    ------
    tuple of float
        Values in the order of `columns`.
    """
    for i in range(len(page.heights)):
        mtf = [m[i] for pair in zip(page.tangential, page.sagittal, strict=True) for m in pair]
        yield (
            float(page.heights[i] * 1e3),
            float(np.degrees(page.angles[i])),
            float(page.illumination[i]),
            float(100 * page.distortion[i]),
            float(page.spot_rms[i] * 1e6),
            *(float(c * 1e6) for c in page.color[i]),
            *(float(m) for m in mtf),
        )
