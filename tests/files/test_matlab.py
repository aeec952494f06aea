"""MATLAB files: what SciPy writes is read as SciPy reads it; what lies about itself is refused."""

import struct
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.io import loadmat, savemat

from vcam_cli.errors import CannotDo
from vcam_cli.files.file_checks import UnusableFile
from vcam_cli.files.spectral import matlab
from vcam_cli.files.spectral.matlab import read_variables

KINDS = ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8")
ARRAYS = st.sampled_from(KINDS).flatmap(
    lambda kind: hnp.arrays(kind, hnp.array_shapes(min_dims=2, max_dims=4, max_side=4))
)
NAMES = st.from_regex(r"[a-z][a-z0-9_]{0,12}", fullmatch=True)
VALUES = st.recursive(
    ARRAYS, lambda inner: st.dictionaries(NAMES, inner, min_size=1, max_size=3), max_leaves=5
)
OTHERS = {"text": "words", "cell": np.array([1, "a"], object), "no": np.array([[1j]])}


@settings(
    max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture]
)  # one folder is enough
@given(values=st.dictionaries(NAMES, VALUES, max_size=4), compress=st.booleans())
def test_reads_what_scipy_reads(values, compress, tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, OTHERS | values, do_compression=compress)
    found = read_variables(path, list(values))
    theirs = loadmat(path)
    assert set(found) == set(values)
    for name in values:
        same(found[name], theirs[name])


def same(ours, theirs) -> None:
    if isinstance(ours, dict):
        assert theirs.shape == (1, 1)
        assert set(ours) == set(theirs.dtype.names)
        for name, value in ours.items():
            same(value, theirs[0, 0][name])
    else:
        assert ours.dtype == theirs.dtype
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("compress", [False, True])
def test_of_what_is_no_number_nothing_is_read(compress, tmp_path):
    savemat(tmp_path / "a.mat", OTHERS, do_compression=compress)
    found = read_variables(tmp_path / "a.mat", [*OTHERS, "missing"])
    assert set(found) == set(OTHERS)
    assert all(value.dtype == object and value.size == 0 for value in found.values())


def element(kind: int, data: bytes, order: str = "<", length: int | None = None) -> bytes:
    tag = struct.pack(f"{order}II", kind, len(data) if length is None else length)
    return tag + data + b"\0" * (-len(data) % 8)


def array(name=b"photons", shape=(1, 2), data=b"\1\2", kind=2, order="<", flags=6) -> bytes:
    """A variable of doubles, its numbers stored as bytes."""
    parts = [
        element(6, struct.pack(f"{order}II", flags, 0), order),
        element(5, struct.pack(f"{order}{len(shape)}i", *shape), order),
        element(1, name, order),
        element(kind, data, order),
    ]
    return element(14, b"".join(parts), order)


def file(tmp_path, *elements: bytes, mark: bytes = b"\0\1IM"):
    path = tmp_path / "a.mat"
    path.write_bytes(b"MATLAB 5.0".ljust(124) + mark + b"".join(elements))
    return path


def packed(variable: bytes) -> bytes:
    data = zlib.compress(variable, 9)
    return struct.pack("<II", 15, len(data)) + data


@pytest.mark.parametrize(("order", "mark"), [("<", b"\0\1IM"), (">", b"\1\0MI")])
def test_either_order_of_bytes_and_small_numbers_of_large_type(order, mark, tmp_path):
    path = file(tmp_path, array(order=order), mark=mark)
    found = read_variables(path, ["photons"])["photons"]
    assert found.dtype == np.float64
    assert found.tolist() == [[1, 2]]


LIES = {
    "more numbers than are there": array(shape=(10**6, 10**6)),
    "fewer numbers than are there": array(shape=(1, 1)),
    "a product that overflows": array(shape=(2**31 - 1,) * 8),
    "less than nothing": array(shape=(-1, -2)),
    "no shape": array(shape=()),
    "one axis": array(shape=(2,)),
    "data of no type": array(kind=99),
    "data that is an array": array(kind=14),
    "half a number": array(kind=9),
    "an element beyond the end": element(14, b"", length=2**31),
    "a structure without fields": array(flags=2, shape=(1, 1)),
    "two of a name": array() + array(),
    "packed rubbish": element(15, b"\xff" * 64),
    "packed and cut short": packed(array())[:-9],
    "half a tag": b"\0\0\0",
}


@pytest.mark.parametrize("lie", LIES)
def test_refuses_what_is_not_so(lie, tmp_path):
    with pytest.raises(UnusableFile, match="no complete MATLAB file"):
        read_variables(file(tmp_path, LIES[lie]), ["photons"])


def test_a_variable_that_nobody_asks_for_is_not_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr(matlab, "SUSPECT", 1 << 16)
    bomb = packed(array(b"spare", (1, 1 << 24), b"\0" * (1 << 24)))
    path = file(tmp_path, bomb, array())
    assert read_variables(path, ["photons"])["photons"].tolist() == [[1, 2]]
    with pytest.raises(UnusableFile, match="unpacks to more than 300 times"):
        read_variables(path, ["spare"])


def test_memory_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(matlab, "ASKED", 1)
    monkeypatch.setattr(matlab.memory, "available", lambda: 10)
    for made in (array(), packed(array())):
        with pytest.raises(CannotDo, match="memory"):
            read_variables(file(tmp_path, made), ["photons"])


def test_structures_in_structures_have_an_end(tmp_path):
    deep: dict = {"photons": np.eye(2)}
    for _ in range(20):
        deep = {"photons": deep}
    savemat(tmp_path / "a.mat", deep)
    value, depth = read_variables(tmp_path / "a.mat", ["photons"])["photons"], 0
    while isinstance(value, dict):
        value, depth = value["photons"], depth + 1
    assert depth == matlab.DEEPEST
    assert value.dtype == object
