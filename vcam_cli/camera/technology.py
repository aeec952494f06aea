"""A process technology: what a pixel takes from it where the camera file says nothing.

Files of `configs/technologies`, and `pixel.technology`. Every key may be overridden in a camera.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from vcam_cli.camera.base import Model, at_most_one, key
from vcam_cli.camera.explain import shown
from vcam_cli.camera.values import (
    Either,
    Length,
    MaybeLength,
    MaybeTime,
    Number,
    Quantity,
    Text,
    Word,
    mapping,
    written,
)

_VOLTAGE = Quantity("voltage", above=0)
_CONCENTRATION = Quantity("concentration", above=0)
_DIFFUSIVITY = Quantity("diffusivity", above=0)
_EXPONENT = Number(example="1")


class Thresholds(Model):
    """Voltages that make the swing: (supply - reset - gate-source) - (bias - bias gate)."""

    reset: Annotated[float, _VOLTAGE] = key(
        "threshold of the reset transistor", unit="V", example="0.8 V"
    )
    bias: Annotated[float, _VOLTAGE] = key("bias voltage", unit="V", example="0.9 V")
    follower_gate_source: Annotated[float, _VOLTAGE] = key(
        "gate-source voltage of the follower", unit="V", example="0.9 V"
    )
    bias_gate: Annotated[float, _VOLTAGE] = key(
        "threshold of the bias transistor", unit="V", example="0.6 V"
    )


class Junction(Model):
    """The photodiode's junction; in a camera, overrides of the technology's."""

    depth: MaybeLength = key("depth of the junction", unit="um", example="0.2 um", default=None)
    depletion_width: Annotated[
        float | Literal["from-capacitance"] | None,
        Quantity("length", above=0, words={"from-capacitance": "from-capacitance"}),
    ] = key(
        "width of the depletion region, or from-capacitance",
        unit="um",
        example="from-capacitance",
        default=None,
    )
    substrate_depth: MaybeLength = key(
        "depth of the quasi-neutral region that collects", unit="um", example="5 um", default=None
    )
    diffusion_length: MaybeLength = key(
        "of electrons in the substrate", unit="um", example="20 um", default=None
    )
    donors: Annotated[float | None, _CONCENTRATION] = key(
        "donor concentration", unit="1/cm3", example="1e17 1/cm3", default=None
    )
    acceptors: Annotated[float | None, _CONCENTRATION] = key(
        "acceptor concentration", unit="1/cm3", example="1e15 1/cm3", default=None
    )
    hole_lifetime: MaybeTime = key("of holes", unit="us", example="1 us", default=None)
    electron_lifetime: MaybeTime = key("of electrons", unit="us", example="1 us", default=None)
    hole_diffusivity: Annotated[float | None, _DIFFUSIVITY] = key(
        "of holes", unit="cm2/s", example="12 cm2/s", default=None
    )
    electron_diffusivity: Annotated[float | None, _DIFFUSIVITY] = key(
        "of electrons", unit="cm2/s", example="36 cm2/s", default=None
    )


class JunctionCapacitance(Model):
    """Capacitance of the photodiode's junction at zero bias."""

    area: Annotated[float | None, Quantity("capacitance_per_area", least=0)] = key(
        "per area", unit="fF/um2", example="0.906 fF/um2", default=None
    )
    sidewall: Annotated[float | None, Quantity("capacitance_per_length", least=0)] = key(
        "per length of perimeter", unit="fF/um", example="0.297 fF/um", default=None
    )
    built_in: Annotated[float | None, _VOLTAGE] = key(
        "built-in potential", unit="V", example="0.8 V", default=None
    )
    grading: Annotated[float | None, Number(above=0, below=1, example="0.36")] = key(
        "grading coefficient", example=0.36, default=None
    )
    sidewall_built_in: Annotated[float | None, _VOLTAGE] = key(
        "built-in potential of the sidewall", unit="V", example="0.8 V", default=None
    )
    sidewall_grading: Annotated[float | None, Number(above=0, below=1, example="0.2")] = key(
        "grading coefficient of the sidewall", example=0.2, default=None
    )
    follower_gate: Annotated[
        float | Literal["auto"] | None,
        Quantity("capacitance", least=0, words={"auto": "auto"}),
    ] = key(
        "of the follower's gate; auto scales with the feature size",
        unit="fF",
        example="auto",
        default=None,
    )


class TechnologyDarkCurrent(Model):
    """Dark current of the photodiode."""

    area: Annotated[float | None, Quantity("current_density", least=0)] = key(
        "per area", unit="nA/cm2", example="10 nA/cm2", default=None
    )
    perimeter: Annotated[float | None, Quantity("linear_current_density", least=0)] = key(
        "per length of perimeter", unit="pA/cm", example="0.437 pA/cm", default=None
    )
    temperature: Annotated[float | None, Quantity("temperature", above=0)] = key(
        "at which both hold", unit="K", example="300 K", default=None
    )
    doubling: Annotated[float | None, Quantity("temperature", above=0, difference=True)] = key(
        "rise of temperature that doubles them", unit="K", example="8 K", default=None
    )


