"""From files to a camera: parts, bases, overrides, names of files, places of mistakes."""

from pathlib import Path

import pytest
from making import long_except

from vcam_cli.camera.load import load
from vcam_cli.config import shipped
from vcam_cli.config.yaml_tree import walk
from vcam_cli.errors import BadInput, CannotDo, bad, dotted_path

CAMERA = """\
scene:
  source: {kind: chart, chart: csf, max_frequency: 33 lp/mm}
  luminance: 100 cd/m2
optics:
  f_number: 2.8
  focal_length: 3.2 mm
pixel:
  width: 6.5 um
  photodetector:
    fill_factor: 0.3
    quantum_efficiency: 0.5
  readout:
    conversion_gain: 20 uV/e
    voltage_swing: 1 V
array: {rows: 32, columns: 48, pattern: monochrome}
exposure: {time: 30 ms}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """An empty current folder with one good camera file."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "camera.yaml").write_text(CAMERA)
    return tmp_path


def problems(file: str | Path = "camera.yaml", sets=()) -> list[str]:
    with pytest.raises(BadInput) as caught:
        load(file, sets)
    return [str(problem) for problem in caught.value.problems]


def change(folder: Path, old: str, new: str) -> None:
    text = (folder / "camera.yaml").read_text()
    assert text.count(old) == 1
    (folder / "camera.yaml").write_text(text.replace(old, new))


class TestPlain:
    def test_a_camera(self, folder):
        camera = load("camera.yaml")
        assert camera.pixel.width == 6.5e-6
        assert camera.pixel.height == 6.5e-6
        assert camera.exposure.time == 0.03
        assert camera.optics.f_number == 2.8
        assert camera.array.columns == 48

    def test_its_name_is_that_of_the_file(self, folder):
        assert load("camera.yaml").name == "camera"
        (folder / "my camera (2).yaml").write_text(CAMERA)
        assert load("my camera (2).yaml").name == "my-camera-2-"
        change(folder, "scene:", "name: other\nscene:")
        assert load("camera.yaml").name == "other"

    def test_places(self, folder):
        camera = load("camera.yaml", ["adc.bits=12"])
        assert camera.locate(("pixel", "width")) == "camera.yaml:8:10"
        assert camera.locate(("pixel", "photodetector")) == "camera.yaml:9:3"
        assert camera.locate(("array", "die", "width")) == "camera.yaml:15:8"
        assert camera.locate(("adc", "bits")) == "--set adc.bits=12"
        assert camera.locate(("processing", 0)) == "camera.yaml:1:1"

    def test_every_shipped_camera_loads(self):
        for name in shipped.names("cameras"):
            assert load(name).pixel.width > 0

    def test_a_path_or_a_shipped_name(self, folder):
        assert load(folder / "camera.yaml") == load("camera.yaml")
        assert load("starter").name == "starter"
        (text,) = problems("startr")
        assert text == "'startr' is not a camera that ships; did you mean 'starter'?"
        (text,) = problems("camra.yaml")
        assert text == "there is no file 'camra.yaml'; did you mean 'camera.yaml'?"
        (text,) = problems("starter.yaml")
        assert "a camera 'starter' ships" in text

    def test_a_name_too_long_for_a_file(self, folder):
        (text,) = problems("a" * 300)
        assert text.startswith(f"'{'a' * 300}' is not a camera that ships; shipped: ")
        (text,) = problems(sets=[f"optics={'a' * 300}"])
        assert "is not an optics that ships" in text

    def test_a_folder_that_is_gone(self, folder, monkeypatch):
        (folder / "gone").mkdir()
        monkeypatch.chdir(folder / "gone")
        (folder / "gone").rmdir()
        with pytest.raises(CannotDo, match="the current folder is gone"):
            load("starter")
        assert load("starter", folder=folder).name == "starter"

    def test_a_study_is_no_camera(self, folder):
        for kind in ("sweep", "schedule"):
            Path("study.yaml").write_text(f"name: x\nkind: {kind}\n")
            (text,) = problems("study.yaml")
            assert text.startswith("study.yaml:2:7: kind: this is a study")
            assert f"give a camera file, or run the study with vcam {kind}" in text

    def test_a_list_or_a_word_is_no_camera(self, folder):
        for text in ("- 1\n", "camera\n", "3\n"):
            Path("c.yaml").write_text(text)
            assert problems("c.yaml")[0].startswith("c.yaml:1:1: a mapping is needed here")


