"""Videos: what ffmpeg is given, and what is said where it fails or is not there."""

import stat
import sys
from pathlib import Path

import numpy as np
import pytest
from making import camera
from typer.testing import CliRunner

from vcam_cli.commands.main import app
from vcam_cli.errors import CannotDo
from vcam_cli.files.images.video import VideoWriter

STAND_IN = """#!{python}
import sys
if "-encoders" in sys.argv:
    print(" V..... {codec} ")
    sys.exit()
data = sys.stdin.buffer.read()
{act}
"""
KEEP = "open(sys.argv[-1], 'wb').write(repr(sys.argv[1:-1]).encode() + b'\\n' + data)"
FAIL = "print('Unknown  encoder\\nof this kind', file=sys.stderr); sys.exit(1)"


def stand_in(folder: Path, act: str = KEEP, codec: str = "libx264") -> str:
    """A program that stands where ffmpeg would, and writes down what it is given."""
    folder.mkdir(exist_ok=True)
    program = folder / "ffmpeg"
    program.write_text(STAND_IN.format(python=sys.executable, act=act, codec=codec))
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    return str(program)


@pytest.mark.parametrize("codec", ["libx264", "mpeg4"])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_frames_go_to_ffmpeg_as_rgb_in_their_order(kind, codec, tmp_path):
    scale = 1 if kind == np.uint8 else 257
    gray = np.arange(15, dtype=kind).reshape(3, 5) * scale
    color = np.stack([gray, gray * 2, gray * 3], axis=2).astype(kind)
    with VideoWriter(tmp_path / "v.mp4", stand_in(tmp_path / "bin", codec=codec), (3, 5), 24) as v:
        v.write(gray)
        v.write(color)
    told, _, data = (tmp_path / "v.mp4").read_bytes().partition(b"\n")
    plain = np.arange(15, dtype=np.uint8).reshape(3, 5)
    expected = [np.stack([plain] * 3, axis=2), np.stack([plain, plain * 2, plain * 3], axis=2)]
    assert data == np.array(expected).tobytes()
    assert f"'{codec}'".encode() in told
    assert b"'5x3', '-r', '24'" in told


def test_what_ffmpeg_says_is_told(tmp_path):
    program = stand_in(tmp_path / "bin", FAIL)
    with (
        pytest.raises(CannotDo, match="Unknown encoder of this kind"),
        VideoWriter(tmp_path / "v.mp4", program, (2, 2), 5) as video,
    ):
        video.write(np.zeros((2, 2), np.uint8))


def test_a_sequence_has_a_video_or_says_why_not(tmp_path, monkeypatch):
    camera(tmp_path, {"array.rows": 16, "array.columns": 24})
    made, out = str(tmp_path / "made.yaml"), tmp_path / "out"
    arguments = ["run", made, "-o", str(out), "--frames", "2", "--fps", "25"]
    empty = tmp_path / "empty"
    empty.mkdir()
    monkeypatch.setenv("PATH", str(empty))
    without = CliRunner().invoke(app, arguments)
    assert without.exit_code == 0, without.output
    assert "there is no ffmpeg on the PATH" in without.output
    assert not (out / "sequence.mp4").exists()
    stand_in(tmp_path / "bin")
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    assert "video" in done.output
    _, _, data = (out / "sequence.mp4").read_bytes().partition(b"\n")
    assert len(data) == 2 * 16 * 24 * 3
