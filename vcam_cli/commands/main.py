"""The program `vcam`: its commands and its exit codes.

Exit codes: 0 done, 2 bad input or usage, 3 this machine cannot do it, 4 some points of a sweep
failed, an expectation was missed or a prediction its tolerance, 1 a bug (only then a traceback),
130 interrupted.

Why commands are looked up by name: a command's module is imported when that command is called,
and imports its physics when it runs, so `vcam --help` and shell completion are quick.
"""

import gc
import os
import sys

from vcam_cli import interrupts

# For a quick start. Imports make 120,000 objects that stay: collecting garbage among them takes a
# tenth of the time, and so does looking for plug-ins of pydantic in every package.
gc.set_threshold(200_000, 10, 10)
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

try:
    with interrupts.exit_on_interrupt():  # imports take most of the start
        import atexit
        import errno
        import io
        import threading
        import warnings
        from collections.abc import Iterator
        from contextlib import contextmanager, suppress
        from importlib import import_module
        from pathlib import Path
        from typing import Annotated, Any

        import typer
        from typer.core import TyperGroup

        from vcam_cli import memory
        from vcam_cli.errors import CannotDo, VcamError, one_line
except KeyboardInterrupt:
    sys.exit(interrupts.INTERRUPTED)

COMMANDS = {
    "run": "run:run",
    "plan": "plan:plan",
    "accuracy": "accuracy:accuracy",
    "sweep": "sweep:sweep",
    "schedule": "schedule:schedule",
    "characterize": "characterize:characterize",
    "fit": "fit:fit",
    "verify": "verify:verify",
    "dataset": "dataset:dataset",
    "compare": "compare:compare",
    "report": "report:report",
    "validate": "validate:validate",
    "list": "list_:list_",
    "explain": "explain:explain",
    "init": "init:init",
    "schema": "schema:schema",
}  # command -> module in this package : function

UsageError: type[Exception] = typer.BadParameter.__mro__[1]
"""Of wrong arguments: typer exports only errors below it."""


