"""The level of a scene: the spectral radiance of its perfect white.

A camera file states one level, for a perfect white diffuser under the illuminant (or the display
white of an image that emits): luminance [cd/m2], radiance [W/(sr m2)], or what falls on the
diffuser, pi times as much: illuminance [lx], irradiance [W/m2]. Luminance is 683 lm/W times
the integral with V(lambda), over all visible light, not only the part that a camera file simulates;
radiance is the plain integral over the scene's wavelengths. Irradiances from a file are as bright
as they are.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003, section 2.3.1.
"""

import math

from vcam_cli.camera.scene.scene import Scene
from vcam_cli.errors import bad
from vcam_cli.spectra import VISIBLE, Spectrum, display_primaries, integral, luminance

LASER_LINES = (650e-9, 550e-9, 450e-9)
"""Wavelengths of red, green and blue of an image that is shown by three lasers [1] [m]."""


def white_radiance(scene: Scene) -> Spectrum:
    """Return the spectral radiance of a perfect white diffuser under the illuminant.

    Parameters
    ----------
    scene : Scene
        What the file says of the scene.

    Returns
    -------
    Spectrum
        Radiance [W/(sr m2 m)].

    Raises
    ------
    BadInput
        If there is no illuminant, it does not cover the scene's wavelengths, or it emits nothing
        there that the stated level could measure.
    """
    path = ("scene", "illuminant")
    if scene.illuminant is None:
        raise bad(path, "this scene needs an illuminant", "write for example illuminant: D65")
    try:
        lamp = scene.illuminant.resolve(path)
        if scene.irradiance == "from-file":
            lamp.require(scene.wavelengths.start, scene.wavelengths.stop)
            return lamp.scale_by(1e9 / math.pi)  # of W/(m2 nm)
        return scale_to_level(lamp, scene)
    except ValueError as error:
        raise bad(path, str(error)) from None


def laser_white(scene: Scene) -> tuple[tuple[Spectrum, ...], Spectrum]:
    """Return the radiances of full red, green and blue laser light, and of their sum, white.

    Equal planes are equal radiances in watts; their sum has the stated level [1].

    Parameters
    ----------
    scene : Scene
        What the file says of the scene.

    Returns
    -------
    colors : tuple of Spectrum
        Radiances [W/(sr m2 m)] of red, green and blue.
    white : Spectrum
        Their sum.

    Raises
    ------
    BadInput
        If a line lies outside of the scene's wavelengths.
    """
    start, stop = scene.wavelengths.start, scene.wavelengths.stop
    if min(LASER_LINES) < start or max(LASER_LINES) > stop:
        raise bad(
            ("scene", "wavelengths"),
            "the laser model emits at 450, 550 and 650 nm, and not all of these are simulated",
            "let the wavelengths start at or below 450 nm and stop at or above 650 nm",
        )
    white = scale_to_level(Spectrum(lines=tuple((line, 1.0) for line in LASER_LINES)), scene)
    power = dict(white.lines or ())
    return tuple(Spectrum.line(line, power[line]) for line in LASER_LINES), white


def display_white(scene: Scene, primaries: str) -> tuple[tuple[Spectrum, ...], Spectrum]:
    """Return the radiances of a display's full red, green and blue, and of their sum, white.

    The white has the stated level; the share of each primary in it is the display's own.

    Parameters
    ----------
    scene : Scene
        What the file says of the scene.
    primaries : str
        As in `spectra.display_primaries`.

    Returns
    -------
    colors : tuple of Spectrum
        Radiances [W/(sr m2 m)] of red, green and blue.
    white : Spectrum
        Their sum.

    Raises
    ------
    BadInput
        If the stated level cannot be reached within the scene's wavelengths.
    """
    colors, relative = display_primaries(primaries)
    try:
        white = scale_to_level(relative, scene)
    except ValueError as error:
        raise bad(("scene", "wavelengths"), str(error), "let them cover 400 to 700 nm") from None
    return tuple(color.scale_by(white.scale / relative.scale) for color in colors), white


def scale_to_level(relative: Spectrum, scene: Scene) -> Spectrum:
    """Return a spectrum at the scene's stated level.

    Parameters
    ----------
    relative : Spectrum
        Its shape, of any scale.
    scene : Scene
        What the file says of the scene.

    Returns
    -------
    Spectrum
        Radiance [W/(sr m2 m)].

    Raises
    ------
    ValueError
        If the light has nothing within the wavelengths that the level could measure.
    """
    start, stop = scene.wavelengths.start, scene.wavelengths.stop
    power = _radiance(scene)
    if power is not None:
        level, measured, what = power, integral(relative, start, stop), "power"
    else:
        relative.require(start, stop)
        start, stop = visible_range(relative, start, stop)
        level, measured, what = _luminance(scene), luminance(relative, start, stop), "visible light"
    if not measured > 0.0:
        raise ValueError(
            f"the light has no {what} within {start * 1e9:g}-{stop * 1e9:g} nm, "
            "so the stated level cannot be reached"
        )
    return relative.scale_by(level / measured)


def visible_range(light: Spectrum, start: float, stop: float) -> tuple[float, float]:
    """Return the wavelengths over which luminance counts.

    They are those simulated and all that is visible, where the light is known.

    Parameters
    ----------
    light : Spectrum
        The light.
    start, stop : float
        Ends of the wavelengths simulated [m].

    Returns
    -------
    tuple of float
        Ends [m].
    """
    known = [table for table in light.tables if table.outside == "error"]
    first = max([VISIBLE[0], *(table.start for table in known)])
    last = min([VISIBLE[1], *(table.stop for table in known)])
    return min(start, first), max(stop, last)


def _radiance(scene: Scene) -> float | None:
    """Return the radiance that the scene states [W/(sr m2)]; None where it states no power."""
    if isinstance(scene.irradiance, float):
        return scene.irradiance / math.pi
    return scene.radiance


def _luminance(scene: Scene) -> float:
    """Return the luminance that the scene states [cd/m2]."""
    if isinstance(scene.luminance, float):
        return scene.luminance
    if scene.illuminance is not None:
        return scene.illuminance / math.pi
    message = "only a file of radiances has a luminance"
    raise bad(("scene", "luminance"), message, "write for example 100 cd/m2")
