"""The models of the camera file: keys, defaults, what is refused, writing without loss."""

import json
import math
from inspect import isabstract
from typing import Annotated

import pytest
from camera_trees import REQUIRED, camera, changed, mistakes
from every import every
from hypothesis import given
from hypothesis import strategies as st
from making import GONE
from pydantic import TypeAdapter, ValidationError

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.dark_current import dark_rate
from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.processing import Step
from vcam_cli.camera.quality import METRICS
from vcam_cli.camera.scene.sources import CHARTS
from vcam_cli.camera.sensor.photodetector import Photodetector
from vcam_cli.camera.sensor.pixel import Readout
from vcam_cli.camera.sensor.technology import Technology
from vcam_cli.camera.simulation import EFFECTS
from vcam_cli.config.model import Model
from vcam_cli.config.quantities import Quantity
from vcam_cli.units import DIMENSIONS


def test_defaults_that_are_not_validated_are_valid():
    fields = [field for model in models() for field in model.model_fields.values()]
    made = [f.default_factory for f in fields if "model_construct" in repr(f.default_factory)]
    assert len(made) > 10
    for construct in made:
        given, valid = construct(), construct.__self__()
        assert given.__dict__ == valid.__dict__
        assert given == valid


def models() -> list[type[Model]]:
    """Every model of a camera or technology file."""
    found, queue = [], [Model]
    while queue:
        children = queue.pop().__subclasses__()
        queue += children
        found += children
    return found


KEYS = [(model, name) for model in models() for name in model.model_fields]


class TestEveryKey:
    """Keys feed the JSON Schema and the messages, so each must say what it is."""

    def test_all_sections_are_seen(self):
        assert {"Camera", "Technology", "Scene", "Csf", "Readout"} <= {m.__name__ for m in models()}
        assert len(KEYS) > 150

    def test_has_a_description_a_unit_and_an_example(self):
        def check(model, name):
            field = model.model_fields[name]
            assert field.description
            assert len(field.description) > 1
            assert field.examples
            assert isinstance(field.json_schema_extra, dict)
            assert "unit" in field.json_schema_extra

        every(KEYS, check)

    def test_has_the_unit_of_its_quantity(self):
        def check(model, name):
            field = model.model_fields[name]
            unit = field.json_schema_extra["unit"]
            for mark in field.metadata:
                if isinstance(mark, Quantity):
                    assert unit in DIMENSIONS[mark.dimension].units

        every(KEYS, check)

    def test_takes_its_own_example(self):
        def check(model, name):
            field = model.model_fields[name]
            if issubclass(model, CameraModel) and field.is_required():
                return  # a section; its example is abridged
            if name == "photodetector":
                return
            annotated = field.annotation
            for mark in field.metadata:
                annotated = Annotated[annotated, mark]
            TypeAdapter(annotated).validate_python(field.examples[0])

        every(KEYS, check)


class TestRequired:
    def test_the_required_keys_are_enough(self):
        assert Camera.model_validate(REQUIRED).pixel.width == 6.5e-6

    @pytest.mark.parametrize(
        "path",
        [
            "scene",
            "optics",
            "pixel",
            "array",
            "exposure",
            "scene.source",
            "scene.luminance",
            "optics.f_number",
            "optics.focal_length",
            "pixel.width",
            "pixel.photodetector",
            "pixel.photodetector.fill_factor",
            "pixel.photodetector.quantum_efficiency",
            "pixel.readout.full_well",  # adc.gain may stand for the other: test_electrical.py
            "array.rows",
            "array.columns",
            "exposure.time",
        ],
    )
    def test_each_is_missed(self, path):
        (mistake,) = mistakes({path: GONE})
        assert mistake.startswith(path.rpartition(".")[0])
        assert "missing" in mistake or "not determined" in mistake

    @pytest.mark.parametrize(
        "changes",
        [
            {"pixel.readout.conversion_gain": GONE, "pixel.photodetector.capacitance": "8 fF"},
            {"pixel.readout.full_well": GONE, "pixel.readout.voltage_swing": "1 V"},
            {"optics.f_number": GONE, "optics.aperture_diameter": "1 mm"},
            {"optics.focal_length": GONE, "optics.field_of_view": "46 deg"},
            {"array": {"die": {"width": "2.7 mm", "height": "2.7 mm"}}},
            {"exposure": {"auto": {}}},
            {"exposure": {"captures": ["5 ms", "30 ms"]}},
            {
                "pixel": {"width": "6.5 um", "technology": "cmos-0.35um", "photodetector": {}},
            },
        ],
    )
    def test_what_may_stand_for_them(self, changes):
        Camera.model_validate(changed(changes))


