"""`vcam list technologies NAME --report`: regions of photocurrent and dark current."""

import pytest
from typer.testing import CliRunner

from vcam_cli.characterization.process_report import process_report
from vcam_cli.commands.main import app


def call(*arguments):
    return CliRunner().invoke(app, ["list", *arguments])


@pytest.mark.parametrize("name", ["cmos-0.35um", "cmos-0.18um"])
def test_every_kind_has_its_lines(name):
    done = call("technologies", name, "--report")
    assert done.exit_code == 0, done.output
    for kind in ("ndiff-psub", "nwell-psub", "photogate", "pinned"):
        assert done.stdout.count(kind) == 3


def test_what_is_printed_is_eq_230_and_231():
    """0.35 um: 1.3 ke of generation and next to nothing else, as eq 2.31 by hand."""
    reports = dict(process_report("cmos-0.35um"))
    diode = reports["ndiff-psub"]
    holes, generation, electrons = diode.dark
    assert generation == pytest.approx(13.2e-5, rel=0.01)
    assert holes + electrons < 1e-3 * generation
    assert len({round(r.capacitance * 1e18) for r in reports.values()}) == 3, "two are transferred"
    assert reports["pinned"].photo[0][0] == 0, "its surface layer collects nothing"


def test_only_of_technologies():
    done = call("cameras", "starter", "--report")
    assert done.exit_code == 2
    assert "vcam list technologies" in done.stderr
