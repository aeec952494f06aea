"""Where points are computed: in this process, in processes of this machine, on a Dask cluster.

All three call `point_work.work` and give the same numbers. Points come in groups that share their
light (`engine.lights`): a worker keeps to its group, and takes half of another's when it has none.

Why processes of our own and not those of `multiprocessing`: these neither run the caller's main
module again nor end with it half alive; a worker whose connection closes ends by itself.
"""

from __future__ import annotations

import math
import os
import socket
import subprocess
import sys
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from importlib import import_module
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Literal

import vcam_cli
from vcam_cli.engine.parallel import available_workers
from vcam_cli.errors import BadInput, CannotDo, Problem
from vcam_cli.studies.outcome import Outcome
from vcam_cli.studies.point_work import Job, work, work_far
from vcam_cli.studies.shared import Shared

Verdict = Literal["go", "skip", "later"]
Ask = Callable[[Job], Verdict]
"""Whether a point is still to be computed, is done, or is being computed by another process."""
Groups = Sequence[Sequence[Job]]

SERVE = "from vcam_cli.studies.run_on import serve; serve({}, {})"
"""What a worker runs: the number of its connection, and threads."""
TRIES = 3
"""Times that a point may take its worker down with it."""
AGAIN = 0.2
"""Seconds between looks at points that others compute."""
LAST_WORDS = 5.0
"""Seconds in which a worker that closed its connection must have ended."""
BATCH = 0.5
"""Seconds that a task on a cluster should take at least: less is mostly overhead."""
REACH = 5.0
"""Seconds in which a scheduler must answer."""
FIRST_WORKER = 60.0
"""Seconds in which a scheduler must have a worker."""