class TestDefaults:
    """All else has a default: none or zero where it would do something to the light."""

    @pytest.mark.parametrize(
        ("path", "value"),
        [
            ("scene.distance", 1.0),
            ("scene.extent", "sensor"),
            ("scene.wavelengths.start", 380e-9),
            ("scene.wavelengths.stop", 780e-9),
            ("scene.wavelengths.step", None),
            ("scene.illuminant.lamp", "D65"),
            ("optics.transmittance.factors", (0.95,)),
            ("optics.off_axis", "exact"),
            ("optics.diffraction", True),
            ("optics.stray_light", 0.0),
            ("optics.psf", None),
            ("pixel.architecture", "aps-3t"),
            ("pixel.height", 6.5e-6),
            ("pixel.gap_x", 0.0),
            ("pixel.temperature", 300.0),
            ("pixel.stack", None),
            ("pixel.microlens", None),
            ("pixel.photodetector.kind", "ndiff-psub"),
            ("pixel.photodetector.dark_current_density", None),
            ("pixel.photodetector.dark_current_scale", 1.0),
            ("pixel.readout.gain", 1.0),
            ("pixel.readout.read_noise", 0.0),
            ("pixel.readout.reset_noise", "none"),
            ("pixel.fpn.offset_pixel", 0.0),
            ("pixel.fpn.gain_column", 0.0),
            ("array.pattern", "bayer-rggb"),
            ("array.binning", None),
            ("exposure.estimator", "lsbs"),
            ("adc.bits", 10),
            ("adc.kind", "linear"),
            ("adc.offset", None),
            ("adc.full_scale", None),
            ("quality", ()),
            ("display.dpi", 72.0),
            ("display.viewing_distance", 18 * 0.0254),
            ("effects", "auto"),
            ("accuracy.preset", "standard"),
            ("accuracy.tolerance", 0.005),
            ("accuracy.knobs", {}),
            ("seed.sensor", 1),
            ("seed.frame", 1),
            ("output.raw", ("dn", "electrons")),
            ("output.render", 8),
            ("output.irradiance", False),
        ],
    )
    def test_is(self, path, value):
        found = Camera.model_validate(REQUIRED)
        for name in path.split("."):
            found = getattr(found, name)
        assert found == value

    def test_processing_follows_the_pattern(self):
        def steps(pattern):
            return [{s.name: s.value} for s in camera(array__pattern=pattern).processing]

        first, last = {"black_level": "subtract"}, {"gamma": "srgb"}
        color = [
            {"demosaic": "bilinear"},
            {"white_balance": "illuminant"},
            {"color_correction": "fit"},
        ]
        assert steps("monochrome") == [first, last]
        assert steps("bayer-gbrg") == [first, *color, last]

    def test_filters_follow_the_pattern(self):
        assert list(camera().array.filters) == ["R", "G", "B"]
        assert camera(array__pattern="monochrome").array.filters == {}
        given = {"Y": 0.5}
        filters = camera(array__pattern="monochrome", array__filters=given).array.filters
        assert filters["Y"].factors == (0.5,)

    def test_an_image_file_says_how_it_codes_light(self):
        source = camera(scene__source={"kind": "image", "file": "a.png"}).scene.source
        assert source.encoding == "auto"
        given = {"kind": "image", "file": "a.exr", "encoding": "srgb"}
        assert camera(scene__source=given).scene.source.encoding == "srgb"


