"""What pixels give to their neighbors: light and charge before it is counted, voltage after."""

import math
from collections.abc import Mapping
from typing import Annotated, Any

from vcam_cli.config.lists import read_items
from vcam_cli.config.model import Model, key
from vcam_cli.config.quantities import Number, Percentage
from vcam_cli.config.validation_messages import describe
from vcam_cli.config.yaml_type import YamlType
from vcam_cli.records import dataclass

Kernel = tuple[tuple[float, ...], ...]
"""Shares of a pixel's signal by row and column, its own in the center; their sum is 1."""
SUM = 1e-6
"""How far from 1 the shares of a kernel may add up to, from decimals that are rounded."""
LARGEST = 9
"""Rows and columns of a kernel."""
_SHARE = Percentage(least=0, most=0.25, example="1 %")
_ENTRY = Number(least=0, most=1, example="0.96")
_EXAMPLE = "write for example 1 %, or {kernel: [[0, 0.01, 0], [0.01, 0.96, 0.01], [0, 0.01, 0]]}"


@dataclass(frozen=True)
class Kernels:
    """One kernel, or several by wavelength: linear between them, held beyond."""

    points: tuple[tuple[float, Kernel], ...]
    """((wavelength [m], kernel), ...), wavelengths rising; of one kernel alone, 0."""

    @property
    def by_wavelength(self) -> bool:
        """Whether there are several."""
        return len(self.points) > 1

    @property
    def largest_share(self) -> float:
        """The largest share of a pixel's signal that its neighbors get."""
        return max(1 - kernel[len(kernel) // 2][len(kernel[0]) // 2] for _, kernel in self.points)


def cross(share: float) -> Kernel:
    """Return the kernel that gives a share to each of the four neighbors."""
    return ((0.0, share, 0.0), (share, 1 - 4 * share, share), (0.0, share, 0.0))


class CrosstalkShare(YamlType):
    """The type of a share to each of the four neighbors, or of a kernel; by wavelength or not."""

    forms = Any

    def __init__(self, by_wavelength: bool) -> None:
        self._by_wavelength = by_wavelength

    def read(self, given: Any) -> Kernels | None:
        """Return the kernels, None of a share of 0; raise ValueError with a sentence."""
        if isinstance(given, Kernels) or given is None:
            return given
        if not isinstance(given, Mapping):
            share = _SHARE.read(given)
            return Kernels(((0.0, cross(share)),)) if share else None
        if len(given) != 1 or not set(given) <= {"kernel", "table"}:
            raise ValueError(f"{describe(given)} is no crosstalk; {_EXAMPLE}")
        [(name, content)] = given.items()
        if name == "kernel" and not isinstance(content, Mapping):
            return Kernels(((0.0, _read_kernel(content)),))
        return self._table(name, content)

    def _table(self, name: str, content: Any) -> Kernels:
        """Return shares or kernels by wavelength."""
        if not self._by_wavelength:
            raise ValueError(f"a table by wavelength does not apply here; {_EXAMPLE}")
        if not isinstance(content, Mapping) or len(content) < 2:
            raise ValueError(
                f"{describe(content)} is no table of two or more wavelengths [nm];"
                " write for example {table: {450: 0.5 %, 650: 2 %}}"
            )

        def point(item: tuple[Any, Any]) -> tuple[float, Kernel]:
            wavelength = _nanometers(item[0])
            if name == "kernel":
                return wavelength, _read_kernel(item[1])
            return wavelength, cross(_SHARE.read(item[1]))

        points = sorted(read_items((((name, at), (at, k)) for at, k in content.items()), point))
        if len({wavelength for wavelength, _ in points}) < len(points):
            raise ValueError("a wavelength comes twice in the table; keep one of them")
        return Kernels(tuple(points))

    def write(self, value: Kernels | None) -> Any:
        """Return the YAML form."""
        if value is None:
            return 0
        crosses = all(kernel == cross(kernel[0][len(kernel[0]) // 2]) for _, kernel in value.points)
        if not value.by_wavelength:
            [(_, kernel)] = value.points
            return _SHARE.write(kernel[0][1]) if crosses else {"kernel": [*map(list, kernel)]}
        if crosses:
            return {"table": {f"{w * 1e9:.12g}": _SHARE.write(k[0][1]) for w, k in value.points}}
        return {"kernel": {f"{w * 1e9:.12g}": [*map(list, k)] for w, k in value.points}}

    def json_schema(self, forms: dict[str, Any]) -> dict[str, Any]:
        """Return the JSON Schema of a share, a kernel, and of tables of them by wavelength."""
        row = {"type": "array", "items": {"type": "number", "minimum": 0, "maximum": 1}}
        kernel = {"type": "array", "items": row, "minItems": 1, "maxItems": LARGEST}

        def table(form: dict[str, Any]) -> dict[str, Any]:
            return {
                "type": "object",
                "patternProperties": {r"^\d+(\.\d*)?$": form},
                "additionalProperties": False,
                "minProperties": 2,
            }

        def mapping(name: str, form: dict[str, Any]) -> dict[str, Any]:
            return {
                "type": "object",
                "properties": {name: form},
                "required": [name],
                "additionalProperties": False,
            }

        if not self._by_wavelength:
            return {"anyOf": [_SHARE.json_schema({}), mapping("kernel", kernel)]}
        return {
            "anyOf": [
                _SHARE.json_schema({}),
                mapping("kernel", {"anyOf": [kernel, table(kernel)]}),
                mapping("table", table(_SHARE.number_schema())),
            ]
        }


def _nanometers(given: Any) -> float:
    """Return a wavelength given in nm [m]; raise ValueError with a sentence."""
    try:
        wavelength = float(given)
    except (TypeError, ValueError):
        wavelength = 0.0
    if not 1 <= wavelength <= 1e6:
        raise ValueError(f"{describe(given)} is not a wavelength in nm, such as 550")
    return wavelength * 1e-9


def _read_kernel(given: Any) -> Kernel:
    """Return a kernel; raise ValueError with a sentence."""
    rows = given if isinstance(given, (list, tuple)) else ()
    sizes = {len(row) if isinstance(row, (list, tuple)) else 0 for row in rows}
    width = sizes.pop() if len(sizes) == 1 else 0
    odd = len(rows) % 2 == 1 and width % 2 == 1
    if not odd or max(len(rows), width) > LARGEST:
        raise ValueError(
            f"{describe(given)} is no kernel: rows of equal length, odd numbers of both, at most"
            f" {LARGEST}; {_EXAMPLE}"
        )
    flat = [((row, column), x) for row, line in enumerate(rows) for column, x in enumerate(line)]
    values = read_items(flat, _ENTRY.read)
    total = math.fsum(values)
    if abs(total - 1) > SUM:
        raise ValueError(
            f"the kernel's weights add up to {total:.9g}, not 1: crosstalk conserves charge;"
            " set the central weight to 1 less the others"
        )
    return tuple(tuple(values[row * width : (row + 1) * width]) for row in range(len(rows)))


_BY_WAVELENGTH = Annotated[Kernels | None, CrosstalkShare(by_wavelength=True)]


class Crosstalk(Model):
    """Crosstalk to neighbors: a fraction to each of the four nearest, or a kernel."""

    optical: _BY_WAVELENGTH = key(
        "light that passes a pixel's filter and ends in a neighbor: a share to each of the four"
        " nearest, or {kernel: [[..]]} with rows of shares that add up to 1, or by wavelength"
        " {table: {450: 0.5 %, 650: 2 %}}, {kernel: {450: [[..]], 650: [[..]]}}",
        example="1 %",
        default=None,
    )
    electrical: _BY_WAVELENGTH = key(
        "charge that diffuses to a neighbor before it is collected, in the same forms",
        example="0.5 %",
        default=None,
    )
    interpixel_capacitance: Annotated[Kernels | None, CrosstalkShare(by_wavelength=False)] = key(
        "signal, with its shot noise, coupled to a neighbor's sense node by the capacitance "
        "between them: a fraction to each of the four nearest, or a kernel",
        example="0.5 %",
        default=None,
    )
