"""The program `vcam`: its commands, and how it ends.

Exit codes: 0 done, 2 bad input or usage, 3 this machine cannot do it, 4 some points of a sweep
failed, 1 a bug (only then a traceback), 130 interrupted.

Why commands are looked up by name: a command's module is imported when that command is asked
for, and imports its physics when it runs, so `vcam --help` and shell completion are quick.
"""

import gc
import os
import sys

from vcam_cli.commands import interrupts

# For a quick start. Loading makes 120,000 objects that stay: looking through them again and again
# for garbage takes a tenth of it, and so does looking for plug-ins of pydantic in every package.
gc.set_threshold(50_000, 10, 10)
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

try:
    with interrupts.at_once():  # most of the time until a command begins goes by here
        import errno
        import io
        from collections.abc import Iterator
        from contextlib import contextmanager, suppress
        from importlib import import_module
        from typing import Annotated, Any

        import typer
        from typer.core import TyperGroup

        from vcam_cli.errors import CannotDo, VcamError
except KeyboardInterrupt:
    sys.exit(interrupts.INTERRUPTED)

COMMANDS = {
    "run": "run:run",
    "plan": "plan:plan",
    "accuracy": "accuracy:accuracy",
    "sweep": "sweep:sweep",
    "schedule": "schedule:schedule",
    "characterize": "characterize:characterize",
    "compare": "compare:compare",
    "validate": "validate:validate",
    "list": "list_:list_",
    "init": "init:init",
    "schema": "schema:schema",
}  # command -> module in this package : function


class Commands(TyperGroup):
    """The commands of `COMMANDS`, each imported when it is wanted."""

    def list_commands(self, ctx: Any) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in COMMANDS:
            return None
        if cmd_name not in self.commands:
            module, function = COMMANDS[cmd_name].split(":")
            one = typer.Typer(add_completion=False, rich_markup_mode=None)
            one.command(cmd_name)(getattr(import_module(f"vcam_cli.commands.{module}"), function))
            self.commands[cmd_name] = typer.main.get_command(one)
        return self.commands[cmd_name]

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args and args[0] not in COMMANDS:
            for name in COMMANDS:  # so that the nearest one can be suggested
                self.get_command(ctx, name)
        return super().resolve_command(ctx, args)

    def make_context(self, *args: Any, **more: Any) -> Any:
        with failures_told():
            return super().make_context(*args, **more)

    def invoke(self, ctx: Any) -> Any:
        with failures_told():
            return super().invoke(ctx)


app = typer.Typer(
    cls=Commands,
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"vcam {version('vcam-cli')}")
        raise typer.Exit


@app.callback()
def vcam(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Simulates digital cameras: from a scene to a raw frame, its render and its quality.

    \b
    Begin with:
      vcam init mycamera
      vcam run mycamera/camera.yaml
    """


@contextmanager
def failures_told() -> Iterator[None]:
    """Turns what a user can cause into one-line messages on stderr and an exit code."""
    try:
        yield
    except VcamError as error:
        _end(str(error), error.exit_code, error)
    except MemoryError as error:
        _end("not enough memory; use a smaller array, or --accuracy draft", 3, error)
    except KeyboardInterrupt as error:
        _end("interrupted; nothing unfinished was kept, run the same command again", 130, error)


def _end(message: str, code: int, error: BaseException) -> None:
    _tell(message)
    raise typer.Exit(code) from error


def _tell(message: object) -> None:
    """A line on stderr; where that is lost too, the exit code has to do."""
    with suppress(OSError):
        print(message, file=sys.stderr, flush=True)


def main() -> None:
    """Runs `vcam` and leaves the process."""
    with interrupts.waiting():
        _main()


def _main() -> None:
    _replace_closed()
    _write_anything()
    try:
        try:
            app(prog_name="vcam")
        finally:
            sys.stdout.flush()
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:  # the reader (head, less) has gone: nothing more to say
        _drop_stdout()
        sys.exit(1)
    except OSError as error:
        if error.errno not in NOT_WRITTEN or error.filename is not None:
            raise
        _tell(CannotDo(f"cannot write to stdout: {error.strerror}", "send it elsewhere"))
        _drop_stdout()
        sys.exit(3)


NOT_WRITTEN = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}
"""What a write can end with. All but those to stdout are told where they happen."""


def _replace_closed() -> None:
    """Gives a process that was started without stdout or stderr (`>&-`) ones that forget.

    Their numbers are taken as well: a result opened next would get them, and all that libraries
    print.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            os.open(os.devnull, os.O_WRONLY)
            setattr(sys, name, io.StringIO())


def _write_anything() -> None:
    """Lets stdout escape what its encoding lacks, as stderr does: a name is any text."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def _drop_stdout() -> None:
    """What stdout still holds goes nowhere, else Python complains at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    main()
