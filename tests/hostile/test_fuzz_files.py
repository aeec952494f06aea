"""Camera and study files with something broken in them: told in a sentence, or good after all.

`make fuzz` does the same with more files. A case that fails is reproduced by its seed:
`fuzz.made("cameras", 123)` is the file.
"""

import re
import subprocess
from collections import Counter
from pathlib import Path

import pytest
from fuzz import FILE, case, inside, made
from making import long_except
from mutations import harmed
from processes import VCAM, environment

BLOCKS, CAMERAS, STUDIES = 40, 38, 12
"""2000 files, in blocks that processes can share."""
SIMULATED = 25  # every so manieth camera that is accepted


@pytest.mark.parametrize("block", long_except([0], range(BLOCKS)))
def test_every_file_is_accepted_or_refused_with_a_message(block, tmp_path):
    ends: Counter[str] = Counter()
    with inside(tmp_path):
        for kind, count in (("cameras", CAMERAS), ("studies", STUDIES)):
            for seed in range(block * count, (block + 1) * count):
                found = case(kind, seed, simulated=seed % SIMULATED == 0)
                assert found.end != "bug", f"{kind} {seed} ({found.of}): {found.said}"
                ends[found.end] += 1
    # neither all broken beyond the YAML, nor all harmless: else the test says little
    assert ends["refused"] > 0.3 * (CAMERAS + STUDIES)
    assert ends["accepted"] + ends["simulated"] > 5


@pytest.mark.parametrize("share", long_except([0], range(4)))
def test_the_command_says_so_too(share, tmp_path):
    """40 files through `vcam validate`: exit code 0, 2 or 3, a sentence for each, no traceback."""
    names = []
    for seed in range(share * 10, share * 10 + 10):
        name = f"{seed}.yaml"
        kind = "studies" if seed % 4 == 3 else "cameras"
        (tmp_path / name).write_bytes(made(kind, 5000 + seed)[1])
        names.append(name)
    done = subprocess.run(
        [*VCAM, "validate", *names], cwd=tmp_path, env=environment(), capture_output=True,
        timeout=300,
    )  # fmt: skip
    said, good = done.stderr.decode(), done.stdout.decode()
    assert done.returncode in (0, 2, 3)
    assert "Traceback" not in said
    for name in names:
        refused = re.search(f"^{re.escape(name)}[:,]", said, re.MULTILINE) is not None
        assert refused != (f"{name}: ok" in good), (name, said, good)
    assert said.isascii() or said.isprintable() or "\x1b" not in said


def test_the_same_seed_is_the_same_file(tmp_path):
    assert made("cameras", 7) == made("cameras", 7)
    assert len({made("cameras", seed)[1] for seed in range(0, 2900, 29)}) > 90


def test_harm_reaches_values_and_not_only_the_text():
    """Of a small file, every place is changed by some seed, and most results are still YAML."""
    import yaml

    text = "a: 1 um\nb: {c: [2, x]}\n"
    read = []
    for seed in range(400):
        try:
            read.append(yaml.safe_load(harmed(text, seed).decode()))
        except (yaml.YAMLError, UnicodeDecodeError):
            continue
    trees = [tree for tree in read if isinstance(tree, dict)]
    assert len(trees) > 250
    assert any(tree.get("a") not in ("1 um", None) for tree in trees)
    assert any(tree.get("b") == {"c": [2, "x"]} for tree in trees)
    assert any("a" not in tree for tree in trees)


def test_a_bug_would_be_noticed(tmp_path, monkeypatch):
    """An error that is none of vcam's, a warning, a hang."""
    import warnings

    import fuzz

    with inside(tmp_path):
        for broken in (
            lambda: 1 / 0,
            lambda: warnings.warn("overflow", RuntimeWarning, stacklevel=1),
            lambda: [None for _ in iter(int, 1)],
        ):
            monkeypatch.setattr(fuzz, "checked", broken)
            monkeypatch.setattr(fuzz, "LONGEST", 0.05)
            with fuzz.deadline(600):
                pass
            found = fuzz.case("cameras", 0)
            assert found.end == "bug", found
        assert Path(FILE).is_file()
