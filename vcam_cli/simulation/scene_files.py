"""What the files of a scene hold, and the scene that image formation makes of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.scene_layers import DEPTH, PATH, camera_at
from vcam_cli.camera.scene.scene_files import DepthMap, Hyperspectral, ImageFile
from vcam_cli.camera.scene.sources import Layers
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.optics import lens_check
from vcam_cli.effects.optics.depth import Depth
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.errors import BadInput, bad
from vcam_cli.image_formation import photon_rate
from vcam_cli.image_formation.optical_path import LayerOptics
from vcam_cli.physics.diffraction import otf_circular
from vcam_cli.progress import Stages
from vcam_cli.scenes.base import View
from vcam_cli.scenes.build import build
from vcam_cli.scenes.build_layers import LayerFiles, PlacedLayer, build_layers
from vcam_cli.scenes.depth_scene import (
    DepthPicture,
    DepthScene,
    LensBlur,
    depth_scene,
    flat_distance,
)
from vcam_cli.scenes.hyperspectral import Cube
from vcam_cli.scenes.image import ImageScene
from vcam_cli.scenes.layered import AnyScene
from vcam_cli.solve.solved import Solved

ScenePicture = Array | Cube | DepthPicture | tuple[LayerFiles, ...] | None
"""Samples of an image file (h, w, channels) in linear light, the cube of a hyperspectral file, one
of both with its map of depth, the files of each layer; None for charts."""
SOURCE = ("scene", "source")


def read_scene(camera: Camera, stages: Stages) -> tuple[Any, tuple[str, ...]]:
    """Return the contents of the scene's files.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.
    stages : Stages
        Stopwatch of the run's stages.

    Returns
    -------
    tuple
        Contents (`ScenePicture`), and notes.

    Raises
    ------
    BadInput
        For files that cannot be used.
    """
    source, path = camera.scene.source, (*SOURCE, "file")
    if source.kind == "image":
        from vcam_cli.files.images.images import read_picture

        with stages("read"):
            read = read_picture(source.file, source.encoding, source.white, path)
            return _with_depth(camera, read.data, read.notes)
    if source.kind == "hyperspectral":
        from vcam_cli.files.spectral.hyperspectral import read_cube
        from vcam_cli.scenes.hyperspectral import check_place

        with stages("read"):
            cube, notes = read_cube(source.file, path, source.names)
            check_place(cube.bands, camera.optics.is_lens)
            if camera.scene.has_depth:  # layers cut it in many ways
                cube = replace(cube, data=np.asarray(cube.data))
            return _with_depth(camera, cube, notes)
    if isinstance(source, Layers):
        with stages("read"):
            return _read_layers(source)
    return None, ()


def _with_depth(
    camera: Camera, picture: Array | Cube, notes: tuple[str, ...]
) -> tuple[ScenePicture, tuple[str, ...]]:
    """Return a picture with its map of depth, where it has one."""
    if not camera.scene.has_depth:
        return picture, notes
    data = picture.data if isinstance(picture, Cube) else picture
    depth, more = read_map(camera, (data.shape[0], data.shape[1]))
    return DepthPicture(picture, depth), (*notes, *more)


def read_map(camera: Camera, size: tuple[int, int]) -> tuple[Array, tuple[str, ...]]:
    """Return the depth map beside a scene's file.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.
    size : tuple of int
        Height and width of the file [samples].

    Returns
    -------
    tuple
        Depth (h, w) [m], and notes.

    Raises
    ------
    BadInput
        For a map that contradicts the file, or depths that the lens cannot image.
    """
    from vcam_cli.files.images.scene_maps import read_depth

    source, focal = camera.scene.source, geometry(camera).focal_length
    assert isinstance(source, ImageFile | Hyperspectral)
    if isinstance(source.depth, DepthMap):
        name = source.depth.file
        depth, notes = read_depth(name, source.depth.unit, DEPTH, size)
    else:
        name = source.file
        depth, notes = read_depth(name, 1.0, DEPTH, size, source.depth)
    nearest = float(depth.min())
    if nearest <= focal:
        row, column = np.argwhere(depth == depth.min())[0]
        message = (
            f"{name}: {nearest:.6g} m at row {row}, column {column} lies within the focal length of"
            f" {focal:.6g} m"
        )
        raise bad(DEPTH, message, "check the unit of the map, or use a shorter focal length")
    for distance in (nearest, float(depth.max())):
        check_blur(camera_at(camera, distance), DEPTH)
    return depth, notes


def check_blur(alone: Camera, path: tuple[str | int, ...]) -> None:
    """Refuse a distance at which a camera's blur cannot be computed.

    Parameters
    ----------
    alone : Camera
        Camera that looks at this distance only.
    path : tuple of str or int
        Key of the distance.

    Raises
    ------
    BadInput
        For such a distance.
    """
    try:
        lens_check.check(alone, geometry(alone))
    except BadInput as error:
        [problem] = error.problems
        message = f"what lies at {alone.scene.distance:.6g} m {problem.message}"
        remedy = "stop down, focus closer to it, or write effects: {diffraction: off} for rays"
        if alone.optics.measured_blur:
            message, remedy = (
                problem.message,
                "use a flat scene, or another description of the lens",
            )
        raise bad(path, message, remedy) from None


def flattened(solved: Solved, picture: ScenePicture) -> tuple[Solved, Any, tuple[str, ...]]:
    """Return the camera without a depth map that is one distance within the tolerance.

    Then the scene is flat, at that distance. With autofocus the tolerance is 0.

    Parameters
    ----------
    solved : Solved
        Solved camera.
    picture : ScenePicture
        Contents of the scene's files.

    Returns
    -------
    tuple
        Camera, contents without the map, and a note where the map is flat.
    """
    if not isinstance(picture, DepthPicture):
        return solved, picture, ()
    view = photon_rate.view(solved.layout.lattice, solved.settings, 0)
    flat = _flat(solved, view, picture)
    tolerance = 0.0 if solved.optics.focus == "auto" else solved.tolerance
    distance = flat_distance(flat, picture, view, _blur(solved), tolerance)
    if distance is None:
        return solved, picture, ()
    note = f"the map of depth is flat within the tolerance: the scene lies at {distance:.6g} m"
    return solved.flat_at(distance), picture.picture, (note,)


def _flat(solved: Solved, view: View, picture: DepthPicture) -> ImageScene:
    """Return a picture with depth as a pinhole sees it."""
    found = build(solved.scene, view, picture.picture, solved.display.primaries)
    assert isinstance(found, ImageScene)
    return found


def _blur(solved: Solved) -> LensBlur:
    """Return how a camera's lens blurs points by their distance."""
    g, optics = solved.geometry, solved.optics
    # Blur over 1 / distance, at what is in focus; f (1 / P - 1) before the entrance pupil.
    behind = g.focal_length * (1 / g.pupil_magnification - 1)
    slope = g.image_distance * g.focal_length / (2 * g.f_number)
    slope /= 1 + behind / g.focus_distance
    shift = optics.defocus / (2 * g.working_f_number)
    off = solved.effects.is_off(Diffraction.name)
    wavelength = solved.scene.wavelengths.start

    def sharp(frequency: Array) -> Array:
        if off or not optics.diffraction:
            return np.ones_like(frequency)
        return otf_circular(frequency, wavelength, g.working_f_number)

    aperture = g.collecting_width, g.collecting_height
    return LensBlur(slope, shift - slope / g.focus_distance, sharp, aperture)


