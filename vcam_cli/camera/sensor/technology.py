"""A process technology: what a pixel takes from it where the camera file says nothing.

Files of `configs/technologies`, and `pixel.technology`. Every key may be overridden in a camera;
an override is a number of the process as it is used, after its scaling (see `process`).
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from vcam_cli.config.model import Model, at_most_one, key
from vcam_cli.config.quantities import Number, Quantity
from vcam_cli.config.validation_messages import describe
from vcam_cli.config.values import (
    Choice,
    Either,
    Length,
    MaybeFraction,
    MaybeGap,
    MaybeLength,
    MaybeSiliconTemperature,
    MaybeTime,
    Text,
    Word,
    mapping,
)
from vcam_cli.config.yaml_type import to_yaml

_Voltage = Annotated[float | None, Quantity("voltage", above=0)]
_Concentration = Annotated[float | None, Quantity("concentration", above=0)]
_Diffusivity = Annotated[float | None, Quantity("diffusivity", above=0)]
_Exponent = Annotated[float | None, Number(least=-10, most=10, example="1")]


class Thresholds(Model):
    """Thresholds that set the swing: (supply - reset - gate-source) - (bias - bias gate)."""

    reset: _Voltage = key("threshold of the reset transistor", example="0.8 V", default=None)
    bias: _Voltage = key("bias voltage", example="0.9 V", default=None)
    follower_gate_source: _Voltage = key(
        "gate-source voltage of the follower", example="0.9 V", default=None
    )
    bias_gate: _Voltage = key("threshold of the bias transistor", example="0.6 V", default=None)


class Junction(Model):
    """The photodiode's junction; in a camera, overrides of the technology's."""

    depth: MaybeLength = key("depth of the junction", example="0.2 um", default=None)
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
        "depth of the quasi-neutral region that collects", example="5 um", default=None
    )
    diffusion_length: MaybeLength = key(
        "of electrons in the substrate", example="20 um", default=None
    )
    donors: _Concentration = key("donor concentration", example="1e17 1/cm3", default=None)
    acceptors: _Concentration = key("acceptor concentration", example="1e15 1/cm3", default=None)
    hole_lifetime: MaybeTime = key("of holes", example="1 us", default=None)
    electron_lifetime: MaybeTime = key("of electrons", example="1 us", default=None)
    hole_diffusivity: _Diffusivity = key("of holes", example="12 cm2/s", default=None)
    electron_diffusivity: _Diffusivity = key("of electrons", example="36 cm2/s", default=None)
    tunneling: Annotated[str | None, Choice("none", "traps")] = key(
        "traps: field-enhanced generation in diffusions and wells, for `dark_current: junction`"
        " (Hurkx 1992)",
        example="none",
        default=None,
    )


class Well(Model):
    """The n-well, which replaces the n-diffusion in a photodetector nwell-psub."""

    depth: MaybeLength = key(
        "depth of its junction with the substrate", example="1.5 um", default=None
    )
    donors: _Concentration = key("donor concentration", example="1e17 1/cm3", default=None)
    acceptors: _Concentration = key(
        "acceptor concentration of the substrate that it lies in",
        example="1.6e15 1/cm3",
        default=None,
    )


class Pinned(Model):
    """The implants of a pinned photodiode."""

    surface: MaybeLength = key("depth of the p+ surface layer", example="0.1 um", default=None)
    surface_acceptors: _Concentration = key(
        "acceptor concentration of the surface layer", example="1e18 1/cm3", default=None
    )
    layer: MaybeLength = key("thickness of the n layer below it", example="0.25 um", default=None)
    donors: _Concentration = key(
        "donor concentration of the n layer", example="5e16 1/cm3", default=None
    )
    acceptors: _Concentration = key(
        "acceptor concentration of the substrate", example="1.6e15 1/cm3", default=None
    )


class Gate(Model):
    """The polysilicon gate of a photogate, which transmits the light."""

    thickness: MaybeGap = key("of the film", example="0.25 um", default=None)


class JunctionCapacitance(Model):
    """Capacitance of the photodiode's junction at zero bias."""

    area: Annotated[float | None, Quantity("capacitance_per_area", least=0)] = key(
        "per area", example="0.906 fF/um2", default=None
    )
    sidewall: Annotated[float | None, Quantity("capacitance_per_length", least=0)] = key(
        "per length of perimeter", example="0.297 fF/um", default=None
    )
    built_in: _Voltage = key("built-in potential", example="0.8 V", default=None)
    grading: Annotated[float | None, Number(above=0, below=1, example="0.36")] = key(
        "grading coefficient", example=0.36, default=None
    )
    sidewall_built_in: _Voltage = key(
        "built-in potential of the sidewall", example="0.8 V", default=None
    )
    sidewall_grading: Annotated[float | None, Number(above=0, below=1, example="0.2")] = key(
        "grading coefficient of the sidewall", example=0.2, default=None
    )
    follower_gate: Annotated[
        float | Literal["auto"] | None, Quantity("capacitance", least=0, words={"auto": "auto"})
    ] = key(
        "of the follower's gate; auto scales with the feature size",
        unit="fF",
        example="auto",
        default=None,
    )


DOUBLING = Quantity("temperature", above=0, difference=True, words={"silicon": "silicon"})


