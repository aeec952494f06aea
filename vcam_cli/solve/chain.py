"""The readout chain of a camera, of one readout or several."""

from __future__ import annotations

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.electrical import Electrical
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.readouts import has_several, readouts
from vcam_cli.readout.binning import BinningGroups
from vcam_cli.readout.chain import ReadoutChain
from vcam_cli.solve.effects import CameraEffects
from vcam_cli.solve.merge import branch, camera_merge


def readout_chain(
    camera: Camera,
    geometry: Geometry,
    circuit: Electrical,
    effects: CameraEffects,
    groups: BinningGroups,
) -> ReadoutChain:
    """Return the readout chain of a camera, with the effects that the user has not switched off.

    Parameters
    ----------
    camera : Camera
        The camera, at the gain of its exposure.
    geometry : Geometry
        Its geometry.
    circuit : Electrical
        Its well and ADC.
    effects : CameraEffects
        Its effects.
    groups : BinningGroups
        Pixels that are read as one.
    """
    chain = ReadoutChain.single(circuit, effects.adc, effects.enabled, groups)
    if not has_several(camera):
        return chain
    every = [branch(each, geometry) for each in readouts(camera)]
    branches = tuple(
        one.without_effects([e.name for e in one.effects if effects.is_off(e.name)])
        for one in every
    )
    return chain.branched(branches, camera_merge(camera, geometry))
