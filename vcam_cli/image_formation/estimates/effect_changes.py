"""What each transfer function does to a picture, by Parseval's theorem.

The plan shows it. What the plan leaves out it decides before, by bounds that know no picture.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.blurs import FieldTransfer, PlaneTransfer, RadialTransfer
from vcam_cli.image_formation.estimates.scene_sampling import SampledImage
from vcam_cli.image_formation.field_dependence import Mode
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.image_formation.transfer_tables import Tables, TableSize, radial_table

MODES_SHARE = 0.15
"""Part of the tolerance for modes of the field that this picture does not need."""


def changes_by_omission(
    path: OpticalPath, image: SampledImage, tables: Tables, field_change: float
) -> dict[str, float]:
    """Return the rms change of the signal by leaving out each transfer function.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    image : SampledImage
        The scene's spectrum.
    tables : Tables
        Tables of the whole lens.
    field_change : float
        Rms of all that changes over the field [e/s].

    Returns
    -------
    dict
        Name of an effect -> rms change [e/s].
    """
    behind_lens = image.lens_power  # that of its radial part, which bounds what it passes
    if path.field is None and of_kind(path.effects, PlaneTransfer):
        behind_lens = image.power.lens_power(tables)
    squares: dict[Effect, Array] = {
        effect: image.power.omission_power(behind_lens, effect) for effect in path.separable
    }
    radial = of_kind(path.effects, RadialTransfer)
    by_length = image.power.by_length(image.tables) if radial else np.empty(0)
    for effect in radial:
        rest = _omission_tables(
            path, image, [e for e in path.transfer.radial_blurs if e is not effect]
        )
        squares[effect] = _radial_power(image, rest, by_length)
    if directed := of_kind(path.effects, PlaneTransfer, FieldTransfer):
        squares |= dict.fromkeys(
            directed, image.power.filtered_power(_directional_tables(path, tables))
        )
    changes = {effect.name: image.rms(square) for effect, square in squares.items()}
    if path.field is not None:
        changes[path.field.name] = math.hypot(changes[path.field.name], field_change)
    return changes


def _omission_tables(
    path: OpticalPath, image: SampledImage, radial: list[RadialTransfer]
) -> Tables:
    """Return the radial part with fewer transfer functions, less the whole of it."""
    whole = image.tables.radial
    others = path.transfer.with_effects(radial).with_mixtures(image.tables.mix)
    size = TableSize(image.tables.top, whole.shape[-1], 0.0, 0.0)
    return replace(image.tables, radial=radial_table(others, size) - whole)


def _radial_power(image: SampledImage, tables: Tables, by_length: Array) -> Array:
    """Return the mean squares (C,) of what tables over |f| pass [(e/s)^2].

    By the lengths of frequencies it takes a quarter of the time of `filtered_power`.
    """
    total: Array = np.zeros(tables.colors)
    for (r, s), squares in zip(image.power.pairs, by_length, strict=True):
        total += (tables.radial[r] * tables.radial[s]) @ squares
    return np.maximum(total, 0)


def _directional_tables(path: OpticalPath, tables: Tables) -> Tables:
    """Return what a blur with a direction, or the mean of one that changes over the field, adds."""
    if tables.factors or not tables.is_radial:
        return replace(tables, is_change=True)
    uniform_transfer = path.transfer.with_mixtures(tables.mix)
    size = TableSize(tables.top, tables.radial.shape[-1], 0.0, 0.0)
    return replace(tables, radial=tables.radial - radial_table(uniform_transfer, size))


def needed_modes(
    path: OpticalPath, image: SampledImage, modes: tuple[Mode, ...]
) -> tuple[tuple[Mode, ...], float]:
    """Return the modes of the field that a picture needs.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    image : SampledImage
        The scene's spectrum.
    modes : tuple of Mode
        All modes of the field.

    Returns
    -------
    kept : tuple of Mode
        The needed modes, in their order.
    change : float
        Rms that all modes add [e/s].
    """
    light = np.array([image.rms(image.power.largest_power(mode.tables())) for mode in modes])
    # Light may lie where a map is largest, at a corner of few pixels.
    most = np.square(light * [float(np.abs(mode.map.values).max()) for mode in modes])
    allowed = MODES_SHARE * path.settings.tolerance * path.full
    weakest = np.argsort(most)
    dropped = set(weakest[np.cumsum(most[weakest]) <= allowed**2].tolist())
    kept = tuple(mode for i, mode in enumerate(modes) if i not in dropped)
    means = np.array([mode.map.mean_square for mode in modes])
    return kept, math.sqrt(float(means @ np.square(light)))