class Layout(Model):
    """Photodetector area = (p - border L)^2 - transistors L^2, L the feature size."""

    border: Annotated[float | None, Number(least=0, example="5.017")] = key(
        "width lost to spacing, in feature sizes", example=5.017, default=None
    )
    transistors: Annotated[float | None, Number(least=0, example="91.1")] = key(
        "area lost to transistors, in squared feature sizes", example=91.1, default=None
    )


class Scaling(Model):
    """The power of the feature-size ratio by which a number goes when the process is scaled."""

    lengths: Annotated[float | None, _EXPONENT] = key(
        "depths, widths, diffusion length", example=1.0, default=None
    )
    capacitance_area: Annotated[float | None, _EXPONENT] = key(
        "capacitance per area", example=0.0, default=None
    )
    capacitance_sidewall: Annotated[float | None, _EXPONENT] = key(
        "capacitance per length", example=0.0, default=None
    )
    dark_current_area: Annotated[float | None, _EXPONENT] = key(
        "dark current per area", example=0.0, default=None
    )
    dark_current_perimeter: Annotated[float | None, _EXPONENT] = key(
        "dark current per length", example=0.0, default=None
    )
    voltage_swing: Annotated[float | None, _EXPONENT] = key(
        "voltage swing", example=0.0, default=None
    )


class _Process(Model):
    """The numbers of a process; shared by technology files and overrides in a camera."""

    supply: Annotated[float | None, _VOLTAGE] = key(
        "supply voltage", unit="V", example="3.3 V", default=None
    )
    voltage_swing: Annotated[float | None, _VOLTAGE] = key(
        "at the photodetector; or thresholds", unit="V", example="1.38 V", default=None
    )
    thresholds: Annotated[Thresholds | None, mapping(Thresholds)] = key(
        "from which the swing follows",
        example={
            "reset": "0.8 V",
            "bias": "0.9 V",
            "follower_gate_source": "0.9 V",
            "bias_gate": "0.6 V",
        },
        default=None,
    )
    junction: Junction = key(
        "the photodiode's junction", example={"depth": "0.2 um"}, default=Junction
    )
    capacitance: JunctionCapacitance = key(
        "junction capacitance at zero bias",
        example={"area": "0.906 fF/um2", "sidewall": "0.297 fF/um"},
        default=JunctionCapacitance,
    )
    dark_current: TechnologyDarkCurrent = key(
        "dark current of the photodiode",
        example={"area": "10 nA/cm2", "perimeter": "0.437 pA/cm"},
        default=TechnologyDarkCurrent,
    )
    quantum_efficiency_scale: Annotated[float | None, Number(least=0, most=1)] = key(
        "reflection and stack; 1 when the camera gives a stack", example=0.75, default=None
    )
    layout: Layout = key(
        "what of a pixel is photodetector",
        example={"border": 5.017, "transistors": 91.1},
        default=Layout,
    )
    scaling: Scaling = key(
        "how the numbers go with the feature size",
        example={"dark_current_perimeter": 0},
        default=Scaling,
    )

    rules = (at_most_one("voltage_swing", "thresholds"),)


class Technology(_Process):
    """A technology file."""

    name: Word = key("name of the technology", example="cmos-0.35um")
    feature_size: Length = key("smallest feature", unit="um", example="0.35 um")
    source: Text = key(
        "where each number comes from", example="MOSIS run T69H; layout of ...", default=""
    )


class TechnologyChoice(_Process):
    """The technology of a camera's pixel: a name, and what is changed of it."""

    from_: Text = key("name or path of a technology file", example="cmos-0.35um", alias="from")
    feature_size: MaybeLength = key(
        "scales the technology to this feature size", unit="um", example="0.13 um", default=None
    )

    def written(self) -> Any:
        """The YAML form: the bare name where nothing is changed."""
        form = written(self)
        changes = {k: v for k, v in form.items() if v != {}}
        return changes["from"] if list(changes) == ["from"] else changes


def _choice(given: Any) -> TechnologyChoice:
    if isinstance(given, (Mapping, TechnologyChoice)):
        return TechnologyChoice.model_validate(given)
    if isinstance(given, str) and given:
        return TechnologyChoice.model_validate({"from": given})
    raise ValueError(f"{shown(given)} is not a technology; write for example cmos-0.35um")


CHOICE = Either(
    _choice,
    str | TechnologyChoice,
    write=lambda value: None if value is None else value.written(),
)
"""The type of `pixel.technology`."""