class TestParts:
    def part(self, name: str, text: str) -> None:
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_text(text)

    def use(self, folder: Path, text: str) -> None:
        change(folder, "optics:\n  f_number: 2.8\n  focal_length: 3.2 mm\n", f"optics: {text}\n")

    @pytest.mark.parametrize("text", ["lens", "./lens.yaml", "lens.yaml", "{use: lens}"])
    def test_beside_the_file(self, folder, text):
        self.part("lens.yaml", "f_number: 4\nfocal_length: 5 mm\n")
        self.use(folder, text)
        camera = load("camera.yaml")
        assert (camera.optics.f_number, camera.optics.focal_length) == (4, 5e-3)
        assert camera.locate(("optics", "f_number")) == "lens.yaml:1:11"

    def test_shipped(self, folder):
        self.use(folder, "f2.8-normal")
        assert load("camera.yaml").optics.f_number == 2.8

    def test_beside_goes_before_shipped(self, folder):
        self.part("f2.8-normal.yaml", "f_number: 11\nfocal_length: 5 mm\n")
        self.use(folder, "f2.8-normal")
        assert load("camera.yaml").optics.f_number == 11

    def test_overrides(self, folder):
        self.part("lens.yaml", "f_number: 4\nfocal_length: 5 mm\noff_axis: cos4\n")
        self.use(folder, "{use: lens, f_number: 8}")
        camera = load("camera.yaml")
        assert (camera.optics.f_number, camera.optics.off_axis) == (8, "cos4")
        assert camera.locate(("optics", "f_number")) == "camera.yaml:4:31"

    def test_an_override_changes_the_part_that_one_before_it_names(self, folder):
        camera = load("csf-0.35um", ["optics=f8-landscape", "optics.transmittance=0.5"])
        assert camera.optics == load("csf-0.35um", ["optics=f8-landscape"]).optics.model_copy(
            update={"transmittance": camera.optics.transmittance}
        )
        assert camera.optics.f_number == 8
        with pytest.raises(BadInput, match="optics: the lens is not determined"):
            load("csf-0.35um", ["optics=none", "optics.focus=auto"])

    def test_a_part_may_extend_and_use_parts(self, folder):
        self.part("parts/base.yaml", "{rows: 3, columns: 4, filters: set}\n")
        self.part("parts/set.yaml", "{R: 0.1, G: 0.2, B: 0.3}\n")
        self.part("parts/mine.yaml", "{extends: base, rows: 5}\n")
        change(folder, "{rows: 32, columns: 48, pattern: monochrome}", "parts/mine.yaml")
        array = load("camera.yaml").array
        assert (array.rows, array.columns, sorted(array.filters)) == (5, 4, ["B", "G", "R"])

    def test_a_camera_may_use_a_part_of_its_own_name(self, folder):
        rest = CAMERA.partition("optics:")[2]
        self.part("csf.yaml", f"scene: csf\noptics:{rest}")
        assert load("csf.yaml").scene.source.chart == "csf"

    def test_a_missing_part_hides_no_other_mistake(self, folder):
        self.use(folder, "f2.8-nrmal")
        change(folder, "rows: 32", "rows: -1")
        change(folder, "30 ms", "30 mm")
        first, *others = problems()
        assert first == (
            "camera.yaml:4:9: optics: 'f2.8-nrmal' is not an optics that ships; "
            "did you mean 'f2.8-normal'?"
        )
        assert [text.split(": ")[1] for text in others] == ["array.rows", "exposure.time"]

    def test_mistakes_in_a_part_are_placed_there(self, folder):
        self.part("lens.yaml", "f_number: 4\nfocal_lenth: 5 mm\n")
        self.use(folder, "lens")
        assert any(p.startswith("lens.yaml:2:14: optics.focal_lenth: ") for p in problems())
        self.part("lens.yaml", "f_number: 4\nf_number: 5\n")
        assert problems()[0].startswith("lens.yaml:2:1: optics: the key 'f_number' is given twice")

    def test_what_is_no_part(self, folder):
        self.use(folder, "https://example.org/lens.yaml")
        assert "is a URL; download the file" in problems()[0]


