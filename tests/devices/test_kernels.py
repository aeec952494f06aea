"""The kernels of graphics processors, compiled for this one, beside NumPy and SciPy."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import scipy.fft

import vcam_cli
from vcam_cli.devices import counter_noise
from vcam_cli.devices.processor import Processor

SOURCE = Path(vcam_cli.__file__).parent / "devices/kernels.cu"
HOST = """
#include <cmath>
using std::exp; using std::expm1; using std::floor; using std::rint; using std::sqrt;
#define HOST
#define FUNCTION static inline
#define KERNEL extern "C" void
#define EACH(i, n) for (i64 i = 0; i < (n); ++i)
#define REAL {kind}
#include "{source}"
"""
COMPILER = shutil.which("g++") or shutil.which("c++")
TYPES = {"float": np.float32, "double": np.float64}
KEYS = np.array([0, 1, 2**40 + 5, 2**64 - 1], np.uint64)


@pytest.fixture(scope="module", params=sorted(TYPES))
def kernels(request, tmp_path_factory):
    """Their functions, and the type that they take."""
    if COMPILER is None:
        pytest.skip("no C++ compiler")
    folder = tmp_path_factory.mktemp("kernels")
    (folder / "host.cpp").write_text(HOST.format(kind=request.param, source=SOURCE))
    library = folder / "host.so"
    options = ("-O1", "-ffp-contract=off", "-shared", "-fPIC")
    subprocess.run([COMPILER, *options, "-o", library, folder / "host.cpp"], check=True)
    return ctypes.CDLL(str(library)), TYPES[request.param]


def call(function, *arguments):
    """Call a kernel: arrays by their place, numbers by their types."""
    kinds = {np.uint32: ctypes.c_uint, np.int32: ctypes.c_int, float: ctypes.c_double}
    function(
        *(
            a.ctypes.data_as(ctypes.c_void_p)
            if isinstance(a, np.ndarray)
            else None
            if a is None
            else kinds.get(type(a), ctypes.c_longlong)(a)
            for a in arguments
        )
    )


def draw(function, out, name="shot_noise", sample=7):
    low, high = (np.uint32(word) for word in counter_noise.stream_words(name))
    call(function, out, KEYS, low, high, np.uint32(sample), out[0].size, len(out))
    return out


def test_normal_numbers_are_those_of_numpy(kernels):
    library, kind = kernels
    expected = Processor().normals(KEYS, "shot_noise", 7, 10_003, kind)
    found = draw(library.normals, np.empty((4, 10_003), kind))
    assert np.abs(found - expected).max() < 1e-6  # logarithms differ in their last bits
    assert np.mean(found == expected) > 0.9


def test_uniform_numbers_are_those_of_numpy(kernels):
    library, _ = kernels
    found = draw(library.uniforms, np.empty((4, 1001)))
    assert (found == Processor().uniforms(KEYS, "shot_noise", 7, 1001)).all()


def test_poisson_numbers_are_those_of_numpy(kernels):
    library, kind = kernels
    mean = np.linspace(-1, 60, 40_012).reshape(4, -1).astype(kind)
    expected = Processor().poisson(KEYS, "shot_noise", 7, mean)
    found = draw(library.poisson, mean.copy())
    assert np.abs(found - expected).max() <= 1
    assert np.mean(found != expected) < 1e-3


def test_added_noise_and_codes_are_those_of_numpy(kernels):
    library, kind = kernels
    host, values = Processor(), np.linspace(-50, 900, 4004).reshape(4, -1).astype(kind)
    low, high = (np.uint32(word) for word in counter_noise.stream_words("read_noise"))
    found = values.copy()
    call(library.add_normals, found, KEYS, low, high, np.uint32(0), 1001, 4, 2.5)
    expected = host.add_normals(values.copy(), 2.5, KEYS, "read_noise", 0)
    assert np.abs(found - expected).max() < 1e-4
    line, most, highest = (0.37, 12.0), 800.0, 255
    for name, dtype in (("levels", None), ("codes16", np.uint16), ("codes32", np.uint32)):
        out = np.empty(values.shape, kind if dtype is None else dtype)
        call(getattr(library, name), values, out, most, *line, float(highest), values.size)
        assert (out == host.on_line(values, most, line, highest, dtype)).all()


@pytest.mark.parametrize("shape", [(8, 6), (7, 9), (16, 16), (5, 4), (1, 3)])
def test_cosine_transforms_are_those_of_scipy(kernels, shape):
    library, kind = kernels
    rows, columns = shape
    rng = np.random.default_rng(1)
    pictures, mix = rng.random((2, rows, columns, 3)), rng.random((2, 3))
    pictures, mix = pictures.astype(kind), mix.astype(kind)
    planes = np.empty((2, 2, rows, columns), kind)
    sizes = (rows, columns, rows, columns, 0, 0)
    counts = (2, np.int32(3), np.int32(2))
    call(library.mixed, pictures, mix, planes, *counts, *sizes, np.int32(1))
    complex_kind = np.complex64 if kind is np.float32 else np.complex128
    turns = [
        np.exp(-0.5j * np.pi * np.arange(n + 1) / n).astype(complex_kind) for n in (rows, columns)
    ]
    half = np.fft.rfft2(planes).astype(complex_kind)
    terms = np.empty_like(planes)
    call(library.cosines, half, *turns, terms, 4, rows, columns)
    expected = scipy.fft.dctn(np.einsum("mk,nyxk->nmyx", mix, pictures), 2, axes=(-2, -1))
    allowed = 2e-6 if kind is np.float32 else 1e-14
    assert np.abs(terms - expected).max() < allowed * np.abs(expected).max()

    back = np.empty_like(half)
    call(library.half_spectrum, terms, *turns, back, 4, rows, columns, rows, columns)
    ordered = np.fft.irfft2(back, s=shape, norm="forward").astype(kind)
    found = np.empty_like(planes)
    call(library.placed, ordered, None, found, 2, np.int32(2), rows, columns, 0, 0, rows, columns)
    truth = scipy.fft.dctn(expected, 3, axes=(-2, -1))
    assert np.abs(found - truth).max() < allowed * np.abs(truth).max()


def test_filter_and_mosaic(kernels):
    library, kind = kernels
    rng, host = np.random.default_rng(2), Processor()
    spectrum, transfer = (
        rng.random((2, 3, 6, 8)).astype(kind),
        rng.random((3, 2, 5, 7)).astype(kind),
    )
    at = np.arange(5, dtype=np.int32)[::-1].copy(), np.arange(7, dtype=np.int32)
    out = np.empty((2, 2, 5, 7), kind)
    counts = (2, np.int32(3), np.int32(2), 5, 7, 6, 8)
    call(library.filtered, spectrum, transfer, *at, out, *counts)
    assert np.allclose(out, host.filtered(spectrum, transfer, *at), rtol=1e-6)
    color = rng.integers(0, 2, (4, 5)).astype(np.int32)
    planes = rng.standard_normal((2, 2, 6, 8)).astype(kind)
    ordered = np.empty_like(planes)
    for axis_rows in range(6):
        for axis_columns in range(8):
            row = 2 * axis_rows if 2 * axis_rows < 6 else 2 * (5 - axis_rows) + 1
            column = 2 * axis_columns if 2 * axis_columns < 8 else 2 * (7 - axis_columns) + 1
            ordered[..., axis_rows, axis_columns] = planes[..., row, column]
    found = np.empty((2, 4, 5), kind)
    call(library.placed, ordered, color, found, 2, np.int32(2), 6, 8, 1, 2, 4, 5)
    inside = planes[:, :, 1:5, 2:7]
    assert (found == np.maximum(np.where(color == 0, inside[:, 0], inside[:, 1]), 0)).all()