class TestValues:
    def test_are_si(self):
        c = camera(
            scene__distance="infinity",
            pixel__photodetector__dark_current_density="1 nA/cm2",
            pixel__fpn={"offset_pixel": "2 e", "gain_pixel": "0.5 %"},
            pixel__temperature="20 degC",
            exposure__time="1/60 s",
            scene__source={"kind": "chart", "chart": "sinusoid", "frequency": "50 lp/mm"},
        )
        assert c.scene.distance == math.inf
        assert c.pixel.photodetector.dark_current_density.value == 1e-5
        assert c.pixel.fpn.gain_pixel == 0.005
        assert c.pixel.temperature == 293.15
        assert c.exposure.time == 1 / 60
        assert c.scene.source.frequency == 50e3

    def test_fpn_has_two_names(self):
        one = camera(pixel__fpn={"offset_pixel": "2 e", "gain_pixel": "1.0 %"})
        two = camera(pixel__fpn={"dsnu": "2 e", "prnu": "1 %"})
        assert one == two

    def test_a_density_at_a_temperature(self):
        given = {"value": "1 nA/cm2", "temperature": "300 K"}
        density = camera(
            pixel__photodetector__dark_current_density=given
        ).pixel.photodetector.dark_current_density
        assert (density.value, density.temperature, density.doubling) == (1e-5, 300.0, 8.0)

    def test_a_dark_current_at_a_temperature(self):
        """As data sheets print it; its YAML reads back, and a bare rate stays bare."""
        given = {"value": "12 e/s", "temperature": "300 K", "doubling": "6 K"}
        for changes, factor, written in (
            (given, 2.0, given),  # one doubling warmer
            ("12 e/s", 1.0, "12 e/s"),
        ):
            c = camera(
                pixel__photodetector__dark_current=changes,
                pixel__temperature="306 K",
            )
            assert dark_rate(c) == pytest.approx(12 * factor, rel=1e-12)
            assert c.model_dump(mode="json")["pixel"]["photodetector"]["dark_current"] == written

    def test_a_dark_current_that_follows_silicon(self):
        """0.0372 e/s at 200 K of 6241.5 e/s at 300 K (Janesick 2001, section 7.1.1)."""
        given = {"value": "6.2415 ke/s", "temperature": "300 K", "doubling": "silicon"}
        c = camera(pixel__photodetector__dark_current=given, pixel__temperature="200 K")
        assert dark_rate(c) == pytest.approx(0.0372, abs=6e-5)
        assert c.model_dump(mode="json")["pixel"]["photodetector"]["dark_current"] == given

    def test_quantum_efficiency_of_a_pixel(self):
        of_detector = camera().pixel.photodetector.quantum_efficiency
        assert not of_detector.per_pixel
        assert of_detector.given.factors == (0.5,)
        given = {"pixel": 0.2}
        of_pixel = camera(
            pixel__photodetector__quantum_efficiency=given
        ).pixel.photodetector.quantum_efficiency
        assert of_pixel.per_pixel
        assert of_pixel.given.factors == (0.2,)

    @pytest.mark.parametrize(
        ("written", "preset", "tolerance", "knobs"),
        [
            ("draft", "draft", 0.02, {}),
            ("reference", "reference", 0.0002, {}),
            ("0.1 %", None, 0.001, {}),
            (0.003, None, 0.003, {}),
            ({"oversampling": 4}, "standard", 0.005, {"oversampling": 4}),
            (
                {"preset": "draft", "wavelength_step": "5 nm", "float_width": 64},
                "draft",
                0.02,
                {"wavelength_step": 5e-9, "float_width": 64},
            ),
            ({"tolerance": 0.01, "shot_noise": "gaussian"}, None, 0.01, {"shot_noise": "gaussian"}),
        ],
    )
    def test_accuracy(self, written, preset, tolerance, knobs):
        accuracy = camera(accuracy=written).accuracy
        assert (accuracy.preset, accuracy.tolerance, accuracy.knobs) == (preset, tolerance, knobs)

    def test_effects(self):
        assert camera(effects="all").effects == "all"
        assert camera(effects={"shot_noise": "off"}).effects == {"shot_noise": "off"}
        every = dict.fromkeys(EFFECTS, "on")
        assert camera(effects=every).effects == every

    def test_black_level_may_be_bare(self):
        for written in (64, "64 DN"):
            steps = camera(processing=[{"black_level": written}]).processing
            assert (steps[0].name, steps[0].value) == ("black_level", 64.0)

    def test_models_are_frozen(self):
        c = camera()
        with pytest.raises(ValidationError):
            c.name = "other"
        with pytest.raises(ValidationError):
            c.pixel.width = 1.0