class _Queue:
    """The points left, handed out group by group."""

    def __init__(self, groups: Groups, ask: Ask) -> None:
        self._groups = deque(deque(group) for group in groups if group)
        self._ask = ask
        self._own: dict[int, deque[Job]] = {}
        self._later: deque[Job] = deque()

    def next(self, worker: int) -> Job | None:
        """The worker's next point; None while there is none for it."""
        while job := self._take(worker):
            verdict = self._ask(job)
            if verdict == "go":
                return job
            if verdict == "later":
                self._later.append(job)
        for _ in range(len(self._later)):
            job = self._later.popleft()
            verdict = self._ask(job)
            if verdict == "go":
                return job
            if verdict == "later":
                self._later.append(job)
        return None

    def back(self, worker: int, job: Job) -> None:
        """A point that was not finished comes first again."""
        self._own.setdefault(worker, deque()).appendleft(job)

    @property
    def waiting(self) -> bool:
        """Whether others compute points that are wanted here."""
        return bool(self._later)

    def _take(self, worker: int) -> Job | None:
        own = self._own.get(worker)
        if not own:
            own = self._own[worker] = self._groups.popleft() if self._groups else self._half()
        return own.popleft() if own else None

    def _half(self) -> deque[Job]:
        """The later half of the longest group of another worker."""
        longest = max(self._own.values(), key=len, default=deque())
        return deque(reversed([longest.pop() for _ in range((len(longest) + 1) // 2)]))


def here(groups: Groups, ask: Ask, threads: int) -> Iterator[Outcome]:
    """One point after the other, in this process."""
    queue, shared = _Queue(groups, ask), Shared()
    while True:
        job = queue.next(0)
        if job is not None:
            yield work(job, threads, shared)
        elif queue.waiting:
            time.sleep(AGAIN)
        else:
            return


class _Worker:
    """A process that computes points, and the connection to it."""

    def __init__(self, number: int, threads: int) -> None:
        self.number = number
        self.job: Job | None = None
        ours, theirs = socket.socketpair()
        root = str(Path(vcam_cli.__file__).parent.parent)
        env = dict(os.environ)
        env["PYTHONPATH"] = os.pathsep.join(p for p in (root, env.get("PYTHONPATH")) if p)
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
            env[name] = str(threads)
        with theirs:
            self.process = subprocess.Popen(
                [sys.executable, "-c", SERVE.format(theirs.fileno(), threads)],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                env=env,
                process_group=0,  # Ctrl-C is this process's business
            )
        self.connection = Connection(ours.detach())

    def give(self, job: Job) -> None:
        """Sends a point; that the worker has died shows when its answer is asked for."""
        self.job = job
        with suppress(OSError):
            self.connection.send(job)

    def answer(self) -> Outcome | None:
        """What came back; None where the worker has died."""
        try:
            return self.connection.recv()
        except (EOFError, OSError):
            return None

    def end(self) -> None:
        """Ends it, whatever it does: what is finished has been sent."""
        self.process.kill()
        self.process.wait()
        self.connection.close()

    def death(self) -> str:
        """How it ended by itself."""
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(LAST_WORDS)
        self.end()
        code = self.process.returncode
        return f"signal {-code}" if code < 0 else f"exit code {code}"


def serve(descriptor: int, threads: int) -> None:
    """The main function of a worker: computes what comes until the connection closes."""
    connection, shared = Connection(descriptor), Shared()
    with suppress(EOFError, OSError):
        while True:
            connection.send(work(connection.recv(), threads, shared))


def local(groups: Groups, ask: Ask, workers: int, threads: int) -> Iterator[Outcome]:
    """In processes of this machine; one that dies is replaced and its point tried again."""
    queue = _Queue(groups, ask)
    deaths: Counter[str] = Counter()
    crew: dict[int, _Worker] = {}
    try:
        while True:
            for number in range(workers):
                if number in crew and crew[number].job is not None:
                    continue
                if (job := queue.next(number)) is not None:
                    crew[number] = crew.get(number) or _Worker(number, threads)
                    crew[number].give(job)
            busy = {w.connection: w for w in crew.values() if w.job is not None}
            if not busy and not queue.waiting:
                return
            if not busy:
                time.sleep(AGAIN)
            for ready in wait(list(busy), AGAIN if queue.waiting else None):
                worker = busy[ready]  # type: ignore[index]
                job, worker.job = worker.job, None
                assert job is not None
                outcome = worker.answer()
                if outcome is None:
                    how = crew.pop(worker.number).death()
                    outcome = _after_death(job, worker, how, deaths, queue)
                if outcome is not None:
                    yield outcome
    finally:
        for worker in crew.values():
            worker.end()


def _after_death(
    job: Job, worker: _Worker, how: str, deaths: Counter[str], queue: _Queue
) -> Outcome | None:
    """The point goes back into the queue, or is given up."""
    deaths[job.id] += 1
    if deaths[job.id] < TRIES:
        queue.back(worker.number, job)
        return None
    message = f"its process died {TRIES} times ({how}); too little memory?"
    return Outcome(job.id, error=message, final=False)


def cluster(
    groups: Groups, ask: Ask, address: str, tell: Callable[[str], None]
) -> Iterator[Outcome]:
    """On the workers of a running Dask scheduler. Raises CannotDo where it cannot be had."""
    client = _client(address)
    as_completed = import_module("distributed").as_completed
    queue = _Queue(groups, ask)
    lost = f"the Dask scheduler at {address} is lost; finished points are kept"
    try:
        slots = _slots(client, address, tell)
        tasks = as_completed(loop=client.loop)
        sent: dict[Any, tuple[int, list[Job]]] = {}
        each = 0.0

        def submit(slot: int) -> None:
            jobs = _batch(queue, slot, each)
            if jobs:
                future = client.submit(work_far, jobs, slots[slot], pure=False, retries=TRIES)
                sent[future] = (slot, jobs)
                tasks.add(future)

        # Two tasks for every place: none waits for its next one to be sent.
        for slot in [*range(len(slots)), *range(len(slots))]:
            submit(slot)
        while sent or queue.waiting:
            if not sent:
                time.sleep(AGAIN)
                submit(0)
                continue
            future = next(tasks)
            slot, jobs = sent.pop(future)
            outcomes = _gathered(future, jobs, lost)
            done = [o.seconds for o in outcomes if not o.error]
            each = sum(done) / len(done) if done else each
            submit(slot)
            yield from outcomes
    except (OSError, RuntimeError) as error:
        raise CannotDo(lost, "run the same command again") from error
    finally:
        with suppress(Exception):
            client.close(timeout=1)


def _batch(queue: _Queue, slot: int, each: float) -> list[Job]:
    """So many points that they take long enough; one while nothing is known."""
    jobs: list[Job] = []
    while len(jobs) < (min(64, math.ceil(BATCH / each)) if each else 1):
        job = queue.next(slot)
        if job is None:
            break
        jobs.append(job)
    return jobs


def _gathered(future: Any, jobs: Iterable[Job], lost: str) -> list[Outcome]:
    """What came of a task; of one that killed its workers, rows that say so."""
    if future.cancelled():
        raise CannotDo(lost, "run the same command again")
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, ImportError):
        message = f"the Dask workers cannot import vcam: {error}"
        raise CannotDo(message, "install vcam there, in the same version")
    message = f"lost on the cluster: {type(error).__name__}"
    return [Outcome(job.id, error=message, final=False) for job in jobs]


def _client(address: str) -> Any:
    """A client of the scheduler. Raises CannotDo and BadInput."""
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        message = "--scheduler needs Dask, which is not installed"
        raise CannotDo(message, "pip install 'vcam-cli[dask]'") from error
    import logging

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        return distributed.Client(address, timeout=REACH, set_as_default=False)
    except ValueError as error:
        problem = Problem(("--scheduler",), f"{address!r}: {error}", "write tcp://HOST:8786")
        raise BadInput([problem]) from error
    except (OSError, TimeoutError) as error:
        message = f"no Dask scheduler answers at {address} within {REACH:g} s"
        raise CannotDo(message, "start one with: dask scheduler") from error


def _slots(client: Any, address: str, tell: Callable[[str], None]) -> list[int]:
    """Of every place that computes one task at a time, how many such its process has."""
    places = client.nthreads()
    if not places:
        tell(f"waiting for a worker at {address}")
        try:
            client.wait_for_workers(1, timeout=FIRST_WORKER)
        except TimeoutError as error:
            message = f"the Dask scheduler at {address} has no workers"
            raise CannotDo(message, f"start some with: dask worker {address}") from error
        places = client.nthreads()
    return [count for count in places.values() for _ in range(count)] or [1]


def shares(workers: int | None, jobs: int) -> tuple[int, int]:
    """(processes, threads in each): together no more threads than processors, where that can be."""
    processors = available_workers()
    count = max(1, min(workers or processors, jobs))
    return count, max(1, processors // count)
