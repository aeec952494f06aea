"""What `vcam run` leaves in its folder: raw.exr, render.png, metrics.csv, ideal.exr, run.json.

Of several samples of one integration also captures/raw_001.exr and so on, and hdr.exr. Raw files
are written by a thread while metrics and render are computed, and the render while raw files are
still being written; files are most of a frame's cost.

What few runs write is imported where it is written.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import vcam_cli
from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.files import atomic
from vcam_cli.files.folder import OutputFolder
from vcam_cli.files.images.exr import ExrWriter
from vcam_cli.files.images.png import write_png
from vcam_cli.files.images.rows import Attribute
from vcam_cli.files.report import hash_file, hash_text, to_json
from vcam_cli.files.tables import write_metrics
from vcam_cli.memory import peak_memory
from vcam_cli.parallel import ThreadPool
from vcam_cli.processing.color_correction import CHROMATICITIES
from vcam_cli.simulation.figures import exposure_report
from vcam_cli.simulation.frame import Frame
from vcam_cli.simulation.output import provenance, raw_file
from vcam_cli.simulation.output.provenance import versions
from vcam_cli.simulation.output.raw_file import ROWS_AT_ONCE
from vcam_cli.simulation.photograph import Photograph


def save(result: Photograph, out: Path) -> Path:
    """Write all files of one run, the record too, into a folder; return it.

    Parameters
    ----------
    result : Photograph
        Photograph to write.
    out : Path
        Folder.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    BadInput
        Where something else has the folder's name.
    CannotDo
        Where a file cannot be written.
    """
    inputs = provenance.inputs(result.frame.camera)
    start = time.perf_counter()
    computed = sum(result.stages.seconds.values())
    with OutputFolder(out, inputs=inputs) as folder:
        write(result, folder)
        finish(result, folder, inputs, lambda: computed + time.perf_counter() - start)
    return out


def finish(
    result: Photograph,
    folder: OutputFolder,
    inputs: tuple[Path, ...],
    seconds: Callable[[], float],
    memory: int = 0,
) -> dict[str, Any]:
    """Write the report where it is requested, and the record.

    Parameters
    ----------
    result : Photograph
        Photograph to write.
    folder : OutputFolder
        Folder of the run.
    inputs : tuple of Path
        Files that the run read.
    seconds : callable
        Returns the time of the run so far [s].
    memory : int, optional
        Estimated memory of other frames of the run [bytes].

    Returns
    -------
    dict
        Contents of `run.json`.

    Raises
    ------
    CannotDo
        Where a file cannot be written.
    """
    if result.frame.solved.output.report:
        from vcam_cli.simulation.output import run_report

        known = record(result, inputs, seconds(), memory)
        run_report.write(folder.new("report.html"), result, known)
    found = record(result, inputs, seconds(), memory)
    folder.finish(found)
    return found


def write(result: Photograph, folder: OutputFolder) -> None:
    """Write the files of one run, all but the record `run.json`.

    Parameters
    ----------
    result : Photograph
        Photograph to write.
    folder : OutputFolder
        Folder of the run.

    Raises
    ------
    CannotDo
        Where a file cannot be written.
    """
    camera = result.frame.solved
    with ThreadPool(2) as pool:
        raw = (*_raw_jobs(result, folder), *_sample_jobs(result, folder))
        jobs = [pool.submit(job) for job in raw]
        try:
            if camera.output.render:
                render = result.render
                jobs.append(
                    pool.submit(lambda: write_render(result, folder.new("render.png"), render))
                )
                compressed = result.processed.jpeg()
                if compressed is not None:
                    atomic.write_bytes(folder.new("render.jpg"), compressed)
            metrics = result.metrics
            if camera.quality:
                jobs.append(pool.submit(lambda: _ideal(result, folder.new("ideal.exr"))))
            if "s-cielab" in camera.quality:
                from vcam_cli.files.images.maps import write_map

                jobs.append(
                    pool.submit(lambda: write_map(folder.new("delta_e.png"), result.s_cielab))
                )
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
        with result.stages("files"):
            for done in jobs:
                done.result()
    if camera.output.steps:
        for name, shown in result.renders_of_steps():
            with result.stages("files"):
                write_render(result, folder.new(name), shown)
    if camera.output.irradiance:
        with result.stages("irradiance"):
            _irradiance(result, folder.new("irradiance.exr"))
    if camera.output.radiance:
        with result.stages("radiance"):
            _radiance(result, folder.new("radiance.exr"))
    if camera.output.isetcam:
        from vcam_cli.simulation.output import isetcam_files

        with result.stages("isetcam"):
            watch = result.stages.watch
            isetcam_files.write_isetcam(folder.new, result.frame, result.workers, watch.step)
    write_metrics(folder.new("metrics.csv"), metrics.rows)


def write_render(result: Photograph, path: Path, render: Array) -> None:
    """Write the render, with its exposure as the description.

    Parameters
    ----------
    result : Photograph
        Photograph to write.
    path : Path
        File to write.
    render : Array
        Picture (h, w) or (h, w, 3), 8 or 16 bits.

    Raises
    ------
    CannotDo
        Where the file cannot be written.
    """
    taken = raw_file.photograph(result.frame)
    write_png(path, render, "; ".join(f"{name} {value}" for name, value in taken.items()))


_SAMPLING = {
    "band": " and over the channel's band, which falls straight to 0 at the neighboring"
    " wavelengths; lines of light count whole",
    "point": ", at the channel's wavelength",
}
"""Sampling -> what a channel is."""


def _irradiance(result: Photograph, path: Path) -> None:
    """Spectral irradiance on the sensor, computed and written wavelength by wavelength."""
    from vcam_cli.files.spectral.exr import write_spectral
    from vcam_cli.simulation import spectral_irradiance

    frame = result.frame
    nodes = spectral_irradiance.nodes(frame)

    def planes() -> Iterator[np.ndarray]:
        for done, plane in enumerate(spectral_irradiance.planes(frame, result.workers)):
            result.stages.watch.step(done, len(nodes))
            yield plane * 1e-9

    said = {
        "name": frame.solved.name,
        "vcam:version": vcam_cli.__version__,
        "vcam:quantity": "spectral irradiance on the sensor, mean over each pixel's cell"
        + _SAMPLING[frame.solved.output.irradiance_sampling],
        "vcam:unit": "W/(m2 nm)",
        **raw_file.photograph(frame),
        "vcam:configHash": config_hash(frame.camera),
    }
    g = frame.layout.geometry
    write_spectral(path, nodes, planes(), (g.rows, g.columns), "W.m^-2.nm^-1", said)


def _radiance(result: Photograph, path: Path) -> None:
    """Write the radiance of the scene, wavelength by wavelength, and how it is a scene again."""
    from vcam_cli.files.spectral.exr import RADIANCE, WHITE, write_spectral
    from vcam_cli.simulation import scene_radiance

    frame = result.frame
    nodes, scene = scene_radiance.nodes(frame), scene_radiance.sampled_scene(frame)

    def planes() -> Iterator[np.ndarray]:
        for done, plane in enumerate(scene_radiance.planes(frame, scene, result.workers)):
            result.stages.watch.step(done, len(nodes))
            yield plane * 1e-9

    (white,) = scene_radiance.band_means((scene.white,), nodes) * 1e-9
    said = {
        "name": frame.camera.name,
        "vcam:version": vcam_cli.__version__,
        "vcam:quantity": "spectral radiance of the scene, mean over each sample and over the"
        " channel's band, which falls straight to 0 at the neighboring wavelengths",
        "vcam:unit": "W/(sr m2 nm)",
        "vcam:scene": scene_radiance.read_back(frame, scene),
        WHITE: ",".join(f"{value:.9g}" for value in white),
        "vcam:configHash": config_hash(frame.camera),
    }
    write_spectral(path, nodes, planes(), scene.shape, RADIANCE[1], said)


def write_raw(result: Photograph, path: Path) -> None:
    """Write raw.exr.

    Parameters
    ----------
    result : Photograph
        Photograph to write.
    path : Path
        File to write.

    Raises
    ------
    CannotDo
        Where the file cannot be written.
    """
    raw_file.write_raw(path, result.frame, config_hash(result.frame.camera))


def _raw_jobs(result: Photograph, folder: OutputFolder) -> Iterator[Callable[[], None]]:
    """Jobs that write the raw frame in every requested format."""
    yield partial(write_raw, result, folder.new("raw.exr"))
    frame = result.frame
    said = config_hash(frame.camera)
    if frame.phase_dn is not None and frame.solved.output.phase:
        from vcam_cli.simulation.output import phase_files

        yield partial(phase_files.write_phase, folder.new("phase.exr"), frame, said)
        yield partial(phase_files.write_disparity, folder.new("disparity.png"), frame)
    if frame.solved.output.dng:
        from vcam_cli.simulation.output import raw_dng

        description = raw_file.description(frame, said)
        yield partial(raw_dng.write_raw_dng, folder.new("raw.dng"), frame, description)
    if frame.solved.output.tiff:
        yield partial(raw_file.write_raw_tiff, folder.new("raw.tif"), frame, said)


def _sample_jobs(result: Photograph, folder: OutputFolder) -> Iterator[Callable[[], None]]:
    """Jobs that write every sample of one integration, and what they tell together."""
    frame = result.frame
    if not frame.times:
        return
    said = config_hash(frame.camera)
    for number, name in enumerate(_sample_files(frame)):
        path, sample = folder.new(name), frame.sample(number)
        yield partial(raw_file.write_raw, path, sample, said)
    yield partial(raw_file.write_hdr, folder.new("hdr.exr"), frame, said)


def _sample_files(frame: Frame) -> list[str]:
    """Names of the samples' files, in the order of time."""
    return [f"captures/raw_{number:03d}.exr" for number in range(1, len(frame.times) + 1)]


