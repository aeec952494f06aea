"""`vcam plan`: what a run would simulate, what not, why, and at what cost."""

from typing import Annotated, Any

import typer

from vcam_cli.commands import options
from vcam_cli.commands.plan_story import LEGEND
from vcam_cli.commands.progress import Progress

Scenes = Annotated[
    list[str] | None,
    typer.Option(
        "--scenes",
        metavar="all|FILE",
        help="Plan before other scenes: `all` for six charts in three lights, or a scene file or"
        " shipped scene. Repeatable. Writes scenes.csv and scenes.png.",
    ),
]
Measure = Annotated[
    bool,
    typer.Option(
        "--measure",
        help="With --scenes: also time frames of every scene, with the planned effects and with"
        " all of them.",
    ),
]
Turns = Annotated[
    int | None,
    typer.Option(
        "--turns",
        metavar="N",
        min=1,
        help="With --measure: frames of each kind that count, after a warm-up; default 5.",
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

LensPage = Annotated[
    bool,
    typer.Option(
        "--lens",
        help="Draw a lens that is given by optics.prescription: rays, spots, MTF, distortion,"
        " illumination, color. Writes lens.png and lens.csv.",
    ),
]
PlannedDevice = Annotated[
    str,
    typer.Option(
        "--device",
        metavar="cpu|gpu",
        callback=options.device_name,
        help="gpu: also estimate the time of each stage with a graphics processor (an H100);"
        " none has to be there.",
    ),
]
Details = Annotated[
    bool,
    typer.Option(
        "--details",
        help="Print every effect with who decided it and why, and all settings; of a large array,"
        " compute the light of all pixels.",
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
    measure: Measure = False,
    turns: Turns = None,
    out: options.Out = None,
    geometry: Geometry = False,
    lens: LensPage = False,
    details: Details = False,
    formats: options.Formats = None,
    device: PlannedDevice = "cpu",
    frames: options.Frames = None,
    fps: options.FrameRate = None,
) -> None:
    """Show the effects that a run simulates or skips, with reasons, and its time and memory.

    Effects on the light are decided by bounds for the whole array. Exposure and noise follow from
    the light of the pixels; of a large array the light of some 65,000 places is computed, with
    --details all of it. Only --measure takes frames, and only --scenes and --lens write files.

    \b
    Example:
      vcam plan still-life
      vcam plan camera.yaml --accuracy 0.001 --json
      vcam plan starter --details
      vcam plan starter --geometry
      vcam plan street --frames 100 --fps 12
      vcam plan double-gauss --lens
      vcam plan starter --scenes all
      vcam plan starter --scenes still-life --scenes my-scene.yaml
      vcam plan everything --scenes all --measure --turns 3
    """
    if lens:
        if scenes or geometry or as_json:
            raise typer.BadParameter(
                "--lens excludes --scenes, --geometry and --json; leave them out"
            )
        from vcam_cli.commands.plan_lens import plan_lens

        plan_lens(camera, out, options.overrides(set_, accuracy=accuracy), quiet, formats)
        return
    if scenes and geometry:
        raise typer.BadParameter("--geometry is of one scene; leave out --scenes")
    if (frames is None) != (fps is None):
        raise typer.BadParameter("--frames and --fps go together: --frames 30 --fps 30")
    if (measure and not scenes) or (turns and not measure):
        raise typer.BadParameter("--turns needs --measure, and --measure needs --scenes")
    if scenes:
        from vcam_cli.commands.plan_scenes import plan_scenes
        from vcam_cli.simulation.scene_times import TURNS

        asked = options.overrides(set_, accuracy=accuracy)
        count = (turns or TURNS) if measure else 0
        plan_scenes(camera, scenes, out, asked, quiet, workers, formats, count)
        return
    from vcam_cli import face
    from vcam_cli.commands.plan_story import print_story
    from vcam_cli.files.report import to_json
    from vcam_cli.simulation.checks import load

    model = load(camera, options.overrides(set_, accuracy=accuracy))
    with Progress(quiet) as progress:
        found = face.plan(model, workers, progress, details or geometry)
    for note in found.notes:
        options.say(note, quiet)
    report, solved = found.report(), found.geometry
    ready, rate_of_frames = found.ready, ""
    if found.readout is not None:
        most = found.readout.rate()
        rate_of_frames = (
            f"{found.frames_per_second:.4g} frames/s, {most:.4g} at most: {found.readout.reason}"
        )
    if frames is not None and fps is not None:
        from vcam_cli.simulation.sequence import frame_cameras, planned_memory, planned_seconds

        *_, last = frame_cameras(model, frames, fps)  # refuses exposures that do not fit
        end = found
        if model.scene.moves and frames > 1:
            with Progress(quiet) as progress:
                end = face.plan(last, workers, progress, details or geometry)
        whole, later = planned_seconds(found, frames)
        report["sequence"] = {
            "frames": frames,
            "seconds": whole,
            "later_frame_seconds": later,
            "memory_bytes": planned_memory(found, end),
        }
    if device != "cpu":
        cost = found.device_cost()
        report["device_seconds"], report["device_start"] = cost.first, cost.start
        report["device"] = cost.report()
    if as_json:
        print(to_json(report), end="")
    elif geometry:
        from vcam_cli.commands.geometry_table import geometry_table

        band = model.scene.wavelengths
        step = report["settings"]["wavelength_step"]
        imaged = model.optics.mapping_name if model.optics.is_lens else ""
        print(geometry_table(solved, step, (band.start, band.stop), imaged))
    else:
        told = facts(report, solved, ready.exposure_time, ready.times, rate_of_frames)
        if details:
            legend = options.wrap(LEGEND)
            print("\n".join((table(report), "", *legend, "", settings_line(report))))
            print("\n".join(f"{heading:<10} {text}" for heading, text in told))
        else:
            print_story(camera, report, told)


def table(report: dict[str, Any]) -> str:
    """Return the decisions as text: one line an effect, its reason below it."""
    lines = []
    for effect in report["effects"]:
        share = effect["contribution"]
        amount = "" if share is None else f"{100 * share:.3g} % {effect['unit']}"
        line = f"{effect['state']:<3}  {effect['name']:<21}{effect['by']:<7} {amount}"
        lines.append(line.rstrip())
        lines.append(f"     {effect['reason']}")
    return "\n".join(lines)


def settings_line(report: dict[str, Any]) -> str:
    """Return the settings of image formation as a line."""
    from vcam_cli.units import render

    named = dict(report["settings"])
    named["wavelength_step"] = render(named["wavelength_step"], "length")
    return f"settings   {', '.join(f'{name} {value}' for name, value in named.items())}"


def mixing(matrix: dict[str, dict[str, float]]) -> str:
    """Return what even light of the colors becomes, as a text."""
    sums = (
        f"{color} = {' + '.join(f'{share:.3g} {other}' for other, share in row.items())}"
        for color, row in matrix.items()
    )
    return ", ".join(sums)


def facts(
    report: dict[str, Any],
    geometry: dict[str, Any],
    exposure_time: float,
    samples: tuple[float, ...] = (),
    frame_rate: str = "",
) -> list[tuple[str, str]]:
    """Return geometry, exposure, frame rate, accuracy and cost: names and texts."""
    several = f", {len(samples)} samples from {samples[0]:.4g} s on" if samples else ""
    seen = f"{geometry['scene_width']:.4g} x {geometry['scene_height']:.4g} m"
    place = f"pixels see {seen} at magnification {geometry['magnification']:.4g}"
    if geometry["f_number"] == float("inf"):
        place = "pixels without a lens"
    seconds, memory = report["seconds"], report["memory_bytes"] / 1e6
    return [
        ("geometry", f"{geometry['rows']} x {geometry['columns']} {place}"),
        ("exposure", f"{exposure_time:.4g} s{several}"),
        *([("estimate", _estimate(report, geometry))] if report.get("estimated_places") else []),
        *([("crosstalk", mixing(report["color_mixing"]))] if "color_mixing" in report else []),
        *([("readout", frame_rate)] if frame_rate else []),
        ("accuracy", f"rms error within {100 * report['settings']['tolerance']:.3g} % of signal"),
        ("cost", f"about {seconds:.2g} s and {memory:.0f} MB"),
        *([("device", _on_device(report))] if "device" in report else []),
        *([("sequence", _sequence(report))] if "sequence" in report else []),
    ]


def _estimate(report: dict[str, Any], geometry: dict[str, Any]) -> str:
    """Return what a plan of a large array leaves open until the run."""
    places = report["estimated_places"]
    pixels = geometry["rows"] * geometry["columns"] / places
    return (
        f"exposure and noise from {places:,} means over {pixels:.3g} pixels each; a run decides on"
        " noise, charge and automatic exposure by the light of every pixel, as --details does"
    )


def _sequence(report: dict[str, Any]) -> str:
    """Return what all frames of a sequence cost."""
    whole = report["sequence"]
    return (
        f"{whole['frames']} frames, about {whole['seconds']:.2g} s:"
        f" {whole['later_frame_seconds']:.2g} s for each after the first;"
        f" {whole['memory_bytes'] / 1e6:.0f} MB, the larger of first and last"
    )


def _on_device(report: dict[str, Any]) -> str:
    """Return what the frame costs with a graphics processor, by stage."""
    first, start, cost = report["device_seconds"], report["device_start"], report["device"]
    stages = {
        "start": start,
        "light": cost["light"],
        "noise and readout": cost["charge"],
        "copies": cost["copies"],
    }
    listed = ", ".join(f"{name} {seconds:.2g} s" for name, seconds in stages.items())
    return (
        f"with --device gpu {first:.2g} s, then {first - start:.2g} s a frame. By measured"
        f" constants of an {cost['card']}: {listed}. By this processor {cost['processor']:.2g} s:"
        f" {', '.join(cost['stays'])}"
    )