class Commands(TyperGroup):
    """The commands of `COMMANDS`, each imported when it is wanted."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands."""
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Import the command of a name."""
        if cmd_name not in COMMANDS:
            return None
        if cmd_name not in self.commands:
            module, function = COMMANDS[cmd_name].split(":")
            one = typer.Typer(add_completion=False, rich_markup_mode=None)
            one.command(cmd_name)(getattr(import_module(f"vcam_cli.commands.{module}"), function))
            self.commands[cmd_name] = typer.main.get_command(one)
        return self.commands[cmd_name]

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands with whole sentences, which wrap where Click would cut them."""
        rows = [(name, self.get_command(ctx, name).get_short_help_str(1000)) for name in COMMANDS]
        with formatter.section("Commands"):
            formatter.write_dl(rows)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command that the arguments call."""
        if args and args[0] not in COMMANDS:
            from vcam_cli.commands.usage_hints import meant_command

            if meant := meant_command(args[0]):
                ctx.fail(f"No such command {args[0]!r}; write {meant}")
            for name in COMMANDS:  # so that the nearest one can be suggested
                self.get_command(ctx, name)
        return super().resolve_command(ctx, args)

    def make_context(self, *args: Any, **more: Any) -> Any:
        """Parse the arguments, and report failures."""
        with report_failures():
            return super().make_context(*args, **more)

    def invoke(self, ctx: Any) -> Any:
        """Run the command, and report failures."""
        with report_failures():
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
    """Simulate digital cameras: from a scene to a raw frame, its render and its quality.

    \b
    Begin with:
      vcam init mycamera
      vcam run mycamera/camera.yaml
    """


@contextmanager
def report_failures() -> Iterator[None]:
    """Report errors that a user can cause in one line on stderr, with an exit code."""
    try:
        with interrupts.restore_interrupt():
            yield
    except UsageError as error:
        from vcam_cli.commands.usage_hints import advise

        advise(error)
        raise
    except VcamError as error:
        _exit(str(error), error.exit_code, error)
    except MemoryError as error:
        _exit("not enough memory; use a smaller array, or --accuracy draft", 3, error)
    except KeyboardInterrupt as error:
        _exit(
            "interrupted; unfinished results were discarded, run the same command again",
            interrupts.INTERRUPTED,
            error,
        )


def _exit(message: str, code: int, error: BaseException) -> None:
    _print_error(message)
    raise typer.Exit(code) from error


def _print_error(message: object) -> None:
    """Print a line on stderr; where that is closed too, the exit code must suffice."""
    with suppress(OSError):
        print(message, file=sys.stderr, flush=True)


def program() -> None:
    """Run `vcam` and end the process, without freeing every object one by one.

    That would take a fifth of the processor time of a `vcam run` of a small frame.
    """
    try:
        main()
    except SystemExit as end:
        others = [t for t in threading.enumerate() if t is not threading.main_thread()]
        if not isinstance(end.code, int) or not all(t.daemon for t in others):
            raise
        atexit._run_exitfuncs()
        with suppress(OSError):
            sys.stdout.flush()
        os._exit(end.code)


def main() -> None:
    """Run `vcam`, and raise SystemExit with its exit code."""
    try:
        with interrupts.raise_interrupts():
            _main()
    except SystemExit as end:
        if end.code == interrupts.INTERRUPTED:
            # Python itself would report the signal where it was running text (`exec`) meanwhile.
            os._exit(interrupts.INTERRUPTED)
        raise


def _main() -> None:
    """Run the command line; end with its exit code."""
    _replace_closed_streams()
    for name in ("stdout", "stderr"):
        _outlive_reader(name)
    _say_warnings()
    memory.limit_blas_threads()
    memory.share_heap()
    try:
        memory.require_address_space()
    except CannotDo as error:
        _print_error(error)
        sys.exit(error.exit_code)
    try:
        try:
            app(prog_name="vcam")
        finally:
            sys.stdout.flush()
    except KeyboardInterrupt:
        sys.exit(interrupts.INTERRUPTED)
    except OSError as error:
        if error.errno not in WRITE_ERRORS or error.filename is not None:
            raise
        _print_error(CannotDo(f"cannot write to stdout: {error.strerror}", "send it elsewhere"))
        _discard_stdout()
        sys.exit(3)


def _say_warnings() -> None:
    """Let warnings of libraries be a line each on stderr, without their source code."""
    told: set[str] = set()

    def show(
        message: Warning | str, category: type, filename: str, lineno: int, *_: object
    ) -> None:
        text = one_line(f"note: {category.__name__}: {message} ({Path(filename).name}:{lineno})")
        if text not in told:
            told.add(text)
            _print_error(text)

    warnings.showwarning = show  # type: ignore[assignment]


WRITE_ERRORS = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}
"""Errors of a write. Those of files are reported where they happen, those of stdout here."""


def _replace_closed_streams() -> None:
    """Replace a stdout or stderr that was closed at the start (`>&-`) by one that discards.

    Its descriptor is occupied as well: else the next file that is opened gets it, with all that
    libraries print.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            os.open(os.devnull, os.O_WRONLY)
            setattr(sys, name, io.StringIO())


class _Unread(io.FileIO):
    """A descriptor whose reader (head, less) may go away: what comes then is discarded.

    The command does its work all the same, and its exit code says what came of it.
    """

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            return memoryview(data).nbytes


def _outlive_reader(name: str) -> None:
    """Let stdout or stderr outlive its reader, and escape what its encoding lacks.

    File names can hold anything.
    """
    stream = getattr(sys, name)
    if isinstance(stream, io.TextIOWrapper):
        stream.flush()
        stream = io.TextIOWrapper(
            io.BufferedWriter(_Unread(stream.fileno(), "w", closefd=False)),
            encoding=stream.encoding,
            errors="backslashreplace",
            line_buffering=stream.line_buffering or name == "stderr",
            write_through=stream.write_through,
        )
        setattr(sys, name, stream)


def _discard_stdout() -> None:
    """Discard what stdout still holds, since Python would report that it cannot be written."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    program()
