"""The house rules, read from the sources: who may import whom, who may write, how long, how told.

Every rule is a function from parsed modules to the places that break it, and is itself tried on a
small module that does: a rule that finds nothing anywhere proves nothing.
"""

import ast
import gc
import io
import os
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

import vcam_cli

PACKAGE = Path(vcam_cli.__file__).parent

FLOORS = (
    {"records", "lamps"},
    {"arrays", "cache", "errors", "interrupts", "arguments"},
    {"units", "rng", "progress", "parallel", "floats"},
    {"memory", "spectra", "scheduling", "source_code"},
    {"devices"},
    {"physics"},
    {"config"},
    {"lenses"},
    {"camera"},
    {"scenes", "effects"},
    {"image_formation"},
    {"readout"},
    {"solve"},
    {"processing"},
    {"quality"},
    {"files"},
    {"reports"},
    {"simulation"},
    {"comparison"},
    {"accuracy_study"},
    {"characterization"},
    {"batches"},
    {"sweeps"},
    {"capture_schedules"},
    {"datasets"},
    {"verification"},
    {"fitting"},
    {"face"},
    {"commands"},
)
"""From the bottom: a module imports from floors below its own, and from its own room (package)."""
FLOOR = {room: number for number, rooms in enumerate(FLOORS) for room in rooms}
FLOOR[""] = len(FLOORS)  # vcam_cli/__init__.py, the face of it all
HEAVY = ("colour", "cupy", "matplotlib", "scipy.signal", "scipy.optimize", "scipy.interpolate")
UNFINISHED = ("TODO", "FIXME", "XXX", "HACK", "NotImplementedError")
WRITERS = {
    "write_text", "write_bytes", "touch", "tofile", "savetxt", "savez", "savez_compressed",
    "memmap", "savefig", "mkstemp", "NamedTemporaryFile", "TemporaryDirectory", "mkdtemp",
    "copyfile", "copy2", "copytree", "rmtree", "unlink", "rename", "symlink_to", "truncate",
    "rmdir", "removedirs", "renames",
}  # fmt: skip
"""Names of calls that change the disk, whatever they are called on. A folder may be made anywhere
(`mkdir`): an empty one holds nothing that could be half written."""
OF_OS = {"remove", "replace", "write", "fdopen", "link", "symlink"}
"""The same, but only as `os.NAME`: elsewhere they are ordinary words."""


@dataclass(frozen=True)
class Module:
    """A parsed source file; `name` is dotted, without `vcam_cli.`."""

    name: str
    text: str

    @property
    def room(self) -> str:
        return self.name.partition(".")[0]

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.text)

    @cached_property
    def nodes(self) -> tuple[ast.AST, ...]:
        """All nodes of the tree, walked once for all rules."""
        return tuple(walked(self.tree))

    @cached_property
    def by_kind(self) -> dict[type[ast.AST], list[ast.AST]]:
        """The nodes by what they are: a rule looks at its own kinds of node alone."""
        found: dict[type[ast.AST], list[ast.AST]] = {}
        for node in self.nodes:
            found.setdefault(type(node), []).append(node)
        return found

    def of(self, *kinds: type[ast.AST]) -> list[Any]:
        """The nodes of some kinds."""
        return [node for kind in kinds for node in self.by_kind.get(kind, ())]

    @cached_property
    def imports(self) -> tuple[tuple[int, str], ...]:
        """(line, dotted name) of every import, inside functions and TYPE_CHECKING as well."""
        nodes = self.of(ast.Import, ast.ImportFrom, ast.Call)
        return tuple((node.lineno, name) for node in nodes for name in imported(node))


def walked(tree: ast.Module) -> list[ast.AST]:
    """The nodes of a tree but contexts (`ast.Load`), a third of all, which say nothing here."""
    found: list[ast.AST] = [tree]
    for node in found:  # which grows meanwhile
        for name in node._fields:
            value = getattr(node, name, None)
            if isinstance(value, list):
                found += [each for each in value if isinstance(each, ast.AST)]
            elif isinstance(value, ast.AST) and not isinstance(value, ast.expr_context):
                found.append(value)
    return found


def sources() -> list[Module]:
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        name = ".".join(part for part in parts if part != "__init__")
        found.append(Module(name, path.read_text("utf-8")))
    return found


MODULES = sources()


def last_name(called: ast.expr) -> str:
    """The name behind the last dot of what is called; "" where it ends with no name."""
    if isinstance(called, ast.Attribute):
        return called.attr
    return called.id if isinstance(called, ast.Name) else ""


