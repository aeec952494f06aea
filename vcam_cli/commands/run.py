"""`vcam run`: one camera, one scene, one photograph."""

from pathlib import Path

from vcam_cli.commands import options


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

    from vcam_cli.camera.load import load

    start = time.perf_counter()
    model = load(camera, options.overrides(set_, seed, accuracy))
    from vcam_cli.files.folder import OutputFolder
    from vcam_cli.files.report import to_json
    from vcam_cli.studies import outputs
    from vcam_cli.studies.simulate import simulate

    inputs = outputs.inputs(model)
    with OutputFolder(out or Path("out") / model.name, inputs=inputs) as folder:
        result = simulate(model, workers)
        for note in result.notes:
            options.say(note, quiet)
        outputs.write(result, folder)
        record = outputs.record(result, inputs, time.perf_counter() - start)
        folder.finish(record)
    if as_json:
        print(to_json(summary(record, folder.path)), end="")
    elif not quiet:
        print(report(result.metrics, record, folder.path))


def summary(record: dict, path: Path) -> dict:
    """What `--json` prints."""
    names = ("name", "metrics", "plan", "geometry", "stages", "seconds", "peak_memory_bytes")
    return {"out": str(path), **{name: record[name] for name in names}}


def report(metrics: list[tuple[str, float, str]], record: dict, path: Path) -> str:
    """What a person reads after a run."""
    lines = [f"{name:<20} {value:>12.6g} {unit}".rstrip() for name, value, unit in metrics]
    left_out = [
        e["name"] for e in record["plan"]["effects"] if e["by"] == "plan" and e["state"] == "off"
    ]
    if left_out:
        lines.append(f"left out by the plan: {', '.join(left_out)} (why: {path}/run.json)")
    lines.append(f"{record['name']}: {path}/ in {record['seconds']:.2f} s")
    return "\n".join(lines)
