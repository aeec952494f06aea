"""Formulas of data sets: arithmetic with units against Python's own, and what is refused."""

import math

import pytest
import yaml
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from making import tree
from typer.testing import CliRunner

from vcam_cli import units
from vcam_cli.commands.main import app
from vcam_cli.datasets import dataset_file
from vcam_cli.datasets.formulas import read_formula
from vcam_cli.errors import BadInput


@pytest.mark.parametrize(
    ("text", "known", "value"),
    [
        ("20 ms / gain", {"gain": 8}, "2.5 ms"),
        ("20ms/gain", {"gain": 8}, "2.5 ms"),
        ("2 * (1 s - time) / 4", {"time": "500 ms"}, "250 ms"),
        ("15 e * exposure.gain^-0.5", {"exposure.gain": 4}, "7.5 e"),
        ("2^3^2", {}, 512.0),  # from the right, as everywhere
        ("-2^2 + 10 %", {}, -3.9),  # powers first
        ("50 cd/m2 * 20 ms / t", {"t": "10 ms"}, "100 cd/m2"),
        ("sqrt((3 um)^2 / 1 um * w)", {"w": "4 um"}, None),
        ("max(1 ms, min(t, 1/60*1 s))", {"t": "2 s"}, "16.6666667 ms"),
        ("exp(log(7))", {}, 7.0),
        ("e * 2 e", {"e": 3}, "6 e"),
        ("300 K + 2 K", {}, "302 K"),
        ("12 e/s * 2 s / 1 s", {}, "24 e/s"),
        ("1e3 ms / 2.5e-1", {}, "4 s"),
    ],
)
def test_what_a_formula_gives(text, known, value):
    formula = read_formula(text)
    assert set(formula.names) == set(known)
    if value is None:
        with pytest.raises(ValueError, match="divide by a unit first"):
            formula.value(known)
    else:
        assert formula.value(known) == value


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "1 to 400 characters"),
        ("1 +" + " 1 +" * 200, "1 to 400 characters"),
        ("20 ms / ", "missing at the end"),
        ("(2 + 3", "')' is missing"),
        ("2 3", "'3' is not expected"),
        ("__import__('os')", "is no number, unit or name"),
        ("open(1)", "'open' is not a function"),
        ("sqrt(1, 2)", "sqrt takes 1 value, not 2"),
        ("(" * 60 + "1" + ")" * 60, "too deeply"),
        ("-" * 5 + "1", "missing before"),
        ("20 degC", "is not expected"),
    ],
)
def test_what_is_no_formula(text, says):
    with pytest.raises(ValueError, match=r".+") as caught:
        read_formula(text)
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("1 s + 2 e", "a time and a charge in electrons do not add"),
        ("1 s * 2 s", "time^2, which no key takes"),
        ("1 / 0", "divides by zero"),
        ("10^400", "too large"),
        ("10^300 * 10^300", "too large"),
        ("(-8)^0.5", "no such power"),
        ("(2 s)^0.5", "an integer"),
        ("log(-1)", "log of -1 is no number"),
        ("max(1 s, 2)", "different units"),
    ],
)
def test_what_has_no_value(text, says):
    with pytest.raises(ValueError, match=r".+") as caught:
        read_formula(text).value({})
    assert says in str(caught.value)


_numbers = st.floats(0.1, 10).map(lambda x: float(f"{x:.4g}"))
_formulas = st.recursive(
    st.one_of(_numbers.map(repr), st.sampled_from(["a", "b"])),
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from([" + ", " - ", " * ", " / "]), inner).map("".join),
        inner.map("({})".format),
        inner.map("sqrt(1 + ({})^2)".format),
    ),
    max_leaves=8,
)


@examples(200)
@given(_formulas, _numbers, _numbers)
def test_bare_numbers_are_computed_as_python_does(text, a, b):
    try:
        truth = eval(text.replace("^", "**"), {"a": a, "b": b, "sqrt": math.sqrt})
    except ZeroDivisionError:
        with pytest.raises(ValueError, match="divides by zero"):
            read_formula(text).value({"a": a, "b": b})
    else:  # nine digits are kept, so half a unit of the last
        assert read_formula(text).value({"a": a, "b": b}) == pytest.approx(truth, rel=5.1e-9)


