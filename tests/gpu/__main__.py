"""What a graphics processor computes, and how fast: `make check-gpu`, `make bench-gpu`.

    python -m tests.gpu              checks, statistics, bench
    python -m tests.gpu check        checks and statistics
    python -m tests.gpu commands     every command with --device gpu
    python -m tests.gpu bench        bench
    python -m tests.gpu written      bench of a data set that is written

Each check stands alone: one that fails hides no other. The exit status is 1 where one failed.
"""

import json
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.gpu.noise_statistics import generator, sources, worst
from vcam_cli import load, simulate
from vcam_cli.batches.frames import frames, ready, solved_for
from vcam_cli.devices import counter_noise
from vcam_cli.devices.choice import open_device
from vcam_cli.devices.processor import Processor, require

DATASET = """
kind: dataset
name: pairs
camera: starter
scenes: {files: "*.png", frames_each: 4}
vary:
  exposure.time: {log_uniform: [1 ms, 30 ms]}
  exposure.gain: {choice: [1, 2, 4, 8]}
frames: 1024
size: {rows: 512, columns: 512}
write: [raw, clean]
shards: 4
"""
MEAN = 1e-5
"""Difference from the processor's mean signal that is allowed, over full signal."""
failed: list[str] = []


def check(name: str, function: Callable[[], object]) -> None:
    """Run a check, and say what it found."""
    start = time.perf_counter()
    try:
        found = function()
        said = "" if found is None else f": {found}"
        print(f"ok    {name}{said} [{time.perf_counter() - start:.2f} s]", flush=True)
    except Exception:
        failed.append(name)
        print(f"FAIL  {name} [{time.perf_counter() - start:.2f} s]", flush=True)
        traceback.print_exc(limit=-6, file=sys.stdout)
        sys.stdout.flush()