class TestRefused:
    """(path, value) -> where the mistake is said to be, and words of the message."""

    @pytest.mark.parametrize(
        ("path", "value", "where", "words"),
        [
            ("pixel.width", 6.5, "pixel.width", ["a length needs its unit", "6.5 um"]),
            ("pixel.width", "6.5 ms", "pixel.width", ["a time, not a length"]),
            ("pixel.width", "-6.5 um", "pixel.width", ["negative"]),
            ("pixel.width", "0 um", "pixel.width", ["zero"]),
            ("pixel.width", True, "pixel.width", ["true"]),
            ("pixel.width", None, "pixel.width", ["empty"]),
            ("pixel.width", math.nan, "pixel.width", ["nan"]),
            ("pixel.width", math.inf, "pixel.width", ["inf"]),
            ("pixel.width", ["6.5 um"], "pixel.width", ["a list"]),
            ("pixel.gap_x", "-1 um", "pixel.gap_x", ["negative"]),
            ("pixel.readout.read_noise", 5, "pixel.readout.read_noise", ["5 e"]),
            ("pixel.readout.gain", "2 e", "pixel.readout.gain", ["'e'"]),
            ("pixel.readout.gain", math.nan, "pixel.readout.gain", ["nan"]),
            ("optics.f_number", True, "optics.f_number", ["true is not a number"]),
            ("optics.f_number", 0, "optics.f_number", ["zero"]),
            ("optics.f_number", None, "optics.f_number", ["empty"]),
            ("optics.diffraction", "on", "optics.diffraction", ["write for example true"]),
            ("optics.diffraction", 1, "optics.diffraction", ["true or false"]),
            ("optics.off_axis", "cos5", "optics.off_axis", ["did you mean cos4?"]),
            ("optics.transmittance", 1.2, "optics.transmittance", ["at most 1"]),
            ("optics.numerical_aperture", 1.2, "optics.numerical_aperture", ["less than 1"]),
            ("optics.field_of_view", "180 deg", "optics.field_of_view", ["less than 180 deg"]),
            ("array.rows", 512.0, "array.rows", ["whole number"]),
            ("array.rows", True, "array.rows", ["whole number"]),
            ("array.rows", 0, "array.rows", ["at least 1"]),
            ("array.pattern", "bayer", "array.pattern", ["bayer-rggb"]),
            ("array.filters", {"R": 0.9}, "array.filters", ["no filter for G"]),
            ("exposure.time", "0 s", "exposure.time", ["zero"]),
            ("adc.bits", 25, "adc.bits", ["at most 24"]),
            ("adc.offset", "1023 DN", "adc.offset", ["no number for a signal"]),
            ("adc.reference", "1 mV", "adc.reference", ["linear"]),
            ("quality", "mse", "quality", ["not a list"]),
            ("quality", ["psnr", "mse", "psnr"], "quality.2", ["twice"]),
            ("effects", {"shot_noise": True}, "effects.shot_noise", ["auto, on, off"]),
            ("effects", {"shot_nois": "off"}, "effects.shot_nois", ["did you mean shot_noise?"]),
            ("effects", True, "effects", ["auto, all"]),
            ("accuracy", "standart", "accuracy", ["did you mean standard?"]),
            ("accuracy", 0, "accuracy", ["zero"]),
            ("accuracy", {"preset": None}, "accuracy.preset", ["empty"]),
            ("accuracy", {"float_width": 32.0}, "accuracy.float_width", ["32, 64"]),
            ("seed.frame", -1, "seed.frame", ["negative"]),
            ("seed.frame", 1.5, "seed.frame", ["whole number"]),
            ("output.raw", [], "output.raw", ["a list of 0"]),
            ("output.render", True, "output.render", ["8, 16, none"]),
            ("name", "a/b", "name", ["letters, digits"]),
            ("name", "..", "name", ["letters, digits"]),
            ("name", "x" * 65, "name", ["64 characters"]),
            ("name", "", "name", ["letters"]),
            ("scene.distance", "-1 m", "scene.distance", ["negative"]),
            ("scene.illuminant", "D66", "scene.illuminant", ["did you mean 'D65'?"]),
            ("scene.illuminant", {"blackbody": 5500}, "scene.illuminant.blackbody", ["K"]),
            ("scene.wavelengths", {"step": 5}, "scene.wavelengths.step", ["unit"]),
            ("scene.luminance", "from-file", "scene.luminance", ["no absolute radiance"]),
            ("scene.source", {"kind": "chart"}, "scene.source.chart", ["missing", "csf"]),
            ("scene.source.chart", "cfs", "scene.source.chart", ["did you mean csf?"]),
            ("scene.source.mean", 2, "scene.source.mean", ["at most 1"]),
            ("processing", None, "processing", ["nothing is not a list"]),
            ("processing", [{"gama": 2.2}], "processing.0.gama", ["did you mean gamma?"]),
            ("processing", [{"gamma": 0}], "processing.0.gamma", ["zero"]),
            ("pixel.technology", 3, "pixel.technology", ["cmos-0.35um"]),
        ],
    )
    def test_values(self, path, value, where, words):
        (mistake,) = mistakes({path: value})
        assert mistake.startswith(f"{where}: ")
        for word in words:
            assert word in mistake, mistake

    @pytest.mark.parametrize(
        ("changes", "where", "words"),
        [
            ({"scene.radiance": "1 W/(sr m2)"}, "scene.radiance", "luminance"),
            ({"exposure.auto": {}}, "exposure.auto", "time"),
            ({"array.die": {"width": "1 mm", "height": "1 mm"}}, "array.rows", "die"),
            ({"pixel.fpn": {"dsnu": "1 e", "offset_pixel": "1 e"}}, "pixel.fpn.dsnu", "both"),
            ({"pixel.fpn": {"prnu": "1 %", "gain_pixel": "1 %"}}, "pixel.fpn.prnu", "both"),
            (
                {
                    "pixel.photodetector.dark_current": "1 e/s",
                    "pixel.photodetector.dark_current_density": "1 nA/cm2",
                },
                "pixel.photodetector.dark_current",
                "both",
            ),
            ({"adc": {"full_scale": "1 V", "gain": "1 DN/e"}}, "adc.gain", "full_scale"),
            ({"display": {"dpi": 72, "width": "7 in"}}, "display.width", "dpi"),
            (
                {
                    "scene.source": {
                        "kind": "chart",
                        "chart": "point-grid",
                        "spacing": "10 um",
                        "diameter": "11 um",
                    }
                },
                "scene.source.diameter",
                "overlap",
            ),
            (
                {"scene.source": {"kind": "chart", "chart": "hdr-patches", "dynamic_range": 1}},
                "scene.source.dynamic_range",
                "more than 1",
            ),
            ({"accuracy": {"preset": "draft", "tolerance": 0.1}}, "accuracy.tolerance", "both"),
            ({"pixel.microlens": {"gain": 2, "efficiency": 0.9}}, "pixel.microlens.eff", "gain"),
        ],
    )
    def test_two_of_one_kind(self, changes, where, words):
        assert any(m.startswith(where) and words in m for m in mistakes(changes))

    @pytest.mark.parametrize(
        ("changes", "where"),
        [
            ({"pixel.readout.voltage_swing": "1.4 V"}, "pixel.readout.full_well"),
            (
                {"pixel.photodetector.width": "2 um", "pixel.photodetector.height": "3 um"},
                "pixel.photodetector.fill_factor",
            ),
            ({"pixel.photodetector.width": "2 um"}, "pixel.photodetector.height"),
            ({"scene.wavelengths": {"start": "700 nm", "stop": "400 nm"}}, "scene.wavelengths"),
            ({"scene.illuminant": {"monochromatic": "1 um"}}, "scene.illuminant.monochromatic"),
            (
                {
                    "scene.source": {"kind": "image", "file": "a.png", "model": "laser"},
                    "scene.illuminant": "D65",
                },
                "scene.illuminant",
            ),
            (
                {
                    "scene.source": {
                        "kind": "chart",
                        "chart": "sinusoid",
                        "frequency": "1 lp/mm",
                        "mean": 0.6,
                        "contrast": 0.7,
                    }
                },
                "scene.source.contrast",
            ),
            ({"exposure": {"auto": {"min": "1 s", "max": "10 ms"}}}, "exposure.auto.min"),
            ({"exposure": {"captures": ["2 ms", "1 ms"]}}, "exposure.captures.1"),
            (
                {"exposure": {"captures": ["1 ms", "2 ms"]}, "pixel.architecture": "aps-4t"},
                "exposure.captures",
            ),
            ({"pixel.readout.charge_transfer": {}}, "pixel.readout.charge_transfer"),
            ({"quality": ["mse"], "processing": []}, "quality"),
            ({"array.pattern": {"block": [["R"], ["G", "B"]]}}, "array.pattern.block"),
            (
                {
                    "pixel.photodetector.dark_current_density": {
                        "value": "1 nA/cm2",
                        "doubling": "8 K",
                    }
                },
                "pixel.photodetector.dark_current_density.doubling",
            ),
        ],
    )
    def test_what_does_not_fit_together(self, changes, where):
        (mistake,) = mistakes(changes)
        assert mistake.startswith(where)

    def test_numbers_that_agree_may_be_given_twice(self):
        camera(
            pixel__readout={
                "conversion_gain": "20 uV/e",
                "full_well": "69 ke",
                "voltage_swing": "1.38 V",
            }
        )
        side = math.sqrt(0.3) * 6.5
        camera(
            pixel__photodetector={
                "fill_factor": 0.3,
                "width": f"{side:.4f} um",
                "height": f"{side:.4f} um",
                "quantum_efficiency": 0.5,
            }
        )

    @pytest.mark.parametrize("pattern", ["monochrome", "bayer-bggr"])
    @pytest.mark.parametrize(
        ("steps", "allowed"),
        [
            ([], ("monochrome", "bayer-bggr")),
            (["gamma"], ("monochrome", "bayer-bggr")),
            (["black_level", "demosaic", "white_balance", "gamma"], ("bayer-bggr",)),
            (["black_level", "white_balance", "demosaic"], ("bayer-bggr",)),
            (["demosaic", "black_level"], ("bayer-bggr",)),
            (["gamma", "black_level"], ()),
            (["demosaic", "demosaic"], ()),
            (["white_balance"], ()),
            (["demosaic", "white_balance", "black_level"], ()),
            (["color_correction", "demosaic"], ()),
            (["demosaic", "color_correction"], ("bayer-bggr",)),
            (["demosaic", "gamma", "color_correction"], ()),
        ],
    )
    def test_steps_that_cannot_work_in_this_order(self, pattern, steps, allowed):
        values = {
            "black_level": "subtract",
            "demosaic": "bilinear",
            "white_balance": "gray-world",
            "color_correction": "fit",
            "gamma": 2.2,
        }
        changes = {"array.pattern": pattern, "processing": [{s: values[s]} for s in steps]}
        if pattern in allowed:
            Camera.model_validate(changed(changes))
        else:
            assert all(m.startswith("processing.") for m in mistakes(changes))

    def test_steps_that_say_none_fit_any_array(self):
        camera(array__pattern="monochrome", processing=[{"white_balance": "none"}])

    @pytest.mark.parametrize("matrix", [[[1]], [[1, 0, 0]] * 2, [[1, 0]] * 3, [[1, 0, 0]] * 4])
    def test_a_matrix_suits_the_colors(self, matrix):
        steps = [{"demosaic": "bilinear"}, {"color_correction": {"matrix": matrix}}]
        (found,) = mistakes({"processing": steps})
        assert found.startswith("processing.1.color_correction.matrix: ")
        assert "three rows" in found
        assert "3 numbers" in found

    def test_all_mistakes_at_once(self):
        found = mistakes(
            {
                "pixel.widht": "1 um",
                "pixel.width": 6.5,
                "scene.luminance": GONE,
                "optics.focal_length": GONE,
                "optics.transmittance": [0.9, {"table": {400: "x", "y": 0.5}}],
                "processing": [{"gamma": -1}, {"demosaic": "linear"}],
                "array.filters": {"R": 2, "G": 0.5, "B": {"file": 3}},
            }
        )
        paths = [mistake.split(": ")[0] for mistake in found]
        assert sorted(paths) == [
            "array.filters.B.file",
            "array.filters.R",
            "optics",
            "optics.transmittance.1.table.400",
            "optics.transmittance.1.table.y",
            "pixel.widht",
            "pixel.width",
            "processing.0.gamma",
            "processing.1.demosaic",
            "scene",
        ]


