"""`vcam validate`: checks camera files, runs nothing."""

from typing import Annotated, Any

import typer

from vcam_cli.commands import options


def validate(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE",
            help="Camera files, or names of shipped cameras.",
            autocompletion=options.complete_camera,
            show_default=False,
        ),
    ],
    set_: options.Set = None,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Checks camera files and says everything that is wrong with them.

    \b
    Example:
      vcam validate camera.yaml
      vcam validate camera.yaml --set pixel.width="8 um"
    """
    checked = [_check(file, options.overrides(set_)) for file in files]
    for report in checked:
        for problem in report["problems"]:
            options.say(problem["text"])
        if report["ok"] and not as_json and not quiet:
            print(f"{report['file']}: ok ({report['name']})")
    if as_json:
        options.write_json({"ok": all(report["ok"] for report in checked), "files": checked})
    codes = {report["exit_code"] for report in checked}
    raise typer.Exit(2 if 2 in codes else max(codes))


def _check(file: str, sets: list[str]) -> dict[str, Any]:
    """What there is to say about one file."""
    from vcam_cli.errors import BadInput, CannotDo, dotted
    from vcam_cli.studies.checks import load

    report: dict[str, Any] = {"file": file, "ok": False, "exit_code": 0, "problems": []}
    try:
        camera = load(file, sets)
    except BadInput as error:
        report["problems"] = [
            {
                "where": problem.where,
                "path": dotted(problem.path),
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
    return report | {"ok": True, "name": camera.name}