class TechnologyDarkCurrent(Model):
    """Dark current of the photodiode."""

    area: Annotated[float | None, Quantity("current_density", least=0)] = key(
        "per area", example="10 nA/cm2", default=None
    )
    perimeter: Annotated[
        float | Literal["geometry"] | None,
        Quantity("linear_current_density", least=0, words={"geometry": "geometry"}),
    ] = key(
        "per length of perimeter; geometry: per area, times the height of the junction's wall, "
        "junction depth plus depletion width",
        unit="pA/cm",
        example="geometry",
        default=None,
    )
    temperature: MaybeSiliconTemperature = key("at which both hold", example="300 K", default=None)
    doubling: Annotated[float | Literal["silicon"] | None, DOUBLING] = key(
        "rise of temperature that doubles them, or silicon", example="8 K", default=None
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
    """Exponents of the feature-size ratio that scale the process parameters."""

    lengths: _Exponent = key(
        "depths, widths, diffusion length, capacitance of the follower's gate; default 1",
        example=1.0,
        default=None,
    )
    voltages: _Exponent = key("supply, thresholds, swing; default 1", example=1.0, default=None)
    concentrations: _Exponent = key(
        "of donors and acceptors; default -1", example=-1.0, default=None
    )
    capacitance_area: _Exponent = key(
        "capacitance per area; default -1", example=-1.0, default=None
    )
    capacitance_sidewall: _Exponent = key(
        "capacitance per length; default 0", example=0.0, default=None
    )
    dark_current_area: _Exponent = key(
        "dark current per area; default 0", example=0.0, default=None
    )
    dark_current_perimeter: _Exponent = key(
        "dark current per length; default 0", example=0.0, default=None
    )


class Numbers(Model):
    """The numbers of a process; shared by technology files and overrides in a camera."""

    supply: _Voltage = key("supply voltage", example="3.3 V", default=None)
    voltage_swing: _Voltage = key(
        "at the photodetector; or thresholds", example="1.38 V", default=None
    )
    reset_voltage: _Voltage = key(
        "to which the photodetector is reset; or thresholds", example="2.5 V", default=None
    )
    thresholds: Annotated[Thresholds | None, mapping(Thresholds)] = key(
        "from which swing and reset voltage follow",
        example={
            "reset": "0.8 V",
            "bias": "0.9 V",
            "follower_gate_source": "0.9 V",
            "bias_gate": "0.6 V",
        },
        default=None,
    )
    junction: Junction = key(
        "the photodiode's junction", example={"depth": "0.2 um"}, default=Junction.model_construct
    )
    well: Well = key(
        "depth and doping of a photodetector nwell-psub",
        example={"depth": "1.5 um", "donors": "1e17 1/cm3", "acceptors": "1.6e15 1/cm3"},
        default=Well.model_construct,
    )
    pinned: Pinned = key(
        "implants of a pinned photodetector",
        example={"layer": "0.25 um"},
        default=Pinned.model_construct,
    )
    gate: Gate = key(
        "of a photogate", example={"thickness": "0.25 um"}, default=Gate.model_construct
    )
    capacitance: JunctionCapacitance = key(
        "junction capacitance at zero bias",
        example={"area": "0.906 fF/um2", "sidewall": "0.297 fF/um"},
        default=JunctionCapacitance.model_construct,
    )
    dark_current: TechnologyDarkCurrent = key(
        "dark current of the photodiode",
        example={"area": "10 nA/cm2", "perimeter": "geometry"},
        default=TechnologyDarkCurrent.model_construct,
    )
    quantum_efficiency_scale: MaybeFraction = key(
        "reflection and stack; 1 when the camera gives a stack", example=0.75, default=None
    )
    layout: Layout = key(
        "photodetector layout within the pixel",
        example={"border": 5.017, "transistors": 91.1},
        default=Layout.model_construct,
    )
    scaling: Scaling = key(
        "scaling of parameters with the feature size",
        example={"dark_current_perimeter": 0},
        default=Scaling.model_construct,
    )

    rules = (at_most_one("voltage_swing", "thresholds"), at_most_one("reset_voltage", "thresholds"))


class Technology(Numbers):
    """A technology file."""

    name: Word = key("name of the technology", example="cmos-0.35um")
    feature_size: Length = key("smallest feature", example="0.35 um")
    source: Text = key(
        "where each number comes from", example="MOSIS run T69H; layout of ...", default=""
    )


def _source(given: Any) -> Technology | str:
    if isinstance(given, (Mapping, Technology)):
        return Technology.model_validate(given)
    if isinstance(given, str) and given:
        return given
    raise ValueError(f"{describe(given)} is not a technology; write for example cmos-0.35um")


class TechnologyChoice(Numbers):
    """The technology of a camera's pixel, with changes."""

    from_: Annotated[Technology | str, Either(_source, str | Technology)] = key(
        "name or path of a technology file; in run.json its content",
        example="cmos-0.35um",
        alias="from",
    )
    feature_size: MaybeLength = key(
        "scales the technology to this feature size", example="0.13 um", default=None
    )

    def to_yaml(self) -> Any:
        """Return the YAML form: the bare name where nothing is changed."""
        changes = _drop_empty(to_yaml(self))
        bare = set(changes) == {"from"} and isinstance(self.from_, str)
        return self.from_ if bare else changes


def _drop_empty(form: Any) -> Any:
    if not isinstance(form, Mapping):
        return form
    full = {name: _drop_empty(item) for name, item in form.items()}
    return {name: item for name, item in full.items() if item != {}}


def _choice(given: Any) -> TechnologyChoice:
    if isinstance(given, (Mapping, TechnologyChoice)):
        return TechnologyChoice.model_validate(given)
    return TechnologyChoice.model_validate({"from": _source(given)})


CHOICE = Either(_choice, str | TechnologyChoice, yaml_form=TechnologyChoice.to_yaml)
"""The type of `pixel.technology`."""
