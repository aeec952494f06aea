"""Random cameras that could be built: a strategy for every section of a camera file.

What is drawn is the YAML form, so that all of vcam's front door is passed: units, words, defaults.
Sizes are those that occur, from the smallest pixels to the largest, from moonlight to the sun; the
array is 8 x 9 pixels, so that a camera is simulated in a few hundredths of a second.
"""

import math
from typing import Any

from hypothesis import strategies as st

ROWS, COLUMNS = 8, 9
Tree = dict[str, Any]


def between(low: float, high: float, unit: str = "") -> st.SearchStrategy[Any]:
    """Numbers whose logarithm is spread evenly, of four digits, with a unit where there is one."""
    exponents = st.floats(math.log10(low), math.log10(high))
    numbers = exponents.map(lambda x: float(f"{min(max(10**x, low), high):.4g}"))
    return numbers.map(lambda x: f"{x!r} {unit}") if unit else numbers


def fractions(low: float = 0.0, high: float = 1.0) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda x: min(max(round(x, 4), low), high))


def mappings(needed: Tree, optional: Tree | None = None) -> st.SearchStrategy[Tree]:
    """Mappings with all of the first keys and some of the second."""
    return st.fixed_dictionaries(needed, optional=optional)


_OR_NONE = "none"
SPECTRA = st.one_of(
    fractions(0.05),
    st.sampled_from(["front-illuminated-qe", "ir-cut-650"]),
    st.lists(fractions(0.1), min_size=1, max_size=3),
    st.tuples(fractions(0.1), fractions(0.1)).map(lambda t: {"table": {380: t[0], 780: t[1]}}),
)
"""Of at most 1, and more than nothing."""
LAMPS = st.one_of(
    st.sampled_from(["D65", "A", "F2", "equal-energy"]),
    between(1500, 20000, "K").map(lambda t: {"blackbody": t}),
    st.integers(420, 680).map(lambda nm: {"monochromatic": f"{nm} nm"}),
)
LEVELS = st.one_of(
    between(1e-3, 1e5, "cd/m2").map(lambda v: {"luminance": v}),
    between(1e-6, 1e2, "W/(sr m2)").map(lambda v: {"radiance": v}),
    between(1e-3, 1e5, "lx").map(lambda v: {"illuminance": v}),
)


def chart(name: str, **keys: Any) -> st.SearchStrategy[Tree]:
    return mappings({"kind": st.just("chart"), "chart": st.just(name)}, keys)


CHARTS = st.one_of(
    chart("uniform", reflectance=fractions()),
    st.builds(
        lambda c, f: c | {"frequency": f},
        chart("sinusoid", contrast=fractions(), phase=st.just("90 deg"), mean=fractions(0, 0.5)),
        between(1, 300, "lp/mm"),
    ),
    between(1, 300, "lp/mm").map(
        lambda f: {"kind": "chart", "chart": "csf", "max_frequency": f}
    ),
    chart("slanted-edge", angle=st.integers(-40, 40).map("{} deg".format), contrast=fractions()),
    chart("step-wedge", steps=st.integers(2, 30), density_range=between(0.1, 6)),
    chart("siemens-star", spokes=st.integers(2, 200), contrast=fractions()),
    chart("hdr-patches", patches=st.integers(2, 30), lamp=between(1, 1e6)),
    between(5, 200, "um").map(
        lambda s: {"kind": "chart", "chart": "point-grid", "spacing": s, "diameter": "2 um"}
    ),
    chart("colorchecker"),
)  # fmt: skip


@st.composite
def scenes(draw: st.DrawFn) -> Tree:
    tree = {"source": draw(CHARTS), "illuminant": draw(LAMPS)} | draw(LEVELS)
    tree["distance"] = draw(st.one_of(between(0.5, 1e4, "m"), st.just("infinity")))
    if tree["distance"] != "infinity" and draw(st.booleans()):
        tree["extent"] = {"width": draw(between(0.01, 10, "m"))}
    if draw(st.booleans()):
        tree["wavelengths"] = {
            "start": "400 nm",
            "stop": draw(st.sampled_from(["700 nm", "720 nm"])),
        }
    return tree  # fmt: skip


