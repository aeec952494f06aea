"""What a command that studies a camera leaves in its folder beside its tables."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from vcam_cli.files import plots
from vcam_cli.files.folder import OutputFolder
from vcam_cli.reports import study_report
from vcam_cli.simulation.output import provenance


def write_study(
    folder: OutputFolder,
    drawn: Mapping[str, Callable[[Path], None]],
    formats: Sequence[str] | None,
    page: Mapping[str, Any] | None,
    record: Mapping[str, Any],
) -> None:
    """Draw the plots, write the report where it is wanted, and finish the folder with its record.

    Parameters
    ----------
    folder : OutputFolder
        Folder that is open and holds the tables.
    drawn : mapping
        Name of a plot -> function that draws it under a path.
    formats : sequence of str or None
        Formats of the plots beside PNG.
    page : mapping or None
        Arguments of `study_report.write`; None where no report is wanted.
    record : mapping
        What was found, and of what; versions are added.
    """
    for name, draw in plots.in_formats(drawn, formats or ()).items():
        draw(folder.new(name))
    if page is not None:
        study_report.write(folder, **page)
    folder.finish({**record, "versions": provenance.versions()})
