"""The JSON Schemas: valid, up to date, and of one mind with the models where they can be."""

import json
from pathlib import Path

import jsonschema
import pytest
from camera_trees import REQUIRED, changed

from vcam_cli.commands import schemas
from vcam_cli.config import schema, shipped
from vcam_cli.config.yaml_reader import read_file
from vcam_cli.spectra import illuminant_names
from vcam_cli.units import DIMENSIONS, parse

CHECKED_IN = Path(__file__).parents[2] / "schemas"
SCHEMAS = {file.name: json.loads(file.read_text("utf-8")) for file in CHECKED_IN.glob("*.json")}
"""As they are checked in: a test compares them with the models'."""
CAMERA = jsonschema.Draft202012Validator(SCHEMAS["camera.schema.json"])
SECTIONS = {"scenes": "Scene", "optics": "Optics", "pixels": "Pixel", "arrays": "Array"}


def plain(file: Path):
    """A YAML file as JSON has it: all keys are text."""
    return json.loads(json.dumps(read_file(file).plain()))


def part(name: str) -> jsonschema.Draft202012Validator:
    """The validator of one definition."""
    root = SCHEMAS["camera.schema.json"]
    return jsonschema.Draft202012Validator(
        {"$ref": f"#/$defs/{name}", "$defs": root["$defs"], "$schema": root["$schema"]}
    )


def test_all_are_schemas():
    """Definitions that several files share are checked once."""
    definitions = {}
    for name, root in SCHEMAS.items():
        assert root["$schema"] == "https://json-schema.org/draft/2020-12/schema"
        jsonschema.Draft202012Validator.check_schema({**root, "$defs": {}})
        for key, definition in root["$defs"].items():
            definitions[json.dumps(definition)] = f"{name} {key}", definition
    jsonschema.Draft202012Validator.check_schema({"$defs": dict(definitions.values())})


def test_the_copies_in_the_repository_are_up_to_date():
    made = {name: schema.text(of_models) for name, of_models in schemas.schemas().items()}
    written = {file.name: file.read_text("utf-8") for file in CHECKED_IN.glob("*.json")}
    assert written.keys() == made.keys()
    assert not [name for name, text in made.items() if written[name] != text], "make schemas"


def test_shipped_cameras_are_valid():
    refused = {
        file.name: error.message
        for file in shipped.files("cameras").values()
        for error in CAMERA.iter_errors(plain(file))
    }
    assert not refused


def test_shipped_parts_are_valid():
    refused = {}
    for kind, section in SECTIONS.items():
        for file in shipped.files(kind).values():
            tree = plain(file)
            loose = "extends" in tree or "use" in tree
            own = part(section + (schema.OVERRIDES if loose else ""))
            refused |= {f"{kind}/{file.name}": e.message for e in own.iter_errors(tree)}
    assert not refused


@pytest.mark.parametrize("kind", SECTIONS)
def test_part_files_have_a_schema_of_their_own(kind):
    section = SECTIONS[kind].lower()
    own = jsonschema.Draft202012Validator(SCHEMAS[f"{section}.schema.json"])
    for file in shipped.files(kind).values():
        own.validate(plain(file))
        assert f"$schema=../../schemas/{section}.schema.json" in file.read_text().splitlines()[0]
    required = "required" in SCHEMAS[f"{section}.schema.json"]["$defs"][SECTIONS[kind]]
    assert own.is_valid({}) != required
    assert not own.is_valid({"no_such_key": 1})
    assert own.is_valid({"extends": "other.yaml"})
    assert not own.is_valid({"extends": "other.yaml", "no_such_key": 1})


def test_shipped_technologies_are_valid():
    for file in shipped.files("technologies").values():
        jsonschema.Draft202012Validator(SCHEMAS["technology.schema.json"]).validate(plain(file))


def accepts(tree) -> bool:
    return CAMERA.is_valid(tree)