class TestExtends:
    def test_a_chain(self, folder):
        Path("b.yaml").write_text("extends: camera.yaml\nexposure: {time: 1 ms}\nadc: {bits: 8}\n")
        Path("c.yaml").write_text("extends: b\nadc: {offset: 16 DN}\n")
        camera = load("c.yaml")
        assert (camera.exposure.time, camera.adc.bits, camera.adc.offset) == (1e-3, 8, 16)
        assert camera.name == "c"
        assert camera.locate(("adc", "offset")) == "c.yaml:2:15"
        assert camera.locate(("adc", "bits")) == "b.yaml:3:13"
        assert camera.locate(("pixel", "width")) == "camera.yaml:8:10"

    def test_another_folder(self, folder):
        Path("sub").mkdir()
        Path("sub/c.yaml").write_text("extends: ../camera.yaml\n")
        assert load("sub/c.yaml").exposure.time == 0.03

    def test_a_shipped_camera(self, folder):
        Path("c.yaml").write_text("extends: starter\nexposure: {time: 1 ms}\n")
        camera = load("c.yaml")
        assert (camera.exposure.time, camera.exposure.auto) == (1e-3, None)

    def test_a_circle(self, folder):
        Path("a.yaml").write_text("extends: ./b.yaml\n")
        Path("b.yaml").write_text("extends: ./a.yaml\n")
        (text,) = problems("a.yaml")
        assert text.startswith("b.yaml:1:10: the files refer to each other in a circle: ")
        assert "a.yaml -> b.yaml -> a.yaml" in text
        Path("a.yaml").write_text("extends: ./a.yaml\n")
        assert "a.yaml -> a.yaml" in problems("a.yaml")[0]

    def test_a_chain_without_end(self, folder):
        for i in range(40):
            Path(f"c{i}.yaml").write_text(f"extends: ./c{i + 1}.yaml\n")
        assert "more than 32 files" in problems("c0.yaml")[0]

    @pytest.mark.parametrize("text", ["[a, b]", "3", "~", "''", "{use: x}"])
    def test_what_is_no_name(self, folder, text):
        Path("c.yaml").write_text(f"extends: {text}\n")
        assert "c.yaml:1:10" in problems("c.yaml")[0]
        assert "the name or path of a file is needed" in problems("c.yaml")[0]