def photograph(rows: int, columns: int, seed: int = 0) -> np.ndarray:
    """Return a smooth colored picture with edges (rows, columns, 3), uint8."""
    rng = np.random.default_rng(seed)
    coarse = rng.random((rows // 8 + 2, columns // 8 + 2, 3))
    picture = coarse.repeat(8, axis=0).repeat(8, axis=1)[:rows, :columns]
    picture = 0.8 * picture + 0.2 * rng.random((rows, columns, 3))
    return (255 * picture).astype(np.uint8)


def camera(name: str, rows: int, columns: int, *sets: str):
    """Return a shipped camera of another size, timed."""
    return load(name, [f"array.rows={rows}", f"array.columns={columns}", *sets])


# --- correctness ---------------------------------------------------------------------------------


def words(device: Processor) -> str:
    """Numbers of the kernels against those of NumPy."""
    seeds, count = [0, 1, 2**40 + 5, 2**64 - 1, 2**70], 100_003
    host, keys = Processor(), device.keys(seeds)
    own = host.keys(seeds)
    said = []
    for dtype in (np.float32, np.float64):
        z = device.get(device.normals(keys, "shot_noise", 7, count, dtype))
        ref = host.normals(own, "shot_noise", 7, count, dtype)
        assert z.dtype == dtype
        off = np.abs(z.astype(np.float32).view(np.int32) - ref.astype(np.float32).view(np.int32))
        assert off.max() <= 64, off.max()
        assert np.abs(z - ref).max() < 2e-6
        said.append(f"normals equal {np.mean(z == ref):.4f}, at most {off.max()} ulp")
        mean = np.tile(np.random.default_rng(0).uniform(-1, 60, count), (len(seeds), 1))
        mean = mean.astype(dtype)
        drawn = device.get(device.poisson(keys, "shot_noise", 7, device.put(mean)))
        expected = host.poisson(own, "shot_noise", 7, mean)
        assert np.abs(drawn - expected).max() <= 1
        share = np.mean(drawn == expected)
        assert share > 0.9999, share
        said.append(f"Poisson equal {share:.6f}")
    values = np.linspace(-50, 900, 5 * count, dtype=np.float32).reshape(5, count)
    noisy = device.get(device.add_normals(device.put(values), 2.5, keys, "read_noise", 0))
    assert np.abs(noisy - host.add_normals(values.copy(), 2.5, own, "read_noise", 0)).max() < 2e-4
    for dtype in (None, np.uint16, np.uint32):
        found = device.get(device.on_line(device.put(values), 800.0, (0.37, 12.0), 255, dtype))
        assert (found == host.on_line(values, 800.0, (0.37, 12.0), 255, dtype)).all()
    u = device.get(device.uniforms(keys, "even", 0, count))
    assert (u == host.uniforms(own, "even", 0, count)).all()
    assert counter_noise.words(host.keys([0]), "x", 0, 4).tolist() == [
        [1357636444, 2365994053, 1312071609, 455539378]
    ]
    return "; ".join(said)


def transforms(device: Processor) -> str:
    """Cosine transforms, filters and gathers against those of SciPy."""
    rng, host, most = np.random.default_rng(1), Processor(), 0.0
    for dtype, allowed in ((np.float32, 2e-6), (np.float64, 1e-13)):
        for rows, columns, black in ((8, 6, 0), (33, 27, 2), (64, 48, 0), (480, 640, 1), (5, 4, 0)):
            pictures = rng.random((3, rows - 2 * black, columns - 2 * black, 3)).astype(dtype)
            mix = rng.random((2, 3)).astype(dtype)
            shape, edge = (rows, columns), (black, black)
            found = device.spectrum(device.put(pictures), device.put(mix), shape, edge)
            expected = host.spectrum(pictures, mix, shape, edge)
            error = np.abs(device.get(found) - expected).max() / np.abs(expected).max()
            assert error < allowed, (dtype, rows, columns, error)
            transfer = rng.random((2, 3, rows - 1, columns)).astype(dtype)
            at = np.arange(rows - 1, dtype=np.int32), np.arange(columns, dtype=np.int32)
            terms = device.filtered(found, device.put(transfer), *map(device.put, at))
            of_host = host.filtered(expected, transfer, *at)
            color = rng.integers(0, 3, (rows - 2, columns - 3)).astype(np.int32)
            window = slice(1, rows - 1), slice(2, columns - 1)
            for colors in (None, color):
                own = None if colors is None else device.put(colors)
                light = device.get(device.evaluated(terms, shape, window, own))
                truth = host.evaluated(of_host, shape, window, colors)
                assert light.shape == truth.shape
                error = np.abs(light - truth).max() / np.abs(truth).max()
                assert error < allowed, (dtype, rows, columns, error)
                most = max(most, float(error)) if dtype is np.float32 else most
    return f"at most {most:.2g} of the largest, 32 bits"


NAMES = (
    *("starter", "imx477", "12mp-bayer", "low-light", "nikon-d850", "street", "everything"),
    *("csf-monochrome", "canon-5d4", "pixel-4a", "sony-a7s2", "imx900"),
)
"""Cameras whose frames are compared."""


def frames_of(device: Processor, name: str) -> str:
    """Frames of a shipped camera on the device and on the processor, code by code."""
    pictures = np.stack([photograph(96, 128, seed) for seed in range(3)])
    model = camera(name, 96, 128, "exposure.time=10 ms")
    asked = {"batch": 4, "frames_each": 2}
    here = list(frames(model, pictures, device=device, **asked))
    host = list(frames(model, pictures, **asked))
    again = list(frames(model, pictures, device=device, batch=6, frames_each=2))
    dn = np.concatenate([device.get(b.dn) for b in here])
    clean = np.concatenate([device.get(b.clean) for b in here])
    other = np.concatenate([device.get(b.dn) for b in again])
    assert (dn == other).all(), "another batch size gives other bytes"
    expected = np.concatenate([b.dn for b in host])
    truth = np.concatenate([b.clean for b in host])
    full = float(truth.max() - truth.min())
    error = float(np.abs(clean - truth).max()) / full
    assert error < MEAN, error
    share = float(np.mean(dn == expected))
    apart = int(np.abs(dn.astype(int) - expected.astype(int)).max())
    assert share > 0.9, (share, apart)
    _, light, _ = ready(solved_for(model), pictures.shape[1:], device)
    said = ""
    if len(here[0].pattern) == 2 and len(here[0].pattern[0]) == 2:
        rgb, ref = here[0].demosaic(here[0].dn), host[0].demosaic(host[0].dn)
        error_rgb = float(np.abs(device.get(rgb) - ref).max())
        said = f", demosaic {error_rgb:.3g} DN"
    equal = f"codes equal {share:.5f}, {apart} apart"
    return f"light on {light.where}, clean {error:.2g}, {equal}{said}"


def per_frame(device: Processor) -> str:
    """Times, gains and places of single frames."""
    pictures = np.stack([photograph(120, 160, seed) for seed in range(3)])
    model = camera("starter", 96, 128)
    asked = {
        "batch": 4,
        "frames_each": 2,
        "times": lambda n: 0.001 * (n + 1),
        "gains": lambda n: (1.0, 2.0)[n % 2],
        "seeds": lambda n: n + 2**63,
        "crop": (96, 128),
        "places": lambda n: (n, 2 * n),
    }
    for here, host in zip(
        frames(model, pictures, device=device, **asked),
        frames(model, pictures, **asked),
        strict=True,
    ):
        assert np.mean(device.get(here.dn) == host.dn) > 0.9
        assert here.times == host.times
        assert here.gains == host.gains
    return "as on the processor"


def means(device: Processor) -> str:
    """Mean signals against those of single frames of the processor."""
    from vcam_cli.files.images.images import read_picture

    said = []
    with tempfile.TemporaryDirectory() as folder:
        import OpenImageIO as oiio

        for size in ((96, 128), (192, 256)):
            path = Path(folder) / "picture.png"
            picture = photograph(*size)
            out = oiio.ImageOutput.create(str(path))
            out.open(str(path), oiio.ImageSpec(size[1], size[0], 3, "uint8"))
            out.write_image(picture)
            out.close()
            model = camera("starter", 96, 128, "exposure.time=10 ms").with_(
                {
                    "scene.source": {"kind": "image", "file": str(path)},
                    "accuracy.oversampling": 16,
                    "effects": "all",
                }
            )
            truth = simulate(model).clean_dn
            read = read_picture(path, "auto", 1.0, "file").data
            for given in (str(path), picture, read):
                [found] = frames(model, [given], device=device)
                full = float(truth.max() - truth.min())
                error = float(np.abs(device.get(found.clean)[0] - truth).max()) / full
                assert error < MEAN, (size, error)
                said.append(f"{error:.2g}")
    return f"{', '.join(said)} of full signal"


def series(device: Processor) -> str:
    """Series along an axis, splines and copies in the background, against those of SciPy."""
    rng, host, most = np.random.default_rng(4), Processor(), 0.0
    for dtype, allowed in ((np.float32, 2e-6), (np.float64, 1e-13)):
        kind = np.complex64 if dtype == np.float32 else np.complex128
        for count in (1, 2, 33, 480, 1001):
            for axis, shape in enumerate(((count, 7), (7, count))):
                values = rng.standard_normal(shape).astype(dtype)
                waves = (values + 1j * rng.standard_normal(shape)).astype(kind)
                pairs = [
                    (device.dct3(device.put(values), axis, odd), host.dct3(values, axis, odd))
                    for odd in (False, True)
                ]
                pairs.append(
                    (device.fft(device.put(waves.copy()), axis), host.fft(waves.copy(), axis))
                )
                pairs.append(
                    (device.ifft(device.put(waves.copy()), axis), host.ifft(waves.copy(), axis))
                )
                for found, truth in pairs:
                    copied = device.get(found)
                    assert copied.dtype == truth.dtype, (copied.dtype, truth.dtype)
                    error = float(np.abs(copied - truth).max() / np.abs(truth).max())
                    assert error < allowed, (dtype, count, axis, error)
                    most = max(most, error) if dtype == np.float32 else most
        image = rng.random((90, 70)).astype(dtype)
        row, column = rng.uniform(0, 89, (40, 50)), rng.uniform(0, 69, (40, 50))
        there = device.splines(device.put(image))
        looked = device.get(device.interpolated(there, device.put(row), device.put(column)))
        truth = host.interpolated(host.splines(image), row, column)
        error = float(np.abs(looked - truth).max())
        assert error < 10 * allowed, (dtype, error)
    large = device.put(rng.random((64, 512, 512)).astype(np.float32))
    waits = [device.fetch(part) for part in large]
    assert all((wait() == device.get(part)).all() for wait, part in zip(waits, large, strict=True))
    return f"at most {most:.2g} of the largest, 32 bits"


ROLL = "scene.camera_motion={roll: 40 deg/s}"
LIGHTS = (
    *(("starter", ()), ("still-life", ()), ("still-life", ("accuracy={float_width: 64}",))),
    *(("everything", ()), ("street", ()), ("x3-stacked", ()), ("cfa-honeycomb", ())),
    *(("table-top", ()), ("fisheye", ()), ("lateral-color", ()), ("starter", (ROLL,))),
    *(("still-life", (ROLL,)), ("photograph", ()), ("photograph", ("accuracy=reference",))),
)
"""Frames whose light is compared: every way of light that a device filters."""


def light_of(name: str, sets: tuple[str, ...]) -> str:
    """Light of a single frame on the device and on the processor."""
    from vcam_cli.files.images.png import write_png

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.png"
        write_png(path, photograph(84, 119))  # samples and pixels have no common grid
        shown = f"scene.source={{kind: image, file: {path}}}"
        of_picture = name == "photograph"
        chosen = ("exposure.time=10 ms", *sets, *((shown,) if of_picture else ()))
        model = camera("starter" if of_picture else name, 96, 128, *chosen)
        here, there = simulate(model).frame, simulate(model, device="gpu").frame
    error = float(np.abs(there.rate - here.rate).max() / here.rate.max())
    assert error < MEAN, error
    assert there.spectrum.computed_on != "cpu"
    assert there.spectrum.oversampling == here.spectrum.oversampling
    return f"{error:.2g} of full signal"


def exchange(device: Processor) -> str:
    """DLPack: torch sees the same memory."""
    import torch

    [found] = frames(camera("starter", 96, 128), [photograph(96, 128)], device=device)
    tensor = torch.from_dlpack(found.clean)
    assert tensor.shape == (1, 96, 128)
    assert tensor.data_ptr() == found.clean.data.ptr
    codes = torch.from_dlpack(found.dn)
    shown = torch.from_dlpack(found.demosaic(found.dn))
    again = list(
        frames(camera("starter", 96, 128), torch.rand(2, 96, 128, 3, device="cuda"), device=device)
    )
    return (
        f"{tensor.device}, {codes.dtype}, {tuple(shown.shape)}, {len(again[0])} frames of a tensor"
    )


def too_large(device: Processor) -> str:
    """A batch that does not fit is refused with a line."""
    from vcam_cli.errors import CannotDo

    free = device.free_memory()
    try:
        require(device, free + 1, "frames")
    except CannotDo as error:
        return str(error)
    raise AssertionError("not refused")


def commands() -> None:
    """Every command with --device gpu."""
    from vcam_cli.files.images.png import write_png

    small = ("--set", "array.rows=120", "--set", "array.columns=160", "-q")
    tiny = ("--set", "array.rows=24", "--set", "array.columns=32")
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        write_png(place / "p.png", photograph(1000, 1400))
        text = DATASET.replace("512", "64").replace("1024", "64").replace("shards: 4", "shards: 2")
        (place / "set.yaml").write_text(text)
        for words in (
            ("run", "starter", *small),
            ("run", "starter", *small, "--frames", "3", "--fps", "10"),
            ("sweep", "exposure-and-noise", "-q", "--workers", "1"),
            ("characterize", "starter", "-q"),
            ("dataset", str(place / "set.yaml"), "-q"),
            ("accuracy", "starter", *tiny, "-q"),
        ):
            out = place / f"{words[0]}{len(words)}"
            asked = [sys.executable, "-m", "vcam_cli.commands.main", *words]
            asked += ["--device", "gpu", "-o", str(out)]

            def run(asked=asked, out=out) -> str:
                found = subprocess.run(asked, capture_output=True, text=True)
                assert found.returncode == 0, found.stderr[-1500:]
                records = sorted(out.glob("*.json"))
                return f"{len(list(out.rglob('*')))} files; " + ", ".join(
                    f"{path.name}: {json.loads(path.read_text()).get('device')}" for path in records
                )

            check(f"vcam {words[0]} --device gpu", run)


# --- speed ---------------------------------------------------------------------------------------


def seconds(device: Processor, function: Callable[[], object], repeats: int = 5) -> float:
    """Return the least seconds of a call, warm, everything done."""
    function()
    device.wait()
    least = np.inf
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        device.wait()
        least = min(least, time.perf_counter() - start)
    return float(least)


def row(name: str, value: float, unit: str, said: str = "") -> None:
    """Print a number."""
    print(f"{name:58s} {value:12.5g} {unit}{'  ' + said if said else ''}", flush=True)


def written() -> None:
    """Print how many pairs of a data set are written in a second, and the disk's speed."""
    from vcam_cli import dataset
    from vcam_cli.files.images.png import write_png

    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for number in range(8):
            write_png(place / f"p{number}.png", photograph(1000, 1400, number))
        (place / "set.yaml").write_text(DATASET)
        start = time.perf_counter()
        with (place / "raw").open("wb", buffering=0) as file:
            block = np.random.default_rng(0).bytes(1 << 26)
            for _ in range(8):
                file.write(block)
        speed = 8 * len(block) / (time.perf_counter() - start)
        row("disk, one file", speed / 1e6, "MB/s")
        for workers in (1, 2, 4, 8):
            start = time.perf_counter()
            found = dataset(
                place / "set.yaml", place / f"out{workers}", workers=workers, device="gpu"
            )
            spent = time.perf_counter() - start
            assert found.failed == 0
            what = f"512² data set, written shards, {workers} processes: pairs a second"
            row(what, found.frames / spent, "1/s", f"{spent:.1f} s")


def bench(device: Processor) -> None:
    """Print seconds and ratios."""
    import cupy

    def rate(found, use=lambda batch: None) -> float:
        """Return frames a second behind the first batch, which makes the camera ready."""
        use(next(found))
        device.wait()
        start, done = time.perf_counter(), 0
        for batch in found:
            use(batch)
            done += len(batch)
        device.wait()
        return done / (time.perf_counter() - start)

    def small() -> None:
        count, side = 64, 512
        model = camera("starter", side, side, "exposure.time=10 ms")
        start = time.perf_counter()
        taker, light, _ = ready(solved_for(model), (side, side, 3), device)
        row("512²: camera made ready", time.perf_counter() - start, "s", light.where)
        pictures = cupy.random.random((count, side, side, 3), dtype=np.float32)
        rates = light.rates(pictures)
        many = list(range(count))
        times = [0.01] * count
        light_time = seconds(device, lambda: light.rates(pictures))
        take = seconds(device, lambda: taker.take(rates, times, 1.0, many))
        row("512², 64 pictures: light", 1e3 * light_time, "ms")
        row("512², 64 frames: charge to codes, clean", 1e3 * take, "ms")
        planes = cupy.random.random((count, 3, side, side), dtype=np.float32)
        half = cupy.fft.rfft2(planes)
        bare = seconds(device, lambda: cupy.fft.rfft2(planes)) + seconds(
            device, lambda: cupy.fft.irfft2(half, s=(side, side))
        )
        draw = seconds(device, lambda: cupy.random.standard_normal(rates.shape, dtype=np.float32))
        copied = seconds(device, lambda: rates.copy())
        row("512², 64: bare transforms of 3 planes, both ways", 1e3 * bare, "ms")
        row("512², 64: bare normals of CuPy", 1e3 * draw, "ms")
        row("512², 64: bare copy of a plane", 1e3 * copied, "ms")
        batched = light.batched
        mixtures, colors = batched.transfer.shape[:2]
        row("512²: mixtures x colors", mixtures, f"x {colors}", str(batched.transfer.shape))
        spectrum = device.spectrum(pictures, batched.mix, batched.shape, light.black)
        terms = device.filtered(spectrum, batched.transfer, *batched.sources)
        steps = {
            "spectrum": lambda: device.spectrum(pictures, batched.mix, batched.shape, light.black),
            "filtered": lambda: device.filtered(spectrum, batched.transfer, *batched.sources),
            "evaluated": lambda: device.evaluated(
                terms, batched.size, batched.window, batched.color
            ),
            "normals": lambda: device.normals(keys, "read_noise", 0, side * side, np.float32),
            "poisson": lambda: device.poisson(keys, "shot_noise", 0, rates * 0.01),
        }
        keys = device.keys(many)
        for name, function in steps.items():
            row(f"   of it: {name}", 1e3 * seconds(device, function), "ms")
        ratio = (light_time + take) / (bare + 3 * draw + 4 * copied)
        row("512²: ratio to bare transforms, 3 draws, 4 copies", ratio, "")
        for each in (1, 4):
            given = cupy.concatenate([pictures[: count // each]] * 32)
            found = frames(model, given, device=device, batch=count, frames_each=each)
            row(f"512², {each} frames a scene: pairs a second", rate(found), "1/s")
        rng = np.random.default_rng(0)
        drawn = rng.uniform(0.001, 0.03, 4096)
        found = frames(
            model,
            cupy.concatenate([pictures] * 32),
            device=device,
            times=lambda n: drawn[n % 4096],
            gains=lambda n: (1.0, 2.0, 4.0, 8.0)[n % 4],
        )
        row("512², times and 4 gains: pairs a second", rate(found), "1/s")
        coded = cupy.concatenate([(pictures * 255).astype(np.uint8)] * 32)
        row(
            "512², 8-bit pictures: pairs a second", rate(frames(model, coded, device=device)), "1/s"
        )
        host = [photograph(side, side, seed) for seed in range(8)] * 64
        row(
            "512², 8-bit of the host: pairs a second",
            rate(frames(model, host, device=device)),
            "1/s",
        )
        found = frames(model, cupy.concatenate([pictures] * 8), device=device)
        copied = lambda batch: (device.get(batch.dn), device.get(batch.clean))  # noqa: E731
        row("512², pairs to the host: pairs a second", rate(found, copied), "1/s")

    def large() -> None:
        model = load("12mp-bayer", ["exposure.time=10 ms"])
        g = solved_for(model).geometry
        start = time.perf_counter()
        taker, light, _ = ready(solved_for(model), (g.rows, g.columns, 3), device)
        row("12 MP: camera made ready", time.perf_counter() - start, "s", light.where)
        picture = cupy.random.random((1, g.rows, g.columns, 3), dtype=np.float32)
        rates = light.rates(picture)
        shoot = lambda: taker.take(rates, [0.01], 1.0, [1])  # noqa: E731
        once = seconds(device, lambda: light.rates(picture))
        again = seconds(device, shoot)
        row("12 MP: light", 1e3 * once, "ms")
        row("12 MP: a further exposure", 1e3 * again, "ms", "aim 2")
        row("12 MP: a frame, warm", 1e3 * (once + again), "ms", "aim 15")
        dn, _ = shoot()
        row("12 MP: codes to the host", 1e3 * seconds(device, lambda: device.get(dn)), "ms")

    def sequence() -> None:
        model = camera("12mp-bayer", 1000, 1000, "exposure.time=10 ms")
        taker, light, _ = ready(solved_for(model), (1000, 1000, 3), device)
        pictures = cupy.random.random((8, 1000, 1000, 3), dtype=np.float32)

        def run() -> None:
            rates = light.rates(pictures)
            dn, _ = taker.take(rates, [0.01] * 8, 1.0, list(range(8)))
            device.get(dn)

        row(
            "1 MP, fresh light, codes to the host: frames a second",
            8 / seconds(device, run),
            "1/s",
            "aim 200",
        )

    def host_time() -> None:
        """Seconds of Python for a batch: pixels are few."""
        model = camera("starter", 16, 16, "exposure.time=10 ms")
        pictures = cupy.random.random((64 * 32, 16, 16, 3), dtype=np.float32)
        drawn = np.random.default_rng(0).uniform(0.001, 0.03, 4096)
        plain = rate(frames(model, pictures, device=device))
        row("a batch of 64 frames of 16²", 64e3 / plain, "ms")
        asked = {"times": lambda n: drawn[n % 4096], "gains": lambda n: (1.0, 2.0, 4.0, 8.0)[n % 4]}
        found = rate(frames(model, pictures, device=device, **asked))
        row("   with times and 4 gains", 64e3 / found, "ms")
        asked.pop("gains")
        row("   with times", 64e3 / rate(frames(model, pictures, device=device, **asked)), "ms")

    def single(name: str) -> None:
        """Seconds of whole frames, of which `vcam plan --device gpu` estimates the stages."""
        from vcam_cli import plan
        from vcam_cli.simulation.shared import Shared

        model = load(name)
        simulate(model, shared=Shared(), device="gpu")  # kernels are compiled
        spent = {}
        for kind in ("gpu", "cpu"):
            least = np.inf
            for _ in range(3):
                start = time.perf_counter()
                result = simulate(model, shared=Shared(), device=kind)
                least = min(least, time.perf_counter() - start)
            spent[kind] = least
            stages = ", ".join(f"{n} {s:.3f}" for n, s in result.stages.seconds.items())
            row(f"{name}: a frame on the {kind}, light included", least, "s", stages)
        cost = plan(model).device_cost()
        said = f"light {cost.light:.2g}, charge {cost.charge:.2g}, copies {cost.copies:.2g}"
        row(f"{name}: a further frame by the plan", cost.further, "s", said)

    check("bench of Python", host_time)
    for name in ("12mp-bayer", "still-life", "everything"):
        check(f"bench of single frames, {name}", lambda name=name: single(name))
    for name, function in (("bench 512²", small), ("bench 12 MP", large), ("bench 1 MP", sequence)):
        check(name, function)


def main() -> int:
    """Run what was asked for."""
    asked = sys.argv[1:] or ["check", "commands", "bench", "written"]
    start = time.perf_counter()
    device = open_device("gpu")
    print(device.describe(), f"{device.free_memory() / 1e9:.1f} GB may be used", flush=True)
    if "check" in asked:
        check("words of the kernels", lambda: words(device))
        check("transforms", lambda: transforms(device))
        for name in NAMES:
            check(f"frames of {name}", lambda name=name: frames_of(device, name))
        check("series, splines, copies", lambda: series(device))
        for name, sets in LIGHTS:
            said = " ".join((name, *sets))
            check(f"light of {said}", lambda name=name, sets=sets: light_of(name, sets))
        check("times, gains, places", lambda: per_frame(device))
        check("means of single frames", lambda: means(device))
        check("exchange with torch", lambda: exchange(device))
        check("memory", lambda: too_large(device))

        def statistics(judge) -> str:
            found, beyond = worst(judge)
            assert not beyond, beyond
            what, off = max(found, key=lambda row: abs(row[1]))
            return f"{len(found)} within 5 standard errors, most {off:.2f} of {what}"

        check("statistics of the generator", lambda: statistics(generator(device, 16, 256)))
        check("statistics of every source", lambda: statistics(sources(device, 64, 128)))
    if "commands" in asked:
        commands()
    if "bench" in asked:
        bench(device)
    if "written" in asked:
        check("bench of shards", written)
    print(f"{len(failed)} failed {failed}; {time.perf_counter() - start:.1f} s", flush=True)
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
