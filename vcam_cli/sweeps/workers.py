"""Workers that compute points: this process, processes of this machine, or a Dask cluster.

All of them compute a point alike. Points come in groups that share their light
(`image_formation.rate_cache`): a worker keeps to its group, and shares another worker's when no
group is left.

Why the processes are no `ProcessPoolExecutor`: that one neither replaces a worker that died nor
kills those at work when a sweep is interrupted, its workers outlive a parent that was killed, and
they run the caller's script again.
"""

from __future__ import annotations

import asyncio
import logging
import math
import os
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import contextmanager, suppress
from importlib import import_module
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from threading import Lock
from typing import Any, Literal

from vcam_cli.errors import CannotDo
from vcam_cli.memory import BLAS_VARIABLES, share_heap
from vcam_cli.parallel import ThreadPool, available_workers
from vcam_cli.simulation.shared import Shared
from vcam_cli.sweeps.point_work import Task, compute_on_cluster, compute_points
from vcam_cli.sweeps.sweep_result import Outcome

Verdict = Literal["compute", "finished", "claimed"]
Ask = Callable[[Task], Verdict]
"""Tells whether a point is to be computed, is finished, or is claimed by another process."""
Groups = Sequence[Sequence[Task]]
Batch = Sequence[Task]
"""Points that a worker computes at once."""
Submit = Callable[[int, Batch], "Future[list[Outcome]]"]
"""Starts to compute points on the worker of a number."""

SERVE = "import sys; sys.path[:] = {}; from vcam_cli.sweeps.workers import serve; serve({}, {})"
"""The program of a worker process: its path, the number of its connection, and of its threads."""
TRIES = 3
"""Number of worker processes that may die of the same point."""
DEATH_TIMEOUT = 5.0
"""Seconds within which a process that has closed its connection must have ended."""
BATCH_SECONDS, MOST = 0.1, 256
"""Seconds that the points of a batch take together, about, and their number, at most. The scheduler
of a cluster, and what is looked up once a batch, take some milliseconds. A worker that is killed
loses its batch, or its one point."""
POLL_INTERVAL = 0.2
"""Seconds between looks at points that other processes have claimed."""
CONNECT_TIMEOUT = 5.0
"""Seconds within which a scheduler must answer."""
WORKER_TIMEOUT = 60.0
"""Seconds within which a scheduler must have a worker."""


class JobQueue:
    """The points that are left, handed out group by group, in batches."""

    def __init__(self, groups: Groups, ask: Ask) -> None:
        self._groups = deque(group for group in groups if group)
        self._ask = ask
        self._own: dict[int, _Rest] = {}
        self._claimed: deque[Task] = deque()
        self._size = 1

    @property
    def waiting(self) -> bool:
        """Whether points of this sweep are claimed by other processes."""
        return bool(self._claimed)

    def next(self, worker: int) -> list[Task]:
        """Return the next points of a worker; none while there are none."""
        batch: list[Task] = []
        for job in self._candidates(worker):
            verdict = self._ask(job)
            if verdict == "compute":
                batch.append(job)
                if len(batch) == self._size:
                    break
            elif verdict == "claimed":
                self._claimed.append(job)
        return batch

    def note(self, outcomes: Sequence[Outcome]) -> None:
        """Let the next batches be as long as `BATCH_SECONDS`, at the pace of these points."""
        seconds = sum(outcome.seconds for outcome in outcomes) / max(len(outcomes), 1)
        fitting = math.ceil(BATCH_SECONDS / seconds) if seconds > 0 else 1
        self._size = max(1, min(fitting, 2 * self._size, MOST))

    def _candidates(self, worker: int) -> Iterator[Task]:
        claimed = len(self._claimed)
        while group := self._group(worker):
            yield group.next()
        for _ in range(claimed):
            yield self._claimed.popleft()

    def _group(self, worker: int) -> _Rest:
        """Return the group of a worker; where none is left, the longest of the others to share."""
        if not self._own.get(worker):
            longest = max(self._own.values(), key=len, default=_Rest(()))
            self._own[worker] = _Rest(self._groups.popleft()) if self._groups else longest
        return self._own[worker]


class _Rest:
    """The points of a group that are not taken; each is made then, since a study has millions."""

    def __init__(self, group: Sequence[Task]) -> None:
        self._group, self._taken = group, 0

    def __len__(self) -> int:
        return len(self._group) - self._taken

    def next(self) -> Task:
        """Return the next point."""
        self._taken += 1
        return self._group[self._taken - 1]


