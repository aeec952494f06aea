"""Layers of a scene as flat scenes: each is what a camera sees that looks at it alone."""

from __future__ import annotations

import math
from typing import Any

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.lens import focus_distance, lens
from vcam_cli.camera.scene.scene import Extent
from vcam_cli.camera.scene.sources import Layers
from vcam_cli.errors import Collector, bad

PATH = ("scene", "source", "layers")
DEPTH = ("scene", "source", "depth")


def layer_cameras(camera: Camera) -> tuple[Camera, ...]:
    """Return a camera for each layer of its scene, the nearest first; () for a flat scene.

    It has the same lens, focused as before, and sees the layer alone, at the layer's distance. Its
    source has the layer's motion, its extent the layer's width.
    """
    source = camera.scene.source
    if not isinstance(source, Layers):
        return ()
    found = []
    for layer in source.layers:
        alone = layer.source.model_copy(update={"motion": layer.motion})
        extent = "sensor" if layer.width is None else Extent.model_construct(width=layer.width)
        found.append(_looking_at(camera, source=alone, distance=layer.distance, extent=extent))
    return tuple(found)


def camera_at(camera: Camera, distance: float) -> Camera:
    """Return a camera that sees all of a picture with depth at one distance [m], as a layer of it.

    It has the same lens, focused as before; the map of depth is left out.
    """
    source = camera.scene.source.model_copy(update={"depth": None})
    return _looking_at(camera, source=source, distance=distance)


def flat_camera(camera: Camera, alone: Camera) -> Camera:
    """Return a camera of one layer that is all of its scene, with the effects of the whole."""
    effects = camera.effects
    if isinstance(effects, dict):  # no depth is left to be simulated
        effects = {name: state for name, state in effects.items() if name != "depth"}
    return alone.model_copy(update={"effects": effects})


def _looking_at(camera: Camera, **changes: Any) -> Camera:
    """Return the camera, focused as before, with another scene."""
    optics = camera.optics.model_copy(update={"focus_distance": focus_distance(camera)})
    effects = camera.effects
    if isinstance(effects, dict):  # what is wanted of the whole need not be in each layer
        effects = {name: state for name, state in effects.items() if state != "on"}
    scene = camera.scene.model_copy(update=changes)
    return camera.model_copy(update={"scene": scene, "optics": optics, "effects": effects})


def with_flat_scene(camera: Camera) -> Camera:
    """Return the camera; with a flat scene where a single layer that hides nothing is all of it."""
    layers = camera.scene.source.layers if isinstance(camera.scene.source, Layers) else ()
    if len(layers) != 1 or layers[0].width is not None or layers[0].mask is not None:
        return camera
    [alone] = layer_cameras(camera)
    return flat_camera(camera, alone)


def check_layers(camera: Camera) -> None:
    """Refuse distances that no lens images, and sizes that are not known (BadInput)."""
    source = camera.scene.source
    if not camera.scene.has_distances:
        return
    if not camera.optics.is_lens:
        message = "without a lens no layer is imaged, at any distance"
        place = PATH if isinstance(source, Layers) else DEPTH
        raise bad(place, message, "use a flat source, or give a lens")
    if not isinstance(source, Layers):
        if isinstance(camera.scene.extent, Extent):
            message = "a picture with depth always covers the array"
            raise bad(("scene", "extent"), message, "remove it")
        return
    if isinstance(camera.scene.extent, Extent):
        message = "every layer has a width of its own"
        raise bad(("scene", "extent"), message, "remove it, and give the layers' widths")
    problems, focal = Collector(), lens(camera).focal_length
    for number, layer in enumerate(source.layers):
        if layer.distance <= focal:
            message = f"{layer.distance:.6g} m lies within the focal length of {focal:.6g} m"
            remedy = "put the layer further away, or use a shorter focal length"
            problems.add((*PATH, number, "distance"), message, remedy)
        if math.isinf(layer.distance) and layer.width is not None:
            message = "an object at infinity has no width in meters"
            problems.add((*PATH, number, "width"), message, "remove it: the layer fills the frame")
    problems.raise_if_any()
