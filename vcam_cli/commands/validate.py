"""`vcam validate`: checks camera, study, measurement and lens files, runs nothing."""

from pathlib import Path
from typing import Annotated, Any

import typer

from vcam_cli.commands import options
from vcam_cli.errors import one_line

MEASUREMENT, LENS = "measurement", "lens"


def validate(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE",
            help="Camera and study files, or names of shipped ones.",
            autocompletion=options.complete_camera,
            show_default=False,
        ),
    ],
    set_: options.Set = None,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Check camera, study, measurement and lens files, and report all errors.

    \b
    Example:
      vcam validate camera.yaml
      vcam validate camera.yaml --set pixel.width="8 um"
    """
    checked = [_check(file, options.overrides(set_)) for file in files]
    for report in checked:
        name = str(Path(report["file"]))
        for problem in report["problems"]:
            # The place of a mistake may be a base or --set, which several files have in common.
            said = len(files) == 1 or problem["text"].startswith(name)
            options.say(problem["text"] if said else one_line(f"{name}: {problem['text']}"))
        if report["ok"] and not as_json and not quiet:
            print(one_line(f"{report['file']}: ok ({report['name']})"))
    if as_json:
        options.write_json({"ok": all(report["ok"] for report in checked), "files": checked})
    codes = {report["exit_code"] for report in checked}
    raise typer.Exit(2 if 2 in codes else max(codes))


def _check(file: str, sets: list[str]) -> dict[str, Any]:
    """Return the report of one file."""
    from vcam_cli.errors import BadInput, CannotDo, dotted_path

    report: dict[str, Any] = {"file": file, "ok": False, "exit_code": 0, "problems": []}
    try:
        name = _checked_name(file, sets)
    except BadInput as error:
        report["problems"] = [
            {
                "where": problem.where,
                "path": dotted_path(problem.path),
                "message": problem.message,
                "remedy": problem.remedy,
                "text": str(problem),
            }
            for problem in error.problems
        ]
        return report | {"exit_code": error.exit_code}
    except CannotDo as error:
        problem = {"where": file, "path": "", "message": error.message, "remedy": error.remedy}
        return report | {"problems": [problem | {"text": str(error)}], "exit_code": error.exit_code}
    return report | {"ok": True, "name": name}


def _checked_name(file: str, sets: list[str]) -> str:
    """Return the name of a file's model without mistakes. Raise BadInput, CannotDo."""
    from vcam_cli.simulation.checks import load

    kind = _study_kind(file)
    if kind is None:
        return load(file, sets).name
    from vcam_cli.capture_schedules import schedule_file
    from vcam_cli.errors import BadInput
    from vcam_cli.sweeps import sweep_file, sweep_points

    if kind == MEASUREMENT:
        from vcam_cli.verification import measurement_file

        return measurement_file.read(file).name
    if kind == LENS:
        from vcam_cli.lenses import files

        found = Path(file)
        return (files.read(found) if found.is_file() else files.shipped_lens(file)).name
    if kind == "dataset":
        from vcam_cli.datasets import dataset_file

        return dataset_file.read(file, sets).model.name
    if kind == "schedule":
        return schedule_file.read(file, sets).model.name
    grid = sweep_points.grid(sweep_file.read(file), sets)
    if grid.problems:
        raise BadInput(grid.problems)
    return grid.study.model.name


def _study_kind(file: str) -> str | None:
    """Return the kind that a file, or a shipped one, says it is; None for a camera."""
    from vcam_cli.camera.camera import STUDIES
    from vcam_cli.config import shipped
    from vcam_cli.config.file_names import is_file
    from vcam_cli.config.yaml_reader import read_file
    from vcam_cli.errors import VcamError

    path = Path(file)
    if path.suffix.lower() == ".zmx":
        return LENS
    if not is_file(path):
        kinds = "studies", "measurements", "lenses"
        others = [k for k in kinds if file in shipped.names(k)]
        if not others or file in shipped.names("cameras"):
            return None
        path = shipped.find(others[0], file)
    try:
        kind = read_file(path).get("kind")
    except VcamError:  # said when it is read as a camera
        return None
    return (
        str(kind.value)
        if kind is not None and kind.value in (*STUDIES, MEASUREMENT, LENS)
        else None
    )
