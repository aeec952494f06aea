"""A data set from its file to its shards: what `vcam dataset` does.

Frames are computed by the workers of sweeps, and kept one by one as points are; then they are
packed. What is written depends on the file alone, not on who computed it or how often it stopped.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from vcam_cli.datasets import manifest
from vcam_cli.datasets.dataset_file import DatasetFile
from vcam_cli.datasets.device_frames import BATCH, batch_key
from vcam_cli.datasets.drawing import Frame
from vcam_cli.datasets.frame_work import NPZ, FrameJob, device_outcomes
from vcam_cli.datasets.shards import Packer, Shard, scale, shards
from vcam_cli.devices.choice import open_device
from vcam_cli.errors import bad
from vcam_cli.files.points_store import SweepFolder
from vcam_cli.files.records import Fingerprint
from vcam_cli.files.report import hash_file, hash_text, to_json
from vcam_cli.progress import Observer, Silent
from vcam_cli.simulation.output import provenance
from vcam_cli.sweeps.execution import Execution
from vcam_cli.sweeps.point_execution import claim_point, compute, keep_outcome
from vcam_cli.sweeps.point_work import Task
from vcam_cli.sweeps.sweep_points import LIBRARIES, hash_of
from vcam_cli.sweeps.sweep_result import Outcome, read_outcome
from vcam_cli.sweeps.workers import Verdict

RECORD, MANIFEST = "dataset.json", "manifest.csv"


@dataclass(frozen=True)
class DatasetResult:
    """What became of a data set."""

    name: str
    out: Path
    frames: int
    computed: int
    """Number of frames computed now; the others were there."""
    failed: int
    missing: int
    """Number of frames that are left to other shares."""
    shards: int
    """Number of shards that are packed."""
    seconds: float

    @property
    def exit_code(self) -> int:
        """0; 4 where frames failed."""
        return 4 if self.failed else 0

    def summary(self) -> dict[str, Any]:
        """Return what `--json` prints."""
        names = ("name", "frames", "computed", "failed", "missing", "shards", "seconds")
        return {"out": str(self.out), **{name: getattr(self, name) for name in names}}


def dataset(
    file: DatasetFile,
    out: Path,
    execution: Execution,
    watch: Observer | None = None,
    tell: Callable[[str], None] | None = None,
) -> DatasetResult:
    """Compute the missing frames of a data set, and write shards, manifest and record.

    Raises BadInput (a share of more than there are shards, a foreign folder), CannotDo.
    """
    start = time.perf_counter()
    watch, tell = watch or Silent(), tell or (lambda _: None)
    watch.begin("frames")
    versions = {name: found for name, found in provenance.versions().items() if name in LIBRARIES}
    ids = frame_ids(file, execution.device)
    whole = shards(file.model.frames, file.model.shards, ids)
    mine = _of_share(whole, execution)
    with SweepFolder(out, RECORD) as folder:
        former = folder.begin({"name": file.model.name}, hash_text(to_json(ids)))
        packer = Packer(folder, file.model.format, _scale(file), former)
        points = _Frames(folder, execution.fresh, versions["code"])
        for shard in mine:
            if not execution.fresh and packer.files(shard) is not None:
                points.packed.update(shard.ids)
        groups = _groups(file, mine, ids, points, versions, execution.device)
        if execution.device == "cpu":
            computed = compute(groups, points, execution, watch, tell, "frames")
        else:
            computed = _compute_on_device(groups, points, execution, watch, tell)
        with folder.summarizing():
            found, there = _pack_all(packer, points, whole)
            record = _record(file, versions, execution.device) | {"packed": len(found)}
            table = partial(manifest.write, file, packer, found)
            folder.finish({MANIFEST: table}, record, file.inputs, there=there)
            failed = manifest.failures(packer, found) + len(points.unfinished)
    done = sum(len(shard.ids) for shard in found)
    return DatasetResult(
        name=file.model.name,
        out=out,
        frames=len(ids),
        computed=computed,
        failed=failed,
        missing=len(ids) - done - len(points.unfinished),
        shards=len(found),
        seconds=time.perf_counter() - start,
    )


def frame_ids(file: DatasetFile, device: str = "cpu") -> list[str]:
    """Return the hash of every frame: of all that its arrays depend on, wherever files lie."""
    form = file.camera.model_dump(mode="json")
    for name in ("name", "quality", "expect", "output", "seed"):
        form.pop(name, None)
    form["sensor"] = file.camera.seed.sensor
    asked = {"write": sorted(file.model.write)} | ({} if device == "cpu" else {"device": device})
    content = hash_of(file.camera, form, asked)
    hashes = {s.file: hash_file(s.file) for s in file.scenes if s.file is not None}

    def plain(frame: Frame) -> dict[str, Any]:
        scene = frame.scene
        shown = None if scene is None else hashes[scene.file] if scene.file else scene.source
        return frame.plain | {"scene": shown}

    return [
        hash_text(f"{content} {to_json(plain(file.frame(n)))}")[:32]
        for n in range(file.model.frames)
    ]


def _scale(file: DatasetFile) -> int:
    """Return what codes are multiplied by in TIFF: what 16 bits leave of the ADC's."""
    return 1 << max(0, 16 - file.camera.adc.bits)


