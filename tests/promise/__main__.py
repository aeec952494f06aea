"""The promises of the plan, measured on cameras with little in common.

    python -m tests.promise [--json FILE] [--random | --exact | --matrix | --times] [CAMERA...]

Without names: all of them, forty cameras drawn at random with every effect in each, and cameras
before lattices, charts and fine images whose mean signal is known exactly; --random, --exact: those
alone. --matrix: ten cameras before eighteen scenes, what is left out held against true ablations;
--times: the time of their frames as planned and with everything on.

Prints what the mean signal and the variances lose beside what may be lost, what the plan expected
of every effect beside its ablation, whether what is not worth its cost is left out, and the time
that is saved. Exit code 1 where a figure is missed.
"""

from __future__ import annotations

import argparse
import itertools
import json
import statistics
import sys
import tempfile
from pathlib import Path

# the tests find each other by their names
sys.path.insert(0, str(Path(__file__).parent.parent))
sys.path.insert(0, str(Path(__file__).parent))

import exact_errors
import promises
import random_cameras
import scene_matrix

from vcam_cli.accuracy import ablation


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("cameras", nargs="*", help="some of them; default all")
    parser.add_argument("--random", action="store_true", help="only those drawn at random")
    parser.add_argument("--exact", action="store_true", help="only those with an exact truth")
    parser.add_argument("--matrix", action="store_true", help="only ten cameras before scenes")
    parser.add_argument("--times", action="store_true", help="only the time that the plan saves")
    parser.add_argument("--json", help="also write the figures to this file")
    options = parser.parse_args()
    if options.matrix or options.times:
        return _matrix(options.times, tuple(options.cameras) or scene_matrix.CAMERAS)
    out: dict[str, list] = {"kept": [], "estimates": [], "costly": [], "idle": [], "seconds": []}
    out["random"] = []
    with tempfile.TemporaryDirectory() as folder:
        named = () if options.random or options.exact else promises.CAMERAS
        for name in options.cameras or named:
            _one(name, Path(folder), out)
        for number in () if options.cameras or options.exact else range(random_cameras.COUNT):
            _random(number, Path(folder), out)
        exact = []
        if not options.cameras and not options.random:
            exact = list(exact_errors.mean_errors(Path(folder)))
            print("", *exact_errors.table(exact), sep="\n")
    out["exact"] = [(each.name, each.kind, each.over_tolerance) for each in exact]
    figures = _figures(out)
    _print_figures(figures)
    if options.json:
        text = json.dumps({**out, "figures": [f[:2] for f in figures]}, indent=1)
        Path(options.json).write_text(text, encoding="utf-8")
    return 0 if all(good for _, _, good in figures) else 1


def _matrix(timed: bool, cameras: tuple[str, ...]) -> int:
    """Measures cameras before scenes, prints their lines, and returns the exit code."""
    with tempfile.TemporaryDirectory() as folder:
        if timed:
            times = []
            for name, scene in itertools.product(cameras, scene_matrix.SCENES):
                times.append(scene_matrix.times(name, scene, Path(folder)))
                print(times[-1].line, flush=True)
            figures = list(scene_matrix.time_figures(times))
        else:
            cells = []
            for name, scene in itertools.product(cameras, scene_matrix.SCENES):
                cells.append(scene_matrix.cell(name, scene, Path(folder)))
                print(cells[-1].line, flush=True)
            figures = list(scene_matrix.figures(cells))
    _print_figures(figures)
    return 0 if all(good for _, _, good in figures) else 1


def _print_figures(figures: list[tuple[str, str, bool]]) -> None:
    print()
    for text, found, good in figures:
        print(f"{'ok    ' if good else 'MISSED'}  {text:<78} {found}")


def _one(name: str, folder: Path, out: dict[str, list]) -> None:
    """Measures one camera and prints its lines."""
    camera = promises.made(name, folder)
    true = promises.truth(camera)
    print(f"\n{name}: full signal {true.full:.4g} e")
    for k in promises.kept(true):
        out["kept"].append((name, k.preset, k.mean / k.tolerance, k.variance / (2 * k.tolerance)))
        print(
            f"  {k.preset:<10} mean {k.mean:9.2e} of {k.tolerance:7.0e}"
            f"   variance {k.variance:9.2e} of {2 * k.tolerance:7.0e}"
        )
    for e in promises.estimates(camera, true):
        out["estimates"].append((name, e.name, e.predicted, e.measured, e.ratio))
        print(
            f"  {e.name:<16} {e.predicted:10.3e} expected {e.measured:10.3e} found {e.ratio:7.3f}"
        )
    shares = ablation.variance_shares(true.found, true.full, 2)
    for preset in promises.PRESETS:
        for effect, off in promises.worth_leaving_out(preset, true, shares):
            out["costly"].append((name, preset, effect, off))
            print(f"  {effect} is not worth its cost at {preset}: {'off' if off else 'ON'}")
    out["idle"] += [(name, *line) for line in promises.idle_work(camera)]
    auto, everything = promises.seconds(camera)
    out["seconds"].append((name, auto, everything))
    print(f"  auto at standard {auto:.3f} s, all at reference {everything:.3f} s", flush=True)


