"""Exposure: time and gain, given or chosen by the camera; or several samples of one integration."""

import math
from collections.abc import Mapping
from itertools import accumulate
from typing import Annotated, Any, Literal, Self

from pydantic import model_validator

from vcam_cli.config.lists import read_items
from vcam_cli.config.model import Model, at_most_one, exactly_one, key
from vcam_cli.config.quantities import Number, Quantity, Whole
from vcam_cli.config.validation_messages import describe, refusal
from vcam_cli.config.values import (
    TIME,
    Either,
    MaybePositive,
    MaybeTime,
    Positive,
    Time,
    mapping,
    word_or,
)
from vcam_cli.config.yaml_type import to_yaml


class AutoExposure(Model):
    """Automatic exposure: time, then gain, that bring a level to a fraction of saturation."""

    max: Time = key("longest time", example="100 ms", default=0.1)
    min: Annotated[float, Quantity("time", least=0, most=1e9)] = key(
        "shortest time", unit="ms", example="0 s", default=0.0
    )
    max_gain: Positive = key(
        "largest gain, used where the longest time does not suffice; default: the gain itself",
        default=1.0,
    )
    max_iso: MaybePositive = key(
        "largest ISO speed (12232, saturation-based), in place of max_gain",
        example=3200,
        default=None,
    )
    method: Literal["white", "percentile", "mean"] = key(
        "metered level: of the perfect white, a percentile of the picture, or its mean",
        default="white",
    )
    target: Annotated[float, Number(above=0, most=1, example="0.9")] = key(
        "fraction of saturation: of the full well, or of the ADC where it saturates first",
        default=0.9,
    )
    percentile: Annotated[float, Number(least=0, most=100, example="99.9")] = key(
        "percentile of the picture, for `method: percentile`", default=99.9
    )
    follow: Annotated[float, Number(above=0, most=1, example="0.5")] = key(
        "in sequences: fraction of the last frame's exposure error, in EV, that the next frame "
        "corrects; 1: all of it",
        default=0.5,
    )

    rules = (at_most_one("max_gain", "max_iso"),)

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if self.min > self.max:
            raise refusal(("min",), "is longer than max", "exchange the two")
        return self


class RollingShutter(Model):
    """Lines exposed in sequence, each for the exposure time."""

    line_time: Annotated[float, Quantity("time", least=0, most=1e3)] = key(
        "delay between the starts of successive lines", unit="us", example="15 us"
    )
    direction: Literal["down", "up", "right", "left"] = key(
        "readout direction in the displayed picture: down begins with the top row, right with "
        "the leftmost column",
        default="down",
    )


class Rolling(Model):
    """A rolling shutter."""

    rolling: RollingShutter = key("rolling shutter, line by line", example={"line_time": "15 us"})


class CaptureSchedule(Model):
    """Capture times chosen by the camera for its scene."""

    schedule: Literal["optimal"] = key("criterion of the schedule", example="optimal")
    count: Annotated[int, Whole(least=1, most=1000, example="8")] = key(
        "number of captures", example=8
    )
    max: Time = key("longest capture time", example="100 ms")


def _captures(given: Any) -> Any:
    if isinstance(given, (Mapping, CaptureSchedule)):
        return CaptureSchedule.model_validate(given)
    return rising_times(given)


def rising_times(given: Any) -> tuple[float, ...]:
    """Return a list of rising times [s]; raise all mistakes at once."""
    if not isinstance(given, (list, tuple)) or not given:
        raise ValueError(
            f"{describe(given)} is not a list of times; write for example [5 ms, 30 ms]"
        )
    latest = -math.inf

    def read(item: Any) -> float:
        nonlocal latest
        time: float = TIME.read(item)
        before, latest = latest, time
        if time <= before:
            raise ValueError("the times must rise; sort them")
        return time

    return tuple(read_items(enumerate(given), read))


def times_to_yaml(times: tuple[float, ...]) -> list[str]:
    """Return times [s] as YAML has them."""
    return [TIME.text(time) for time in times]


def _bracket(given: Any) -> tuple[float, ...]:
    if not isinstance(given, (list, tuple)) or len(given) == 1:
        raise ValueError(
            f"{describe(given)} is not a list of two or more times; write for example [10 ms, 1 ms]"
        )
    return tuple(read_items(enumerate(given), TIME.read))


