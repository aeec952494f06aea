"""How a camera's readouts of one exposure are merged: by the noise that its file describes."""

from __future__ import annotations

import numpy as np

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.readouts import Readout, readouts
from vcam_cli.effects.base import Effect, switched_off
from vcam_cli.effects.noise.quantization import Quantization
from vcam_cli.effects.order import ORDER
from vcam_cli.effects.pixel_signal import Charge
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.effects.signal_chain import ElectronEffect, noise_sources
from vcam_cli.readout.binning import ALONE
from vcam_cli.readout.chain import Branch, ReadoutChain
from vcam_cli.readout.exposure import mean_dark
from vcam_cli.readout.merging import Merge, MergedReadout


def camera_merge(camera: Camera, geometry: Geometry) -> Merge:
    """Return how the readouts of a camera are merged.

    Parameters
    ----------
    camera : Camera
        The camera, at the gain of its exposure.
    geometry : Geometry
        Its geometry.
    """
    found = [_merged_readout(each, geometry) for each in readouts(camera)]
    last = {r.photodiode: 0.0 for r in found}
    for r in found:
        last[r.photodiode] = max(last[r.photodiode], r.top / r.sensitivity)
    # First the photodiode, and of it the gain, that saturates last.
    found.sort(key=lambda r: (-last[r.photodiode], -r.top))
    return Merge(tuple(found), camera.pixel.readout.merge)


def branch(readout: Readout, geometry: Geometry) -> Branch:
    """Return one readout of a camera, with all effects on its electrons.

    Parameters
    ----------
    readout : Readout
        One readout of a camera.
    geometry : Geometry
        Geometry of its array.
    """
    found = (
        kind.from_camera(readout.camera, geometry)
        for kind in ORDER
        if issubclass(kind, Charge | ElectronEffect)
    )
    effects: tuple[Effect, ...] = tuple(effect for effect in found if effect is not None)
    return Branch(
        circuit=electrical(readout.camera),
        adc=Quantization.from_camera(readout.camera, geometry),
        effects=effects,
        name=readout.name,
        sensitivity=readout.sensitivity,
        photodiode=readout.photodiode,
    )


def _merged_readout(readout: Readout, geometry: Geometry) -> MergedReadout:
    found = branch(readout, geometry)
    chain = ReadoutChain(whole=found, groups=ALONE)
    sources = noise_sources(found.effects, "frame")
    own = sum(s.variance(0.0) for s in sources if s.sample_draws == "independent")
    # Of noise the rule knows what the file describes; a dark signal is subtracted if there is one.
    running = [e for e in found.effects if not switched_off(readout.camera, e.name)]
    return MergedReadout(
        name=readout.name,
        chain=chain,
        sensitivity=readout.sensitivity,
        photodiode=readout.photodiode,
        # Half a step below the lowest code of a saturated pixel: none of it is one that is not.
        top=float(chain.to_electrons(np.array([chain.saturated_dn - 0.5]))[0]),
        own_variance=own + found.circuit.electrons_per_dn**2 / 12,
        common_variance=sum(s.variance(0.0) for s in sources if s.sample_draws == "common"),
        dark_rate=mean_dark(1.0, tuple(running)),
    )
