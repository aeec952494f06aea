"""What commands do, as functions: they take a camera or the name of its file and return objects.

`out` is a folder to write into what the command writes; without it nothing is written. `watch`
follows the progress, as that of `simulate` does; `report` also writes report.html; `formats` are
formats of plots beside PNG. All of them raise BadInput for mistakes of a user, CannotDo for what
the machine lacks, and TypeError or ValueError for arguments that are neither.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from vcam_cli.arguments import require_folder, require_name, require_overrides, require_whole
from vcam_cli.camera.camera import Camera
from vcam_cli.errors import bad
from vcam_cli.files.folder import OutputFolder
from vcam_cli.progress import Callback, Observer, observer

if TYPE_CHECKING:
    from vcam_cli.accuracy_study.study import Study
    from vcam_cli.characterization.characterize import Characterization
    from vcam_cli.comparison.image_files import Comparison, Space
    from vcam_cli.datasets.dataset import DatasetResult
    from vcam_cli.fitting.result import Fit
    from vcam_cli.quality.cielab import Formula
    from vcam_cli.quality.eye import Filters
    from vcam_cli.simulation.planned import PlannedRun
    from vcam_cli.verification.model import Measurement
    from vcam_cli.verification.verify import Verification

Watch = Observer | Callback | None
DPI, DISTANCE = 72.0, "18 in"
"""The display of `compare`, where none is stated."""


def plan(
    camera: Camera | str | Path,
    workers: int | None = None,
    watch: Watch = None,
    details: bool = False,
) -> PlannedRun:
    """Return what a run would simulate, what not, why, and at what cost: `vcam plan`.

    details: form the light of all pixels; without it a plan of a large array estimates exposure and
    noise from the light of some 65,000 places.
    """
    from vcam_cli.simulation.planned import planned_run

    return planned_run(_camera(camera), _threads(workers), observer(watch), details)


def accuracy(
    camera: Camera | str | Path,
    out: str | Path | None = None,
    workers: int | None = None,
    watch: Watch = None,
    report: bool = False,
    formats: Sequence[str] = (),
    device: str = "cpu",
) -> Study:
    """Return what accuracy costs, along every knob and for every preset: `vcam accuracy`.

    device: as that of `simulate`; the converged reference is the processor's.
    """
    from vcam_cli.accuracy_study import output, study
    from vcam_cli.simulation.output import provenance

    model = _camera(camera)
    with _folder(out, "accuracy.json", lambda: provenance.inputs(model)) as folder:
        found = study.accuracy(model, _threads(workers), observer(watch), device)
        if folder is not None:
            output.write(found, model, folder, report, formats)
    return found


def characterize(
    camera: Camera | str | Path,
    out: str | Path | None = None,
    workers: int | None = None,
    watch: Watch = None,
    keep_frames: bool = False,
    report: bool = False,
    formats: Sequence[str] = (),
    device: str = "cpu",
) -> Characterization:
    """Return what a camera measures on a bench, beside its closed forms: `vcam characterize`.

    keep_frames: also write the flat and dark frames into `out`; device: as that of `simulate`.
    """
    from vcam_cli.characterization import characterize as study
    from vcam_cli.characterization import output
    from vcam_cli.characterization.kept_frames import FrameFiles
    from vcam_cli.simulation.output import provenance

    model = _camera(camera)
    if keep_frames and out is None:
        raise ValueError("keep_frames needs a folder; write out='out/bench'")
    with _folder(out, "characterize.json", lambda: provenance.inputs(model)) as folder:
        keeper = FrameFiles(folder.new) if keep_frames and folder is not None else None
        found = study.characterize(model, _threads(workers), observer(watch), keeper, device)
        if folder is not None:
            output.write(found, model, folder, report, formats)
    return found


def fit(
    measurement: Measurement | str | Path,
    out: str | Path | None = None,
    watch: Watch = None,
    report: bool = False,
    formats: Sequence[str] = (),
) -> Fit:
    """Return a camera estimated from raw frames, every number with its interval: `vcam fit`."""
    from vcam_cli.fitting import fit as fitting
    from vcam_cli.fitting import output
    from vcam_cli.verification.frames import paths

    measured = _measurement(measurement)
    files = [page.path for found in paths(measured).values() for page in found]
    with _folder(out, "fit.json", lambda: (*measured.files, *files)) as folder:
        found = fitting.fit(measured, observer(watch))
        if folder is not None:
            output.write(found, folder, report, formats)
    return found


def verify(
    camera: Camera | str | Path,
    measurement: Measurement | str | Path,
    out: str | Path | None = None,
    watch: Watch = None,
    report: bool = False,
    formats: Sequence[str] = (),
) -> Verification:
    """Return measured signals beside those that a camera file predicts: `vcam verify`."""
    from vcam_cli.simulation.output import provenance
    from vcam_cli.verification import output
    from vcam_cli.verification import verify as comparison
    from vcam_cli.verification.frames import paths

    model, measured = _camera(camera), _measurement(measurement)
    files = [page.path for found in paths(measured, held_out=True).values() for page in found]

    def inputs() -> tuple[Path, ...]:
        return (*provenance.inputs(model), *measured.files, *files)

    with _folder(out, "verify.json", inputs) as folder:
        found = comparison.verify(model, measured, observer(watch))
        if folder is not None:
            output.write(found, folder, report, formats)
    return found


def dataset(
    study: str | Path,
    out: str | Path | None = None,
    sets: Sequence[str] = (),
    seed: int | None = None,
    accuracy: str | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    shard: tuple[int, int] | None = None,
    fresh: bool = False,
    watch: Watch = None,
    tell: Callable[[str], None] | None = None,
    device: str = "cpu",
) -> DatasetResult:
    """Write the labeled frames of a data set into `out`, default out/NAME: `vcam dataset`.

    Its arguments are those of `sweep`; seed and accuracy replace those of the files.
    """
    from vcam_cli.datasets import dataset as work
    from vcam_cli.datasets import dataset_file
    from vcam_cli.sweeps.execution import Execution, Share

    require_name(study, "study")
    require_overrides(sets)
    share = Share(*shard) if shard else None
    execution = Execution(share, _threads(workers), scheduler, fresh, device)
    file = dataset_file.read(study, sets, seed, accuracy)
    place = Path("out") / file.model.name if out is None else require_folder(out)
    return work.dataset(file, place, execution, observer(watch), tell)


def compare(
    image: str | Path,
    reference: str | Path,
    out: str | Path | None = None,
    ppd: float | None = None,
    dpi: float | None = None,
    distance: str | None = None,
    space: Space | None = None,
    white: tuple[float, float, float] | None = None,
    delta_e: Formula = "1976",
    filters: Filters = "zhang-wandell-1996",
    workers: int | None = None,
) -> Comparison:
    """Return how different two image files look: `vcam compare`.

    ppd: pixels in a degree of vision; or dpi and distance, default 72 at "18 in"; white: X, Y, Z
    for the space xyz.
    """
    from vcam_cli.comparison import image_files as study
    from vcam_cli.files.report import hash_file
    from vcam_cli.quality.display import D65

    require_name(image, "image")
    require_name(reference, "reference")
    if white is not None and space != "xyz":
        raise bad("--white", "it is for the space xyz only", "remove it, or write --space xyz")
    if white is not None:
        problem = study.white_problem(white, ",".join(map(str, white)))
        if problem:
            message, _, remedy = problem.partition("; ")
            raise bad("--white", message, remedy)
    files = Path(image), Path(reference)
    settings = study.Settings(
        samples_per_degree=_per_degree(ppd, dpi, distance),
        space=space,
        white=D65 if white is None else white,
        formula=delta_e,
        filters=filters,
    )
    found = study.compare(*files, settings, _threads(workers))
    found = replace(found, names=(str(image), str(reference)))
    with _folder(out, "compare.json", lambda: files) as folder:
        if folder is not None:
            study.write(found, folder)
            hashes = {"inputs": {str(path): hash_file(path) for path in files}}
            folder.finish(found.report() | {"hashes": hashes, "notes": list(found.notes)})
    return found


def _per_degree(ppd: float | None, dpi: float | None, distance: str | None) -> float:
    """Return the pixels in one degree of visual angle."""
    from vcam_cli.quality.display import samples_per_degree
    from vcam_cli.units import parse

    if ppd is not None:
        for name, given in (("--dpi", dpi), ("--distance", distance)):
            if given is not None:
                raise bad(name, "it and --ppd cannot both be given", "remove one of them")
        return ppd
    return samples_per_degree(DPI if dpi is None else dpi, parse(distance or DISTANCE, "length"))


def _camera(camera: Camera | str | Path) -> Camera:
    if isinstance(camera, Camera):
        return camera
    from vcam_cli.simulation.checks import load

    require_name(camera, "camera")
    return load(camera)


def _measurement(measurement: Measurement | str | Path) -> Measurement:
    from vcam_cli.verification import measurement_file
    from vcam_cli.verification.model import Measurement

    if isinstance(measurement, Measurement):
        return measurement
    require_name(measurement, "measurement")
    return measurement_file.read(measurement)


def _threads(workers: int | None) -> int | None:
    if workers is not None:
        require_whole(workers, "workers", 1)
    return workers


@contextmanager
def _folder(
    out: str | Path | None, record: str, inputs: Callable[[], tuple[Path, ...]]
) -> Iterator[OutputFolder | None]:
    """Open the folder that is written, if any: before work starts, so that it may be refused."""
    if out is None:
        yield None
        return
    with OutputFolder(require_folder(out), record=record, inputs=inputs()) as folder:
        yield folder