@st.composite
def optics(draw: st.DrawFn) -> Tree:
    tree = {"focal_length": draw(between(0.5, 100, "mm")), "transmittance": draw(SPECTRA)}
    tree["f_number"] = draw(between(0.8, 32))
    tree |= draw(
        mappings(
            {},
            {
                "off_axis": st.sampled_from(["exact", "cos4", "none"]),
                "diffraction": st.booleans(),
                "stray_light": fractions(0, 0.3),
                "defocus": st.integers(-30, 30).map(lambda d: f"{d} um"),
            },
        )
    )
    if draw(st.integers(0, 3)) == 0:
        terms = st.dictionaries(st.integers(4, 15), st.integers(-100, 100), max_size=3)
        tree["zernike"] = {n: f"{nm} nm" for n, nm in draw(terms).items()}
    return tree


_ELECTRONS = between(0.1, 300, "e")


@st.composite
def pixels(draw: st.DrawFn) -> Tree:
    width = draw(between(0.7, 30))
    tree: Tree = {"width": f"{width} um", "photodetector": draw(_detectors(width))}
    tree["readout"] = draw(_readouts())
    shares = {"gain_pixel": between(0.01, 5, "%"), "gain_column": between(0.01, 5, "%")}
    offsets = {"offset_pixel": _ELECTRONS, "offset_column": _ELECTRONS}
    shading = mappings({"offset": _ELECTRONS}, {"gain": between(0.01, 5, "%")})
    fpn = mappings({}, shares | offsets | {"dark": between(0.01, 30, "%"), "shading": shading})
    defects = mappings({}, {"hot": fractions(0, 0.3), "dead": fractions(0, 0.3)})
    architectures = st.sampled_from(["aps-3t", "aps-4t", "dps", "ccd"])
    temperatures = st.integers(230, 350).map(lambda k: f"{k} K")
    tree |= draw(
        mappings(
            {},
            {
                "architecture": architectures,
                "gap_x": between(0.01, 1, "um"),
                "gap_y": between(0.01, 1, "um"),
                "fpn": fpn,
                "defects": defects,
                "temperature": temperatures,
            },
        )
    )
    fill = tree["photodetector"]["fill_factor"]
    if fill < 0.8 and draw(st.integers(0, 3)) == 0:
        tree["microlens"] = {"gain": round(draw(st.floats(1, 0.94 / fill)), 3)}
    if draw(st.integers(0, 3)) == 0:
        layer = between(0.1, 5, "um").map(lambda t: {"thickness": t, "index": 1.46})
        tree["stack"] = {"passivation": draw(layer), "oxide": draw(layer)}
    return tree


@st.composite
def _detectors(draw: st.DrawFn, width: float) -> Tree:
    tree: Tree = {"fill_factor": draw(fractions(0.05)), "quantum_efficiency": draw(SPECTRA)}
    dark = draw(st.integers(0, 2))
    if dark == 1:
        tree["dark_current"] = draw(between(0.01, 1e5, "e/s"))
    elif dark == 2:
        tree["dark_current_density"] = draw(between(1e-3, 100, "nA/cm2"))
    if draw(st.integers(0, 3)) == 0:
        tree["charge_diffusion"] = {
            "diffusion_length": draw(between(1, 200, "um")),
            "depletion_width": draw(between(0.1, 5, "um")),
            "substrate_depth": draw(between(0.5, 50, "um")),
        }
    return tree


@st.composite
def _readouts(draw: st.DrawFn) -> Tree:
    tree = {"conversion_gain": draw(between(0.5, 200, "uV/e"))}
    tree |= draw(
        st.one_of(
            between(0.1, 3, "V").map(lambda v: {"voltage_swing": v}),
            between(100, 5e5, "e").map(lambda w: {"full_well": w}),
        )
    )
    noises = {name: _ELECTRONS for name in ("read_noise", "column_noise", "row_noise")}
    resets = {"reset_noise": st.one_of(st.sampled_from(["ktc", "none"]), _ELECTRONS)}
    tails = mappings({"rms": _ELECTRONS}, {"shape": fractions(-0.4, 0.14)})
    bands = mappings({"rms": _ELECTRONS}, {"correlation": fractions(0, 0.99)})
    traps = mappings(
        {"fraction": between(0.01, 100, "%"), "amplitude": _ELECTRONS},
        {"occupancy": between(1, 99, "%")},
    )
    others = {"heavy_tailed_noise": tails, "correlated_row_noise": bands, "telegraph_noise": traps}
    return tree | draw(mappings({}, noises | resets | others | {"gain": between(0.5, 16)}))


