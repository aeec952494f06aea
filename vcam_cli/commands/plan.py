"""`vcam plan`: what a run would simulate, what not, why, and at what cost."""

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress


def plan(
    camera: options.Camera,
    set_: options.Set = None,
    accuracy: options.Accuracy = None,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
    workers: options.Workers = None,
) -> None:
    """Show which effects a run simulates, which not and why, and what it costs.

    The irradiance on the pixels is computed, since the scene's spectrum decides what blur
    contributes; no frame is exposed and nothing is written.

    \b
    Example:
      vcam plan still-life
      vcam plan camera.yaml --accuracy 0.001 --json
    """
    from vcam_cli.files.report import to_json
    from vcam_cli.simulation.checks import load
    from vcam_cli.simulation.simulate import prepare

    model = load(camera, options.overrides(set_, accuracy=accuracy))
    with Progress(quiet) as progress:
        ready, notes = prepare(model, workers, progress)
    for note in notes:
        options.say(note, quiet)
    report = ready.plan.report()
    geometry = ready.layout.report(ready.spectrum.oversampling)
    if as_json:
        samples = {"captures": list(ready.times)} if ready.times else {}
        print(to_json({**report, **samples, "geometry": geometry}), end="")
    else:
        print(table(report))
        print(facts(report, geometry, ready.exposure_time, ready.times))


def table(report: dict) -> str:
    """Return the decisions as text: one line an effect, its reason below it."""
    lines = []
    for effect in report["effects"]:
        share = effect["contribution"]
        amount = "" if share is None else f"{100 * share:.3g} % {effect['unit']}"
        line = f"{effect['state']:<3}  {effect['name']:<17}{effect['by']:<7} {amount}"
        lines.append(line.rstrip())
        lines.append(f"     {effect['reason']}")
    return "\n".join(lines)


def facts(
    report: dict, geometry: dict, exposure_time: float, samples: tuple[float, ...] = ()
) -> str:
    """Return settings, geometry, exposure and cost as text, in a few lines."""
    from vcam_cli.units import render

    named = dict(report["settings"])
    named["wavelength_step"] = render(named["wavelength_step"], "length")
    knobs = ", ".join(f"{name} {value}" for name, value in named.items())
    several = f", {len(samples)} samples from {samples[0]:.4g} s on" if samples else ""
    scene = f"{geometry['scene_width']:.4g} x {geometry['scene_height']:.4g} m"
    return "\n".join(
        (
            "",
            f"settings   {knobs}",
            f"geometry   {geometry['rows']} x {geometry['columns']} pixels see {scene}"
            f" at magnification {geometry['magnification']:.4g}",
            f"exposure   {exposure_time:.4g} s{several}",
            f"cost       about {report['seconds']:.2g} s and {report['memory_bytes'] / 1e6:.0f} MB",
        )
    )