def imported(node: ast.AST) -> list[str]:
    """The dotted names that a statement imports, `from a import b` as a.b."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom):
        return ["." * node.level + f"{node.module or ''}.{alias.name}" for alias in node.names]
    if isinstance(node, ast.Call) and "import_module" in last_name(node.func):
        return [a.value for a in node.args if isinstance(a, ast.Constant)]
    return []


def at_top(module: Module) -> Iterator[tuple[int, str]]:
    """(line, dotted name) of the imports that run when the module is imported."""
    queue: list[ast.AST] = [module.tree]
    while queue:
        node = queue.pop()
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            continue
        for name in imported(node):
            yield getattr(node, "lineno", 0), name
        queue.extend(ast.iter_child_nodes(node))


def climbs(module: Module) -> list[str]:
    """Imports of a floor above, or beside, the module's own."""
    found = []
    for line, name in module.imports:
        if name.startswith("."):
            found.append(f"{module.name}:{line}: {name} is relative; write vcam_cli...")
        package, _, rest = name.partition(".")
        room = rest.partition(".")[0]
        if package != "vcam_cli" or room in ("", "__version__"):
            continue
        if room not in FLOOR:
            found.append(f"{module.name}:{line}: {name} is on no floor")
        elif room != module.room and FLOOR[room] >= FLOOR[module.room]:
            found.append(f"{module.name}:{line}: {module.room} imports {room}")
    return found


def image_library(module: Module) -> list[str]:
    """Imports of OpenImageIO outside files/."""
    if module.room == "files":
        return []
    return [f"{module.name}:{line}" for line, n in module.imports if n.startswith("OpenImageIO")]


def heavy(module: Module) -> list[str]:
    """Slow libraries imported at the top."""
    slow = tuple(f"{name}." for name in HEAVY)
    if not any(f"{name}.".startswith(slow) for _, name in module.imports):
        return []  # the way through the statements of the top takes longer
    return [f"{module.name}:{line}: {n}" for line, n in at_top(module) if f"{n}.".startswith(slow)]


def writes(module: Module) -> list[str]:
    """Calls that change the disk outside files/."""
    if module.room == "files":
        return []
    calls = module.of(ast.Call)
    found = [f"{module.name}:{c.lineno}: {ast.unparse(c)}" for c in calls if _writes(c)]
    names = {f"{owner}.{name}" for owner in ("os", "shutil") for name in WRITERS | OF_OS}
    return found + [f"{module.name}:{line}: {n}" for line, n in module.imports if n in names]


def _writes(call: ast.Call) -> bool:
    name = last_name(call.func)
    if name not in {"open", "save"} | WRITERS | OF_OS:
        return False
    whole = ast.unparse(call.func)
    if name == "open":
        return _opens_to_write(call, whole)
    if whole in ("np.save", "numpy.save"):
        return True
    owner = whole.rpartition(".")[0]
    if owner == "os":
        return name in OF_OS | WRITERS
    # files.atomic is how the others write; a bare name is a function of the module's own.
    return name in WRITERS and owner not in ("", "atomic")


def _opens_to_write(call: ast.Call, whole: str) -> bool:
    """open(path, mode), path.open(mode); a mode that is no plain read counts as writing."""
    if whole == "os.open":  # the null device aside
        return ast.unparse(call.args[0]) != "os.devnull"
    given = [k.value for k in call.keywords if k.arg == "mode"]
    given += call.args[1:2] if whole in ("open", "io.open") else call.args[:1]
    return any(not isinstance(m, ast.Constant) or set(str(m.value)) & set("wax+") for m in given)


def undocumented(module: Module) -> list[str]:
    """Modules, public classes and public functions without a docstring.

    A method is documented where its class, or the base that it fulfills, says what it does.
    """
    tree = module.tree
    found = [module.name] if module.text.strip() and not ast.get_docstring(tree) else []
    for node in module.of(ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef):
        if node.name.startswith("_") or ast.get_docstring(node):
            continue
        if isinstance(node, ast.ClassDef) or node in tree.body:
            found.append(f"{module.name}:{node.lineno}: {node.name}")
    return found


def unfinished(module: Module) -> list[str]:
    """Words of work left undone, in code and comments."""
    words = re.compile(rf"\b({'|'.join(UNFINISHED)})\b")
    if not words.search(module.text):
        return []
    tokens = tokenize.generate_tokens(io.StringIO(module.text).readline)
    return [
        f"{module.name}:{t.start[0]}: {t.line.strip()}" for t in tokens if words.search(t.string)
    ]


