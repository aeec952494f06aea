"""`vcam run`: one camera, one scene, one photograph."""

from pathlib import Path

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress


def run(
    camera: options.Camera,
    out: options.Out = None,
    set_: options.Set = None,
    seed: options.Seed = None,
    accuracy: options.Accuracy = None,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
    workers: options.Workers = None,
) -> None:
    """Simulate a camera and write raw.exr, render.png, metrics.csv and run.json.

    \b
    Example:
      vcam run still-life
      vcam run camera.yaml -o out/tele --set optics.focal_length="12 mm"
    """
    import time

    from vcam_cli.simulation.checks import load

    start = time.perf_counter()
    model = load(camera, options.overrides(set_, seed, accuracy))
    from vcam_cli.files.folder import OutputFolder
    from vcam_cli.files.report import to_json
    from vcam_cli.simulation import outputs, provenance
    from vcam_cli.simulation.simulate import simulate

    inputs = provenance.inputs(model)
    place = OutputFolder(out or Path("out") / model.name, inputs=inputs)
    with place as folder, Progress(quiet) as progress:
        result = simulate(model, workers, progress)
        outputs.write(result, folder)
        record = outputs.record(result, inputs, time.perf_counter() - start)
        folder.finish(record)
    for note in result.notes:
        options.say(note, quiet)
    if as_json:
        print(to_json(summary(record, folder.path)), end="")
    elif not quiet:
        print(report(result.metrics, record, folder.path, folder.names))


def summary(record: dict, path: Path) -> dict:
    """Return the summary that `--json` prints."""
    names = ("name", "metrics", "plan", "geometry", "stages", "seconds", "peak_memory_bytes")
    return {"out": str(path), **{name: record[name] for name in names}}


def report(
    metrics: list[tuple[str, float, str]], record: dict, path: Path, files: tuple[str, ...]
) -> str:
    """Return the report of a run: metrics, effects, time and files."""
    lines = [f"{name:<20} {value:>12.6g} {unit}".rstrip() for name, value, unit in metrics]
    lines += ["", *effect_lines(record["plan"]["effects"])]
    estimate, measured = record["plan"]["seconds"], sum(record["stages"].values())
    lines.append(
        f"time         {measured:.2f} s, {estimate:.2f} s were estimated"
        f" ({record['seconds']:.2f} s with start-up)"
    )
    lines += [f"{about:<12} {path / name}" for name, about in FILES.items() if name in files]
    lines.append(f"{record['name']}: {path}/")
    return "\n".join(lines)


FILES = {
    "render.png": "render",
    "raw.exr": "raw frame",
    "ideal.exr": "ideal image",
    "delta_e.png": "error map",
    "irradiance.exr": "irradiance",
    "captures/raw_001.exr": "first sample",
    "hdr.exr": "photocurrent",
}
"""Image files that a run may write -> their descriptions."""


def effect_lines(decisions: list[dict]) -> list[str]:
    """Return the lines on effects: simulated, left out by the plan, switched off in the file."""

    def names(state: str, *by: str) -> list[str]:
        return [e["name"] for e in decisions if e["state"] == state and e["by"] in by]

    lines = wrap("simulated", ", ".join(names("on", "plan", "user")) or "nothing but light")
    for e in decisions:
        if e["state"] == "off" and e["by"] == "plan":
            lines += wrap("left out", f"{e['name']}: {e['reason']}")
    if names("off", "user"):
        lines += wrap("switched off", ", ".join(names("off", "user")))
    return lines


def wrap(label: str, text: str) -> list[str]:
    """Return lines of at most 100 characters, with a label before the first."""
    import textwrap

    lines = textwrap.wrap(text, 100 - 12 - 1) or [""]
    return [f"{label if not i else '':<12} {line}" for i, line in enumerate(lines)]