def _read_layers(source: Layers) -> tuple[tuple[LayerFiles, ...], tuple[str, ...]]:
    from vcam_cli.files.images.images import LinearImage, read_picture
    from vcam_cli.files.images.scene_maps import read_opacity

    found, notes = list[LayerFiles](), list[str]()
    pictures: dict[tuple[str, str, float], LinearImage] = {}  # layers may share a file
    for number, layer in enumerate(source.layers):
        place, picture, mask = (*PATH, number), None, None
        if layer.source.kind == "image":
            image, at = layer.source, (*place, "source", "file")
            kept = image.file, image.encoding, image.white
            if kept not in pictures:
                pictures[kept] = read_picture(*kept, at)
            read = pictures[kept]
            picture = read.data if image.crop is None else read.data[image.crop.window]
            notes += [note for note in read.notes if layer.mask is None or "alpha" not in note]
        if layer.mask is not None:
            mask = read_opacity(layer.mask, (*place, "mask"))
        found.append(LayerFiles(picture, mask))
    return tuple(found), tuple(dict.fromkeys(notes))


def scene_bytes(picture: ScenePicture) -> int:
    """Return the memory of a scene's files.

    Parameters
    ----------
    picture : ScenePicture
        Contents of the scene's files.

    Returns
    -------
    int
        Memory [bytes].
    """
    if isinstance(picture, tuple):
        arrays = (array for files in picture for array in (files.picture, files.mask))
        return sum({id(one): one.nbytes for one in arrays if one is not None}.values())
    return getattr(picture, "nbytes", 0)


