"""The array: how many pixels, in which colors, behind which filters."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import model_validator
from pydantic_core import InitErrorDetails

from vcam_cli.camera.spectrum import Spectral, SpectrumSpec, balanced
from vcam_cli.config import shipped
from vcam_cli.config.lists import read_items
from vcam_cli.config.model import Model, all_or_none, at_most_one, key
from vcam_cli.config.quantities import Whole
from vcam_cli.config.validation_messages import describe, fault, one_of, refusal
from vcam_cli.config.values import Either, File, Length, mapping, word_or
from vcam_cli.config.yaml_type import to_yaml
from vcam_cli.errors import BadInput
from vcam_cli.spectra.measured import column_names

BAYER = ("bayer-rggb", "bayer-grbg", "bayer-gbrg", "bayer-bggr")
PATTERNS: dict[str, tuple[str, ...]] = {
    "monochrome": ("Y",),
    **dict.fromkeys(BAYER, ("R", "G", "B")),
    "quad-bayer": ("R", "G", "B"),
    "rgbw": ("R", "G", "B", "W"),
    "honeycomb": ("R", "G", "B"),
    "stacked": ("R", "G", "B"),
}
"""Pattern -> its colors, in the order of color planes."""
CLEAR = ("Y", "W")
"""Colors that need no filter."""
DEFAULT_FILTERS = "generic-rgb"
STACKED_FILTERS = "silicon-layers"

_FILTER = Spectral(most=1.0)
_Count = Whole(least=1, most=10**7, example="512")


class Die(Model):
    """A piece of silicon: count = round(die / pitch)."""

    width: Length = key("width of the sensitive area", example="2.7 mm")
    height: Length = key("height of the sensitive area", example="2.7 mm")


class Block(Model):
    """A repeated block of colors."""

    block: tuple[tuple[str, ...], ...] = key(
        "rows of color names", example=[["R", "G"], ["G", "B"]]
    )

    @model_validator(mode="after")
    def _rectangular(self) -> Self:
        if not self.block or not self.block[0] or len({len(row) for row in self.block}) > 1:
            message = "its rows are not equally long"
            raise refusal(("block",), message, "write for example [[R, G], [G, B]]")
        return self


class Positions(Model):
    """Pixels at places of their own."""

    positions: File = key(
        "CSV file with the columns x_um,y_um,color: places to the right of and below the origin",
        example="pixels.csv",
    )
    origin: Literal["center", "corner"] = key(
        "center: the optical axis, at the middle of the array; corner: the upper-left corner of"
        " the array",
        default="center",
    )


class Binning(Model):
    """Binning of adjacent pixels."""

    rows: Annotated[int, Whole(least=1, most=64, example="2")] = key("in a column", example=2)
    columns: Annotated[int, Whole(least=1, most=64, example="2")] = key("in a row", example=2)
    kind: Literal["charge", "voltage", "digital"] = key(
        "domain of binning: charges (added before readout), voltages (averaged, then read), or "
        "digital codes (added)",
        default="charge",
    )

    @property
    def count(self) -> int:
        """Number of pixels that are read as one."""
        return self.rows * self.columns

    @property
    def conversions(self) -> int:
        """How many conversions of the ADC make one pixel of the raw frame."""
        return self.count if self.kind == "digital" else 1


def _pattern(given: Any) -> Any:
    if isinstance(given, (Block, Positions)) or (isinstance(given, str) and given in PATTERNS):
        return given
    if isinstance(given, Mapping):
        return (Positions if "positions" in given else Block).model_validate(given)
    also = "{block: [[R, G], [G, B]]} or {positions: file.csv}"
    raise refusal((), *one_of(given, PATTERNS, also), given)


def _filters(given: Any) -> dict[str, SpectrumSpec]:
    if isinstance(given, str):
        return filter_set(given)
    if isinstance(given, Mapping) and isinstance(given.get("file"), str):
        return _filters_of_file(given)
    if not isinstance(given, Mapping):
        raise ValueError(
            f"{describe(given)} is not a set of filters; write for example {{R: 0.9, ...}}"
        )

    def read(color: Any) -> SpectrumSpec:
        if not isinstance(color, str) or not color.isidentifier():
            raise ValueError(f"{describe(color)} is not the name of a color; write for example R")
        return _FILTER.read(given[color])

    return dict(zip(given, read_items(((color, color) for color in given), read), strict=True))


def _filters_of_file(given: Mapping[Any, Any]) -> dict[str, SpectrumSpec]:
    """Return the filters of a file with a column for each color, by the columns' names."""
    if "column" in given:
        message = "a set of filters takes all columns of the file"
        raise refusal(("column",), message, "remove it, or write {R: {file: ..}, ..}", given)
    try:
        names = column_names(given["file"])
    except ValueError as error:
        raise refusal(("file",), str(error), "give wavelengths and a column a color") from None
    except OSError as error:
        message = f"{given['file']} cannot be read: {error.strerror}"
        raise refusal(("file",), message, "check the file name") from None
    return _filters({name: {**given, "column": name} for name in names})


