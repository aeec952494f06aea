"""A data set from its file to its shards: what `vcam dataset` does.

Parts of a shard are computed by the workers of sweeps, and kept one by one as points are; a shard
is packed as soon as its parts are there. What is written depends on the file alone, not on who
computed it or how often it stopped.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from threading import Lock
from typing import Any, Self, overload

from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.datasets import manifest
from vcam_cli.datasets.dataset_file import DatasetFile
from vcam_cli.datasets.device_frames import batch_key
from vcam_cli.datasets.frame_work import NPZ, FramesJob
from vcam_cli.datasets.parts import Hasher, cut
from vcam_cli.datasets.shards import Packer, Part, Shard, scale
from vcam_cli.devices.choice import open_device
from vcam_cli.errors import bad
from vcam_cli.files.points_store import SweepFolder
from vcam_cli.files.records import Fingerprint
from vcam_cli.files.report import hash_text, to_json
from vcam_cli.parallel import ThreadPool
from vcam_cli.progress import Observer, Silent
from vcam_cli.records import dataclass
from vcam_cli.simulation.output import provenance
from vcam_cli.sweeps.execution import Execution
from vcam_cli.sweeps.point_execution import claim_point, compute, keep_outcome
from vcam_cli.sweeps.point_work import Task
from vcam_cli.sweeps.sweep_points import LIBRARIES
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
    whole = cut(file, Hasher(file, execution.device))
    mine = _of_share(whole, execution)
    with SweepFolder(out, RECORD) as folder, ExitStack() as opened:
        asked = hash_text(to_json([shard.ids for shard in whole]))
        former = folder.begin({"name": file.model.name}, asked)
        packer = Packer(folder, file.model.format, _scale(file), former)
        packing = opened.enter_context(_Packing(folder))
        parts = _Parts(folder, packer, packing, whole, execution.fresh, versions["code"])
        left = [shard for shard in mine if not parts.is_packed(shard)]
        size = geometry(file.camera)
        pixels = size.rows * size.columns
        given = versions, pixels, execution.device
        groups = [group for shard in left for group in _groups(file, shard, *given)]
        sizes = {part.id: len(part.numbers) for shard in left for part in shard.parts}
        if execution.device != "cpu" and batch_key(file.frame(0), file.model.write) is None:
            tell("frames take their light from the processor, one by one")
        computed = compute(groups, parts, execution, watch, tell, "frames", sizes)
        packing.wait()
        with folder.summarizing():
            packed = [(shard, parts.pack(shard)) for shard in whole]
            found = [shard for shard, files in packed if files is not None]
            there = {name: made for _, files in packed for name, made in (files or {}).items()}
            record = _record(file, versions, execution.device) | {"packed": len(found)}
            known = manifest.packed(packer, found)
            table = partial(manifest.write, file, packer, known)
            folder.finish({MANIFEST: table}, record, file.inputs, there=there)
            unfinished = sum(sizes[part] for part in parts.unfinished)
    done = sum(len(shard.frames) for shard in found)
    return DatasetResult(
        name=file.model.name,
        out=out,
        frames=file.model.frames,
        computed=computed,
        failed=known.failed + unfinished,
        missing=file.model.frames - done - unfinished,
        shards=len(found),
        seconds=time.perf_counter() - start,
    )


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


PACKERS = 4
"""Threads that pack shards beside the computation: they hash, copy and wait for the disk."""


class _Packing:
    """Shards that threads pack, while no other process makes tables or shards of the folder."""

    def __init__(self, folder: SweepFolder) -> None:
        self._folder, self._lock, self._count = folder, Lock(), 0
        self._alone = ExitStack()
        self._pool = ThreadPool(PACKERS)
        self._waiting: list[Future[None]] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def add(self, pack: Callable[[], object]) -> None:
        """Have a shard packed. Raise what went wrong with those before."""
        self.wait(is_done=True)
        while len(self._waiting) >= 2 * PACKERS:  # the disk holds the parts of no more
            self._waiting.pop(0).result()
        self._waiting.append(self._pool.submit(self._pack, pack))

    def wait(self, is_done: bool = False) -> None:
        """Wait for all shards, or look at those that are done. Raise what went wrong."""
        for future in list(self._waiting):
            if future.done() or not is_done:
                self._waiting.remove(future)
                future.result()

    def _pack(self, pack: Callable[[], object]) -> None:
        with self._lock:  # locks of files are those of the process, not of a thread
            if not self._count:
                self._alone.enter_context(self._folder.summarizing())
            self._count += 1
        try:
            pack()
        finally:
            with self._lock:
                self._count -= 1
                if not self._count:
                    self._alone.close()


class _Parts:
    """The parts to compute, and their records; shards are packed when theirs are there."""

    def __init__(
        self,
        folder: SweepFolder,
        packer: Packer,
        packing: _Packing,
        shards: Sequence[Shard],
        fresh: bool,
        code: str,
    ) -> None:
        self._folder, self._packer, self._fresh, self._code = folder, packer, fresh, code
        self._packing = packing
        self._shards = {part.id: shard for shard in shards for part in shard.parts}
        self._left = {shard.number: {part.id for part in shard.parts} for shard in shards}
        """Number of a shard -> its parts that are not known to be there."""
        self._computed: set[str] = set()
        self.unfinished: set[str] = set()
        """Those that failed, and might not another time."""

    def ask(self, job: Task) -> Verdict:
        """Return whether a part is still to be computed, and claim it then."""
        verdict = claim_point(self._folder, job.id, lambda: self._is_finished(job.id))
        if verdict == "finished":
            self._note(job.id)
        return verdict

    def keep(self, outcome: Outcome) -> None:
        """Keep the outcome of a part, and pack its shard with the last one."""
        found = keep_outcome(self._folder, outcome, self._code)
        self._computed.add(outcome.id)
        if found.final and not found.error:
            self._note(outcome.id)
        else:
            self.unfinished.add(outcome.id)

    def is_packed(self, shard: Shard) -> bool:
        """Return whether a shard is packed, and need not be computed again."""
        return not self._fresh and self._packer.files(shard) is not None

    def pack(self, shard: Shard) -> dict[str, Fingerprint] | None:
        """Return the files of a shard, packed now where all of its parts are there.

        None where it is not packed. The caller is alone to do so: `SweepFolder.summarizing`.
        """
        if all(self._is_there(part) for part in shard.parts):
            return self._packer.pack(shard)
        return self._packer.files(shard)

    def _note(self, part: str) -> None:
        """Note that a part is there, and pack its shard with the last one."""
        shard = self._shards[part]
        self._left[shard.number].discard(part)
        if not self._left[shard.number]:
            self._packing.add(partial(self.pack, shard))

    def _is_finished(self, part: str) -> bool:
        """Return whether a part is kept, or in a shard that another process has packed."""
        if self._fresh and part not in self._computed:
            return False
        return self._is_kept(part) or self._packer.files(self._shards[part]) is not None

    def _is_there(self, part: Part) -> bool:
        """Return whether a part can be packed; one computed now is not read for that."""
        if part.id in self.unfinished:
            return False
        if part.id in self._computed:
            return self._folder.file(part.id, NPZ).exists()
        return not self._fresh and self._is_kept(part.id)

    def _is_kept(self, part: str) -> bool:
        content = self._folder.read(part)
        try:
            outcome = None if content is None else read_outcome(part, content)
        except ValueError:
            return False
        if outcome is None or not outcome.final or outcome.error:
            return False
        return self._folder.read(part, (NPZ,)) is not None


TOGETHER = 64
"""Parts of a group, at most: a worker keeps to it."""


def _groups(
    file: DatasetFile, shard: Shard, versions: dict[str, str], pixels: int, device: str
) -> list[_Group]:
    """Return the parts of a shard; those that begin with one picture together, it is read once."""
    found: list[_Group] = []
    scene: Any = None
    for part in shard.parts:
        own = file.frame(part.numbers[0]).scene
        if not found or own is not scene or len(found[-1].parts) == TOGETHER:
            found.append(_Group(file, shard, versions, pixels, device, []))
        found[-1].parts.append(part)
        scene = own
    return found


@dataclass(frozen=True)
class _Group(Sequence[FramesJob]):
    """Parts of a shard; each draws its frames when it is read."""

    file: DatasetFile
    shard: Shard
    versions: dict[str, str]
    pixels: int
    device: str
    parts: list[Part]

    def __len__(self) -> int:
        return len(self.parts)

    @overload
    def __getitem__(self, index: int) -> FramesJob: ...
    @overload
    def __getitem__(self, index: slice) -> list[FramesJob]: ...
    def __getitem__(self, index: int | slice) -> FramesJob | list[FramesJob]:
        if isinstance(index, slice):
            return [self[number] for number in range(*index.indices(len(self)))]
        part, model = self.parts[index], self.file.model
        lit = tuple(tuple(map(self.file.frame, numbers)) for numbers in part.lit)
        about = self.file.base, model.write, self.versions, self.pixels, self.device
        return FramesJob(part.id, lit, self.shard.frames, *about)


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
        "device": device if device == "cpu" else open_device(device).describe(),
    }