class TestCamera:
    def test_required_keys(self):
        assert accepts(REQUIRED)
        assert not accepts({k: v for k, v in REQUIRED.items() if k != "optics"})
        assert not accepts(changed({"scene": {"luminance": "1 cd/m2"}}))

    @pytest.mark.parametrize(
        ("path", "good", "bad"),
        [
            ("pixel.width", ["6.5 um", "6.5µm", "1/2 um", "1e-3 mm"], [6.5, "6.5", "-1 um", "1 s"]),
            ("optics.defocus", ["-3 um"], [0]),
            ("scene.distance", ["infinity", "1 m"], ["inf", "1"]),
            ("scene.wavelengths", [{"step": "auto"}, {"step": "5 nm"}], [{"step": "x"}]),
            ("pixel.readout.reset_noise", ["ktc", "none", "12 e"], ["kt", 12]),
            (
                "pixel.fpn",
                [{"dsnu": "1 e", "prnu": "1 %"}, {"gain_pixel": "1 %"}],
                [{"dsn": "1 e"}],
            ),
            ("pixel.stack", ["none"], ["some", None, {"oxide": {}}]),
            ("optics.transmittance", [1, "95 %", "a", [0.5, {"file": "x"}]], [1.5, [], {"x": 1}]),
            ("optics.transmittance", [{"table": {"400": 0.1, "650.5": 1}}], [{"table": {"x": 1}}]),
            ("scene.illuminant", ["D65", {"blackbody": "3000 K"}], [{"blackbody": 3000}, 5]),
            ("optics.zernike", [{}, {"4": "1 um"}, [{"field": 0.7, "4": "1 um"}]], [{"x": "1 um"}]),
            ("array.rows", [512], ["512", 0, 1.5]),
            ("array.pattern", ["bayer-rggb", {"block": [["R"]]}], ["bayer", {"blok": []}]),
            ("array.filters", ["generic-rgb", {"R": 0.5}], [3, {"R": 2}]),
            ("processing", [[], [{"gamma": 2.2}, {"gamma": "srgb"}]], [[{"gama": 1}], ["gamma"]]),
            ("effects", ["auto", {"fpn": "off"}], ["on", {"fpn": True}, {"x": "off"}]),
            ("accuracy", ["draft", 0.01, "0.1 %", {"oversampling": 4}], ["fine", 2, {"x": 1}]),
            ("output", [{"render": "none"}, {"render": 16}], [{"render": 12}, {"raw": ["x"]}]),
            ("pixel.technology", ["a", {"from": "a", "supply": "3 V"}], [3, {"supply": "3 V"}]),
            ("scene.source.chart", ["colorchecker"], ["cfs", 3]),
            ("name", ["a-b_1.c"], ["a b", ""]),
        ],
    )
    def test_agrees_with_the_models(self, path, good, bad):
        for value in good:
            tree = changed({path: value})
            if path == "scene.source.chart":
                tree["scene"]["source"] = {"kind": "chart", "chart": value}
            assert accepts(tree), value
        for value in bad:
            assert not accepts(changed({path: value})), value

    def test_a_source_has_the_keys_of_its_kind_alone(self):
        """And a mistake is told of the one form that is meant, not of fifteen."""
        scene = {"kind": "chart", "chart": "slanted-edge", "contrast": 0.5}
        for source, right in (
            (scene, True),
            (scene | {"max_frequency": "3 lp/mm"}, False),  # of csf
            ({"kind": "image", "file": "a.png", "white": 2}, True),
            ({"kind": "image", "file": "a.png", "contrast": 0.5}, False),
            ({"kind": "image"}, False),
            ({"chart": "uniform"}, False),
        ):
            assert accepts(changed({"scene.source": source})) == right, source
        (mistake,) = part("Scene").iter_errors(
            {"source": {"kind": "image", "file": 3}, "luminance": "1 cd/m2"}
        )
        assert list(mistake.path) == ["source", "file"]
        base = {"extends": "other.yaml"}
        assert accepts(base | {"scene": {"source": {"contrast": 0.5}}})
        assert not accepts(base | {"scene": {"source": {"contrst": 0.5}}})
        assert not accepts(base | {"scene": {"source": {"kind": "image", "contrast": 0.5}}})

    def test_illuminants_are_described(self):
        forms = SCHEMAS["camera.schema.json"]["$defs"]["illuminant"]["anyOf"]
        said = {form["const"]: form["description"] for form in forms if "const" in form}
        assert said["FL2"] == "fluorescent, cool white, 4230 K."
        assert set(said) == set(illuminant_names())

    def test_parts(self):
        assert accepts(changed({"optics": "f2.8-normal"}))
        assert accepts(changed({"optics": {"use": "f2.8-normal", "f_number": 4}}))
        assert accepts(changed({"scene": {"use": "x", "source": {"reflectance": 0.5}}}))
        assert not accepts(changed({"optics": 3}))
        assert not accepts(changed({"optics": {"use": "f2.8-normal", "f_numbr": 4}}))
        assert not accepts(changed({"pixel": {"use": "x", "width": 4}}))
        assert not accepts(changed({"adc": "fine"}))

    def test_extends(self):
        assert accepts({"extends": "other.yaml"})
        assert accepts({"extends": "other.yaml", "pixel": {"photodetector": {"fill_factor": 0.4}}})
        assert accepts({"extends": "other.yaml", "optics": {"use": "x"}, "scene": "y"})
        assert not accepts({"extends": "other.yaml", "pixle": {}})
        assert not accepts({"extends": "other.yaml", "pixel": {"width": 4}})


