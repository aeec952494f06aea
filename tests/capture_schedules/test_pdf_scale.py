"""Photocurrents in arbitrary units on a sensor: refused where no camera is like that, or scaled."""

import numpy as np
import pytest
from making import long_except

from vcam_cli import BadInput, schedule
from vcam_cli.capture_schedules import schedule_file

STUDY = """kind: schedule
pdf: {pdf}
counts: [4]
sensor: {{well_capacity: 20 ke, read_noise: 10 e{more}}}
"""
TABLE = "{histogram: {file: codes.csv}%s}"
LEVELS = "{levels: {file: levels.csv}%s}"
MAX = ", max_time: 100 ms"


@pytest.fixture
def study(tmp_path):
    rows = "".join(f"{code},{code + 1},{1000 - code}\n" for code in range(256))
    (tmp_path / "codes.csv").write_text(f"low,high,count\n{rows}")
    (tmp_path / "levels.csv").write_text("level,count\n0.1,5\n1,3\n")

    def write(pdf, more=""):
        (tmp_path / "study.yaml").write_text(STUDY.format(pdf=pdf, more=more))
        return tmp_path / "study.yaml"

    return write


@pytest.mark.parametrize("more", [MAX, ""], ids=["max_time", "any time"])
@pytest.mark.parametrize("pdf", [TABLE % "", LEVELS % ""])
def test_arbitrary_units_are_refused(study, pdf, more):
    """Where a sensor would see nothing: with 256 e/s for white, a well of 20 ke fills in 78 s."""
    if pdf.startswith("{histogram") and not more:
        pytest.skip("78 s are an exposure of the night sky")
    with pytest.raises(BadInput, match=r"brightest: .*e/s") as error:
        schedule_file.read(study(pdf, more))
    assert "study.yaml:2:" in str(error.value)


@pytest.mark.parametrize("pdf", long_except([TABLE], [TABLE, LEVELS]))
def test_the_remedy_works(study, pdf, tmp_path):
    """What the message says is taken, and no schedule but the scale of times depends on it."""
    with pytest.raises(BadInput) as error:
        schedule_file.read(study(pdf % "", MAX))
    remedy = str(error.value).partition("in the pdf: ")[2]
    known = schedule_file.read(study(pdf % f", {remedy}", MAX)).known
    assert 20e3 / known.max == pytest.approx(0.01, rel=0.05)
    one, two = (
        schedule(study(pdf % f", brightest: {rate} ke/s"), tmp_path / f"out{rate}")
        for rate in (40, 400)
    )
    np.testing.assert_allclose(one.times("optimal", 4), 10 * two.times("optimal", 4), rtol=1e-6)


@pytest.mark.parametrize(
    "pdf", ["{uniform: {min: 0, max: 250}}", "{segments: [{min: 0, max: 250 e/s, probability: 1}]}"]
)
def test_what_is_written_in_the_study_is_believed(study, pdf):
    assert schedule_file.read(study(pdf, MAX)).known.max == 250


def test_relative_photocurrents_in_the_study_are_wondered_at(study, tmp_path):
    """A well of 20 ke takes five hours of 1 e/s: said, as the stars may be meant."""
    uniform = "{uniform: {min: 0, max: 1}%s}"
    (said,) = schedule(study(uniform % ""), tmp_path / "out").notes
    assert "fills the well in 2e+04 s" in said
    remedy = said.partition("add to the pdf ")[2]
    assert not schedule(study(uniform % f", {remedy}"), tmp_path / "two").notes


def test_what_numbers_were_taken_for_is_said(study, tmp_path):
    found = schedule(study(TABLE % ", brightest: 4 fA", ""), tmp_path / "out")
    assert any("as the study scales them: the brightest, 2.497e+04 e/s" in n for n in found.notes)


@pytest.mark.parametrize(
    ("pdf", "said"),
    [("{camera: hdr-patches, brightest: 4 ke/s}", "a camera's photocurrents are in e/s already")],
)
def test_a_scale_that_cannot_act_is_refused(study, pdf, said):
    with pytest.raises(BadInput, match=said):
        schedule_file.read(study(pdf))
    path = study(TABLE % ", brightest: 4 ke/s")
    path.write_text(path.read_text().partition("sensor")[0])
    with pytest.raises(BadInput, match="has no effect: without a sensor"):
        schedule_file.read(path)