def _samples(frame: Frame) -> list[dict[str, Any]]:
    """Return what `run.json` says of the samples of one integration."""
    said = []
    for number, name in enumerate(_sample_files(frame)):
        sample = frame.sample(number)
        full = float((sample.dn >= frame.chain.saturated_dn).mean())
        said.append({"file": name, "time": sample.exposure_time, "saturated_fraction": full})
    return said


def _ideal(result: Photograph, path: Path) -> None:
    """Write the ideal image in linear display RGB (Y for monochrome)."""
    ideal = result.ideal
    names = ("Y",) if ideal.shape[2] == 1 else ("R", "G", "B")
    with ExrWriter(path, ideal.shape[:2], names, _ideal_attributes(result.frame)) as exr:
        for row in range(0, len(ideal), ROWS_AT_ONCE):
            rows = slice(row, row + ROWS_AT_ONCE)
            exr.write_rows(row, {n: ideal[rows, :, i] for i, n in enumerate(names)})


def _ideal_attributes(frame: Frame) -> dict[str, Attribute]:
    """Return what ideal.exr says; chromaticities where its colors are corrected to a display's."""
    corrected = any(
        step.name == "color_correction" and step.value != "none" for step in frame.solved.processing
    )
    return {
        "name": frame.solved.name,
        "vcam:quantity": "the scene point-sampled at the pixels' centers, linear, white = 1",
        **({"chromaticities": CHROMATICITIES} if corrected else {}),
        **raw_file.photograph(frame),
    }


