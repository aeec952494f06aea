"""`vcam plan`: what a run would simulate, what not, why, and at what cost."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress

if TYPE_CHECKING:
    from vcam_cli.simulation.scene_plans import ScenePlan


Scenes = Annotated[
    list[str] | None,
    typer.Option(
        "--scenes",
        metavar="all|FILE",
        help="Plan before other scenes: `all` for six charts in three lights, or a scene file or"
        " shipped scene. Repeatable. Writes scenes.csv and scenes.png.",
    ),
]
Geometry = Annotated[
    bool,
    typer.Option(
        "--geometry",
        help="Print scene and optics instead: distances, angles, resolution, frequencies,"
        " wavelengths, apertures.",
    ),
]


def plan(
    camera: options.Camera,
    set_: options.Set = None,
    accuracy: options.Accuracy = None,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
    workers: options.Workers = None,
    scenes: Scenes = None,
    out: options.Out = None,
    geometry: Geometry = False,
) -> None:
    """Show which effects a run simulates, which not and why, and what it costs.

    The irradiance on the pixels is computed, since the scene decides what each effect contributes;
    no frame is exposed, and nothing is written but the table of several scenes.

    \b
    Example:
      vcam plan still-life
      vcam plan camera.yaml --accuracy 0.001 --json
      vcam plan starter --geometry
      vcam plan starter --scenes all
      vcam plan starter --scenes still-life --scenes my-scene.yaml
    """
    if scenes and geometry:
        raise typer.BadParameter("--geometry is of one scene; leave out --scenes")
    if scenes:
        _plan_scenes(
            camera, scenes, out, options.overrides(set_, accuracy=accuracy), quiet, workers
        )
        return
    from vcam_cli.camera.derived.frame_rate import frame_rate
    from vcam_cli.files.report import to_json
    from vcam_cli.simulation.checks import load
    from vcam_cli.simulation.simulate import prepare

    model = load(camera, options.overrides(set_, accuracy=accuracy))
    with Progress(quiet) as progress:
        ready, notes = prepare(model, workers, progress)
    for note in notes:
        options.say(note, quiet)
    report = ready.plan.report()
    solved = ready.layout.report(ready.spectrum.oversampling)
    readout = frame_rate(model)
    said, rate_of_frames = {}, ""
    if readout is not None:
        rate = readout.rate(ready.exposure_time)
        said = {"frame_rate": {"readout_time": readout.readout_time, "frames_per_second": rate}}
        rate_of_frames = f"{rate:.4g} frames/s, {readout.rate():.4g} at most: {readout.reason}"
    if as_json:
        samples = {"captures": list(ready.times)} if ready.times else {}
        print(to_json({**report, **samples, **said, "geometry": solved}), end="")
    elif geometry:
        from vcam_cli.commands.geometry_table import geometry_table

        band = model.scene.wavelengths
        step = report["settings"]["wavelength_step"]
        print(geometry_table(solved, step, (band.start, band.stop)))
    else:
        print(table(report))
        print(facts(report, solved, ready.exposure_time, ready.times, rate_of_frames))


def _plan_scenes(
    camera: str,
    scenes: list[str],
    out: Path | None,
    overrides: list[str],
    quiet: bool,
    workers: int | None,
) -> None:
    """Write and print the table of effects by scenes."""
    from vcam_cli.files.folder import OutputFolder
    from vcam_cli.files.tables import write_table
    from vcam_cli.simulation import provenance, scene_plans
    from vcam_cli.simulation.checks import load
    from vcam_cli.simulation.scene_plans_plot import plot_scene_plans

    model = load(camera, overrides)
    path = out or Path("out") / f"{model.name}-scenes"
    place = OutputFolder(path, record="scenes.json", inputs=provenance.inputs(model))
    with place as folder:
        plans = list(scene_plans.plan_scenes(camera, overrides, scenes, workers))
        rows = list(scene_plans.rows(plans))
        write_table(folder.new("scenes.csv"), scene_plans.COLUMNS, rows)
        plot_scene_plans(folder.new("scenes.png"), f"{model.name}: what scenes call for", plans)
        folder.finish({"name": model.name, "scenes": [each.scene for each in plans]})
    if not quiet:
        print(scene_table(plans))
        print(f"{model.name}: {folder.path / 'scenes.csv'}, {folder.path / 'scenes.png'}")


def scene_table(plans: "Sequence[ScenePlan]") -> str:
    """Return effects by scenes as text: on, off, or free, one line a scene."""
    from vcam_cli.simulation.scene_plans import effect_names

    names = effect_names(plans)
    width = max(len(each.scene) for each in plans)
    lines = [f"{'':<{width}}  " + " ".join(names)]
    for each in plans:
        states = {d.name: "free" if d.free else d.state for d in each.decisions}
        cells = (f"{states.get(name, '-'):<{len(name)}}" for name in names)
        lines.append(f"{each.scene:<{width}}  " + " ".join(cells).rstrip())
    return "\n".join(lines)


def table(report: dict) -> str:
    """Return the decisions as text: one line an effect, its reason below it."""
    lines = []
    for effect in report["effects"]:
        share = effect["contribution"]
        amount = "" if share is None else f"{100 * share:.3g} % {effect['unit']}"
        line = f"{effect['state']:<3}  {effect['name']:<21}{effect['by']:<7} {amount}"
        lines.append(line.rstrip())
        lines.append(f"     {effect['reason']}")
    return "\n".join(lines)


def facts(
    report: dict,
    geometry: dict,
    exposure_time: float,
    samples: tuple[float, ...] = (),
    frame_rate: str = "",
) -> str:
    """Return settings, geometry, exposure, frame rate and cost as text, in a few lines."""
    from vcam_cli.units import render

    named = dict(report["settings"])
    named["wavelength_step"] = render(named["wavelength_step"], "length")
    knobs = ", ".join(f"{name} {value}" for name, value in named.items())
    several = f", {len(samples)} samples from {samples[0]:.4g} s on" if samples else ""
    seen = f"{geometry['scene_width']:.4g} x {geometry['scene_height']:.4g} m"
    place = f"pixels see {seen} at magnification {geometry['magnification']:.4g}"
    if geometry["f_number"] == float("inf"):
        place = "pixels without a lens"
    return "\n".join(
        (
            "",
            f"settings   {knobs}",
            f"geometry   {geometry['rows']} x {geometry['columns']} {place}",
            f"exposure   {exposure_time:.4g} s{several}",
            *([f"readout    {frame_rate}"] if frame_rate else []),
            f"cost       about {report['seconds']:.2g} s and {report['memory_bytes'] / 1e6:.0f} MB",
        )
    )
