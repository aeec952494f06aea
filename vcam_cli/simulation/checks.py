"""What a run would refuse only later, found when its camera file is read.

The file's own contradictions are `camera.load`'s business; here is what takes the engine, the
processing or the picture to know. What only some cameras need is imported where it is checked:
`vcam validate` starts twice as fast.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera import load as files
from vcam_cli.camera.camera import Camera, example
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.image_motion import check_motion
from vcam_cli.camera.derived.lattice import places
from vcam_cli.camera.derived.line_times import check_shutter
from vcam_cli.camera.derived.scene_layers import PATH, check_layers, layer_cameras
from vcam_cli.camera.processing import SHOWN
from vcam_cli.camera.scene.scene_files import Crop
from vcam_cli.camera.scene.sources import Layers
from vcam_cli.camera.sensor.array import Positions
from vcam_cli.effects import readout_chain
from vcam_cli.effects.optics import lens_check
from vcam_cli.errors import bad, split
from vcam_cli.solve.layout import camera_layout

SOURCE = ("scene", "source")


def load(camera: str | Path, sets: Sequence[str] = ()) -> Camera:
    """Return the camera of a file, as `camera.load.load` does, with all checks that need no light.

    Parameters
    ----------
    camera : str or Path
        File, or name of a camera that ships.
    sets : sequence of str, optional
        Changes `KEY=VALUE`, applied in their order.

    Returns
    -------
    Camera
        Camera that passed all checks.

    Raises
    ------
    BadInput
        With all problems of the file at once.
    """
    return files.load(camera, sets, checks=CHECKS)


def check_effects(camera: Camera) -> None:
    """Refuse effects that are on but not described in the file.

    The check does not depend on the solution of lens and readout: a good camera's numbers replace
    theirs, so that an error in them hides nothing here.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        For an effect that is on and has no numbers.
    """
    if not isinstance(camera.effects, dict) or "on" not in camera.effects.values():
        return
    from vcam_cli.solve.effects import camera_effects

    good = example()
    names = ("conversion_gain", "voltage_swing", "full_well")
    solved = {name: getattr(good.pixel.readout, name) for name in names}
    readout = camera.pixel.readout.model_copy(update=solved)
    pixel = camera.pixel.model_copy(update={"readout": readout})
    adc = good.adc.model_copy(update={"noise": camera.adc.noise})
    camera_effects(camera.model_copy(update={"pixel": pixel, "adc": adc}), geometry(good))


def check_size(camera: Camera) -> None:
    """Refuse an array too small for the demosaicing of its processing.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        For fewer than 2 x 2 pixels, or a missing color among scattered ones.
    """
    if camera.array.is_scattered:
        _check_every_color(camera)
        return
    solved = camera_layout(camera, geometry(camera)).geometry
    if any(step.name == "demosaic" for step in camera.processing):
        for name, count in (("rows", solved.rows), ("columns", solved.columns)):
            if count < 2:
                path = ("array", "die" if camera.array.die is not None else name)
                message = f"{solved.rows} x {solved.columns} pixels cannot be demosaiced"
                raise bad(path, message, "use an array of at least 2 x 2 pixels")


def _check_every_color(camera: Camera) -> None:
    """Refuse scattered pixels if a color has no pixel (BadInput)."""
    layout = camera_layout(camera, geometry(camera))
    there = {layout.mosaic.colors[index] for index in np.unique(layout.color)}
    missing = [color for color in layout.mosaic.colors if color not in there]
    if missing and any(step.name == "demosaic" for step in camera.processing):
        message = f"too few pixels: none of color {', '.join(missing)}, and cannot be demosaiced"
        raise bad("array", message, "use a larger array")


def check_binning(camera: Camera) -> None:
    """Refuse an array that is no whole number of binning groups.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        For such an array.
    """
    if not camera.array.is_scattered:
        camera_layout(camera, geometry(camera))


def check_positions(camera: Camera) -> None:
    """Refuse positions of colors that cannot be processed into a picture.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        For steps that scattered pixels do not allow, or colors without a display's.
    """
    if not isinstance(camera.array.pattern, Positions):
        return
    from vcam_cli.processing import check as check_steps

    colors = tuple(dict.fromkeys(places(camera).colors))
    check_steps(camera.processing, (), colors, camera.quality, scattered=True)
    done = {step.name for step in camera.processing if step.value != "none"}
    wanted = bool(camera.quality or camera.output.render) and "demosaic" in done
    if wanted and len(colors) not in SHOWN and "color_correction" not in done:
        message = f"{', '.join(colors)} are not the colors of a display"
        raise bad(("processing",), message, "add color_correction: fit, behind the demosaic")


def check_picture(camera: Camera) -> None:
    """Refuse a picture that is unreadable or contradicts its description.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        For such a picture, with its file.
    """
    source, path = camera.scene.source, (*SOURCE, "file")
    if source.kind == "image":
        from vcam_cli.files.images.images import color_channels, picture_size
        from vcam_cli.scenes.build import check_channels

        check_channels(source.model, color_channels(source.file, path))
        if source.crop is not None:
            _check_crop(source.crop, picture_size(source.file, path), SOURCE)
    if isinstance(source, Layers):
        _check_crops_of_layers(source)
    if source.kind == "hyperspectral":
        from vcam_cli.files.spectral.hyperspectral import read_bands
        from vcam_cli.scenes.hyperspectral import check_bands, check_place

        bands = read_bands(source.file, path, source.names)
        check_place(bands, camera.optics.is_lens)
        check_bands(camera.scene, bands)


def check_depth(camera: Camera) -> None:
    """Refuse a depth map that contradicts its picture or the lens.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        For such a map.
    """
    source, path = camera.scene.source, (*SOURCE, "file")
    if not camera.scene.has_depth or not camera.optics.is_lens:
        return
    from vcam_cli.simulation.scene_files import read_map

    if source.kind == "image":
        from vcam_cli.files.images.images import picture_size

        read_map(camera, picture_size(source.file, path))
    if source.kind == "hyperspectral":
        from vcam_cli.files.spectral.hyperspectral import spectra_size

        read_map(camera, spectra_size(source.file, path, source.names))


def _check_crops_of_layers(source: Layers) -> None:
    from vcam_cli.files.images.images import picture_size

    for number, layer in enumerate(source.layers):
        shown, place = layer.source, (*SOURCE, "layers", number, "source")
        if shown.kind == "image" and shown.crop is not None:
            _check_crop(shown.crop, picture_size(shown.file, (*place, "file")), place)


def _check_crop(crop: Crop, size: tuple[int, int], place: tuple[str | int, ...]) -> None:
    """Refuse a crop that goes beyond its picture of `size`, rows and columns (BadInput)."""
    for name, part, whole in zip(("rows", "columns"), crop.window, size, strict=True):
        if part.stop > whole:
            message = f"the crop ends at {part.stop}, the picture has {whole} {name}"
            raise bad((*place, "crop", name), message, "take a smaller crop, or begin it earlier")


def check_spectral_file(camera: Camera) -> None:
    """Refuse a file of spectra that ends at wavelengths that the camera sees.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        Where more than the tolerance of white's electrons lies beyond its bands.
    """
    source = camera.scene.source
    if source.kind == "hyperspectral":
        from vcam_cli.files.spectral.hyperspectral import read_bands
        from vcam_cli.scenes.hyperspectral import check_coverage
        from vcam_cli.simulation import scene_bands
        from vcam_cli.solve.response import responses

        bands = read_bands(source.file, (*SOURCE, "file"), source.names)
        seen = responses(camera, camera_layout(camera, geometry(camera)).mosaic)
        if scene_bands.unseen_share(camera.scene, seen, bands) > camera.accuracy.tolerance:
            check_coverage(camera.scene, bands)


def check_lens(camera: Camera) -> None:
    """Refuse a wavefront too steep, or an unreadable point spread function.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        For such a lens.
    """
    read_lens(camera)


def read_lens(camera: Camera) -> dict[str, Array]:
    """Return the contents of the optics' files, for `Camera.with_samples`.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Returns
    -------
    dict of str to Array
        Samples by the dotted path of their key; empty without a file.

    Raises
    ------
    BadInput
        For a wavefront too steep, or an unreadable point spread function.
    """
    lens_check.check(camera, geometry(camera))
    for number, alone in enumerate(layer_cameras(camera)):
        from vcam_cli.simulation.scene_files import check_blur

        check_blur(alone, (*PATH, number, "distance"))
    psf = camera.optics.psf
    if psf is None:
        return {}
    from vcam_cli.effects.optics.point_spread import PSF
    from vcam_cli.files.images.psf import read_psf

    channels = max(len(psf.wavelengths), 1)
    return {PSF: read_psf(psf.file, channels, (*split(PSF), "file"))}


def check_maps(camera: Camera) -> None:
    """Refuse unusable maps of the fixed pattern.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        For such maps.
    """
    read_maps(camera)


def read_maps(camera: Camera) -> dict[str, Array]:
    """Return the maps of the fixed pattern, for `Camera.with_samples`.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Returns
    -------
    dict of str to Array
        Maps (rows, columns) by the dotted path of their key; empty without a file.

    Raises
    ------
    BadInput
        For a file that is no map, is smaller than the array, or has values that are not finite,
        or negative gains or dark currents.
    """
    fpn = camera.pixel.fpn
    files = fpn.offset_map, fpn.gain_map, fpn.dark_map
    if not any(files):
        return {}
    from vcam_cli.effects.noise import fpn_maps
    from vcam_cli.files.images.scene_maps import read_pixels

    found, g = {}, geometry(camera)
    for key, file in zip(fpn_maps.MAPS, files, strict=True):
        if file is not None:
            found[key] = read_pixels(file, split(key), (g.rows, g.columns), key != fpn_maps.OFFSET)
    return found


def check_display(camera: Camera) -> None:
    """Refuse a display too fine to be judged, where a metric uses it.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        For such a display.
    """
    if {"cielab", "s-cielab"} & set(camera.quality):
        from vcam_cli.quality.display import display_screen

        display_screen(camera.display, camera_layout(camera, geometry(camera)).picture_shape[1])


def check_files(camera: Camera) -> None:
    """Refuse requested files that cannot hold the camera's frame.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        For DNG or ISETCam files that cannot.
    """
    if camera.output.dng:
        from vcam_cli.simulation.output import raw_dng

        raw_dng.check(camera)
    if camera.output.isetcam:
        from vcam_cli.simulation.output import isetcam_files

        isetcam_files.check(camera)


def check_irradiance(camera: Camera) -> None:
    """Refuse point samples of light that consists of lines.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        For such light, where the irradiance is sampled at points.
    """
    if camera.output.irradiance_sampling != "band":
        from vcam_cli.simulation import spectral_irradiance

        spectral_irradiance.check(camera)


def check_radiance(camera: Camera) -> None:
    """Refuse scenes whose radiance has no single picture.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        For a scene of several distances, where its radiance is written.
    """
    if camera.output.radiance:
        from vcam_cli.simulation import scene_radiance

        scene_radiance.check(camera)


CHECKS: tuple[files.CameraCheck, ...] = (
    (check_effects, "optics pixel effects"),
    (check_shutter, "array exposure"),
    (check_motion, "scene optics exposure"),
    (check_layers, "scene optics pixel array"),
    (check_binning, "pixel array exposure adc"),
    (check_size, "pixel array processing"),
    (check_positions, "pixel array processing"),
    (check_picture, "scene"),
    (check_depth, "scene optics pixel array"),
    (check_spectral_file, "scene optics pixel array exposure adc accuracy"),
    (check_maps, "pixel array"),
    (check_lens, "optics scene pixel array effects"),
    (readout_chain.check, "scene optics pixel array adc exposure"),
    (check_files, "pixel array exposure adc output"),
    (check_irradiance, "scene output"),
    (check_radiance, "scene output"),
    (check_display, "optics scene pixel array quality display"),
)