STUDY = {
    "kind": "dataset",
    "name": "tied",
    "camera": "camera.yaml",
    "vary": {
        "exposure.gain": {"log_uniform": [1, 32]},
        "exposure.time": {"from": "20 ms / gain"},
        "pixel.readout.read_noise": {"from": "8 e * gain^-0.5", "scatter": 0.25},
    },
    "frames": 400,
    "size": {"rows": 8, "columns": 8},
}


def study(folder, **changes):
    (folder / "camera.yaml").write_text(yaml.safe_dump(tree({})))
    vary = changes.pop("vary", STUDY["vary"])
    (folder / "study.yaml").write_text(yaml.safe_dump(STUDY | {"vary": vary}, sort_keys=False))
    return folder / "study.yaml"


def test_draws_are_tied_and_scatter_as_stated(tmp_path):
    """Exposure keeps; the noise's logarithm is normal about the line: 5 standard errors of 400."""
    file = dataset_file.read(study(tmp_path))
    z = []
    for number in range(400):
        drawn = file.frame(number).values
        gain = drawn["exposure.gain"]
        assert 1 <= gain <= 32
        assert units.parse(drawn["exposure.time"], "time") * gain == pytest.approx(0.02, rel=1e-8)
        noise = units.parse(drawn["pixel.readout.read_noise"], "charge")
        z.append(math.log(noise / (8 * gain**-0.5)) / 0.25)
    mean = sum(z) / 400
    assert mean == pytest.approx(0, abs=5 / math.sqrt(400))
    spread = math.sqrt(sum((x - mean) ** 2 for x in z) / 399)
    assert spread == pytest.approx(1, abs=5 / math.sqrt(800))
    camera = file.frame(3).camera(file.base)
    assert camera.exposure.time * camera.exposure.gain == pytest.approx(0.02, rel=1e-8)


def test_a_formula_changes_no_other_draw(tmp_path):
    tied = dataset_file.read(study(tmp_path))
    alone = {"exposure.gain": STUDY["vary"]["exposure.gain"]}
    bare = dataset_file.read(study(tmp_path, vary=alone))
    for number in range(5):
        assert (
            tied.frame(number).values["exposure.gain"] == bare.frame(number).values["exposure.gain"]
        )


@pytest.mark.parametrize(
    ("vary", "says"),
    [
        ({"exposure.time": {"from": "20 ms / gain"}}, "'gain' is unknown"),
        ({"exposure.time": {"from": "2 * time"}}, "write one of the keys above: (none)"),
        (
            {
                "adc.gain": {"uniform": ["1 DN/e", "2 DN/e"]},
                "exposure.gain": {"uniform": [1, 2]},
                "exposure.time": {"from": "1 ms * gain"},
            },
            "'gain' means adc.gain, exposure.gain",
        ),
        (
            {
                "pixel.readout.reset_noise": {"choice": ["ktc", "none"]},
                "exposure.time": {"from": "1 ms * reset_noise"},
            },
            "not numbers",
        ),
        ({"exposure.time": {"from": "1 ms", "uniform": ["1 ms", "2 ms"]}}, "cannot both be given"),
        ({"exposure.time": {"uniform": ["1 ms", "2 ms"], "scatter": 1}}, "scatter applies only to"),
        ({"exposure.time": {"from": "1 ms + 1 e"}}, "do not add"),
        ({"exposure.time": {"from": "3 e"}}, "is a charge in electrons, not a time"),
        ({"exposure.time": {"from": 7}}, "7 is no formula"),
    ],
)
def test_mistakes_are_said_with_their_place(vary, says, tmp_path):
    file = study(tmp_path, vary=vary)
    with pytest.raises(BadInput) as caught:
        dataset_file.read(file)
    assert says in str(caught.value)
    assert "study.yaml:" in str(caught.value)
    result = CliRunner().invoke(app, ["dataset", str(file), "-o", str(tmp_path / "out")])
    assert result.exit_code == 2
