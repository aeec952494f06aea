"""Files that try to run code, or to reach what they do not name: each is refused with a sentence.

`vcam validate` reads many of them in one process of bounded memory and time.
"""

import json
import os
import threading
from pathlib import Path
from socketserver import BaseRequestHandler, TCPServer

import numpy as np
import pytest
import spectral_files as made
import yaml
from cameras import camera, image_of, said_of, spectra_of, validated
from making import long_except
from processes import vcam
from typer.testing import CliRunner

from vcam_cli.commands import main
from vcam_cli.errors import BadInput
from vcam_cli.files.spectral.hyperspectral import read_cube

STARTER = Path(__file__).parents[2] / "configs" / "cameras" / "starter.yaml"


CODE = {
    "an object": "!!python/object/apply:os.system ['touch ran']",
    "a name": "!!python/name:os.system ''",
    "a module": "!!python/module:antigravity ''",
    "a new object": "!!python/object/new:os.system ['touch ran']",
    "a local tag": "!exec 'touch ran'",
    "binary": "!!binary aGVsbG8=",
    "a tag of four megabytes": "!" * 4_000_000,
}
TEXTS = {
    "templates": "$(touch ran) `touch ran` {0.__class__.__mro__} %(x)s ${HOME}",
    "a hundred kilobytes": "z" * 100_000,
    "steering": "\x1b[2J\x07\x1b]0;owned",
}


@pytest.mark.parametrize("third", long_except([0], range(3)))
def test_nothing_of_a_file_is_run_and_all_is_refused(third, tmp_path):
    """A third of the pairs of a value and a place, each of both in every third."""
    text = STARTER.read_text("utf-8")
    names = {}
    for i, (what, value) in enumerate((*CODE.items(), *TEXTS.items())):
        whole = value if what in CODE else json.dumps(value)
        for j, old in enumerate(("1000 cd/m2", "srgb", "starter\n")):
            assert text.count(old) == 1
            if (i + j) % 3 != third:
                continue
            name = names[what, old] = f"{i}-{j}.yaml"
            (tmp_path / name).write_text(text.replace(old, whole + "\n" * old.endswith("\n")))
    before = sorted(os.listdir(tmp_path))
    said = validated(list(names.values()), tmp_path)
    for (what, _), name in names.items():
        assert name in said[name], what
        assert len(said[name]) < 10_000, what
        assert "the YAML tag" in said[name] or what in TEXTS
        assert said[name].replace("\n", "").isprintable()
    assert sorted(os.listdir(tmp_path)) == before


@pytest.fixture
def server():
    """Of this machine, at which whoever asks for a URL would arrive."""
    asked = []

    class Handler(BaseRequestHandler):
        def handle(self) -> None:
            asked.append(self.client_address)

    with TCPServer(("127.0.0.1", 0), Handler) as listening:
        threading.Thread(target=listening.serve_forever, args=(0.01,), daemon=True).start()
        yield f"127.0.0.1:{listening.server_address[1]}", asked
        listening.shutdown()