@st.composite
def arrays(draw: st.DrawFn) -> Tree:
    patterns = ["monochrome", "bayer-rggb", "bayer-gbrg", "quad-bayer", "rgbw", "honeycomb"]
    blocks = st.just({"block": [["R", "G", "B"]]})
    tree = {"rows": ROWS, "columns": COLUMNS}
    tree["pattern"] = draw(st.one_of(st.sampled_from([*patterns, "stacked"]), blocks))
    if tree["pattern"] == "monochrome" and draw(st.booleans()):
        kinds = st.sampled_from(["charge", "voltage", "digital"])
        tree["binning"] = {"rows": 2, "columns": 3, "kind": draw(kinds)}
    return tree


@st.composite
def exposures(draw: st.DrawFn, nondestructive: bool) -> Tree:
    longest = draw(between(0.01, 1000))
    automatic = mappings(
        {"max": st.just(f"{longest} ms")},
        {"method": st.sampled_from(["white", "percentile", "mean"]), "target": fractions(0.1, 1)},
    )
    forms = [st.just({"time": f"{longest} ms"}), automatic.map(lambda a: {"auto": a})]
    if nondestructive:
        steps = st.lists(fractions(0.05, 0.9), min_size=1, max_size=3)
        forms.append(steps.map(lambda s: {"captures": _times(longest, s)}))
        counts = st.integers(1, 4)
        scheduled = counts.map(
            lambda n: {"schedule": "optimal", "count": n, "max": f"{longest} ms"}
        )
        forms.append(scheduled.map(lambda c: {"captures": c}))
    tree = draw(st.one_of(forms))
    if "captures" in tree:
        tree["estimator"] = draw(st.sampled_from(["lsbs", "weighted"]))
    return tree


def _times(longest: float, steps: list[float]) -> list[str]:
    """Times that rise to the longest, each the given part of the next."""
    times = [longest]
    for step in steps:
        times.append(times[-1] * step)
    return [f"{time!r} ms" for time in reversed(times)]


@st.composite
def adcs(draw: st.DrawFn) -> Tree:
    bits = draw(st.integers(4, 16))
    tree: Tree = {"bits": bits}
    is_logarithmic = draw(st.integers(0, 3)) == 0
    # the noise in the dark may take all codes of few, and is refused by an offset: auto
    if is_logarithmic or bits < 8 or draw(st.booleans()):
        tree["offset"] = f"{draw(st.integers(0, 2**bits // 8))} DN"
    if is_logarithmic:
        tree["kind"] = "logarithmic"
    elif draw(st.integers(0, 3)) == 0:
        tree["full_scale"] = draw(between(0.1, 10, "V"))
    return tree


EFFECTS = ("diffraction", "shot_noise", "fpn", "off_axis", "pixel_aperture", "quantization")


@st.composite
def cameras(draw: st.DrawFn) -> Tree:
    """A camera file's tree."""
    pixel, array = draw(pixels()), draw(arrays())
    binned = array.get("binning", {}).get("kind") in ("voltage", "digital")
    nondestructive = pixel.get("architecture") not in ("aps-4t", "ccd") and not binned
    states = st.dictionaries(st.sampled_from(EFFECTS), st.sampled_from(["auto", "off"]))
    return {
        "name": "random",
        "scene": draw(scenes()),
        "optics": draw(optics()),
        "pixel": pixel,
        "array": array,
        "exposure": draw(exposures(nondestructive)),
        "adc": draw(adcs()),
        "quality": draw(st.sampled_from([[], ["mse", "psnr"], ["cielab"]])),
        "effects": draw(st.one_of(st.sampled_from(["auto", "all"]), states)),
        "accuracy": "draft",
        "seed": {"sensor": draw(st.integers(0, 2**63 - 1)), "frame": draw(st.integers(0, 9))},
        "output": {"render": draw(st.sampled_from([8, 16]))},
    }