SWEEP = {
    "kind": "sweep",
    "name": "a",
    "camera": "starter",
    "vary": {"pixel.width": {"start": "3 um", "stop": "8 um", "count": 3}},
    "cases": {"dim": {"scene.luminance": "10 cd/m2"}},
    "repeat": {"seed.frame": [1, 2]},
    "metrics": ["snr_db"],
}


class TestStudy:
    """Paths of a camera's keys, where a sweep has them, are completed and explained."""

    STUDY = jsonschema.Draft202012Validator(SCHEMAS["study.schema.json"])

    def test_shipped_studies_are_valid(self):
        for file in shipped.files("studies").values():
            self.STUDY.validate(plain(file))

    def test_paths_are_known_in_all_places(self):
        assert self.STUDY.is_valid(SWEEP)
        definitions = SCHEMAS["study.schema.json"]["$defs"]
        for name in ("vary paths", "repeat paths", "Case"):
            about = definitions[name]["properties"]["pixel.width"]
            assert about["title"] == "pixel.width [um]"
            assert about["description"].startswith("Width of the")

    def test_what_is_written_below_a_path_is_checked_as_before(self):
        for key, wrong in (("vary", {"pixel.width": 3}), ("repeat", {"seed.frame": 1})):
            assert not self.STUDY.is_valid(SWEEP | {key: wrong})
        assert not self.STUDY.is_valid(SWEEP | {"cases": {"dim": {"vary": {"x": 3}}}})


class TestReadable:
    """Hover texts: every key has a title, a description and an example."""

    def keys(self):
        for file, root in SCHEMAS.items():
            for name, definition in root["$defs"].items():
                for key, value in definition.get("properties", {}).items():
                    yield f"{file} {name}.{key}", value

    def test_every_key_is_described(self):
        for where, key in self.keys():
            if where.rpartition(".")[2] in ("use", "extends", "field"):
                continue
            assert key.get("title"), where
            assert key.get("description"), where
            assert key.get("examples"), where

    def test_units_are_in_titles_and_defaults_have_units(self):
        pixel = SCHEMAS["camera.schema.json"]["$defs"]["Pixel"]["properties"]
        assert pixel["gap_x"]["title"] == "gap_x [um]"
        assert pixel["gap_x"]["default"] == "0 um"
        assert pixel["temperature"]["default"] == "300 K"
        assert pixel["stack"]["default"] == "none"
        assert "default" not in pixel["width"]

    def test_nothing_of_a_camera_is_marked_as_not_built(self):
        assert "Not supported" not in json.dumps(SCHEMAS["camera.schema.json"])

    def test_no_marks_of_ours_are_left(self):
        text = json.dumps(SCHEMAS)
        assert "x-definition" not in text
        assert '"null"' not in text


@pytest.mark.parametrize(
    "name", [d for d in DIMENSIONS if d in SCHEMAS["camera.schema.json"]["$defs"]]
)
def test_patterns_take_every_unit_that_parse_takes(name):
    validator = part(name)
    for unit in DIMENSIONS[name].units:
        for text in (f"2.5 {unit}", f"1e-3{unit}", f" 1/60  {unit} "):
            parse(text, name)
            assert validator.is_valid(text), text
    assert validator.is_valid(DIMENSIONS[name].example)
    for text in ("2.5", "um", "2.5 parsec", "2,5 um", "nan", ""):
        assert not validator.is_valid(text), text