class TestSet:
    def test_values_are_yaml(self, folder):
        sets = ["pixel.width=8 um", "adc.bits=12", "processing=[]", "seed={frame: 7}"]
        camera = load("camera.yaml", sets)
        assert camera.pixel.width == 8e-6
        assert (camera.adc.bits, camera.processing, camera.seed.frame) == (12, (), 7)

    def test_the_order_does_not_matter(self, folder):
        sets = ["scene.source.chart=sinusoid", "scene.source.frequency=50 lp/mm"]
        assert load("camera.yaml", sets) == load("camera.yaml", sets[::-1])
        assert load("camera.yaml", sets).scene.source.frequency == 50e3

    def test_the_last_of_two_wins(self, folder):
        assert load("camera.yaml", ["adc.bits=8", "adc.bits=9"]).adc.bits == 9

    def test_alternatives(self, folder):
        camera = load("camera.yaml", ["exposure.auto.max=1 s", "scene.radiance=1 W/(sr m2)"])
        assert camera.exposure.time is None
        assert camera.exposure.auto.max == 1.0
        assert (camera.scene.luminance, camera.scene.radiance) == (None, 1.0)

    def test_a_prescription_drops_the_lens_of_the_file_but_not_the_reverse(self, folder):
        """A lens of a file of its own is added to any camera; a traced lens is not lost."""
        traced = "optics.prescription={use: cooke-triplet, scale: 0.05}"
        optics = load("camera.yaml", [traced]).optics
        assert (optics.f_number, optics.focal_length, optics.prescription.scale) == (
            None,
            None,
            0.05,
        )
        assert load("camera.yaml", ["optics.prescription=none"]).optics.f_number is not None
        assert "cannot be combined" in problems(sets=[traced, "optics.f_number=8"])[0]

    def test_a_part(self, folder):
        Path("lens.yaml").write_text("f_number: 4\nfocal_length: 5 mm\n")
        assert load("camera.yaml", ["optics=lens"]).optics.f_number == 4
        sets = ["optics.use=lens", "optics.f_number=8"]
        optics = load("camera.yaml", sets).optics
        assert (optics.f_number, optics.focal_length) == (8, 5e-3)

    def test_an_element_of_a_list(self, folder):
        change(folder, "exposure:", "processing: [black_level: subtract, gamma: 2.2]\nexposure:")
        steps = load("camera.yaml", ["processing.1.gamma=srgb"]).processing
        assert [step.value for step in steps] == ["subtract", "srgb"]
        assert "use 0 to 1" in problems(sets=["processing.2=1"])[0]

    @pytest.mark.parametrize(
        "item", ["processing.gamma=srgb", "processing[1].gamma=srgb", "processing={gamma: srgb}"]
    )
    def test_a_step_by_its_name(self, folder, item):
        change(folder, "exposure:", "processing: [black_level: subtract, gamma: 2.2]\nexposure:")
        steps = load("camera.yaml", [item]).processing
        assert [step.value for step in steps] == ["subtract", "srgb"]

    def test_a_step_by_its_name_in_the_file_of_another_camera(self, folder):
        change(folder, "exposure:", "processing: [black_level: subtract, gamma: 2.2]\nexposure:")
        Path("other.yaml").write_text("extends: camera.yaml\nprocessing: {gamma: 1.8}\n")
        steps = load("other.yaml").processing
        assert [step.value for step in steps] == ["subtract", 1.8]

    @pytest.mark.parametrize(
        ("item", "remedy"),
        [
            ("processing.0.gamma=2", "write processing.gamma"),
            ("processing.gama=2", "write processing.gamma"),
            ("processing.7.gamma=2", "write processing.gamma"),
            ("processing.jpeg=90", "give the whole list, with jpeg where it belongs"),
            ("processing.sharpen=1", "write processing.1.sharpen or processing.3.sharpen"),
        ],
    )
    def test_a_step_that_is_not_there(self, folder, item, remedy):
        sharpen = "sharpen: {radius: 1 px, amount: 0.5}"
        steps = f"[black_level: subtract, {sharpen}, gamma: 2.2, {sharpen}]"
        change(folder, "exposure:", f"processing: {steps}\nexposure:")
        (said,) = problems(sets=[item])
        assert remedy in said
        assert item in said

    def test_a_step_of_the_usual_list(self, folder):
        """Where the file gives none, the remedy is the usual one, with the step that was asked."""
        change(folder, "monochrome", "bayer-rggb")
        (said,) = problems(sets=["processing.gamma=2"])
        assert "is not a list of steps" in said
        listed = said.partition("a list such as ")[2]
        steps = load("camera.yaml", [f"processing={listed}"]).processing
        assert steps[-1].value == 2

    @pytest.mark.parametrize(
        ("item", "said"),
        [
            ("pixel.widht=8 um", "--set pixel.widht=8 um: pixel.widht: "),
            ("pixle.width=8 um", "--set pixle.width=8 um: pixle: "),
            ("pixel.width=8", "--set pixel.width=8: pixel.width: 8 is a bare number"),
            ("extends=camera", "--set extends=camera: extends: "),
            ("optics.f_number.x=3", "--set optics.f_number.x=3: optics.f_number: "),
            ("pixel.width", "--set: 'pixel.width' is not PATH=VALUE"),
            ("=3", "--set: '=3' is not PATH=VALUE"),
            ("pixel..width=8 um", "--set: 'pixel..width=8 um' is not PATH=VALUE"),
            (".pixel.width=8 um", "--set: '.pixel.width=8 um' is not PATH=VALUE"),
            ("pixel.width.=8 um", "--set: 'pixel.width.=8 um' is not PATH=VALUE"),
            ("pixel.width=", "--set: 'pixel.width=' is not PATH=VALUE"),
            ("pixel.width=[", "--set pixel.width=[: is not YAML"),
            ("pixel.width=!x 3", "--set pixel.width=!x 3: the YAML tag"),
            ("a\nb=1", "--set a\\nb=1: "),
        ],
    )
    def test_mistakes_name_the_option(self, folder, item, said):
        (text,) = problems(sets=[item])
        assert text.startswith(said)

    def test_a_misspelt_path_gets_the_nearest_name(self, folder):
        assert "width" in problems(sets=["pixel.widht=8 um"])[0].rpartition(";")[2]


