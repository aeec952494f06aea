"""What a file of a data set may say: a camera, scenes, what is drawn, what is written."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import model_validator

from vcam_cli import units
from vcam_cli.config.lists import check_list, list_of_any, words_of
from vcam_cli.config.model import FileModel, Model, at_most_one, exactly_one, key
from vcam_cli.config.quantities import Number, Whole
from vcam_cli.config.validation_messages import describe, failure, fault, refusal
from vcam_cli.config.values import Either, Text, Word, mapping
from vcam_cli.datasets.formulas import Formula, read_formula

KINDS = ("raw", "clean", "ideal", "depth")
"""What may be written of a frame."""
MOST_FRAMES = 10_000_000

_SIZE = Whole(least=1, most=1 << 20, example="512")


def _range(given: Any) -> tuple[Any, Any]:
    if not isinstance(given, (list, tuple)) or len(given) != 2:
        raise ValueError(f"{describe(given)} is not two ends; write for example [1 ms, 100 ms]")
    low, unit = units.split(given[0])
    high = units.convert(*units.split(given[1]), unit)
    if not low < high:
        raise ValueError("the first end is not below the second; write for example [1 ms, 100 ms]")
    return given[0], given[1]


def _logarithmic(given: Any) -> tuple[Any, Any]:
    low, high = _range(given)
    if units.split(low)[0] <= 0:
        raise ValueError("equal ratios need ends above zero; write uniform")
    return low, high


def _whole_ends(given: Any) -> tuple[int, int]:
    if not isinstance(given, (list, tuple)) or [type(end) for end in given] != [int, int]:
        raise ValueError(f"{describe(given)} is not two whole numbers; write for example [1, 1000]")
    if given[0] > given[1]:
        raise ValueError("the first number is above the second; write the smaller one first")
    return given[0], given[1]


def _formula(given: Any) -> str:
    if not isinstance(given, str):
        raise ValueError(f"{describe(given)} is no formula; write for example 20 ms / gain")
    return read_formula(given).text


_ENDS = list[str | float]


class Distribution(Model):
    """Distribution of a parameter."""

    uniform: Annotated[tuple[Any, Any] | None, Either(_range, _ENDS)] = key(
        "all values between two ends are equally probable",
        unit="",
        example=["10 ms", "30 ms"],
        default=None,
    )
    log_uniform: Annotated[tuple[Any, Any] | None, Either(_logarithmic, _ENDS)] = key(
        "all ratios between two ends are equally probable",
        unit="",
        example=["1 ms", "100 ms"],
        default=None,
    )
    integers: Annotated[tuple[int, int] | None, Either(_whole_ends, list[int])] = key(
        "whole numbers between two ends, both included", example=[1, 1000], default=None
    )
    choice: Annotated[tuple[Any, ...] | None, list_of_any("[1, 4, 16]")] = key(
        "one of these values, equally probable", example=[1, 4, 16], default=None
    )

    from_: Annotated[str | None, Either(_formula, str)] = key(
        "formula over keys above it, by their paths or last words, with units, + - * / ^, sqrt,"
        " exp, log (natural), min, max: couples parameters",
        example="20 ms / exposure.gain",
        alias="from",
        default=None,
    )
    scatter: Annotated[float, Number(least=0, most=10, example="0.25")] = key(
        "of `from`: standard deviation of the natural logarithm of a log-normal factor on it",
        default=0.0,
    )

    rules = (
        exactly_one(
            *("uniform", "log_uniform", "integers", "choice", "from"),
            of="distribution",
            remedy="write {uniform: [10 ms, 30 ms]}",
        ),
    )

    @property
    def formula(self) -> Formula | None:
        """The formula; None of what is drawn by itself."""
        return None if self.from_ is None else read_formula(self.from_)

    @property
    def values(self) -> tuple[Any, ...]:
        """Each choice, or both ends; none of a formula."""
        return self.choice or self.uniform or self.log_uniform or self.integers or ()

    @property
    def is_number(self) -> bool:
        """Whether all that is drawn are numbers, or quantities with a unit."""
        try:
            return bool([units.split(value) for value in self.values]) or self.from_ is not None
        except ValueError:
            return False

    @model_validator(mode="after")
    def _only_a_formula_scatters(self) -> Self:
        if self.scatter and self.from_ is None:
            message = "scatter applies only to `from`"
            raise refusal(("scatter",), message, "remove it, or write from")
        return self


def _patterns(given: Any) -> tuple[str, ...]:
    found = given if isinstance(given, (list, tuple)) else [given]
    check_list(found, '["photos/*.png"]', 1)
    for item in found:
        if not isinstance(item, str) or not item:
            raise ValueError(f"{describe(item)} names no files; write for example photos/*.png")
    return tuple(found)


def _charts(given: Any) -> tuple[Any, ...]:
    check_list(given, "[dead-leaves, colorchecker]", 1, "a list of charts")
    for item in given:
        if not isinstance(item, (str, Mapping)):
            message = f"{describe(item)} is no chart"
            raise ValueError(f"{message}; write for example dead-leaves, or a scene.source")
        if not isinstance(item, str) and item.get("kind", "chart") != "chart":
            raise ValueError(f"{describe(item['kind'])} is no chart; give pictures under files")
    return tuple(given)


class Scenes(Model):
    """Scenes of the frames."""

    files: Annotated[tuple[str, ...], Either(_patterns, str | list[str])] = key(
        "pictures; each scene is a random crop of one",
        example="photos/*.png",
        default=(),
    )
    charts: Annotated[tuple[Any, ...], Either(_charts, list[str | dict[str, Any]])] = key(
        "charts in place of files: names, or mappings as scene.source has them",
        example=["dead-leaves", "colorchecker"],
        default=(),
    )
    samples_per_pixel: Annotated[float, Number(above=0, most=64, example="1")] = key(
        "samples of a picture across one pixel; more of them take a larger crop", default=1.0
    )
    frames_each: Annotated[int, Whole(least=1, most=MOST_FRAMES, example="4")] = key(
        "consecutive frames of one scene, with the same crop and light", default=1
    )

    rules = (at_most_one("files", "charts"),)


class Size(Model):
    """The size of the frames."""

    rows: Annotated[int, _SIZE] = key("number of rows", example=512)
    columns: Annotated[int, _SIZE] = key("number of columns", example=512)


class Dataset(FileModel):
    """A data set: frames of a camera with random parameters, and their labels."""

    kind: Literal["dataset"] = key("the kind of study", example="dataset")
    name: Word = key(
        "name of the data set and of its output folder; default the file's",
        example="noise-pairs",
        default="dataset",
    )
    camera: Text = key("name or path of a camera file", example="starter")
    scenes: Annotated[Scenes | None, mapping(Scenes)] = key(
        "scenes of the frames; default the camera's own scene",
        example={"files": "photos/*.png"},
        default=None,
    )
    vary: dict[str, Distribution] = key(
        "path in the camera -> its distribution, or a formula over keys above it",
        example={"exposure.time": {"log_uniform": ["1 ms", "100 ms"]}},
        default=dict,
    )
    frames: Annotated[int, Whole(least=1, most=MOST_FRAMES, example="1000")] = key(
        "number of frames", example=1000
    )
    size: Annotated[Size | None, mapping(Size)] = key(
        "of every frame; default the camera's array",
        example={"rows": 512, "columns": 512},
        default=None,
    )
    write: Annotated[tuple[str, ...], words_of(KINDS, 1)] = key(
        "outputs of a frame: raw (codes), clean (codes without noise and rounding, clipped: "
        "near saturation the mean of raw frames is lower), ideal (the scene at the pixels' "
        "centers, all colors, in codes), depth (distance along the axis in m, of the nearest "
        "layer)",
        example=["raw", "clean"],
        default=("raw", "clean"),
    )
    shards: Annotated[int, Whole(least=1, most=100_000, example="8")] = key(
        "files, or folders of TIFF, among which the frames are divided", example=8, default=1
    )
    format: Literal["npz", "tiff"] = key(
        "npz: shards in NumPy's format; tiff: whole numbers, a file a frame and kind",
        default="npz",
    )
    seed: Annotated[int, Whole(least=0, most=2**63 - 1, example="1")] = key(
        "seed of all draws; the frames' seeds follow from it", default=1
    )

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        mistakes = [*self._wrong_paths(), *self._wrong_names()]
        if mistakes:
            raise failure(mistakes)
        if self.scenes is not None and self.scenes.files and self.size is None:
            message = "the size of the frames, and so of crops, is missing"
            raise refusal((), message, "add size: {rows: 512, columns: 512}")
        if self.shards > self.frames:
            message = f"{self.frames} frames do not fill {self.shards} shards"
            raise refusal(("shards",), message, "set fewer shards")
        return self

    def named(self, name: str) -> list[str]:
        """Return the paths of `vary` that a name of a formula may mean."""
        return [path for path in self.vary if path == name or path.endswith(f".{name}")]

    def _wrong_names(self) -> Iterator[Any]:
        """Yield names of formulas that mean no key above, or several, or no number."""
        above: list[str] = []
        for path, drawn in self.vary.items():
            for name in drawn.formula.names if drawn.formula else ():
                found = self.named(name)
                if len(found) != 1 or found[0] not in above:
                    some = f"{name!r} means {', '.join(found)}" if found else f"{name!r} is unknown"
                    remedy = f"write one of the keys above: {', '.join(above) or '(none)'}"
                    yield fault(("vary", path, "from"), some, remedy)
                elif not self.vary[found[0]].is_number:
                    message = f"{found[0]} has a distribution over values that are not numbers"
                    yield fault(("vary", path, "from"), message, "name another key")
            above.append(path)

    def _wrong_paths(self) -> Iterator[Any]:
        taken = {"seed.frame": "the seeds follow from the key seed"}
        if self.size is not None:
            taken |= dict.fromkeys(("array.rows", "array.columns", "array.die"), "size sets it")
        if self.scenes is not None and self.scenes.files:
            taken["scene.source"] = "the scene is a crop of a file"
        for path in self.vary:
            if not path or "" in path.split("."):
                message = f"{describe(path)} is not a path of a camera"
                yield fault(("vary", path), message, "write for example exposure.time")
            for other, why in taken.items():
                if path == other or path.startswith(f"{other}."):
                    yield fault(("vary", path), why, "remove this key")
