"""What is meant by arguments that no command takes: verbs and options of other programs."""

import re
from pathlib import PurePath
from typing import Any

VERBS = {
    **dict.fromkeys(("simulate", "render", "shoot", "capture", "photograph", "start"), "run"),
    **dict.fromkeys(("check", "lint", "test"), "validate"),
    **dict.fromkeys(("info", "describe", "what", "doc", "docs"), "explain"),
    **dict.fromkeys(("ls", "show", "cameras"), "list"),
    **dict.fromkeys(("new", "create", "template"), "init"),
    **dict.fromkeys(("estimate", "preview", "dry-run"), "plan"),
    **dict.fromkeys(("study", "vary", "optimize", "scan"), "sweep"),
    **dict.fromkeys(("measure", "emva", "bench"), "characterize"),
    **dict.fromkeys(("diff", "psnr"), "compare"),
    "calibrate": "fit",
    "help": "--help",
    "version": "--version",
}
"""A word in place of a command -> the command."""
OPTIONS = {
    **dict.fromkeys(("--resume", "--continue"), "none; repeat the command to continue"),
    **dict.fromkeys(("--jobs", "--threads", "--cores", "--processes"), "--workers"),
    **dict.fromkeys(("--output", "--output-dir", "--dir"), "--out"),
    **dict.fromkeys(("--verbose", "--debug"), "none; vcam plan shows a run's effects, and why"),
}
"""An option of other programs -> the one of this."""
_EXTRA = "Got unexpected extra argument"


def meant_command(word: str) -> str:
    """Return the command line that begins with what is no command; "" where none is known."""
    if word in VERBS:
        return f"vcam {VERBS[word]}"
    from vcam_cli.config import shipped
    from vcam_cli.config.file_names import SUFFIXES

    if word in shipped.names("cameras"):
        return f"vcam run {word}"
    if study := shipped.files("studies").get(word):
        kind = re.search(r"^kind: (\w+)", study.read_text("utf-8"), re.MULTILINE)
        return f"vcam {kind[1]} {word}" if kind else ""
    return f"vcam run {word}" if word.endswith(SUFFIXES) else ""


def advise(error: Any) -> None:
    """Tell in a usage error what is meant by an option or argument, where that is known."""
    option = getattr(error, "option_name", None)
    if option is not None:
        _advise_option(error, option)
    elif error.message.startswith(_EXTRA):
        extra = error.message.rpartition("(")[2].rstrip(")")
        error.message += f"; {_meant_argument(extra)}"


def _advise_option(error: Any, option: str) -> None:
    if said := OPTIONS.get(option):
        error.possibilities = [said]
        return
    if any(name.startswith(option) for name in getattr(error, "possibilities", None) or ()):
        return  # an option that was not written to its end
    from vcam_cli.camera.hints import set_option

    if meant := set_option(option):
        error.possibilities = [meant]


def _meant_argument(extra: str) -> str:
    """Return what is meant by an argument too many."""
    from vcam_cli.camera.hint_tables import PICTURES

    if PurePath(extra).suffix.lower() in PICTURES:
        return f'for a scene write --set scene.source="{{kind: image, file: {extra}}}"'
    return 'put a value with spaces in quotes, as in --set pixel.width="3 um"'
