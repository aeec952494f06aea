"""`vcam plan --lens`: the page of a lens that is given by its surfaces, and its table."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress


def plan_lens(
    camera: str,
    out: Path | None,
    overrides: list[str],
    quiet: bool,
    formats: Sequence[str] | None,
) -> None:
    """Write lens.png and lens.csv, and print the table."""
    from vcam_cli.files.folder import OutputFolder
    from vcam_cli.files.plots import in_formats
    from vcam_cli.files.tables import write_table
    from vcam_cli.simulation.checks import load
    from vcam_cli.simulation.lens_page import columns, lens_page, rows
    from vcam_cli.simulation.output import provenance
    from vcam_cli.simulation.output.lens_plot import plot_lens
    from vcam_cli.solve.solved import solve

    model = load(camera, overrides)
    path = out or Path("out") / f"{model.name}-lens"
    place = OutputFolder(path, record="lens.json", inputs=provenance.inputs(model))
    with place as folder, Progress(quiet) as progress:
        progress.begin("rays")
        page = lens_page(solve(model))
        progress.begin("files")
        write_table(folder.new("lens.csv"), columns(page), rows(page))
        drawn = {"lens.png": partial(plot_lens, page=page)}
        for name, draw in in_formats(drawn, formats or ()).items():
            draw(folder.new(name))
        folder.finish({"name": model.name, "lens": page.view.lens.name})
    for remark in page.remarks:
        options.say(remark, quiet)
    if not quiet:
        print("\n".join((page.title, *page.facts)))
        print(f"{model.name}: {folder.path / 'lens.csv'}, {folder.path / 'lens.png'}")
