"""Kinds of effects that displace the image, by place, wavelength and time."""

from __future__ import annotations

import math
from abc import abstractmethod

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.image_motion import ExposedMotion
from vcam_cli.effects.base import Effect, SignalLevels


class Warp(Effect):
    """Where in the unwarped image lies what a place of the sensor sees.

    The warps of a camera are composed once, before colors are summed over the wavelengths, in
    their order from the scene to the sensor (`image_formation.warps`). Irradiance keeps: an image
    that is stretched is as bright as before.
    """

    origin = "lens"

    @abstractmethod
    def places(
        self, x: Array, y: Array, wavelength: float, time: Array | float
    ) -> tuple[Array, Array]:
        """Return where in the unwarped image the places x, y look at a time.

        Parameters
        ----------
        x, y : Array
            Places right of the axis and below it, of shapes that broadcast [m].
        wavelength : float
            Wavelength [m].
        time : Array or float
            Time, of a shape that broadcasts with theirs [s].

        Returns
        -------
        tuple of Array
            Places in the unwarped image [m]; NaN for those that see nothing.
        """

    @abstractmethod
    def images(
        self, x: Array, y: Array, wavelength: float, time: Array | float
    ) -> tuple[Array, Array]:
        """Return where places x, y of the unwarped image are seen: the inverse of `places`.

        Parameters
        ----------
        x, y : Array
            Places in the unwarped image right of the axis and below it, of shapes that broadcast
            [m].
        wavelength : float
            Wavelength [m].
        time : Array or float
            Time, of a shape that broadcasts with theirs [s].

        Returns
        -------
        tuple of Array
            Places on the sensor [m].
        """

    @property
    @abstractmethod
    def travel(self) -> float:
        """How far from its place light comes to lie [m]."""

    def mean_error(self, signal: SignalLevels) -> float:
        """Return the most that leaving it out can change, light in place of dark [electrons]."""
        return float(signal.full_signal)


class StillWarp(Warp):
    """A warp that is the same at all times: it warps the scene, before all blurs."""

    largest_loss = 2.0 * math.sqrt(2)

    @property
    def travel(self) -> float:
        """No motion: what it displaces is displaced in the scene."""
        return 0.0

    @property
    def knots(self) -> tuple[float, ...]:
        """Wavelengths between which it is straight [m]; none of one that is the same at all."""
        return ()

    @abstractmethod
    def displacements(self, wavelengths: Array) -> Array:
        """Return the largest distance by which it displaces the image on the sensor.

        Displacements from the unwarped image to the sensor and back both count.

        Parameters
        ----------
        wavelengths : Array
            Wavelengths (J,) [m].

        Returns
        -------
        Array
            Distances (J,) [m].
        """

    def spread(self, wavelengths: Array) -> Array:
        """Return a bound (J,) on |1 - H(f)| / (2 pi |f|) for what it changes [m].

        Of an image split at a frequency in two parts, the lower one changes by its gradient times
        the displacement at most, and the upper one by twice itself; the squares of both add to no
        more than twice their sum.
        """
        return math.sqrt(2) * self.displacements(wavelengths)


class Magnification(StillWarp):
    """A still warp that magnifies about the axis, by a factor of the wavelength."""

    @abstractmethod
    def factor(self, wavelength: float) -> float:
        """Return the magnification at a wavelength.

        Parameters
        ----------
        wavelength : float
            Wavelength [m].

        Returns
        -------
        float
            Factor without unit.
        """

    def places(
        self, x: Array, y: Array, wavelength: float, time: Array | float
    ) -> tuple[Array, Array]:
        """Return where in the unwarped image the places x, y look [m]."""
        return x / self.factor(wavelength), y / self.factor(wavelength)

    def images(
        self, x: Array, y: Array, wavelength: float, time: Array | float
    ) -> tuple[Array, Array]:
        """Return where places x, y of the unwarped image are seen [m]."""
        return x * self.factor(wavelength), y * self.factor(wavelength)


class ImageMotion(Warp):
    """Motion of the image: a blur, and a displacement of what rows see at their own times."""

    exposed: ExposedMotion
    """The motion, and when lines see it."""

    def places(
        self, x: Array, y: Array, wavelength: float, time: Array | float
    ) -> tuple[Array, Array]:
        """Return where in the still image the places x, y look at a time [m]."""
        return self.exposed.trajectory.still_places(x, y, np.asarray(time))

    def images(
        self, x: Array, y: Array, wavelength: float, time: Array | float
    ) -> tuple[Array, Array]:
        """Return where places x, y of the still image are at a time [m]."""
        return self.exposed.trajectory.moved_places(x, y, np.asarray(time))

    @property
    @abstractmethod
    def drift(self) -> tuple[float, float]:
        """Displacement of the image per length down the sensor, along x and y."""

    @property
    @abstractmethod
    def displacement(self) -> tuple[float, float]:
        """Displacement of the image in the array's middle, along x and y [m]."""

    def spread(self, wavelengths: Array) -> Array:
        """Return a bound (J,) on |1 - H(f)| / (2 pi |f|): no light moves further [m]."""
        return np.full(len(wavelengths), self.travel)

    @property
    def is_uniform(self) -> bool:
        """Whether all rows see the image in the same place."""
        return not any(self.drift)
