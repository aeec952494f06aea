"""`vcam run`: one camera, one scene, one photograph."""

from pathlib import Path
from typing import Any

import typer

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress
from vcam_cli.reports.run_facts import spoken


def run(
    camera: options.Camera,
    out: options.Out = None,
    set_: options.Set = None,
    seed: options.Seed = None,
    accuracy: options.Accuracy = None,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
    workers: options.Workers = None,
    device: options.Device = "cpu",
    report: options.Report = False,
    frames: options.Frames = None,
    fps: options.FrameRate = None,
    expect: options.Expect = None,
) -> None:
    """Simulate a camera and write raw.exr, render.png, metrics.csv and run.json.

    With --frames and --fps a sequence: frames/raw_0001.exr and so on, frames.csv, strip.png
    and, where ffmpeg is installed, sequence.mp4.

    \b
    Example:
      vcam run still-life
      vcam run camera.yaml -o out/tele --set optics.focal_length="12 mm"
    """
    import time

    from vcam_cli.simulation.checks import load

    start = time.perf_counter()
    if (frames is None) != (fps is None):
        raise typer.BadParameter("--frames and --fps go together: --frames 30 --fps 30")
    asked = ["output.report=true"] if report else []
    model = load(camera, [*options.overrides(set_, seed, accuracy), *asked])
    model = model.with_expectations(expect or ())
    from vcam_cli.files.folder import OutputFolder
    from vcam_cli.files.report import to_json
    from vcam_cli.simulation.output import outputs, provenance
    from vcam_cli.simulation.simulate import simulate

    inputs = provenance.inputs(model)
    place = OutputFolder(out or Path("out") / model.name, inputs=inputs)
    with place as folder, Progress(quiet) as progress:
        memory = 0
        if frames is None:
            result = simulate(model, workers, progress, device=device)
            outputs.write(result, folder)
        else:
            from vcam_cli.simulation.sequence import write_sequence

            assert fps is not None
            result, memory = write_sequence(model, frames, fps, folder, workers, progress, device)
        record = outputs.finish(result, folder, inputs, lambda: time.perf_counter() - start, memory)
    for note in result.notes:
        options.say(note, quiet)
    if as_json:
        print(to_json(summary(record, folder.path) | {"missed": result.missed}), end="")
    elif not quiet:
        print_summary(result.metrics.rows, record, folder.path, folder.names)
    options.end_with_expectations(model.limits, result.missed, quiet)


def summary(record: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return the summary that `--json` prints."""
    names = ("name", "metrics", "plan", "geometry", "stages", "seconds", "peak_memory_bytes")
    return {"out": str(path), **{name: record[name] for name in names}}


def print_summary(
    metrics: tuple[tuple[str, float, str], ...],
    record: dict[str, Any],
    path: Path,
    files: tuple[str, ...],
) -> None:
    """Print what a run found: metrics, effects, time and files."""
    rows = [(name, f"{value:.6g}", unit, LABELS.get(name, "")) for name, value, unit in metrics]
    plain = "\n".join(f"{n:<26} {v:>12} {u:<4} {said}".rstrip() for n, v, u, said in rows)
    options.print_rows(("metric", ">value", "unit", ""), rows, plain)
    lines = ["", *exposure_lines(record["exposure"])]
    estimate, measured = record["plan"]["seconds"], sum(record["stages"].values())
    lines.append("")
    lines.append(
        f"time         {measured:.2f} s, {estimate:.2f} s were estimated"
        f" ({record['seconds']:.2f} s with start-up)"
    )
    lines += [f"{about:<12} {path / name}" for name, about in FILES.items() if name in files]
    lines.append(f"{record['name']}: {path}/")
    lines += ["", *options.wrap(simulated_effects(record["plan"], measured))]
    print("\n".join(lines))


LABELS = {
    "snr_db": "of a pixel at 20 % of the well, eq 3.2",
    "dynamic_range_db": "of a pixel, eq 3.1",
    "quantized_dynamic_range_db": "with the ADC's end and rounding",
    "picture_snr_db": "of this picture, mean signal over its temporal noise",
    "gray_snr_db": "of 18 % gray in this exposure",
    "mtf50": "of the slanted edge in the raw frame",
    "base_iso": "ISO speed at gain 1",
    "digital_gain": "of the render, over raw saturation = white",
}
"""Metric -> what it is measured of, where its name leaves that open."""


def exposure_lines(exposure: dict[str, Any]) -> list[str]:
    """Return how the frame was exposed, in words."""
    from vcam_cli.units import render

    time = render(float(f"{exposure['time']:.4g}"), "time")
    how = f"{time} at gain {exposure['gain']:.4g}"
    if exposure["iso"]:
        how += f", ISO {float(format(exposure['iso'], '.3g')):g}"
    if exposure["automatic"]:
        how += "; automatic"
    if exposure["stopped_by"]:
        how += f", stopped at its {exposure['stopped_by']}"
    shares = exposure["clipped"].items()
    clipped = ", ".join(f"{color} {100 * share:.3g} %" for color, share in shares)
    peak = f"peak {100 * exposure['raw_peak']:.3g} % of full scale"
    return [f"exposure     {how}", f"raw          {peak}; clipped {clipped}"]


FILES = {
    "render.png": "render",
    "raw.exr": "raw frame",
    "phase.exr": "left and right halves",
    "disparity.png": "disparity",
    "raw.dng": "raw frame",
    "raw.tif": "raw frame",
    "ideal.exr": "ideal image",
    "delta_e.png": "error map",
    "irradiance.exr": "irradiance",
    "scene.mat": "for ISETCam",
    "irradiance.mat": "for ISETCam",
    "volts.mat": "for ISETCam",
    "captures/raw_001.exr": "first sample",
    "hdr.exr": "photocurrent",
    "frames/render_0001.png": "first frame",
    "frames/raw_0001.exr": "first raw frame",
    "frames.csv": "all frames",
    "strip.png": "strip",
    "sequence.mp4": "video",
    "report.html": "report",
}
"""Files to look at that a run may write -> their descriptions."""


def simulated_effects(plan: dict[str, Any], measured: float) -> str:
    """Return how many effects were simulated, which were skipped, and the time of both."""
    effects = plan["effects"]
    on = [e for e in effects if e["state"] == "on"]
    omitted = [e for e in effects if e["state"] == "off" and e["by"] == "plan"]
    off = [e for e in effects if e["state"] == "off" and e["by"] == "user"]
    parts = [f"simulated {len(on)} of {len(on) + len(omitted)} effects"]
    if omitted:
        parts.append("skipped: " + ", ".join(map(_share, omitted)))
    if off:
        parts.append("switched off: " + ", ".join(spoken(e["name"]) for e in off))
    time = f"{measured:.2f} s"
    if omitted:
        time += f", all of them about {measured * plan['seconds_of_all'] / plan['seconds']:.2f} s"
    return "; ".join([*parts, time])


def _share(effect: dict[str, Any]) -> str:
    """Return an effect and how much it would change."""
    return f"{spoken(effect['name'])} ({100 * effect['contribution']:.2g} % {effect['unit']})"
