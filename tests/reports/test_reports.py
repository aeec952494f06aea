"""Reports: valid pages that need nothing else, with what the run knows and nothing invented."""

import base64
import json
import math
import re
from html.parser import HTMLParser

import numpy as np
import OpenImageIO
import pytest
from typer.testing import CliRunner

from tests.making import camera as made
from vcam_cli import load, simulate
from vcam_cli.commands.main import app
from vcam_cli.reports import page, pictures, side_by_side, study_report
from vcam_cli.reports.page import Facts, Page, Picture, Scale, Section, Table, Text
from vcam_cli.simulation.output import report_plots

VOID = {"meta", "img", "br", "link", "input", "hr"}
SMALL = ["array.rows=24", "array.columns=32"]


class Checked(HTMLParser):
    """A page read strictly: every tag closed in its order, and what its attributes say."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open, self.ids, self.images, self.links, self.texts = [], [], [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        assert len(given) == len(attrs), f"{tag} has an attribute twice"
        self.ids += [given["id"]] if "id" in given else []
        self.links += [given[name] for name in ("href", "src") if name in given]
        if tag == "img":
            self.images.append(given)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("style", "script"):
            self.texts.append(data)


def check(text: str) -> Checked:
    """Check a page: well-formed, described pictures, nothing from elsewhere."""
    assert text.startswith("<!DOCTYPE html>")
    found = Checked(text)
    assert len(set(found.ids)) == len(found.ids)
    for image in found.images:
        assert len(image["alt"]) > 8
        kind, _, data = image["src"].partition(";base64,")
        assert base64.b64decode(data, validate=True)[:4] in (b"\x89PNG", b"<svg")
        assert kind in ("data:image/png", "data:image/svg+xml")
    for link in found.links:
        assert link.startswith("data:") or link.removeprefix("#") in found.ids
    assert not re.search(r"https?://|@import|url\(", re.sub(r'"data:[^"]*"', "", text))
    return found


def test_a_page_of_every_part_is_valid_and_escapes_what_it_shows():
    evil = '<script>alert("1")</script> & "quoted"'
    image, note = pictures.codes(np.zeros((2, 3), np.uint8))
    assert note == ""
    parts = [
        Picture(evil, image, evil, evil, Scale("0", evil, ("000000", "ffffff")), "one"),
        Table(evil, (evil, "b"), [(evil, 1), ("x", "")], evil, numbers=frozenset({1})),
        Table("long", ("a",), [("x",)], folded=True, marked=frozenset({0})),
        Facts(evil, [(evil, evil)]),
        Text(evil, evil),
    ]
    sections = [Section("First part", parts), Section("Empty", []), Section("Second", parts)]
    text = page.html(Page(evil, evil, sections, [evil]))
    found = check(text)
    assert text.count("<script>") == 1
    assert "".join(found.texts).count('alert("1")') > 8
    assert found.ids == ["first-part", "second"]


@pytest.mark.parametrize(
    ("name", "sets"),
    [
        pytest.param("still-life", [], marks=pytest.mark.long),
        pytest.param("x3-stacked", [], marks=pytest.mark.long),
        ("starter", ["optics=none", "array.binning={rows: 2, columns: 2}"]),
        pytest.param(
            *("starter", ["adc={bits: 10, kind: logarithmic}", "output.render=none", "quality=[]"]),
            marks=pytest.mark.draws,
        ),
        pytest.param(
            *("starter", ["scene.illuminant={monochromatic: 550 nm}"]), marks=pytest.mark.long
        ),
    ],
)
def test_a_run_of_any_kind_has_a_report(name, sets, tmp_path):
    camera = load(name, [*SMALL, *sets, "output.report=true"])
    simulate(camera, workers=1).save(tmp_path / "out")
    text = (tmp_path / "out" / "report.html").read_text("utf-8")
    found = check(text)
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert "report.html" in record["files"]
    shown = " ".join(found.texts)
    for effect in record["plan"]["effects"]:
        assert effect["reason"] in shown
    assert record["hashes"]["camera"] in shown
    assert f"{record['metrics']['well_capacity']:.6g} e" in shown
    assert len(found.images) >= 6


@pytest.mark.long
def test_every_shipped_camera_has_a_report(tmp_path):
    from vcam_cli.config import shipped

    for name in shipped.names("cameras"):
        camera = load(name, [*SMALL, "output.report=true"])
        simulate(camera, workers=1).save(tmp_path / name)
        check((tmp_path / name / "report.html").read_text("utf-8"))


def test_a_run_writes_no_report_that_is_not_asked_for(tmp_path):
    simulate(load("starter", SMALL), workers=1).save(tmp_path / "out")
    assert not (tmp_path / "out" / "report.html").exists()


def test_noise_and_sharpness_are_those_of_closed_forms(tmp_path):
    """Shot noise has the variance of its signal; the lens and the pixel are in every textbook."""
    frame = simulate(made(tmp_path, {"pixel.readout.read_noise": "7 e"}), workers=1).frame
    signal, parts = report_plots.noise_parts(frame)
    assert parts["shot_noise"] == pytest.approx(signal, rel=1e-12)
    assert parts["read_noise"] == pytest.approx(np.full(len(signal), 49.0), rel=1e-12)
    step = 100e3 / (2**12 - 1)  # electrons; the noise is far below it where there is little light
    assert parts["quantization"][-1] == pytest.approx(step**2 / 12, rel=1e-3)

    frequency, factors = report_plots.mtf_parts(frame)
    assert set(factors) == {"diffraction", "pixel_aperture"}
    width = 5e-6 * math.sqrt(0.5)
    assert factors["pixel_aperture"] == pytest.approx(np.abs(np.sinc(width * frequency)), abs=1e-12)
    working = 4 * (1 + 5e-3 / (1 - 5e-3))
    s = frequency * 550e-9 * working
    s = s[s < 1]
    expected = 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2))
    got = factors["diffraction"][: len(s)]
    # From a table of 257 frequencies between which it is straight, and the exact sine of the cone
    # in place of the paraxial one.
    assert got == pytest.approx(expected, abs=2e-2)


def test_the_histogram_counts_every_pixel_once():
    frame = simulate(load("starter", SMALL), workers=1).frame
    edges, counts = report_plots.histogram(frame)
    assert sum(int(c.sum()) for c in counts) == 24 * 32
    green = counts[frame.mosaic.colors.index("G")]
    assert green.sum() == 24 * 32 / 2
    assert edges[0] < 0 < edges[-1]


def test_a_large_picture_is_shown_smaller_and_says_so():
    image = np.zeros((4, 2050, 3), np.uint8)
    image[:, :1025] = 90
    source, note = pictures.codes(image)
    assert note == "Shown at 1/3 of its size, 3 x 3 pixels averaged."
    assert source.startswith("data:image/png;base64,")


def run(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


def small(*words):
    return [*words, "-q", *(part for s in SMALL for part in ("--set", s))]


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    place = tmp_path_factory.mktemp("runs")
    assert (
        run(*small("run", "starter"), "--set", "optics=none", "-o", place / "bare").exit_code == 0
    )
    for name, time in (("a", "10 ms"), ("b", "20 ms")):
        done = run(*small("run", "starter"), "--set", f"exposure.time={time}", "-o", place / name)
        assert done.exit_code == 0, done.output
    return place


def test_runs_side_by_side(runs, tmp_path):
    done = run("report", runs / "a", runs / "b", "-o", tmp_path / "both.html")
    assert done.exit_code == 0, done.output
    found = check((tmp_path / "both.html").read_text("utf-8"))
    assert [i["alt"] for i in found.images][:2] == ["render.png of a", "render.png of b"]
    settings = "".join(found.texts).partition("Keys of the cameras")[2].partition("Metrics")[0]
    assert re.findall(r"exposure\.\S+?(?=\d)", settings) == ["exposure.time"]
    assert "10 ms" in settings
    assert "20 ms" in settings
    assert "f_number" not in settings
    assert run("report", runs / "bare", "-q", "-o", tmp_path / "bare.html").exit_code == 0
    again = run("report", runs / "a", runs / "b", "-o", tmp_path / "both.html", "-q")
    assert (again.exit_code, again.stdout) == (0, "")


@pytest.mark.long
def test_a_page_in_the_folder_of_a_run_leaves_it_a_runs(tmp_path):
    """Before and after a run that writes a report of its own, and in the folder of a sweep."""
    place = tmp_path / "run"
    for words in ((), ("--report",), ()):
        assert run(*small("run", "starter", *words), "-o", place).exit_code == 0
        done = run("report", place, "-o", place / "report.html", "-q")
        assert done.exit_code == 0, done.output
    assert run(*small("run", "starter", "--report"), "-o", place).exit_code == 0


def test_notes_of_all_runs_are_said_once(tmp_path):
    notes = {"a": ["same", "own of a"], "b": ["same", "two"], "c": ["same", "two"]}
    read = [(label, tmp_path, {"notes": said}) for label, said in notes.items()]
    assert list(side_by_side._notes(read)) == ["same", "a: own of a", "b, c: two"]


def test_what_is_no_run_or_no_page_is_refused(runs, tmp_path):
    foreign = run("report", tmp_path)
    assert foreign.exit_code == 2
    assert "holds no run.json" in foreign.stderr
    (tmp_path / "mine.html").write_text("<p>mine</p>")
    kept = run("report", runs / "a", "-o", tmp_path / "mine.html")
    assert kept.exit_code == 2
    assert (tmp_path / "mine.html").read_text() == "<p>mine</p>"
    assert run("report", runs / "a", "-o", tmp_path / "page.png").exit_code == 2
    assert run("report").exit_code == 2


def test_a_folder_that_was_changed_is_refused(runs, tmp_path):
    place = tmp_path / "c"
    assert run(*small("run", "starter"), "-o", place).exit_code == 0
    (place / "render.png").write_bytes(b"other")
    changed = run("report", place, "-o", tmp_path / "page.html")
    assert changed.exit_code == 2
    assert "is not as its run wrote it" in changed.stderr
    record = json.loads((place / "run.json").read_text())
    del record["exposure"]
    record["files"] = []
    (place / "run.json").write_text(json.dumps(record))
    broken = run("report", place, "-o", tmp_path / "page.html")
    assert broken.exit_code == 2
    assert "not as this version of vcam writes it" in broken.stderr


@pytest.mark.long
def test_a_sweep_has_a_report_of_its_tables_and_plots(tmp_path):
    out = tmp_path / "out"
    words = ["sweep", "exposure-and-noise", "-q", "--workers", 1, "-o", out]
    more = [part for s in SMALL for part in ("--set", s)]
    assert run(*words, *more, "--report", "--format", "pdf").exit_code == 0
    assert (out / "mean_s_cielab.pdf").read_bytes().startswith(b"%PDF")
    found = check((out / "report.html").read_text("utf-8"))
    alts = {image["alt"] for image in found.images}
    assert any("mean_s_cielab" in alt for alt in alts)
    shown = "".join(found.texts)
    assert all(name in shown for name in ("points.csv", "optimum.csv", "timings.csv", "quiet"))
    assert "report.html" in json.loads((out / "study.json").read_text())["files"]
    points = (out / "points.csv").read_bytes()
    again = run(*words, *more, "--report", "--format", "pdf", "--json")
    assert json.loads(again.stdout)["computed"] == 0
    assert (out / "points.csv").read_bytes() == points
    assert run(*words, *more).exit_code == 0
    assert not (out / "report.html").exists()  # it is of a request that has one
    assert not (out / "mean_s_cielab.pdf").exists()


def test_a_schedule_has_a_report(tmp_path):
    words = ["schedule", "captures", "--set", "counts=[2, 3]", "--report", "-q", "-o", tmp_path]
    done = run(*words, "--format", "svg", "--format", "png")
    assert done.exit_code == 0, done.output
    plots = {path.stem for path in tmp_path.glob("*.png")}
    assert len(plots) >= 3
    assert {path.stem for path in tmp_path.glob("*.svg")} == plots
    assert not list(tmp_path.glob("*.pdf"))
    assert run(*words, "--format", "bmp").exit_code == 2
    found = check((tmp_path / "report.html").read_text("utf-8"))
    assert "best of 3 captures" in "".join(found.texts)
    assert len(found.images) >= 2


@pytest.mark.long
@pytest.mark.parametrize("command", ["accuracy", "characterize"])
def test_measured_cameras_have_a_report(command, tmp_path):
    words = small(command, "starter")
    done = run(*words, "--report", "-o", tmp_path / "out")
    assert done.exit_code == 0, done.output
    found = check((tmp_path / "out" / "report.html").read_text("utf-8"))
    assert found.images
    assert f"{command}.csv" in "".join(found.texts)


def decoded(source, folder):
    """The gray codes of a picture that a page holds."""
    file = folder / "picture.png"
    file.write_bytes(base64.b64decode(source.partition(",")[2]))
    return OpenImageIO.ImageBuf(str(file)).get_pixels(OpenImageIO.UINT8)[:, :, 0]


def test_cells_of_a_mosaic_stand_for_it_until_it_is_zoomed(tmp_path):
    """Shown smaller, pixels that alternate would beat with the screen's; zoomed, each is seen."""
    mosaic = np.zeros((100, 400), np.uint8)
    mosaic[::2, ::2] = 200
    far = decoded(pictures.without_mosaic(mosaic), tmp_path)
    assert np.array_equal(far, np.full((50, 200), 50))
    assert not pictures.without_mosaic(mosaic[:, :200])
    wide = np.tile(mosaic, (1, 6))  # 2400 columns: squares of 3 x 3 would not have all colors alike
    source, note = pictures.codes(wide, is_mosaic=True)
    assert "1/4" in note
    assert np.unique(decoded(source, tmp_path)).tolist() == [50]
    shown = Picture("raw", "data:b", "alt", group="a", far="data:a")
    text = page.html(Page("t", "a", [Section("s", [shown])]))
    assert text.index('class="far" src="data:a"') < text.index('src="data:b"')


def test_a_table_leaves_out_columns_in_which_nothing_stands():
    csv = b"frame,channel,error\none,,1.5\ntwo,,2.5\n"
    text = study_report.study_html("t", "a", [], {"verify.csv": csv}).decode()
    assert "channel" not in text
    assert "error" in text