class Exposure(Model):
    """Exactly one of time, auto, captures and bracket; and the gain, or the ISO speed."""

    time: MaybeTime = key("exposure time", example="30 ms", default=None)
    auto: Annotated[AutoExposure | None, mapping(AutoExposure)] = key(
        "automatic exposure", example={"max": "100 ms", "method": "white"}, default=None
    )
    gain: MaybePositive = key(
        "analog gain before the ADC, which saturates at 1 / gain of the electrons; default 1",
        example=1,
        default=None,
    )
    iso: MaybePositive = key(
        "ISO speed (ISO 12232, saturation-based) in place of gain, which is iso / base_iso",
        example=800,
        default=None,
    )
    compensation: Annotated[float, Quantity("exposure_value", least=-20, most=20)] = key(
        "exposure compensation of auto: the level is brought to target x 2^compensation",
        example="0 EV",
        default=0.0,
    )
    shutter: Annotated[Literal["global"] | Rolling, word_or(Rolling, {"global": "global"})] = key(
        "global: all pixels are exposed at once; or {rolling: {line_time: 15 us, direction: "
        "down}}: line by line",
        default="global",
    )
    start: Annotated[float, Quantity("time", least=0, most=1e9)] = key(
        "start of the exposure, for flicker and motion",
        unit="ms",
        example="0 s",
        default=0.0,
    )
    reference: Annotated[float | None, Quantity("time", least=0, most=1e9)] = key(
        "time at which moving objects are at the position in the file; default the middle of "
        "the exposure of the array's center, for an exposure that starts at 0 s",
        unit="ms",
        example="5 ms",
        default=None,
    )
    captures: Annotated[
        tuple[float, ...] | CaptureSchedule | None,
        Either(
            _captures,
            list[Annotated[float, TIME]] | CaptureSchedule,
            yaml_form=lambda v: times_to_yaml(v) if isinstance(v, tuple) else to_yaml(v),
        ),
    ] = key(
        "non-destructive samples of one integration, rising; or {schedule: optimal, count, max}",
        unit="ms",
        example=["5 ms", "15 ms", "30 ms", "200 ms"],
        default=None,
    )
    bracket: Annotated[
        tuple[float, ...],
        Either(_bracket, list[Annotated[float, TIME]], yaml_form=lambda v: times_to_yaml(v)),
    ] = key(
        "consecutive exposures without a pause, with independent noise; merged to hdr.exr, "
        "raw.exr is the longest",
        unit="ms",
        example=["10 ms", "1 ms", "0.1 ms"],
        default=(),
    )
    merge: Literal["snr", "switch"] = key(
        "merging of bracketed exposures: by inverse variance of the unsaturated ones, or the "
        "longest unsaturated one",
        default="snr",
    )
    estimator: Literal["lsbs", "weighted"] = key(
        "estimator of the picture from its captures: the last sample before saturation, or the "
        "optimal weighted mean",
        default="lsbs",
    )

    rules = (
        exactly_one(
            *("time", "auto", "captures", "bracket"),
            of="the exposure",
            remedy="write for example time: 30 ms",
        ),
        at_most_one("gain", "iso"),
    )

    @model_validator(mode="after")
    def _check_automatic(self) -> Self:
        if self.merge == "switch" and not self.bracket:
            message = "needs several exposures; this camera has one"
            raise refusal(("merge",), message, "add bracket: [10 ms, 1 ms], or remove merge")
        if self.auto is None and self.compensation:
            message = "only an automatic exposure is compensated"
            raise refusal(("compensation",), message, "change the time, or write auto in its place")
        limit = (
            self.auto.max_gain if self.auto and "max_gain" in self.auto.model_fields_set else None
        )
        if limit is not None and self.gain is not None and limit < self.gain:
            message = f"is less than the gain of {self.gain:g} that it starts from"
            raise refusal(("auto", "max_gain"), message, "raise it, or lower gain")
        return self

    def exposures(self) -> tuple["Exposure", ...]:
        """Return the exposures of a bracket in the order of time; () without a bracket."""
        begins = accumulate(self.bracket, initial=self.start)
        return tuple(
            self.single(time).with_derived(start=begin)
            for time, begin in zip(self.bracket, begins, strict=False)
        )

    @property
    def samples(self) -> tuple[float, ...]:
        """Times that the file gives for samples of one integration [s]; () where it gives none."""
        return self.captures if isinstance(self.captures, tuple) else ()

    @property
    def has_samples(self) -> bool:
        """Whether a frame is several samples of an integration, or several exposures."""
        return bool(self.captures or self.bracket)

    @property
    def schedule(self) -> CaptureSchedule | None:
        """How the camera is to choose the times of its samples; None where it does not."""
        return self.captures if isinstance(self.captures, CaptureSchedule) else None

    @property
    def rolling(self) -> RollingShutter | None:
        """The rolling shutter; None where all pixels are exposed together."""
        return self.shutter.rolling if isinstance(self.shutter, Rolling) else None

    @property
    def count(self) -> int:
        """Most samples of one integration; 0 where there is a single exposure."""
        return self.schedule.count if self.schedule else len(self.samples)

    @property
    def longest(self) -> float | None:
        """Longest time that the file allows an exposure or a sample [s]; None with `auto`."""
        if self.schedule:
            return self.schedule.max
        if self.bracket:
            return max(self.bracket)
        return self.samples[-1] if self.samples else self.time

    @property
    def longest_allowed(self) -> float:
        """Longest time of an exposure or a sample, that of an automatic exposure included [s]."""
        longest = self.auto.max if self.auto is not None else self.longest
        assert longest is not None
        return longest

    @property
    def is_timed_by_scene(self) -> bool:
        """Whether the camera chooses times for its scene."""
        return self.auto is not None or self.schedule is not None

    def single(self, time: float, gain: float | None = None) -> "Exposure":
        """Return one exposure of that time [s] in place of whatever the file says.

        Its gain is the file's where none is given.
        """
        fixed = {
            **{"auto": None, "captures": None, "bracket": (), "merge": "snr"},
            **{"compensation": 0.0, "time": time},
        }
        return self.model_copy(
            update=fixed if gain is None else {**fixed, "gain": gain, "iso": None}
        )
