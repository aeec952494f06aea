"""Libraries that only some formats need, and that a user may not have installed."""

from importlib import import_module
from typing import Any

from vcam_cli.errors import CannotDo


def optional_library(name: str, files: str, extra: str) -> Any:
    """Return a library that reads or writes files of some formats.

    Parameters
    ----------
    name : str
        Its name.
    files : str
        What needs it, as a message begins.
    extra : str
        Extra of the package that installs it.

    Raises
    ------
    CannotDo
        Where it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        message = f"{files} need {name}, which is not installed"
        raise CannotDo(message, f"pip install 'vcam-cli[{extra}]'") from error
