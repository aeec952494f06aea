"""The promises of the plan, measured: prints every figure, and exits with 1 where one is missed.

    python -m tests.promise [--named] [--random] [--exact] [--frames] [--layers] [--matrix]
                            [--times] [--spent] [--count N] [--first-seed N] [CAMERA...]
    python -m tests.promise --frames --kinds KIND... [--count N] [--first-seed N]
    python -m tests.promise --only KIND SEED

Without options: all of it, in an hour on two processors. Named cameras have little in common;
of each, what the mean signal and the variances lose beside what may be lost, what the plan expected
of every effect beside its ablation, and what is not worth its cost. Forty more are drawn at random
with every effect. The mean signal of others is known exactly. Thousands of frames of all kinds are
drawn at random, each with a truth of its own (`frames.py`); `--only` prints one of them. Twenty
layered frames show whether a tighter accuracy errs less, and as predicted. Ten cameras stand before
eighteen scenes: what is left out there is held against true ablations, and the time that it saves
is measured, in processor seconds on one thread. Shipped cameras spend the tolerance: their errors
are no small part of it, and their presets no more expensive than that explains.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, replace
from multiprocessing import get_context
from pathlib import Path

# the tests find each other by their names
sys.path.insert(0, str(Path(__file__).parent.parent))
sys.path.insert(0, str(Path(__file__).parent))

import frames
from parts import PARTS, Figure, Part

from vcam_cli.memory import limit_blas_threads
from vcam_cli.parallel import available_workers


def main() -> int:
    parser = argparse.ArgumentParser(description="Measure the promises of the plan.")
    parser.add_argument("cameras", nargs="*", help="some of them; default all")
    for name, part in PARTS.items():
        parser.add_argument(f"--{name}", action="store_true", help=f"only {part.text}")
    parser.add_argument("--workers", type=int, default=available_workers(), help="processes")
    parser.add_argument("--json", help="also write what was found to this file")
    parser.add_argument("--count", type=int, default=frames.COUNT, help="random frames")
    parser.add_argument("--first-seed", type=int, default=0, help="of every kind of them")
    parser.add_argument(
        "--kinds", nargs="+", choices=tuple(frames.KINDS), default=(), help="of them; default all"
    )
    parser.add_argument("--only", nargs=2, metavar=("KIND", "SEED"), help="print one of them")
    options = parser.parse_args()
    if options.only:
        print(frames.show(*options.only, Path(tempfile.mkdtemp())))
        return 0
    drawn = frames.cases(options.count, options.first_seed, options.kinds)
    PARTS["frames"] = replace(PARTS["frames"], cases=drawn)
    limit_blas_threads()  # of the processes that are started, as `vcam` does
    names = [name for name in PARTS if getattr(options, name)] or list(PARTS)
    found: dict[str, list] = {}
    figures: dict[str, list[Figure]] = {}
    start = time.perf_counter()
    for name in names:
        part = PARTS[name]
        cases = [c for c in part.cases if not options.cameras or str(c[0]) in options.cameras]
        if cases:
            print(f"\n{part.text}", flush=True)
            found[name] = list(_measured(part, cases, options.workers))
            figures[name] = list(part.figures(found[name]))
    for name, lines in figures.items():
        print(f"\n{PARTS[name].text}")
        for text, value, good in lines:
            print(f"{'ok    ' if good else 'MISSED'}  {text:<78} {value}")
    print(f"\nmeasured in {(time.perf_counter() - start) / 60:.0f} min")
    if options.json:
        plain = {name: [asdict(each) for each in own] for name, own in found.items()}
        content = {**plain, "figures": figures}
        text = json.dumps(content, indent=1, default=lambda value: value.item())
        Path(options.json).write_text(text, encoding="utf-8")
    return 0 if all(good for lines in figures.values() for _, _, good in lines) else 1


def _measured(part: Part, cases: list[tuple], workers: int) -> Iterator:
    """Yield what is found of each case, in their order, and print its lines."""
    with tempfile.TemporaryDirectory() as folder:
        places = []
        for number in range(len(cases)):
            places.append(Path(folder) / str(number))
            places[-1].mkdir()
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            jobs = [pool.submit(part.measure, *c, p) for c, p in zip(cases, places, strict=True)]
            for job in jobs:
                found = job.result()
                if found.line:
                    print(found.line, flush=True)
                yield found


if __name__ == "__main__":
    sys.exit(main())
