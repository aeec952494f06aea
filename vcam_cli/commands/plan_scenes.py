"""`vcam plan --scenes`: one camera before many scenes, as a table, a CSV file and a picture."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from vcam_cli.commands import options
from vcam_cli.commands.plan_story import SCENES_LEGEND
from vcam_cli.commands.progress import Progress

if TYPE_CHECKING:
    from vcam_cli.simulation.scene_plans import ScenePlan


def plan_scenes(
    camera: str,
    scenes: list[str],
    out: Path | None,
    overrides: list[str],
    quiet: bool,
    workers: int | None,
    formats: Sequence[str] | None,
    turns: int,
) -> None:
    """Write and print the table of effects by scenes; frames are taken where turns are."""
    from vcam_cli.files.folder import OutputFolder
    from vcam_cli.files.plots import in_formats
    from vcam_cli.files.tables import write_table
    from vcam_cli.simulation import scene_plans
    from vcam_cli.simulation.checks import load
    from vcam_cli.simulation.output import provenance
    from vcam_cli.simulation.output.scene_plans_plot import plot_scene_plans
    from vcam_cli.simulation.simulate import threads

    model = load(camera, overrides)
    workers = workers or threads(model)
    path = out or Path("out") / f"{model.name}-scenes"
    place = OutputFolder(path, record="scenes.json", inputs=provenance.inputs(model))
    with place as folder, Progress(quiet) as bar:
        found = scene_plans.plan_scenes(camera, overrides, scenes, workers, turns, bar)
        plans = list(found)
        columns, rows = scene_plans.columns(plans), list(scene_plans.rows(plans))
        write_table(folder.new("scenes.csv"), columns, rows)
        title = f"{model.name}: effects simulated before {len(plans)} scenes"
        how = times_line(turns, workers)
        drawn = {"scenes.png": partial(plot_scene_plans, title=title, plans=plans, times=how)}
        for name, draw in in_formats(drawn, formats or ()).items():
            draw(folder.new(name))
        record = {"turns": turns, "workers": workers} if turns else {}
        folder.finish({"name": model.name, "scenes": [each.scene for each in plans], **record})
    if not quiet:
        print_scenes(plans)
        print("\n".join(options.wrap(f"{SCENES_LEGEND} {how}")))
        print(f"{model.name}: {folder.path / 'scenes.csv'}, {folder.path / 'scenes.png'}")


def times_line(turns: int, workers: int) -> str:
    """Return a sentence on the seconds of the table."""
    if not turns:
        return "Seconds of a frame with the plan and with all effects are estimated for one core."
    runs = f"{turns} turns" if turns > 1 else "one turn"
    return (
        "Seconds of a frame with the plan and with all effects are measured: the median of"
        f" {runs} after a warm-up, {workers} worker{'s' if workers > 1 else ''}."
    )


def print_scenes(plans: "Sequence[ScenePlan]") -> None:
    """Print effects by scenes, and seconds with the plan and with all effects.

    Elsewhere than in a terminal a scene has a line, in a terminal an effect.
    """
    from vcam_cli.simulation.scene_plans import effect_names, mark, time_text

    effects = effect_names(plans)
    names = [*effects, "plan [s]", "all [s]"]
    width = max(len(each.scene) for each in plans)
    lines, columns = [f"{'':<{width}}  " + " ".join(names)], []
    for each in plans:
        marks = {d.name: mark(d) for d in each.decisions}
        times = [time_text(seconds) for seconds in each.seconds]
        columns.append([marks.get(name, "-") for name in effects] + times)
        cells = (f"{text:<{len(name)}}" for name, text in zip(names, columns[-1], strict=True))
        lines.append(f"{each.scene:<{width}}  " + " ".join(cells).rstrip())
    rows = [(name, *marks) for name, *marks in zip(names, *columns, strict=True)]
    options.print_rows(("effect", *(each.scene for each in plans)), rows, "\n".join(lines))
