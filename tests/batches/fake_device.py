"""A device that is none: NumPy's arrays that refuse hidden copies, as those of CuPy do.

It refuses what CuPy refuses: conversion by `np.asarray`, mixing with arrays of NumPy, functions of
NumPy that CuPy lacks, methods of ufuncs, and generalized ones (`np.matmul`; `@` is its own).
"""

from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from vcam_cli.devices.processor import Processor

FUNCTIONS = {
    *("clip", "concatenate", "copyto", "empty_like", "moveaxis", "partition", "prod", "ravel"),
    *("take", "where", "zeros_like", "mean", "ndim", "broadcast_arrays", "outer"),
}
"""Functions of NumPy that a device's arrays may meet: CuPy has all of them."""


def _own(value: Any) -> Any:
    if isinstance(value, FakeArray):
        return value.values
    if isinstance(value, tuple | list):
        return type(value)(_own(item) for item in value)
    if isinstance(value, np.ndarray) and value.ndim:
        raise TypeError("Unsupported type <class 'numpy.ndarray'>")
    return value


def _fake(found: Any) -> Any:
    if isinstance(found, np.ndarray | np.generic):
        return FakeArray(np.asarray(found))
    if isinstance(found, tuple | list):
        return type(found)(_fake(item) for item in found)
    return found


class FakeArray(NDArrayOperatorsMixin):
    def __init__(self, values: np.ndarray) -> None:
        self.values = values

    def __array__(self, *_: Any, **__: Any) -> np.ndarray:
        raise TypeError("Implicit conversion to a NumPy array is not allowed")

    def __array_ufunc__(self, ufunc, method, *inputs, **kwargs):
        if method != "__call__" or ufunc.signature is not None:
            return NotImplemented
        if "out" in kwargs:
            [out] = kwargs["out"]
            ufunc(*map(_own, inputs), **{**kwargs, "out": _own(out)})
            return out
        return _fake(ufunc(*map(_own, inputs), **kwargs))

    def __array_function__(self, func, types, args, kwargs):
        if func.__name__ not in FUNCTIONS:
            raise TypeError(f"{func.__name__}: not among the functions of a device")
        return _fake(func(*_own(args), **{k: _own(v) for k, v in kwargs.items()}))

    def __matmul__(self, other: "FakeArray") -> "FakeArray":
        return FakeArray(self.values @ other.values)

    def __getattr__(self, name: str) -> Any:
        if name in ("dtype", "shape", "ndim", "size", "nbytes"):
            return getattr(self.values, name)
        if name in ("T", "real", "imag"):
            return FakeArray(getattr(self.values, name))
        if name in ("astype", "reshape", "sum", "mean", "min", "max", "ravel", "copy"):
            method = getattr(self.values, name)
            return lambda *args, **kwargs: _fake(method(*_own(args), **kwargs))
        raise AttributeError(name)

    def __len__(self) -> int:
        return len(self.values)

    def __iter__(self):
        return (FakeArray(item) for item in self.values)

    def __float__(self) -> float:
        return float(self.values)

    def __bool__(self) -> bool:
        return bool(self.values)

    def __getitem__(self, index: Any) -> "FakeArray":
        return FakeArray(np.asarray(self.values[_own(index)]))

    def __setitem__(self, index: Any, value: Any) -> None:
        self.values[_own(index)] = _own(value)


class FakeDevice(Processor):
    name = "fake"
    whole = True

    def __init__(self):
        self.log = []

    def describe(self):
        return self.name

    def put(self, values, dtype=None):
        values = values.values if isinstance(values, FakeArray) else values
        return FakeArray(super().put(values, dtype))

    def get(self, array):
        return array.values

    def fetch(self, array):
        """Copy when it is waited for: who changes the array meanwhile gets what it is then."""
        self.log.append("begun")

        def wait():
            self.log.append("waited")
            return array.values.copy()

        return wait

    def zeros(self, shape, dtype):
        return FakeArray(super().zeros(shape, dtype))

    def dct3(self, values, axis, odd, overwrite=False):
        return FakeArray(super().dct3(values.values, axis, odd))

    def fft(self, values, axis):
        return FakeArray(super().fft(values.values, axis))

    def ifft(self, values, axis):
        return FakeArray(super().ifft(values.values, axis))

    def irfft(self, values, count):
        return FakeArray(super().irfft(values.values, count))

    def splines(self, values):
        return FakeArray(super().splines(values.values))

    def interpolated(self, coefficients, row, column):
        return FakeArray(super().interpolated(*(a.values for a in (coefficients, row, column))))

    def normals(self, keys, name, sample, count, dtype):
        return FakeArray(super().normals(keys.values, name, sample, count, dtype))

    def uniforms(self, keys, name, sample, count):
        return FakeArray(super().uniforms(keys.values, name, sample, count))

    def poisson(self, keys, name, sample, mean):
        return FakeArray(super().poisson(keys.values, name, sample, mean.values))

    def add_normals(self, values, rms, keys, name, sample):
        z = Processor.normals(self, keys.values, name, sample, values[0].size, values.dtype)
        z *= rms
        values += FakeArray(z.reshape(values.shape))
        return values

    def stacked(self, pictures):
        return FakeArray(np.stack([p.values if isinstance(p, FakeArray) else p for p in pictures]))

    def spectrum(self, pictures, mix, shape, black):
        return FakeArray(super().spectrum(pictures.values, mix.values, shape, black))

    def filtered(self, spectrum, transfer, from_y, from_x):
        arrays = (array.values for array in (spectrum, transfer, from_y, from_x))
        return FakeArray(super().filtered(*arrays))

    def evaluated(self, terms, size, window, color):
        color = None if color is None else color.values
        return FakeArray(super().evaluated(terms.values, size, window, color))
