"""Point spread functions as NPY files and as the text of lens programs."""

import numpy as np
import pytest

from vcam_cli.errors import BadInput
from vcam_cli.files.images.psf import read_psf

GRID = np.random.default_rng(5).random((5, 7)).round(6)
EXPECTED = GRID / GRID.sum()


def rows(mark, comma=False):
    text = "\n".join(mark.join(f"{value:.6f}" for value in row) for row in GRID)
    return text.replace(".", ",") if comma else text


HEAD = """Listing of FFT PSF Data

File : C:\\lens\\double gauss.zmx
Date : 1/2/2020
Wavelength 0.5876 um at 0.0000, 0.0000 (deg).
Data spacing is 0.4050 um.
Image grid size:  7 by 5
Center point is: row 3, column 4

Values are relative to the diffraction limit.

"""
FORMS = {
    "commas": rows(","),
    "commas and spaces": rows(", "),
    "spaces": rows("  "),
    "tabs": rows("\t"),
    "semicolons and decimal commas": rows(";", comma=True),
    "a lens program's head": HEAD + rows("\t"),
    "a lone line of numbers in the head": "7 5\nrelative intensity\n" + rows(" "),
    "a separator at the end": rows(",").replace("\n", ",\n"),
}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
@pytest.mark.parametrize("form", FORMS)
def test_a_text_grid_is_read_as_it_lies(form, encoding, tmp_path):
    path = tmp_path / "psf.txt"
    path.write_bytes(FORMS[form].encode(encoding))
    found = read_psf(path, 1, "optics.psf.file")
    np.testing.assert_allclose(found, EXPECTED[None], rtol=1e-12)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_npy_is_read_as_it_lies(dtype, tmp_path):
    path = tmp_path / "psf.npy"
    np.save(path, GRID.astype(dtype))
    np.testing.assert_allclose(read_psf(path, 1, "optics.psf.file")[0], EXPECTED, rtol=1e-6)
    np.save(path, np.stack([GRID, 2 * GRID.T.reshape(GRID.shape)]).astype(dtype))
    two = read_psf(path, 2, "optics.psf.file")
    np.testing.assert_allclose(two[0], EXPECTED, rtol=1e-6)
    np.testing.assert_allclose(two.sum(axis=(1, 2)), 1, rtol=1e-12)


BROKEN = {
    "words": ("psf.txt", b"no numbers here\nat all\n", "no grid of numbers"),
    "ragged": ("psf.csv", b"1,2,3\n1,2,3\n1,2\n", "line 3"),
    "not finite": ("psf.csv", b"1,2\nnan,2\n", "not finite"),
    "negative": ("psf.csv", b"1,2\n-1,2\n", "negative"),
    "words below": ("psf.csv", b"1,2\n1,2\nend of data\n", "line 3"),
    "empty": ("psf.csv", b"", "empty"),
    "no npy": ("psf.npy", b"not an array at all", "no NPY file"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_what_is_no_grid_is_refused(case, tmp_path):
    name, content, says = BROKEN[case]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(BadInput, match=says):
        read_psf(tmp_path / name, 1, "optics.psf.file")


def test_objects_and_other_shapes_are_refused(tmp_path):
    path = tmp_path / "psf.npy"
    np.save(path, np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(BadInput, match="NPY"):
        read_psf(path, 1, "optics.psf.file")
    np.save(path, np.ones(5))
    with pytest.raises(BadInput, match="not a grid"):
        read_psf(path, 1, "optics.psf.file")
    np.save(path, np.ones((2, 5, 5)))
    with pytest.raises(BadInput, match="2 channels"):
        read_psf(path, 1, "optics.psf.file")