CAMERA_WORDS = {
    "camera", "cameras", "scene", "scenes", "illuminant", "lens", "optics", "pixel", "pixels",
    "photodetector", "sensor", "exposure", "adc",
}  # fmt: skip


def names_a_camera(module: Module) -> list[str]:
    """Names of `config`, which knows no camera, that speak of one; texts may."""
    if module.room != "config":
        return []
    found = []
    for node in module.nodes:
        for field in ("id", "attr", "arg", "name", "asname"):
            name = getattr(node, field, None)
            if isinstance(name, str):
                words = re.split(r"[_.]", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name))
                if CAMERA_WORDS & {word.lower() for word in words}:
                    found.append(f"{module.name}:{getattr(node, 'lineno', 0)}: {name}")
    return found


def asks_for_an_effects_kind(module: Module) -> list[str]:
    """Branches on the kind of an effect outside `effects`, which answers for itself.

    `of_kind` selects effects of a kind.
    """
    if module.room == "effects":
        return []
    imported_names = {
        alias.asname or alias.name
        for node in module.of(ast.ImportFrom)
        if f"{node.module}.".startswith("vcam_cli.effects.")
        for alias in node.names
    }
    found = []
    for node in module.of(ast.Call, ast.MatchClass):
        kinds: list[ast.expr] = []
        if isinstance(node, ast.Call) and last_name(node.func) == "isinstance":
            kinds = node.args[1:]
        elif isinstance(node, ast.MatchClass):
            kinds = [node.cls]
        names = {n.id for kind in kinds for n in ast.walk(kind) if isinstance(n, ast.Name)}
        if names & imported_names:
            found.append(f"{module.name}:{getattr(node, 'lineno', 0)}: {ast.unparse(node)}")
    return found


BEHIND_SOLVE = {"image_formation", "readout", "processing", "quality", "simulation"}
"""Packages behind `solve`."""
READS_CAMERAS = {
    "simulation.simulate", "simulation.exposures", "simulation.pipeline", "simulation.reading",
    "simulation.shared",
    "simulation.planned", "simulation.sequence", "simulation.exposure_control",
    "simulation.scene_times", "simulation.bracket",  # who simulates a camera
    "simulation.checks", "simulation.scene_files", "simulation.spectral_irradiance",
    "simulation.scene_radiance",
    "simulation.output.isetcam_files", "simulation.output.raw_dng",  # who checks or reads its files
    "simulation.output.outputs", "simulation.output.provenance",  # who says where a frame is from
}  # fmt: skip
"""Modules of them in which functions take what a camera file says."""


def reads_a_camera(module: Module) -> list[str]:
    """Parameters behind `solve` that are a whole camera."""
    if module.room not in BEHIND_SOLVE or module.name in READS_CAMERAS:
        return []
    taken = (a for a in module.of(ast.arg) if a.annotation is not None)
    return [
        f"{module.name}:{a.lineno}: {a.arg}"
        for a in taken
        if a.annotation and re.search(r"\bCamera(Model)?\b", ast.unparse(a.annotation))
    ]


def slow_records(module: Module) -> list[str]:
    """Frozen dataclasses that the standard library makes: `records` takes a fifth of the time."""
    slow = "dataclasses.dataclass" in (name for _, name in module.imports)
    frozen = [n for n in module.of(ast.keyword) if slow and n.arg == "frozen"]
    return [f"{module.name}:{keyword.lineno}" for keyword in frozen if module.name != "records"]


RULES = (
    climbs, image_library, heavy, slow_records, writes, undocumented, unfinished, names_a_camera,
    asks_for_an_effects_kind, reads_a_camera,
)  # fmt: skip


def test_the_house_keeps_its_rules():
    """All rules in one test: modules are parsed and walked once.

    Their nodes stay to its end: to look for those that do not takes a third of the time.
    """
    gc.disable()
    try:
        broken = {rule.__name__: [p for m in MODULES for p in rule(m)] for rule in RULES}
    finally:
        gc.enable()
    assert broken == {rule.__name__: [] for rule in RULES}