def _of_share(whole: list[Shard], execution: Execution) -> list[Shard]:
    """Return the shards of a share. Raises BadInput where there are more shares than shards."""
    share = execution.share
    if share is None:
        return whole
    if share.count > len(whole):
        message = f"{len(whole)} shards cannot be divided among {share.count}"
        raise bad("--shard", message, f"write at most N = {len(whole)}, or more shards in the file")
    return whole[share.number - 1 :: share.count]


class _Frames:
    """The frames to compute, and their records."""

    def __init__(self, folder: SweepFolder, fresh: bool, code: str) -> None:
        self._folder, self._fresh, self._code = folder, fresh, code
        self.packed: set[str] = set()
        self.computed: set[str] = set()
        self.unfinished: set[str] = set()
        """Those that failed, and might not another time."""

    def ask(self, job: Task) -> Verdict:
        """Return whether a frame is still to be computed, and claim it then."""
        return claim_point(self._folder, job.id, lambda: self.is_finished(job.id))

    def is_finished(self, point: str) -> bool:
        """Return whether a frame is there, or failed as it would again."""
        if self._fresh and point not in self.computed:
            return False
        content = self._folder.read(point)
        try:
            outcome = None if content is None else read_outcome(point, content)
        except ValueError:
            return False
        if outcome is None or not outcome.final:
            return False
        return bool(outcome.error) or self._folder.read(point, (NPZ,)) is not None

    def is_there(self, point: str) -> bool:
        """Return whether a frame can be packed; one computed now is not read for that."""
        return point in self.computed - self.unfinished or self.is_finished(point)

    def keep(self, outcome: Outcome) -> None:
        """Keep the outcome of a frame."""
        found = keep_outcome(self._folder, outcome, self._code)
        self.computed.add(outcome.id)
        if not found.final:
            self.unfinished.add(outcome.id)


def _groups(
    file: DatasetFile,
    mine: list[Shard],
    ids: list[str],
    points: _Frames,
    versions: dict[str, str],
    device: str,
) -> list[list[FrameJob]]:
    """Return the frames that are not packed; those of one picture together, it is read once."""
    groups: dict[Any, list[FrameJob]] = defaultdict(list)
    for shard in mine:
        for number in shard.frames:
            if ids[number] in points.packed:
                continue
            frame = file.frame(number)
            scene = None if frame.scene is None else (frame.scene.name, str(frame.scene.file))
            job = FrameJob(ids[number], frame, file.base, file.model.write, versions, device)
            groups[scene].append(job)
    return list(groups.values())


def _compute_on_device(
    groups: list[list[FrameJob]],
    points: _Frames,
    execution: Execution,
    watch: Observer,
    tell: Callable[[str], None],
) -> int:
    """Compute frames in batches on a device, and those that batches do not compute one by one."""
    device = open_device(execution.device)
    cameras: dict[str, list[FrameJob]] = defaultdict(list)
    others: list[FrameJob] = []
    for job in (job for group in groups for job in group):
        key = batch_key(job.frame, job.write)
        (others if key is None else cameras[key]).append(job)
    total, computed = sum(len(jobs) for jobs in cameras.values()), 0
    for jobs in cameras.values():
        for start in range(0, len(jobs), BATCH):
            batch = jobs[start : start + BATCH]
            wanted = [job for job in batch if points.ask(job) == "compute"]
            for outcome in device_outcomes(wanted, device) if wanted else ():
                points.keep(outcome)
                computed += 1
                watch.step(computed, total)
    if others:
        tell("frames take their light from the processor, one by one")
        computed += compute([others], points, execution, watch, tell, "frames")
    return computed


def _pack_all(
    packer: Packer, points: _Frames, whole: list[Shard]
) -> tuple[list[Shard], dict[str, Fingerprint]]:
    """Pack all shards whose frames are there; return those that are packed, and their files."""
    found: list[Shard] = []
    there: dict[str, Fingerprint] = {}
    for shard in whole:
        is_new = not points.computed.isdisjoint(shard.ids)
        files = None if is_new else packer.files(shard)
        if files is None and all(map(points.is_there, shard.ids)):
            files = packer.pack(shard)
        if files is not None:
            found.append(shard)
            there |= files
    return found, there


def _record(file: DatasetFile, versions: dict[str, str], device: str) -> dict[str, Any]:
    model = file.model
    whole = {"npz": "shard_NNNN.npz: members FRAME.KIND", "tiff": "shard_NNNN/FRAME_KIND.tif"}
    return {
        "name": model.name,
        "dataset": model.model_dump(mode="json"),
        "camera": file.camera.model_dump(mode="json"),
        "frames": model.frames,
        "shards": model.shards,
        "layout": whole[model.format],
        "scale": {
            kind: 1 if model.format == "npz" else scale(kind, _scale(file)) for kind in model.write
        },
        "versions": versions,
        "device": open_device(device).describe() if device != "cpu" else device,
    }