def filter_set(name: str) -> dict[str, SpectrumSpec]:
    """Return the filters of a set that ships, by color; raise ValueError for another name."""
    from vcam_cli.config import yaml_reader  # `vcam list` reads no YAML

    try:
        path = shipped.find("filters", name)
        tree: Any = yaml_reader.read_file(path).plain()
    except BadInput as error:
        problem = error.problems[0]
        raise ValueError(f"{problem.message}; {problem.remedy}") from None

    def absolute_item(item: Any) -> Any:
        if isinstance(item, list):  # a product of spectra
            return [absolute_item(factor) for factor in item]
        named = isinstance(item, Mapping) and "file" in item
        return {**item, "file": str(path.parent / item["file"])} if named else item

    return _filters({color: absolute_item(item) for color, item in tree.items() if color != "name"})


def _has_size(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """Require rows and columns, or a die, unless every pixel has a place of its own."""
    pattern = given.get("pattern")
    if isinstance(pattern, Mapping) and "positions" in pattern:
        return
    if not {"rows", "columns", "die"} & set(given):
        yield fault((), "its size is missing", "add rows: 512 and columns: 512, or a die")


class Array(Model):
    """The pixel array: rows and columns, or a die to fill."""

    rows: Annotated[int | None, _Count] = key("pixels in a column", example=512, default=None)
    columns: Annotated[int | None, _Count] = key("pixels in a row", example=512, default=None)
    die: Annotated[Die | None, mapping(Die)] = key(
        "size of the sensitive area, in place of rows and columns",
        example={"width": "2.7 mm", "height": "2.7 mm"},
        default=None,
    )
    pattern: Annotated[
        str | Block | Positions, Either(_pattern, Literal[tuple(PATTERNS)] | Block | Positions)
    ] = key("colors of the pixels, row 0 column 0 first", default="bayer-rggb")
    filters: Annotated[
        dict[str, SpectrumSpec],
        Either(
            _filters,
            str | dict[str, Annotated[SpectrumSpec, _FILTER]],
            yaml_form=lambda value: {color: spec.to_yaml() for color, spec in value.items()},
        ),
    ] = key(
        "transmittance of each color's filter (a spectrum), or the name of a shipped set; "
        "or {file: rgb.csv} with a column for each color; default generic-rgb, and no filter on "
        "monochrome pixels (color Y) and on W. Filters act on photons: measured sensitivities of "
        "cameras are mostly per watt, which read as if per photon leaves red 10 % low and blue "
        "13 % high; write {file: rgb.csv, per: watt}",
        example={"R": {"file": "r.csv"}, "G": {"file": "g.csv"}, "B": {"file": "b.csv"}},
        default=None,
    )
    binning: Annotated[Binning | None, word_or(Binning, {"none": None})] = key(
        "binning of adjacent pixels", example="none", default=None
    )

    rules = (
        _has_size,
        at_most_one("die", "rows"),
        at_most_one("die", "columns"),
        all_or_none("rows", "columns"),
    )

    @property
    def colors(self) -> tuple[str, ...]:
        """Colors of the pattern, in the order of color planes; () for positions from a file."""
        if isinstance(self.pattern, Block):
            return tuple(dict.fromkeys(color for row in self.pattern.block for color in row))
        return PATTERNS[self.pattern] if isinstance(self.pattern, str) else ()

    @property
    def mosaic(self) -> bool:
        """Whether a pixel holds one color of several."""
        return len(self.colors) != 1 and self.pattern != "stacked"

    @property
    def is_scattered(self) -> bool:
        """Whether the pixels fill no rows and columns of squares."""
        return self.pattern == "honeycomb" or isinstance(self.pattern, Positions)

    @property
    def reads_several(self) -> bool:
        """Whether several pixels are read as one."""
        return self.binning is not None and self.binning.count > 1

    @property
    def summed_charges(self) -> int:
        """Pixels whose charge is counted as one."""
        given = self.binning
        return given.count if given is not None and given.kind == "charge" else 1

    @model_validator(mode="after")
    def _binning_has_neighbors(self) -> Self:
        if self.binning is not None and self.binning.count > 1 and self.is_scattered:
            message = "needs pixels in rows and columns; these are at free positions"
            remedy = "write binning: none, or another pattern"
            raise refusal(("binning",), message, remedy)
        return self

    @model_validator(mode="after")
    def _complete_filters(self) -> Self:
        filters = self.filters or {}
        colored = set(self.colors) - set(CLEAR) or isinstance(self.pattern, Positions)
        if "filters" not in self.model_fields_set and colored:
            stacked = self.pattern == "stacked"
            filters = filter_set(STACKED_FILTERS if stacked else DEFAULT_FILTERS)
        for color in self.colors:
            if color not in filters and color not in CLEAR:
                message = f"has no filter for {color}, a color of {describe(to_yaml(self.pattern))}"
                raise refusal(("filters",), message, f"add {color}: and its spectrum")
        chosen = {c: filters[c] for c in self.colors if c in filters} or filters
        self._fill(filters=balanced(chosen))
        return self