class TestFilesNamedInside:
    def test_relative_to_the_file_that_names_them(self, folder):
        Path("sub").mkdir()
        Path("sub/qe.csv").write_text("wavelength_nm,value\n300,0.5\n900,0.5\n")
        Path("sub/pd.yaml").write_text(
            "width: 6.5 um\nphotodetector: {fill_factor: 0.3, quantum_efficiency: {file: qe.csv}}\n"
            "readout: {conversion_gain: 20 uV/e, voltage_swing: 1 V}\n"
        )
        camera = load("camera.yaml", ["pixel=sub/pd.yaml"])
        spectrum = camera.pixel.photodetector.quantum_efficiency.given
        assert spectrum.factors[0].file == str(folder / "sub" / "qe.csv")

    @pytest.mark.parametrize(
        ("name", "said"),
        [
            ("photo.pgn", "there is no file 'photo.pgn'; did you mean 'photo.png'?"),
            ("no/such.png", "there is no file 'no/such.png'; looked in"),
            ("dangling.png", "'dangling.png' is a broken link; point it"),
            ("loop.png", "'loop.png' is a broken link; point it"),
            (".", "'.' is not a regular file"),
            ("/dev/zero", "'/dev/zero' is not a regular file"),
            ("~/photo.png", "~ is not expanded"),
            ("$HOME/photo.png", "there is no file '$HOME/photo.png'"),
            ("file:///photo.png", "'file:///photo.png' is a URL"),
        ],
    )
    def test_what_is_no_file(self, folder, name, said):
        Path("photo.png").write_bytes(b"")
        Path("dangling.png").symlink_to("nowhere")
        Path("loop.png").symlink_to("loop.png")
        change(folder, "{kind: chart, chart: csf, max_frequency: 33 lp/mm}",
               f"{{kind: image, file: '{name}', model: laser}}")  # fmt: skip
        change(folder, "rows: 32", "rows: 0")
        texts = problems()
        assert any(f"camera.yaml:2:31: scene.source.file: {said}" in text for text in texts)
        assert len(texts) == 2  # and the rows


def test_all_mistakes_at_once(folder):
    change(folder, "f_number: 2.8", "f_nubmer: 2.8")
    change(folder, "width: 6.5 um", "width: 6.5")
    change(folder, "conversion_gain: 20 uV/e", "conversion_gain: 20 mm")
    change(folder, "rows: 32", "rows: 32.5")
    paths = {text.split(": ")[1] for text in problems()}
    wrong = {"optics.f_nubmer", "pixel.width", "pixel.readout.conversion_gain", "array.rows"}
    assert wrong <= paths


def test_a_wrong_section_hides_no_contradiction_of_others(folder):
    change(folder, "exposure:", "adc: {bits: 4, offset: 20 DN}\nexposure:")
    change(folder, "    fill_factor: 0.3\n", "    width: 9 um\n    height: 9 um\n")
    change(folder, "  luminance: 100 cd/m2", "  luminance: 100 cd/m2\n  distance: 1 mm")
    texts = problems()
    assert [text.split(": ")[1] for text in texts] == [
        "scene.distance", "pixel.photodetector.width", "adc.offset",
    ]  # fmt: skip
    assert all(text.startswith("camera.yaml:") for text in texts)


def test_an_example_in_place_of_a_wrong_section_makes_no_mistakes_of_its_own(folder):
    """A die for pixels of 6.5 um, and 7 um between them, must not meet another camera's pixel."""
    change(folder, "{rows: 32, columns: 48, pattern: monochrome}",
           "{die: {width: 1 um, height: 1 um}, pattern: monochrome}")  # fmt: skip
    change(folder, "width: 6.5 um", "width: 0.1")
    assert [text.split(": ")[1] for text in problems()] == ["pixel.width"]


def test_further_checks_are_made_with_the_others_where_their_sections_are_right(folder):
    seen = []

    def check(camera):
        seen.append(camera.name)
        raise bad("pixel.width", "does not please", "take another")

    change(folder, "  luminance: 100 cd/m2", "  luminance: 100 cd/m2\n  distance: 1 mm")
    with pytest.raises(BadInput) as caught:
        load("camera.yaml", checks=[(check, "pixel"), (check, "pixel")])
    first, second = map(str, caught.value.problems)  # the same is said once
    assert first.startswith("camera.yaml:4:13: scene.distance: ")
    assert second == "camera.yaml:9:10: pixel.width: does not please; take another"
    with pytest.raises(BadInput):
        load("camera.yaml", ["pixel.width=3"], checks=[(check, "pixel")])
    chosen = "exposure.captures={schedule: optimal, count: 4, max: 30}"
    with pytest.raises(BadInput):
        load("camera.yaml", [chosen], checks=[(check, "exposure")])
    assert seen == ["camera", "camera"]


@pytest.mark.parametrize(
    "name", long_except(shipped.names("cameras")[::6], shipped.names("cameras"))
)
def test_an_empty_mapping_empties_every_section_of_every_camera(name):
    """Nothing that a base gave there stays; where that leaves too little, the file says so."""
    here = load(name).source_tree
    for path, node in walk(here.tree):
        if not path or not node.mapping or not all(isinstance(key, str) for key in path):
            continue
        try:
            emptied = load(name, [f"{dotted_path(path)}={{}}"]).source_tree.tree
        except BadInput:
            continue
        for key in path:
            emptied = emptied.get(key)
        assert emptied.plain() == {}, path
