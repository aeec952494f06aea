"""Color profiles that are cut off, harmed or lie: read, refused or noted, always in a line."""

import struct
import zlib
from io import BytesIO

import numpy as np
import pytest
from cameras import camera, image_of
from making import long_except
from PIL import Image, ImageCms
from typer.testing import CliRunner

from vcam_cli.commands import main

pytestmark = pytest.mark.attack("profiles of pictures")

CODES = np.random.default_rng(3).integers(0, 256, (12, 16, 3)).astype(np.uint8)
WHOLE = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()


def mutated(seed: int) -> bytes:
    """A profile with a few bytes changed, cut off, or with a size that is not its own."""
    rng = np.random.default_rng(seed)
    data = bytearray(WHOLE)
    match seed % 4:
        case 0:
            for place in rng.integers(0, len(data), 8):
                data[place] = rng.integers(256)
        case 1:
            del data[int(rng.integers(0, len(data))) :]
        case 2:  # counts and offsets of its table of tags
            place = 128 + 4 * int(rng.integers(0, 30))
            data[place : place + 4] = struct.pack(">I", int(rng.integers(0, 1 << 32)))
        case 3:  # the data of its tags
            place = int(rng.integers(300, len(data) - 8))
            data[place : place + 8] = rng.bytes(8)
    return bytes(data)


@pytest.mark.parametrize("seed", long_except(range(12), range(40)))
def test_a_harmed_profile_ends_in_a_frame_or_a_line(seed, tmp_path):
    body = b"icc\0\0" + zlib.compress(mutated(seed))
    chunk = struct.pack(">I", len(body)) + b"iCCP" + body
    chunk += struct.pack(">I", zlib.crc32(b"iCCP" + body))
    plain = BytesIO()
    Image.fromarray(CODES).save(plain, "PNG")
    data = plain.getvalue()
    (tmp_path / "a.png").write_bytes(data[:33] + chunk + data[33:])
    name = camera(tmp_path, "camera.yaml", image_of("a.png"))
    line = ["run", str(tmp_path / name), "-o", str(tmp_path / "out")]
    done = CliRunner().invoke(main.app, line, prog_name="vcam")
    assert done.exit_code in (0, 2), (done.stderr, done.exception)
    assert "Traceback" not in done.stderr
    if done.exit_code == 2:
        assert "a.png" in done.stderr
        assert not (tmp_path / "out").exists()
