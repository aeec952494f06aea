"""Videos for looking at: MP4, made by ffmpeg where it is installed."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.errors import CannotDo

CODECS = (("-c:v", "libx264", "-crf", "16"), ("-c:v", "mpeg4", "-q:v", "2"))
"""Ways to encode, the best first: not every ffmpeg has it."""
LAST_WORDS = 300
"""Characters of ffmpeg's message that are shown."""


def ffmpeg() -> str | None:
    """Return the path of ffmpeg; None where it is not installed."""
    return shutil.which("ffmpeg")


class VideoWriter:
    """Context that writes frames, one after the other, into an MP4 file.

    It lies under its name when the context ends without an error.

    Raises CannotDo where ffmpeg fails.
    """

    def __init__(self, path: Path, program: str, shape: tuple[int, int], rate: float) -> None:
        rows, columns = shape
        self._shape = (rows, columns, 3)
        self._path = path
        # Frames of odd sizes get a row or column more: the codec halves its color planes.
        self._command = (
            *(program, "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"),
            *("-s", f"{columns}x{rows}", "-r", f"{rate:.9g}", "-i", "-"),
            *("-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"),
            *(*_codec(program), "-threads", "1", "-fflags", "+bitexact", "-f", "mp4", str(path)),
        )

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        return self

    def write(self, render: Array) -> None:
        """Append a render (rows, columns) or (rows, columns, 3) of 8 or 16 bits."""
        codes = render if render.dtype == np.uint8 else (render >> 8).astype(np.uint8)
        codes = codes if codes.ndim == 3 else codes[:, :, None]
        frame = np.ascontiguousarray(np.broadcast_to(codes, self._shape))
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(frame.tobytes())
        except OSError:
            self._fail()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is not None:
            self._process.kill()
        _, said = self._process.communicate()
        if kind is None and self._process.returncode:
            raise _failure(said)

    def _fail(self) -> None:
        _, said = self._process.communicate()
        raise _failure(said)


def _codec(program: str) -> tuple[str, ...]:
    """Return how this ffmpeg encodes."""
    asked = (program, "-v", "error", "-hide_banner", "-encoders")
    known = subprocess.run(asked, capture_output=True, check=False).stdout.decode(errors="replace")
    return next((codec for codec in CODECS if codec[1] in known), CODECS[-1])


def _failure(said: bytes) -> CannotDo:
    words = " ".join(said.decode(errors="replace").split())[-LAST_WORDS:]
    return CannotDo(
        f"ffmpeg wrote no video: {words}", "remove ffmpeg from the PATH to skip the video"
    )