BROKEN = [
    (climbs, "physics.lens", "def f():\n    from vcam_cli.simulation import plan\n"),
    (climbs, "units", "from vcam_cli import memory\n"),
    (climbs, "effects.x", "from vcam_cli.scenes.base import View\n"),
    (climbs, "camera.x", "import vcam_cli.files.png\n"),
    (climbs, "camera.x", "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n"
     "    from vcam_cli.simulation import simulate\n"),
    (climbs, "camera.x", "from vcam_cli import simulate\n"),
    (climbs, "camera.x", "from .base import Model\n"),
    (climbs, "camera.x", "import importlib\nimportlib.import_module('vcam_cli.files.png')\n"),
    (image_library, "scenes.image", "def f():\n    import OpenImageIO as oiio\n"),
    (heavy, "physics.x", "from scipy import signal\n"),
    (heavy, "physics.x", "import scipy.interpolate as si\n"),
    (heavy, "devices.x", "import cupy\n"),
    (heavy, "physics.x", "class A:\n    import colour\n"),
    (heavy, "physics.x", "try:\n    from matplotlib import pyplot\nexcept OSError: ...\n"),
    (slow_records, "solve.x", "from dataclasses import dataclass\n"
     "@dataclass(frozen=True)\nclass A: ...\n"),
    (writes, "sweeps.x", "open('a', 'w')\n"),
    (writes, "sweeps.x", "from pathlib import Path\nPath('a').open('ab')\n"),
    (writes, "sweeps.x", "open('a', mode=how)\n"),
    (writes, "sweeps.x", "from pathlib import Path\nPath('a').write_text('b')\n"),
    (writes, "sweeps.x", "import os\nos.replace('a', 'b')\n"),
    (writes, "sweeps.x", "import numpy as np\nnp.save('a', b)\n"),
    (writes, "sweeps.x", "array.tofile('a')\n"),
    (writes, "sweeps.x", "from shutil import rmtree\n"),
    (undocumented, "x", "a = 1\n"),
    (undocumented, "x", "'''Module.'''\ndef public():\n    pass\n"),
    (undocumented, "x", "'''Module.'''\nclass Public:\n    pass\n"),
    (unfinished, "x", "a = 1  # TO" + "DO: more\n"),
    (unfinished, "x", "raise NotImplemented" + "Error\n"),
    (names_a_camera, "config.x", "def camera_file():\n    pass\n"),
    (names_a_camera, "config.x", "from vcam_cli.config.x import PixelWidth\n"),
    (names_a_camera, "config.x", "f(lens=1)\n"),
    (reads_a_camera, "readout.x", "def f(a, camera: Camera | None):\n    pass\n"),
    (reads_a_camera, "simulation.x", "def f(*, c: 'camera.Camera'):\n    pass\n"),
    (asks_for_an_effects_kind, "readout.x", "from vcam_cli.effects.base import Charge, Gain\n"
     "if isinstance(a, Charge):\n    pass\nelif isinstance(a, int | Gain):\n    pass\n"),
    (asks_for_an_effects_kind, "readout.x", "from vcam_cli.effects import base\n"
     "[a for a in b if isinstance(a, base.Charge)]\n"),
    (asks_for_an_effects_kind, "readout.x", "from vcam_cli.effects.fpn import FixedPattern as Fpn\n"
     "match a:\n    case Fpn(): ...\n"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("rule", "name", "text"), BROKEN, ids=[f"{b[0].__name__}-{i}" for i, b in enumerate(BROKEN)]
)
def test_every_rule_can_be_broken(rule, name, text):
    assert rule(Module(name, text))


KEPT = [
    (
        climbs,
        "image_formation.x",
        "from vcam_cli.effects.base import Effect\nfrom vcam_cli import memory\n",
    ),
    (climbs, "spectra.x", "from vcam_cli.spectra.text import read\n"),
    (climbs, "sweeps.x", "import vcam_cli\nfrom vcam_cli import __version__\n"),
    (heavy, "physics.x", "import scipy.fft\ndef f():\n    from scipy import signal\n"),
    (writes, "camera.x", "open('a', 'rb')\nopen('a', encoding='utf-8')\npath.open()\n"),
    (writes, "commands.x", "atomic.write_text('a', 'b')\n'a'.replace('a', 'b')\n"),
    (writes, "files.x", "open('a', 'w')\n"),
    (undocumented, "x", "'''Module.'''\ndef _private():\n    pass\n"),
    (reads_a_camera, "readout.x", "def f(camera: Solved, other: CameraEffects):\n    pass\n"),
    (reads_a_camera, "solve.x", "def f(camera: Camera):\n    pass\n"),
    (names_a_camera, "config.x", "a = 'write pixel.width'\n"),
    (names_a_camera, "camera.x", "pixel = 1\n"),
    (
        asks_for_an_effects_kind,
        "readout.x",
        "from vcam_cli.effects.base import Charge, of_kind\n"
        "of_kind(a, Charge)\nisinstance(a, str)\n",
    ),
    (
        asks_for_an_effects_kind,
        "effects.x",
        "from vcam_cli.effects.base import Charge\nisinstance(a, Charge)\n",
    ),
]


@pytest.mark.parametrize(
    ("rule", "name", "text"), KEPT, ids=[f"{k[0].__name__}-{i}" for i, k in enumerate(KEPT)]
)
def test_no_rule_forbids_too_much(rule, name, text):
    assert rule(Module(name, text)) == []


def circle(modules: list[Module]) -> list[str]:
    """Modules that import each other in a circle, the first one again at the end; [] for none.

    Imports inside functions and for types alone count: who needs a name needs its module. Those
    of `vcam_cli` itself do not, whose `__init__` imports names when they are asked for.
    """
    names = {f"vcam_cli.{module.name}" for module in modules if module.name}
    graph: dict[str, set[str]] = {}
    for module in modules:
        if not module.name:
            continue
        own = graph.setdefault(f"vcam_cli.{module.name}", set())
        for _, name in module.imports:
            while name and name not in names:  # a name in a module, which is what is imported
                name = name.rpartition(".")[0]
            own |= {name} - {"", f"vcam_cli.{module.name}"}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1][::-1]  # who imports before who is imported
    return []


