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
    """Simulates a camera and writes raw.exr, render.png, metrics.csv and run.json.

    \b
    Example:
      vcam run still-life
      vcam run camera.yaml -o out/tele --set optics.focal_length="12 mm"
    """
    import time

    from vcam_cli.studies.checks import load

    start = time.perf_counter()
    model = load(camera, options.overrides(set_, seed, accuracy))
    from vcam_cli.files.folder import OutputFolder
    from vcam_cli.files.report import to_json
    from vcam_cli.studies import outputs, provenance
    from vcam_cli.studies.simulate import simulate

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
    """What `--json` prints."""
    names = ("name", "metrics", "plan", "geometry", "stages", "seconds", "peak_memory_bytes")
    return {"out": str(path), **{name: record[name] for name in names}}


def report(
    metrics: list[tuple[str, float, str]], record: dict, path: Path, files: tuple[str, ...]
) -> str:
    """What a person reads after a run: figures, what was simulated, the time, where it all is."""
    lines = [f"{name:<20} {value:>12.6g} {unit}".rstrip() for name, value, unit in metrics]
    lines += ["", *effects(record["plan"]["effects"])]
    foretold, took = record["plan"]["seconds"], sum(record["stages"].values())
    lines.append(
        f"time         {took:.2f} s, {foretold:.2f} s were foretold"
        f" ({record['seconds']:.2f} s with start-up)"
    )
    lines += [f"{said:<12} {path / name}" for name, said in FILES.items() if name in files]
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
"""Pictures a run may leave, and what they are."""


def effects(decisions: list[dict]) -> list[str]:
    """What was simulated, and what the plan or the file left out."""

    def names(state: str, *by: str) -> list[str]:
        return [e["name"] for e in decisions if e["state"] == state and e["by"] in by]

    lines = wrapped("simulated", ", ".join(names("on", "plan", "user")) or "nothing but light")
    for e in decisions:
        if e["state"] == "off" and e["by"] == "plan":
            lines += wrapped("left out", f"{e['name']}: {e['reason']}")
    if names("off", "user"):
        lines += wrapped("switched off", ", ".join(names("off", "user")))
    return lines


def wrapped(label: str, text: str) -> list[str]:
    """Lines of at most 100 characters, with a label before the first."""
    import textwrap

    lines = textwrap.wrap(text, 100 - 12 - 1) or [""]
    return [f"{label if not i else '':<12} {line}" for i, line in enumerate(lines)]