def compute_here(groups: Groups, ask: Ask, threads: int) -> Iterator[Outcome]:
    """Compute one point after the other in this process."""
    shared, queue = Shared(), JobQueue(groups, ask)

    def submit(_: int, batch: Batch) -> Future[list[Outcome]]:
        future: Future[list[Outcome]] = Future()
        future.set_result(compute_points(batch, threads, shared))
        return future

    for _, future in _run_points(queue, [0], submit):
        queue.note(future.result())
        yield from future.result()


def compute_in_processes(groups: Groups, ask: Ask, count: int, threads: int) -> Iterator[Outcome]:
    """Compute points in processes of this machine, each with `threads` threads."""
    processes = [WorkerProcess(threads) for _ in range(count)]
    queue = JobQueue(groups, ask)
    with ThreadPool(count) as pool:

        def submit(worker: int, batch: Batch) -> Future[list[Outcome]]:
            return pool.submit(processes[worker].compute, batch)

        try:
            for _, future in _run_points(queue, range(count), submit):
                queue.note(future.result())
                yield from future.result()
        finally:
            for process in processes:
                process.end()


def compute_on_dask(
    groups: Groups, ask: Ask, address: str, report: Callable[[str], None]
) -> Iterator[Outcome]:
    """Compute points on the workers of a running Dask scheduler. Raise CannotDo without one."""
    distributed = _distributed()
    with _silence("distributed", "tornado", "asyncio"):  # which report what is said in a line
        yield from _compute_on_dask(groups, ask, distributed, address, report)


def _compute_on_dask(
    groups: Groups, ask: Ask, distributed: Any, address: str, report: Callable[[str], None]
) -> Iterator[Outcome]:
    client = _client(distributed, address)
    lost = f"the Dask scheduler at {address} is lost; finished points are kept"
    try:
        slots = _slots(client, address, report)
        # A group stays with its worker, while that one is there: its light is computed once.
        executors = [
            client.get_executor(pure=False, retries=TRIES, workers=[name], allow_other_workers=True)
            for name, _ in slots
        ]

        def submit(slot: int, batch: Batch) -> Future[list[Outcome]]:
            future: Future[list[Outcome]] = executors[slot].submit(
                compute_on_cluster, batch, slots[slot][1]
            )
            return future

        # Every slot has two batches, so that it does not wait for the next one to be sent.
        numbers, queue = [*range(len(slots)), *range(len(slots))], JobQueue(groups, ask)
        for batch, future in _run_points(queue, numbers, submit):
            found = _outcomes(batch, future, lost)
            if found is None:  # each by itself: the one that kills its worker is lost alone
                alone = [submit(0, [job]) for job in batch]
                pairs = zip(batch, alone, strict=True)
                found = [one for job, each in pairs for one in _outcomes([job], each, lost) or ()]
            queue.note(found)
            yield from found
    except (OSError, RuntimeError) as error:
        raise CannotDo(lost, "run the same command again") from error
    finally:
        with suppress(Exception):
            client.close(timeout=1)


def _run_points(
    queue: JobQueue, workers: Sequence[int], submit: Submit
) -> Iterator[tuple[Batch, Future[list[Outcome]]]]:
    """Keep workers busy until no point is left; each number is there as often as it has batches."""
    idle = deque(workers)
    running: dict[Future[list[Outcome]], tuple[int, Batch]] = {}
    while True:
        for worker in [idle.popleft() for _ in range(len(idle))]:
            given = queue.next(worker)
            if given:
                running[submit(worker, given)] = worker, given
            else:
                idle.append(worker)
        if running:
            timeout = POLL_INTERVAL if queue.waiting else None
            for future in wait(running, timeout, FIRST_COMPLETED).done:
                worker, batch = running.pop(future)
                idle.append(worker)
                yield batch, future
        elif queue.waiting:
            time.sleep(POLL_INTERVAL)
        else:
            return


class WorkerProcess:
    """A process that computes one batch at a time, replaced when it dies."""

    def __init__(self, threads: int) -> None:
        self._threads = threads
        self._lock = Lock()
        self._ended = False
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection

    def compute(self, batch: Batch) -> list[Outcome]:
        """Compute points; called by one thread at a time."""
        how = ""
        for _ in range(TRIES if len(batch) == 1 else 1):
            self._start()
            try:
                self._connection.send(batch)
                outcomes: list[Outcome] = self._connection.recv()
                return outcomes
            except (EOFError, OSError):
                how = self._exit_text()
        if len(batch) > 1:  # the point that it dies of fails alone
            return [outcome for job in batch for outcome in self.compute([job])]
        message = f"its process died {TRIES} times ({how}); too little memory?"
        return [Outcome(job.id, error=message, final=False) for job in batch]

    def end(self) -> None:
        """End the process, whatever it does: each point that is finished has been sent."""
        with self._lock:
            self._ended = True
            if self._process is not None:
                self._process.kill()
                self._process.wait()

    def _start(self) -> None:
        """Start the process unless it runs."""
        with self._lock:
            if self._ended:
                raise CancelledError
            if self._process is not None:
                return
            self._connection, theirs = Pipe()
            with theirs:
                self._process = subprocess.Popen(
                    [sys.executable, "-c", SERVE.format(sys.path, theirs.fileno(), self._threads)],
                    pass_fds=[theirs.fileno()],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    env=os.environ | dict.fromkeys(BLAS_VARIABLES, "1"),
                    process_group=0,  # an interrupt is for this process alone
                )

    def _exit_text(self) -> str:
        """Return how the process ended, which has closed its connection."""
        with self._lock:
            process, self._process = self._process, None
        assert process is not None
        with suppress(subprocess.TimeoutExpired):
            process.wait(DEATH_TIMEOUT)
        process.kill()
        code = process.wait()
        return f"signal {-code}" if code < 0 else f"exit code {code}"