def test_modules_import_each_other_in_no_circle():
    assert circle(MODULES) == []


@pytest.mark.parametrize(
    "back",
    [
        "from vcam_cli.x.a import A\n",
        "def f():\n    from vcam_cli.x import a\n",
        "class B:\n    def f(self):\n        import vcam_cli.x.a as a\n",
        "if TYPE_CHECKING:\n    from vcam_cli.x.a import A\n",
        "from importlib import import_module\nimport_module('vcam_cli.x.a')\n",
    ],
)
def test_a_circle_is_found(back):
    modules = [
        Module("x", "from vcam_cli.x.a import A\n"),
        Module("x.a", "from vcam_cli.x import c\n"),
        Module("x.b", back),
        Module("x.c", "from vcam_cli.x.b import B\n"),
    ]
    found = circle(modules)
    assert len(found) == 4
    steps = {("a", "c"), ("c", "b"), ("b", "a")}
    assert {(p[-1], q[-1]) for p, q in pairwise(found)} == steps


def test_a_package_imported_from_within_is_a_circle():
    face = Module("x", "from vcam_cli.x.a import A\n")
    assert circle([face, Module("x.a", "from vcam_cli.x import A\n")])


def test_what_is_no_circle_is_none():
    """Two ways to one module, a module's own name, another package, the face of it all."""
    face = Module("", "from vcam_cli.x.a import A\n")
    top = Module("x.a", "from vcam_cli.x import b, c\nfrom vcam_cli import __version__\n")
    left = Module("x.b", "import numpy\nfrom vcam_cli.x.c import C\n")
    assert circle([face, top, left, Module("x.c", "import vcam_cli\n")]) == []


def test_every_room_has_a_floor():
    rooms = {m.room for m in MODULES} - {"", "data"}
    assert rooms <= set(FLOOR)


def test_configs_and_tests_are_no_part_of_the_sources():
    assert len(MODULES) > 80
    assert not {m.room for m in MODULES} & {"tests", "configs"}


LIGHT = {
    "--help": ("numpy", "pydantic", "scipy", "yaml", "OpenImageIO", "colour", "matplotlib"),
    "--version": ("numpy", "pydantic", "scipy", "yaml", "OpenImageIO", "colour", "matplotlib"),
    "run --help": ("numpy", "scipy", "yaml", "OpenImageIO", "colour", "matplotlib"),
    "validate starter": ("scipy.signal", "scipy.optimize", "colour", "matplotlib"),
}
"""Command -> libraries it must not import: each costs more than the command itself.

They run in this order in one process: what one of them may import, those behind it may as well.
"""


def test_commands_import_only_what_they_need(tmp_path):
    code = (
        "import sys\n"
        "from vcam_cli.commands.main import main\n"
        f"for command, libraries in {LIGHT!r}.items():\n"
        "    sys.argv = ['vcam', *command.split()]\n"
        "    try: main()\n"
        "    except SystemExit as end: code = end.code\n"
        "    found = [name for name in libraries if name in sys.modules]\n"
        "    print('found', command, code or 0, found, file=sys.stderr)"
    )
    env = os.environ | {"PYTHONPATH": str(PACKAGE.parent)}
    line = [sys.executable, "-c", code]
    result = subprocess.run(line, capture_output=True, text=True, env=env, cwd=tmp_path)
    said = [line for line in result.stderr.splitlines() if line.startswith("found")]
    assert said == [f"found {command} 0 []" for command in LIGHT], result.stderr
