"""A picture of another aspect than the array: what is cropped is blurred into the frame."""

import numpy as np
import OpenImageIO as oiio
from making import QUIET, camera

from vcam_cli import simulate


def test_light_just_outside_the_crop_is_there(tmp_path):
    """The frame is the middle of one by a wider array, which sees all of the picture."""
    picture = np.full((24, 48, 1), 0.1, np.float32)
    picture[:, :12] = picture[:, 36:] = 1  # what an array of 24 x 24 does not see
    spec = oiio.ImageSpec(48, 24, 1, "float")
    output = oiio.ImageOutput.create("a.exr")
    assert output.open(str(tmp_path / "a.exr"), spec)
    assert output.write_image(picture)
    assert output.close()
    said = {
        "scene.source": {"kind": "image", "file": str(tmp_path / "a.exr")},
        "optics.f_number": 16,
        "pixel.photodetector.charge_diffusion": {
            "diffusion_length": "10 um", "depletion_width": "1 um", "substrate_depth": "5 um"
        },
        "array.rows": 24,
        "effects": QUIET,
    }  # fmt: skip
    narrow, wide = (
        simulate(camera(tmp_path, said | {"array.columns": count})).mean_electrons
        for count in (24, 48)
    )
    middle = wide[:, 12:36]
    assert middle[:, 0].mean() > 2 * middle[:, 12].mean()  # a mirror there would have it dark
    np.testing.assert_allclose(narrow, middle, atol=1e-3 * wide.max())