def reading_bytes(picture: ScenePicture) -> int:
    """Return the memory that was taken beside a scene's files while they were read.

    Parameters
    ----------
    picture : ScenePicture
        Contents of the scene's files.

    Returns
    -------
    int
        Memory [bytes].
    """
    of_depth = picture.picture if isinstance(picture, DepthPicture) else picture
    return of_depth.reading if isinstance(of_depth, Cube) else 0


def build_scene(
    solved: Solved, view: View, picture: ScenePicture, overexposure: float = 1.0
) -> AnyScene:
    """Return the scene of a camera on a view.

    Parameters
    ----------
    solved : Solved
        Solved camera.
    view : View
        Grid of samples on the sensor.
    picture : ScenePicture
        Contents of the scene's files.
    overexposure : float, optional
        White over the signal that fills a pixel; below 1 it counts as 1.

    Returns
    -------
    AnyScene
        Scene; raises as `build` does.

    Raises
    ------
    ValueError
        Where the contents do not match the source.
    """
    source = solved.scene.source
    if isinstance(picture, DepthPicture):
        flat = _flat(solved, view, picture)
        most = 1 / max(overexposure, 1.0)
        return depth_scene(flat, picture, view, _blur(solved), solved.tolerance, most)
    if not isinstance(source, Layers):
        if isinstance(picture, tuple):
            raise ValueError("a flat source has no layers")
        return build(solved.scene, view, picture, solved.display.primaries)
    if not isinstance(picture, tuple):
        raise ValueError("layers depend on their files")
    placed = []
    layers = zip(source.layers, solved.layers, picture, strict=True)
    for layer, alone, files in layers:
        g = alone.geometry
        center = layer.position[0] * g.scene_scale, layer.position[1] * g.scene_scale
        placed.append(PlacedLayer(alone.scene, g.scene_width_on_sensor, center, files))
    return build_layers(placed, view)


def layer_optics(
    solved: Solved, effects: tuple[Effect, ...], scene: AnyScene
) -> tuple[LayerOptics, ...]:
    """Return the effects on the light of each layer.

    Parameters
    ----------
    solved : Solved
        Solved camera.
    effects : tuple of Effect
        Effects in their order.
    scene : AnyScene
        Scene with its layers.

    Returns
    -------
    tuple of LayerOptics
        Effects and defocus of each layer; () of a scene that is seen flat.
    """
    if not of_kind(effects, Depth):
        return ()
    layers = solved.layers
    if isinstance(scene, DepthScene):
        layers = solved.layers_at(tuple(scene.distances))
    return tuple(LayerOptics(alone.effects, alone.radius) for alone in layers)