@pytest.mark.parametrize("half", long_except([0], range(2)))
def test_nothing_is_reached_but_regular_files(half, tmp_path, server, monkeypatch):
    """Half of the pairs of a place and a key that names it, each of both in every half."""
    address, asked = server
    secret = tmp_path / "home" / "secret.csv"
    secret.parent.mkdir()
    secret.write_text("wavelength_nm,value\n300,0.5\n900,0.5\n")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("/dev/zero")
    (tmp_path / "circle").symlink_to("circle")
    places = [
        f"http://{address}/a.csv", f"https://{address}/a", f"file://{secret}", f"ftp://{address}/a",
        f"\\\\{address}\\share\\a.csv", "/dev/zero", "/dev/stdin", "/dev/fd/0", "/dev/random",
        "/proc/self/environ/x", "pipe", "link", "circle", ".", "/", "~/secret.csv", "~root/x.csv",
        "$HOME/secret.csv", "${HOME}/secret.csv", "%HOME%/secret.csv", "`cat x`", "|cat x", "*.csv",
        "-", "", " ", "x" * 5000, "a\0b", "oiio:DebugOpenConfig!", "noise.null?RES=9x9",
    ]  # fmt: skip
    names = []
    for i, place in enumerate(places):
        for j, changes in enumerate(
            (
                {"optics.transmittance": {"file": place}},
                image_of(place),
                spectra_of(place),
                {"array": {"pattern": {"positions": place}}, "output.render": "none"},
                {"extends": place if place.strip() else "-"},
                {"optics": {"use": place}},
            )
        ):
            names.append(camera(tmp_path, f"{i}-{j}.yaml", changes))
        for kind in ("histogram", "camera"):
            pdf = {kind: place if kind == "camera" else {"file": place}}
            study = {"kind": "schedule", "pdf": pdf, "counts": [2], "full_well": "10 ke"}
            names.append(f"{i}-{kind}.yaml")
            (tmp_path / names[-1]).write_text(yaml.safe_dump(study))
    (tmp_path / "study.yaml").write_text(
        f"kind: sweep\ncamera: http://{address}/c.yaml\nvary: {{adc.bits: {{values: [8]}}}}\n"
        "metrics: [snr_db]\n"
    )
    monkeypatch.setenv("HOME", str(secret.parent))
    keys = len(names) // len(places)
    names = [n for i, n in enumerate(names) if (i + i // keys) % 2 == half]
    said = validated([*names, "study.yaml"], tmp_path)
    assert not asked
    for name in (*names, "study.yaml"):
        assert said[name].startswith(name), (places[int(name.split("-")[0])], said[name])
        assert "0.5" not in said[name]
        assert len(said[name]) < 10_000


def test_an_include_shows_nothing_of_a_file_that_is_no_camera(tmp_path):
    """A message names the place in a file, never a line of its text."""
    (tmp_path / "password.txt").write_text("root: hunter2: x\n")
    (tmp_path / "words.csv").write_text("hunter2,hunter3\n1,2\n")
    text = "extends: ./password.txt\n"
    (tmp_path / "a.yaml").write_text(text)
    said = said_of(vcam(["validate", "--json", "a.yaml"], tmp_path))["a.yaml"]
    assert "password.txt:1:14: is not YAML" in said
    assert "hunter" not in said


@pytest.mark.parametrize("way", ["a link", "a path inside", "storage elsewhere", "virtual"])
def test_hdf5_that_points_into_another_file(way, tmp_path):
    """HDF5 may say that its numbers lie elsewhere: another's bytes would come out as a picture."""
    h5py = pytest.importorskip("h5py")
    secret = tmp_path / "secret"
    shape = made.CUBE.T.shape
    with h5py.File(secret, "w") as file:
        file["x"] = made.photons().T
        file["a/photons"] = made.photons().T
    with h5py.File(tmp_path / "scene.mat", "w") as file:
        file["wave"] = made.NM
        match way:
            case "a link":
                file["photons"] = h5py.ExternalLink(str(secret), "/x")
            case "a path inside":
                file["scene/spectrum/wave"] = made.NM
                file["scene/data"] = h5py.ExternalLink(str(secret), "/a")
            case "storage elsewhere":
                place = [(str(secret), 0, made.CUBE.size)]
                file.create_dataset("photons", shape, "u1", external=place)
            case "virtual":
                layout = h5py.VirtualLayout(shape, "f8")
                layout[:] = h5py.VirtualSource(str(secret), "x", shape)
                file.create_virtual_dataset("photons", layout)
    with pytest.raises(BadInput, match=r"scene\.mat: its .*(link|another file); save it with"):
        read_cube(tmp_path / "scene.mat", "file")


def test_an_array_of_objects_is_not_unpickled(tmp_path):
    class Harm:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "ran"),)

    objects = np.empty((1, 1, 2), object)
    objects[:] = Harm()
    made.npz(tmp_path / "a.npz", wavelength_nm=made.NM[:2], radiance=objects)
    made.npz(tmp_path / "b.npz", wavelength_nm=objects, radiance=made.CUBE)
    for name in ("a.npz", "b.npz"):
        with pytest.raises(BadInput, match="holds no real numbers"):
            read_cube(tmp_path / name, "file")
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("value", [
    "optics.f_number=!!python/object/apply:os.system ['touch ran']",
    "optics.transmittance={file: /dev/zero}",
    "optics.transmittance={file: 'http://127.0.0.1:9/a.csv'}",
    "optics={use: ~/secret.yaml}",
    "name=../../x",
    "scene={a: &a [1], b: &b [*a, *a], c: *c}",
    "pixel.width=" + "[" * 10_000,
])  # fmt: skip
def test_the_command_line_is_no_way_around(value, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    camera(tmp_path, "camera.yaml", {})
    line = ["run", "camera.yaml", "-q", "--set", value]
    result = CliRunner().invoke(main.app, line, prog_name="vcam")
    assert result.exit_code == 2, (result.stderr, result.exception)
    assert "--set" in result.stderr, (result.stderr, result.exception)
    assert os.listdir(tmp_path) == ["camera.yaml"]


@pytest.mark.parametrize("name", ["../../x", "/tmp/x", "..", ".", "a/b", "x\0y", "", "~", "$HOME"])
def test_a_name_leads_to_no_other_folder(name, tmp_path):
    """The output goes to out/NAME: of a camera, and of a study."""
    study = {"kind": "sweep", "camera": "starter", "metrics": ["snr_db"], "vary": {}}
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(study | {"name": name}))
    from vcam_cli.simulation import checks
    from vcam_cli.sweeps import sweep_file

    with pytest.raises(BadInput, match="is not a name of letters"):
        checks.load(tmp_path / camera(tmp_path, "camera.yaml", {"name": name}))
    with pytest.raises(BadInput, match="is not a name of letters"):
        sweep_file.read(tmp_path / "study.yaml")