JUNK = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**300), 10**300)
    | st.floats()
    | st.sampled_from(
        ["", "auto", "none", "junction", "1 um", "1e999 um", "5 %", "D65", "\0", "\n"]
    )
    | st.text(st.characters(exclude_categories=["Cs"]), max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["kind", "file", "table", "pixel", "width", 4, 1.5]), inner
        )
    ),
    max_leaves=4,
)
PATHS = sorted(
    {"name", "processing", "quality", "effects", "accuracy", "optics.zernike", "scene.source.kind"}
    | {
        f"{section}.{key}"
        for section in ("scene", "optics", "pixel", "array", "exposure", "adc", "output", "seed")
        for key in Camera.model_fields[section].annotation.model_fields
    }
    | {f"pixel.photodetector.{key}" for key in Photodetector.model_fields}
    | {f"pixel.readout.{key}" for key in Readout.model_fields}
)


@given(st.dictionaries(st.sampled_from(PATHS), JUNK, min_size=1, max_size=4))
def test_nothing_that_can_be_written_is_a_bug(changes):
    """Whatever stands in the file: a camera that can be written again, or mistakes with paths."""
    try:
        tree = changed(dict(sorted(changes.items(), reverse=True)))
    except TypeError:  # junk below junk
        return
    try:
        Camera.model_validate(tree)
    except ValidationError as error:
        assert all(item["type"] == "vcam" for item in error.errors())
    else:
        same_again(tree)


