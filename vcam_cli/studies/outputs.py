"""What `vcam run` leaves in its folder: raw.exr, render.png, metrics.csv, ideal.exr, run.json.

Raw and render are written by two threads at once; files are most of a frame's cost.
"""

from __future__ import annotations

import platform
import resource
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

import vcam_cli
from vcam_cli.camera import shipped
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.electrical import Electrical
from vcam_cli.camera.load import FILE_KEYS
from vcam_cli.camera.support import spectra
from vcam_cli.engine import irradiance
from vcam_cli.files.exr import ExrWriter
from vcam_cli.files.folder import OutputFolder
from vcam_cli.files.maps import write_map
from vcam_cli.files.png import write_png
from vcam_cli.files.report import hash_file, hash_text, to_json
from vcam_cli.files.spectral import write_spectral
from vcam_cli.files.tables import write_metrics
from vcam_cli.rng import BLOCK_ROWS
from vcam_cli.studies.simulate import Result

ROWS_AT_ONCE = 4 * BLOCK_ROWS


def write(result: Result, folder: OutputFolder) -> None:
    """Writes the files of one run, all but the record `run.json`."""
    camera = result.frame.camera
    metrics = result.metrics
    jobs: list[Callable[[], None]] = [lambda: _raw(result, folder.new("raw.exr"))]
    if camera.output.render:
        render = result.render
        jobs.append(lambda: write_png(folder.new("render.png"), render))
    if camera.quality:
        jobs.append(lambda: _ideal(result, folder.new("ideal.exr")))
    if "s-cielab" in camera.quality:
        jobs.append(lambda: write_map(folder.new("delta_e.png"), result.s_cielab))
    with result.stages("files"), ThreadPoolExecutor(2) as pool:
        for done in [pool.submit(job) for job in jobs]:
            done.result()
    if camera.output.irradiance:
        with result.stages("irradiance"):
            _irradiance(result, folder.new("irradiance.exr"))
    write_metrics(folder.new("metrics.csv"), metrics)


def _irradiance(result: Result, path: Path) -> None:
    """Spectral irradiance on the sensor, computed and written wavelength by wavelength."""
    frame = result.frame
    nodes = irradiance.nodes(frame)

    def planes() -> Iterator[np.ndarray]:
        for done, plane in enumerate(irradiance.planes(frame, result.processed.workers)):
            result.stages.watch.step(done, len(nodes))
            yield plane * 1e-9

    said = {
        "name": frame.camera.name,
        "vcam:version": vcam_cli.__version__,
        "vcam:quantity": "spectral irradiance on the sensor, mean over each pixel's cell",
        "vcam:configHash": config_hash(frame.camera),
    }
    write_spectral(path, nodes, planes(), frame.dn.shape, "W.m^-2.nm^-1", said)


def _raw(result: Result, path: Path) -> None:
    """Raw channels as `output.raw` asks, block by block."""
    frame = result.frame
    sources = {"dn": frame.dn, "electrons": frame.electrons}
    channels = frame.camera.output.raw
    volts_per_electron = frame.electrical.conversion_gain * frame.electrical.analog_gain
    with ExrWriter(path, frame.dn.shape, channels, _attributes(result)) as exr:
        for row in range(0, frame.dn.shape[0], ROWS_AT_ONCE):
            rows = slice(row, row + ROWS_AT_ONCE)
            blocks = {name: array[rows] for name, array in sources.items() if name in channels}
            if "volts" in channels:
                blocks["volts"] = frame.electrons[rows] * np.float32(volts_per_electron)
            exr.write_rows(row, blocks)


def _ideal(result: Result, path: Path) -> None:
    """The ideal image, linear display RGB (Y for monochrome)."""
    ideal = result.ideal
    names = ("Y",) if ideal.shape[2] == 1 else ("R", "G", "B")
    with ExrWriter(path, ideal.shape[:2], names, {"name": result.frame.camera.name}) as exr:
        for row in range(0, len(ideal), ROWS_AT_ONCE):
            rows = slice(row, row + ROWS_AT_ONCE)
            exr.write_rows(row, {n: ideal[rows, :, i] for i, n in enumerate(names)})


def _attributes(result: Result) -> dict[str, str | int | float]:
    frame, e = result.frame, result.frame.electrical
    block = "/".join("".join(row) for row in frame.mosaic.block)
    return {
        "name": frame.camera.name,
        "vcam:version": vcam_cli.__version__,
        "vcam:seedSensor": str(frame.camera.seed.sensor),
        "vcam:seedFrame": str(frame.camera.seed.frame),
        "vcam:exposureTime": frame.exposure_time,
        "vcam:blackLevel": frame.black_dn,
        "vcam:whiteLevel": float(e.highest_code),
        "vcam:conversionGain": e.conversion_gain,
        **_curve(e),
        "vcam:cfa": "monochrome" if len(frame.mosaic.colors) == 1 else block,
        "vcam:configHash": config_hash(frame.camera),
    }


def _curve(e: Electrical) -> dict[str, str | int | float]:
    """What turns raw numbers back into electrons or volts."""
    if e.reference is None:
        return {"vcam:adc": "linear", "vcam:electronsPerDN": e.electrons_per_dn}
    return {
        "vcam:adc": "logarithmic",
        "vcam:adcOffset": e.offset,
        "vcam:adcFullScale": e.full_scale,
        "vcam:adcReference": e.reference,
    }


def config_hash(camera: Camera) -> str:
    """SHA-256 of the resolved camera."""
    return hash_text(to_json(camera.model_dump(mode="json")))


def record(result: Result, inputs: tuple[Path, ...], seconds: float) -> dict[str, Any]:
    """What `run.json` says, but for the names of the files."""
    frame = result.frame
    camera = frame.camera
    return {
        "name": camera.name,
        "camera": camera.model_dump(mode="json"),
        "plan": frame.plan.report(),
        "geometry": frame.geometry.report(frame.spectrum.oversampling),
        "metrics": {name: value for name, value, _ in result.metrics},
        "stages": result.stages.seconds,
        "seconds": seconds,
        "peak_memory_bytes": peak_memory(),
        "seeds": {"sensor": camera.seed.sensor, "frame": camera.seed.frame},
        "hashes": {
            "camera": config_hash(camera),
            "inputs": {str(path): hash_file(path) for path in inputs},
        },
        "versions": versions(),
        "notes": list(result.notes),
    }


def inputs(camera: Camera) -> tuple[Path, ...]:
    """Every file that a run reads: YAML files, and what they name."""

    def named(value: Any) -> Iterator[str]:
        if isinstance(value, dict):
            for key, item in value.items():
                if key in FILE_KEYS and isinstance(item, str):
                    yield item
                else:
                    yield from named(item)
        elif isinstance(value, list):
            for item in value:
                yield from named(item)

    shipped_spectra = (
        str(shipped.find("spectra", factor))
        for _, spec in spectra(camera)
        for factor in getattr(spec, "factors", ())
        if isinstance(factor, str)
    )
    files = [str(path) for path in camera.files]
    found = {*files, *named(camera.model_dump(mode="json")), *shipped_spectra}
    return tuple(Path(name) for name in sorted(found))


def peak_memory() -> int:
    """Largest memory of this process so far [bytes]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def versions() -> dict[str, str]:
    """Versions that decide the bytes of a frame."""
    libraries = ("numpy", "scipy", "pydantic", "OpenImageIO")
    found = {name: version(name) for name in libraries}
    return {"vcam": vcam_cli.__version__, "python": platform.python_version(), **found}