def _random(number: int, folder: Path, out: dict[str, list]) -> None:
    """Measures one random camera and prints its lines."""
    camera = random_cameras.made(number, folder)
    print(f"\nrandom camera {number}: {camera.scene.source.kind}")
    for h in random_cameras.held(camera, 2):
        out["random"].append((number, h.tolerance, h.expected, h.mean, h.variance))
        print(
            f"  {h.tolerance:<6g} mean {h.mean:9.2e} ({h.expected:9.2e} expected)"
            f"   variance {h.variance:9.2e} of {2 * h.tolerance:7.0e}",
            flush=True,
        )


def _figures(out: dict[str, list]) -> list[tuple[str, str, bool]]:
    """(what is promised, what was found, whether it holds)"""
    return [*_of_random(out), *_of_exact(out), *(_of_named(out) if out["kept"] else ())]


def _of_exact(out: dict[str, list]) -> list[tuple[str, str, bool]]:
    worst = max((max(over.values()) for _, _, over in out["exact"]), default=None)
    if worst is None:
        return []
    text = "exact truths: error of the mean raw over the tolerance; at most 1"
    return [(text, f"{worst:.2f}", worst <= 1)]


def _of_random(out: dict[str, list]) -> list[tuple[str, str, bool]]:
    if not out["random"]:
        return []
    worst = max(mean / tolerance for _, tolerance, _, mean, _ in out["random"])
    noise = max(variance / tolerance / 2 for _, tolerance, _, _, variance in out["random"])
    ratios = [expected / mean for _, _, expected, mean, _ in out["random"] if mean > 0]
    return [
        ("random cameras: error of the mean raw over the tolerance; at most 1", f"{worst:.2f}",
         worst <= 1),
        ("random cameras: change of a variance over twice the tolerance; at most 1",
         f"{noise:.2f}", noise <= 1),
        ("random cameras: expected over measured error, least and median; for information",
         f"{min(ratios):.2f} {statistics.median(ratios):.2f}", True),
    ]  # fmt: skip


def _of_named(out: dict[str, list]) -> list[tuple[str, str, bool]]:
    mean, variance = (max(k[i] for k in out["kept"]) for i in (2, 3))
    ratios = [e[4] for e in out["estimates"] if e[4] != 1.0]
    off = [c[3] for c in out["costly"]]
    idle = [i[2] for i in out["idle"]]
    auto, everything = (sum(s[i] for s in out["seconds"]) for i in (1, 2))
    parts = [s[1] / s[2] for s in out["seconds"]]
    middle = statistics.median(ratios)
    part = sum(off) / len(off) if off else 1.0
    return [
        ("error of the mean raw over the tolerance, largest; at most 1", f"{mean:.2f}", mean <= 1),
        ("change of a variance over twice the tolerance, largest; at most 1", f"{variance:.2f}",
         variance <= 1),
        ("expected over measured contribution, least; at least 0.9", f"{min(ratios):.3f}",
         min(ratios) >= 0.9),
        ("the same, median; at most 3", f"{middle:.3f}", middle <= 3),
        ("the same, largest; at most 10", f"{max(ratios):.3f}", max(ratios) <= 10),
        ("draws of an ablation under a tenth of their share that are off; at least 80 %",
         f"{sum(off)} of {len(off)}", part >= 0.8),
        ("work that nobody asks for (ideal image, metrics, demosaic) and is not done; all",
         f"{sum(idle)} of {len(idle)}", all(idle)),
        ("time of auto at standard over all at reference, of all cameras; at most 60 %",
         f"{auto / everything:.0%}", auto <= 0.6 * everything),
        ("the same, median of the cameras; at most 60 %", f"{statistics.median(parts):.0%}",
         statistics.median(parts) <= 0.6),
    ]  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
