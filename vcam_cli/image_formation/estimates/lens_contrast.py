"""The contrast that a lens leaves where it is sharpest, by which cells and colors are chosen.

C(f) = max over places and directions of |sum over wavelengths of w(l) H(f, l)|
"""

from __future__ import annotations

from functools import partial

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import ByteCache
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.blurs import Blur, PlaneTransfer, RadialTransfer
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.physics.pupil_harmonics import in_directions

TURNS = 2
"""Directions in half a turn over the highest harmonic: the largest contrast is known to 10 %."""


def lens_contrast(path: OpticalPath, frequency: Array) -> Array:
    """Return the contrast of waves, in the color with most light.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    frequency : Array
        Spatial frequencies (n,) [cycles/m].

    Returns
    -------
    Array
        Contrast (n,) without unit: of blurs that depend on |f| alone, and of the one that changes
        over the field.
    """
    field = path.field, path.settings.field_zones
    key = path.transfer.key, path.has_opacity, field, frequency.tobytes()
    return _CONTRASTS.get(key, partial(_contrast, path, frequency))


_CONTRASTS: ByteCache[Array] = ByteCache(1 << 20)
"""Those of the last lenses: planning, metering and painting need the same."""


def _contrast(path: OpticalPath, frequency: Array) -> Array:
    """Compute what `lens_contrast` returns."""
    transfer, weights = path.transfer, path.judged_weights.sum(axis=0)
    if not path.field_rings:
        mean = (weights / (weights.sum() or 1.0)) @ transfer.otf_radial(frequency)
        return np.asarray(mean)
    one = Transfer(transfer.wavelengths, weights[None, None], transfer.radial_blurs)
    light = one.with_half_the_wavelengths()
    share = light.weights[0, 0] / (light.weights.sum() or 1.0)
    before = share[:, None] * light.otf_radial(frequency)
    found = [
        _in_any_direction(ring.blur, before, frequency, light.wavelengths)
        for ring in path.field_rings
    ]
    return np.asarray(np.max(found, axis=0))


def _in_any_direction(blur: Blur, before: Array, frequency: Array, wavelengths: Array) -> Array:
    """Return the largest contrast in any direction behind a blur, from what lies before (J, n)."""
    if radial := of_kind([blur], RadialTransfer):
        return np.asarray(
            np.abs((before * radial[0].spectral_otf(frequency, wavelengths)).sum(axis=0))
        )
    directed = of_kind([blur], PlaneTransfer)[0]
    parts = np.einsum("jn,jnm->nm", before, directed.harmonics(frequency, wavelengths))
    count = TURNS * parts.shape[1]
    values = in_directions(parts, np.arange(count) * (np.pi / count))
    return np.asarray(np.abs(values).max(axis=1))