def config_hash(camera: Camera) -> str:
    """Return the SHA-256 of the resolved camera.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Returns
    -------
    str
        SHA-256 in hexadecimal digits.
    """
    return hash_text(to_json(camera.model_dump(mode="json")))


def record(
    result: Photograph, inputs: tuple[Path, ...], seconds: float, memory: int = 0
) -> dict[str, Any]:
    """Return the contents of `run.json`, without the names of the files.

    Parameters
    ----------
    result : Photograph
        Photograph to write.
    inputs : tuple of Path
        Files that the run read.
    seconds : float
        Time of the run [s].
    memory : int, optional
        Estimated memory of other frames of the run [bytes].

    Returns
    -------
    dict
        Contents, as JSON can hold them.
    """
    frame = result.frame
    camera = frame.camera
    plan = replace(frame.plan, memory_bytes=max(frame.plan.memory_bytes, memory))
    return {
        "name": camera.name,
        "camera": camera.model_dump(mode="json"),
        "plan": plan.report(),
        "geometry": frame.layout.report(frame.spectrum.oversampling),
        "exposure": exposure_report(frame).report(),
        **({"captures": _samples(frame)} if frame.times else {}),
        "metrics": dict(result.metrics),
        "stages": result.stages.seconds,
        "seconds": seconds,
        "peak_memory_bytes": peak_memory(),
        "device": {"light": frame.spectrum.computed_on, "charge to codes": frame.device},
        "seeds": {"sensor": camera.seed.sensor, "frame": camera.seed.frame},
        "hashes": {
            "camera": config_hash(camera),
            "inputs": {str(path): hash_file(path) for path in inputs},
        },
        "versions": versions(),
        "notes": list(result.notes),
    }
