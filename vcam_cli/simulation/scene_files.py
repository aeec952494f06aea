"""What the files of a scene hold, and the scene that image formation makes of it."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.scene_layers import PATH, layer_cameras
from vcam_cli.camera.scene.sources import Layers
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.optics.depth import Depth
from vcam_cli.image_formation.optical_path import LayerOptics
from vcam_cli.progress import Stages
from vcam_cli.scenes.base import View
from vcam_cli.scenes.build import build
from vcam_cli.scenes.build_layers import LayerFiles, PlacedLayer, build_layers
from vcam_cli.scenes.hyperspectral import Cube
from vcam_cli.scenes.layered import AnyScene
from vcam_cli.simulation import plan

ScenePicture = NDArray | Cube | tuple[LayerFiles, ...] | None
"""Samples of an image file (h, w, channels) in linear light, the cube of a hyperspectral file, the
files of each layer; None for charts."""
SOURCE = ("scene", "source")


def read_scene(camera: Camera, stages: Stages) -> tuple[Any, tuple[str, ...]]:
    """Return what the scene's files hold (`ScenePicture`), and notes.

    Raises BadInput for files that cannot be used.
    """
    source, path = camera.scene.source, (*SOURCE, "file")
    if source.kind == "image":
        from vcam_cli.files.images.images import read_picture

        with stages("read"):
            read = read_picture(source.file, source.encoding, source.white, path)
        return read.data, read.notes
    if source.kind == "hyperspectral":
        from vcam_cli.files.spectral.hyperspectral import read_cube
        from vcam_cli.scenes.hyperspectral import check_place

        with stages("read"):
            cube, notes = read_cube(source.file, path, source.channels)
        check_place(cube.bands, camera.optics.is_lens)
        return cube, notes
    if isinstance(source, Layers):
        with stages("read"):
            return _read_layers(source)
    return None, ()


def _read_layers(source: Layers) -> tuple[tuple[LayerFiles, ...], tuple[str, ...]]:
    from vcam_cli.files.images.images import read_picture
    from vcam_cli.files.images.scene_maps import read_opacity

    found, notes = list[LayerFiles](), list[str]()
    for number, layer in enumerate(source.layers):
        place, picture, mask = (*PATH, number), None, None
        if layer.source.kind == "image":
            image, at = layer.source, (*place, "source", "file")
            read = read_picture(image.file, image.encoding, image.white, at)
            picture = read.data if image.crop is None else read.data[image.crop.window]
            notes += [note for note in read.notes if layer.mask is None or "alpha" not in note]
        if layer.mask is not None:
            mask = read_opacity(layer.mask, (*place, "mask"))
        found.append(LayerFiles(picture, mask))
    return tuple(found), tuple(dict.fromkeys(notes))


def scene_bytes(picture: ScenePicture) -> int:
    """Return the memory of what was read [bytes]."""
    if isinstance(picture, tuple):
        return sum(files.nbytes for files in picture)
    return getattr(picture, "nbytes", 0)


def build_scene(camera: Camera, view: View, picture: ScenePicture) -> AnyScene:
    """Return the scene of a camera on a view, from what its files hold; raises as `build` does."""
    source = camera.scene.source
    if not isinstance(source, Layers):
        if isinstance(picture, tuple):
            raise ValueError("a flat source has no layers")
        return build(camera.scene, view, picture, camera.display.primaries)
    if not isinstance(picture, tuple):
        raise ValueError("layers need what their files hold")
    placed = []
    layers = zip(source.layers, layer_cameras(camera), picture, strict=True)
    for layer, alone, files in layers:
        solved = geometry(alone)
        center = layer.position[0] * solved.scene_scale, layer.position[1] * solved.scene_scale
        placed.append(PlacedLayer(alone.scene, solved.scene_width_on_sensor, center, files))
    return build_layers(placed, view)


def layer_optics(camera: Camera, effects: tuple[Effect, ...]) -> tuple[LayerOptics, ...]:
    """Return what acts on the light of each layer; () of a scene that is seen flat."""
    if not of_kind(effects, Depth):
        return ()
    found = []
    for alone in layer_cameras(camera):
        solved = geometry(alone)
        shift = alone.optics.defocus + solved.focus_shift
        radius = shift / (2 * solved.working_f_number)
        found.append(LayerOptics(plan.mean_signal_effects(alone, solved), radius))
    return tuple(found)
