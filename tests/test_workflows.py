"""The project's own workflow of a sweep: the documentation prints it, and its commands run.

Here in one process: shares in folders of their own, which are merged as the artifacts are.
"""

import re
import shlex
import shutil

import pytest
import yaml
from typer.testing import CliRunner

from tests import documents
from tests.documents import ROOT
from vcam_cli.commands.main import app

WORKFLOW = ROOT / ".github" / "workflows" / "sweep.yml"
SMALL = ("-q", "--workers", "1", "--set", "seeds=1", "--set", "vary.exposure.time.count=5",
         "--set", "array.rows=48", "--set", "array.columns=72")  # fmt: skip


def steps(job):
    return yaml.safe_load(documents.read(WORKFLOW))["jobs"][job]["steps"]


def test_the_documentation_prints_the_workflow():
    page = documents.read(ROOT / "docs" / "howto" / "sweeps.md")
    assert f"```yaml\n{documents.read(WORKFLOW)}```\n" in page


@pytest.fixture(scope="module")
def merged(tmp_path_factory):
    """The points of all shares in one folder, as the artifacts bring them together."""
    folder = tmp_path_factory.mktemp("shares")
    (share,) = (step["with"] for step in steps("share") if step.get("uses") == "./")
    for index in (1, 2):
        out = folder / str(index)
        shard = share["shard"].replace("${{ matrix.share }}", str(index))
        words = ["sweep", share["study"], "-o", str(out), "--shard", shard, *SMALL]
        assert CliRunner().invoke(app, words).exit_code == 0
        shutil.copytree(out / "points", folder / "whole" / "points", dirs_exist_ok=True)
    return folder / "whole"


def test_shares_add_up_and_the_limits_hold(merged):
    (gate,) = (step["run"] for step in steps("whole") if "--expect" in step.get("run", ""))
    words = shlex.split(re.sub(r"-o \S+", f"-o {merged}", gate))[1:]
    done = CliRunner().invoke(app, [*words, *(word for word in SMALL if word != "-q")])
    assert done.exit_code == 0, done.output
    assert "10 of 10 points, 0 computed" in done.output
    missed = CliRunner().invoke(app, [*words, *SMALL, "--expect", "psnr_db >= 99"])
    assert missed.exit_code == 4