def serve(descriptor: int, threads: int) -> None:
    """Compute what comes, as the main function of a process, until the connection closes."""
    share_heap()
    connection, shared = Connection(descriptor), Shared()
    with suppress(EOFError, OSError):
        while True:
            connection.send(compute_points(connection.recv(), threads, shared))


def _outcomes(batch: Batch, future: Any, lost: str) -> list[Outcome] | None:
    """Return the outcomes of points that a cluster has, or has not, computed.

    None for several points that were lost together.
    """
    if future.cancelled():
        raise CannotDo(lost, "run the same command again")
    error = future.exception()
    if isinstance(error, ImportError):
        message = f"the Dask workers cannot import vcam: {error}"
        raise CannotDo(message, "install vcam there, in the same version")
    if error is not None:
        if len(batch) > 1:
            return None
        message = f"lost on the cluster: {type(error).__name__}"
        return [Outcome(job.id, error=message, final=False) for job in batch]
    outcomes: list[Outcome] = future.result()
    return outcomes


@contextmanager
def _silence(*names: str) -> Iterator[None]:
    """Silence these loggers and those below them, which may have levels of their own."""
    below = tuple(f"{name}." for name in names)
    found = [name for name in logging.root.manager.loggerDict if name.startswith(below)]
    loggers = [logging.getLogger(name) for name in (*names, *found)]
    levels = [logger.level for logger in loggers]
    try:
        for logger in loggers:
            logger.setLevel(logging.CRITICAL + 1)
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def _distributed() -> Any:
    """Return Dask's package. Raise CannotDo where it is not installed."""
    try:
        return import_module("distributed")
    except ImportError as error:
        message = "--scheduler needs Dask, which is not installed"
        raise CannotDo(message, "pip install 'vcam-cli[dask]'") from error


def _client(distributed: Any, address: str) -> Any:
    """Return a client of the scheduler. Raise CannotDo without a scheduler."""
    arguments = distributed.Security().get_connection_args("client")
    if address.startswith("tls") and not arguments.get("ssl_context"):
        message = f"Dask's configuration has no certificates for {address}"
        raise CannotDo(message, "set distributed.comm.tls there, or use tcp://HOST:8786")

    async def connect() -> None:  # a client itself waits forever for one that says nothing
        async with asyncio.timeout(CONNECT_TIMEOUT):
            (await distributed.comm.connect(address, CONNECT_TIMEOUT, **arguments)).abort()

    try:
        with ThreadPool(1) as pool:  # whose thread has no event loop yet
            pool.submit(lambda: asyncio.run(connect())).result()
        return distributed.Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        message = f"no Dask scheduler answers at {address} within {CONNECT_TIMEOUT:g} s"
        raise CannotDo(message, "start one with: dask scheduler") from error
    except Exception as error:  # whatever Dask makes of bytes that another program sends
        message = f"the program at {address} is no Dask scheduler"
        raise CannotDo(message, "use the address that `dask scheduler` prints") from error


def _slots(client: Any, address: str, report: Callable[[str], None]) -> list[tuple[str, int]]:
    """Return (worker, its threads) once for each thread of each worker."""
    if not client.nthreads():
        report(f"waiting for a worker at {address}")
        with suppress(TimeoutError):
            client.wait_for_workers(1, timeout=WORKER_TIMEOUT)
    slots = [(name, count) for name, count in client.nthreads().items() for _ in range(count)]
    if not slots:
        message = f"the Dask scheduler at {address} has no workers"
        raise CannotDo(message, f"start some with: dask worker {address}")
    return slots


def processes_and_threads(workers: int | None, points: int) -> tuple[int, int]:
    """Return the number of processes for `points` points, and of the threads in each.

    Together they have no more threads than there are processors, unless more workers are wanted.
    """
    processors = available_workers()
    count = max(1, min(workers or processors, points))
    return count, max(1, processors // count)