class TestWritten:
    """What is written (run.json) is a camera file that means the same."""

    def test_units_are_in_it(self):
        written = camera().model_dump(mode="json")
        assert written["pixel"]["width"] == "6.5 um"
        assert written["scene"]["distance"] == "1 m"
        assert written["scene"]["wavelengths"]["step"] == "auto"
        assert written["accuracy"] == "standard"
        assert "radiance" not in written["scene"]
        assert camera(scene__distance="infinity").model_dump(mode="json")["scene"]["distance"] == (
            "infinity"
        )

    @pytest.mark.parametrize(
        "changes",
        [
            {"scene.illuminant": {"blackbody": "3200 K"}},
            {"scene.illuminant": {"file": "/lamp.csv", "outside": "zero"}},
            {"scene.extent": {"width": "0.5 m"}, "scene.wavelengths.step": "5 nm"},
            {"scene.source": {"kind": "image", "file": "/a.png", "model": "laser"}},
            {"optics.transmittance": [0.95, "ir-cut-650", {"table": {400: 0.1, 650.5: 1}}]},
            {"optics.zernike": {4: "0.05 um", 8: "-0.1 um"}, "optics.defocus": "-3 um"},
            {"optics.zernike": [{"field": 0, 4: "0 um"}, {"field": 1, 8: "0.1 um"}]},
            {"optics.psf": {"file": "/p.exr", "pitch": "0.5 um", "wavelengths": ["450 nm"]}},
            {"optics.off_axis": {"file": "/r.csv"}, "optics.exit_pupil_distance": "5 mm"},
            {"pixel.photodetector.quantum_efficiency": {"pixel": [0.5, 0.5]}},
            {"pixel.photodetector.quantum_efficiency": "junction"},
            {
                "pixel.photodetector.dark_current_density": {
                    "value": "1 nA/cm2",
                    "temperature": "9 K",
                }
            },
            {
                "pixel.photodetector.capacitance": "junction",
                "pixel.photodetector.junction": {"depth": "1 um"},
            },
            {"pixel.photodetector.charge_diffusion": "junction"},
            {"pixel.technology": "cmos-0.35um"},
            {"pixel.technology": {"from": "x", "feature_size": "0.13 um", "layout": {"border": 5}}},
            {
                "pixel.stack": {
                    "passivation": {"thickness": "1 um", "index": 2},
                    "oxide": {"thickness": "6 um", "index": 1.46},
                }
            },
            {"pixel.microlens": {"gain": 1.8}, "pixel.fpn": {"dsnu": "1 e", "prnu": "1 %"}},
            {"pixel.architecture": "ccd", "pixel.readout.charge_transfer": {"inefficiency": 1e-5}},
            {"pixel.readout.reset_noise": "12 e", "array.binning": {"rows": 2, "columns": 2}},
            {"array.pattern": {"block": [["R", "G"], ["G", "B"]]}},
            {"array": {"pattern": {"positions": "/p.csv"}}},
            {"array.pattern": "stacked"},
            {"exposure": {"auto": {"method": "percentile", "percentile": 50}}},
            {"exposure": {"captures": ["5 ms", "15 ms"], "estimator": "weighted"}},
            {"exposure": {"captures": {"schedule": "optimal", "count": 8, "max": "100 ms"}}},
            {"adc": {"kind": "logarithmic", "reference": "1 mV", "full_scale": "1 V"}},
            {"adc": {"gain": "0.25 DN/e", "offset": "64 DN"}},
            {"processing": []},
            {
                "processing": [
                    {"black_level": "64 DN"},
                    {"demosaic": "edge-aware"},
                    {"color_correction": {"matrix": [[1.5, -0.5, 0], [0, 1, 0], [0, 0, 1]]}},
                    {"gamma": 2.2},
                ]
            },
            {"quality": ["mse", "s-cielab"], "display.width": "7.11 in"},
            {"effects": {"shot_noise": "off", "fpn": "auto"}},
            {"accuracy": {"preset": "draft", "wavelength_step": "5 nm"}},
            {
                "accuracy": "0.1 %",
                "output": {"raw": ["volts"], "render": "none", "irradiance": True},
            },
            *[
                {"scene.source": {"kind": "chart", "chart": c}}
                for c in CHARTS
                if c not in ("csf", "sinusoid", "point-grid")
            ],
        ],
        ids=lambda changes: " ".join(changes),
    )
    def test_loads_again_to_an_equal_camera(self, changes):
        same_again(changed(changes))

    @given(st.data())
    def test_loses_no_digit(self, data):
        """Random values for keys of every dimension: the SI numbers come back bit for bit."""
        draw = data.draw
        positive = st.floats(1e-3, 1e3)
        units = {
            "scene.distance": ["m", "in", "km"],
            "scene.luminance": ["cd/m2", "kcd/m2"],
            "exposure.time": ["s", "ms", "us"],
            "pixel.readout.conversion_gain": ["uV/e", "mV/e"],
            "pixel.readout.full_well": ["e", "ke"],
            "pixel.photodetector.dark_current_density": ["nA/cm2", "A/m2"],
            "pixel.photodetector.capacitance": ["fF", "pF"],
            "display.viewing_distance": ["in", "cm"],
            "optics.focal_length": ["mm", "m"],
            "pixel.technology.dark_current.perimeter": ["pA/cm", "nA/m"],
            "pixel.technology.junction.donors": ["1/cm3", "1/m3"],
            "pixel.technology.capacitance.area": ["fF/um2"],
        }
        changes = {
            path: f"{draw(positive)!r} {draw(st.sampled_from(u))}" for path, u in units.items()
        }
        changes["pixel.technology.from"] = "x"
        changes["pixel.width"] = draw(st.floats(1, 1e6).map("{!r} nm".format))
        changes["pixel.temperature"] = draw(st.floats(4, 1e3).map("{!r} K".format))
        changes["optics.f_number"] = draw(st.floats(0.5, 1e3))
        efficiency = st.just(0.0) | st.floats(1e-9, 1)  # less is refused as too small
        changes["pixel.photodetector.quantum_efficiency"] = draw(efficiency)
        phase = f"{draw(st.floats(-360, 360))!r} deg"
        source = {"kind": "chart", "chart": "csf", "max_frequency": "33 lp/mm", "phase": phase}
        same_again(changed(changes | {"scene.source": source}))

    def test_technology_too(self):
        given = {
            "name": "cmos-0.35um",
            "feature_size": "0.35 um",
            "supply": "3.3 V",
            "voltage_swing": "1.38 V",
            "junction": {"depth": "0.2 um", "depletion_width": "from-capacitance"},
            "capacitance": {"area": "0.906 fF/um2", "follower_gate": "auto"},
            "dark_current": {"area": "10 nA/cm2", "perimeter": "0.437 pA/cm", "doubling": "8 K"},
            "layout": {"border": 5.017, "transistors": 91.1},
        }
        technology = Technology.model_validate(given)
        written = json.loads(json.dumps(technology.model_dump(mode="json")))
        assert Technology.model_validate(written) == technology


def same_again(tree):
    first = Camera.model_validate(tree)
    written = json.loads(json.dumps(first.model_dump(mode="json"), allow_nan=False))
    second = Camera.model_validate(written)
    assert second == first
    assert second.model_dump(mode="json") == first.model_dump(mode="json")


class TestOrigin:
    class Origin:
        file = "camera.yaml"

        def locate(self, path):
            return f"camera.yaml:{len(path)}"

    def test_of_a_camera_made_in_memory(self):
        c = camera()
        assert c.origin is None
        assert c.locate(("pixel",)) == ""

    def test_is_kept_and_changes_nothing(self):
        c = camera()
        loaded = c.with_origin(self.Origin())
        assert loaded.locate(("pixel", "width")) == "camera.yaml:2"
        assert loaded.origin == "camera.yaml"
        assert loaded == c
        assert c.origin is None


def test_steps_have_one_key_each():
    own = [step for step in Step.__subclasses__() if not isabstract(step)]
    assert all(len(step.model_fields) == 1 for step in own)


def test_metrics_of_the_contract():
    assert METRICS == ("mse", "psnr", "cielab", "s-cielab")
