"""How long charge takes from gate to gate of a CCD.

References
----------
.. [1] J. E. Carnes, W. F. Kosonocky, E. G. Ramberg, "Free charge transfer in charge-coupled
   devices", IEEE Trans. Electron Devices 19(6), 798-808, 1972, doi:10.1109/T-ED.1972.17497.
.. [2] S. M. Sze, K. K. Ng, "Physics of Semiconductor Devices", 3rd edition, Wiley, 2007, section
   1.5, doi:10.1002/0470068329 (electrons in silicon: 1350 cm2/(V s) at 300 K).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

DIFFUSIVITY = 35e-4
"""Of electrons in lightly doped silicon at 300 K, mobility times k T / q [m2/s] [2]."""


def transfer_time(
    length: ArrayLike, inefficiency: ArrayLike, diffusivity: ArrayLike = DIFFUSIVITY
) -> NDArray[np.float64]:
    """Return the time after which a transfer leaves no more than a share behind.

    The last charge leaves by thermal diffusion [1], (8 / pi^2) exp(-t / tau) of it with
    tau = 4 L^2 / (pi^2 D). Fringing fields, which hasten it, and repulsion, which acts on the first
    charge, are left out.

    Parameters
    ----------
    length : array_like
        Length L of a gate [m].
    inefficiency : array_like
        Share that is left behind, below 8 / pi^2.
    diffusivity : array_like
        Of the electrons D [m2/s].

    Returns
    -------
    ndarray
        Time [s].
    """
    tau = 4 * np.square(np.asarray(length, float)) / (np.pi**2 * np.asarray(diffusivity, float))
    left = np.pi**2 / 8 * np.asarray(inefficiency, float)
    return np.asarray(tau * np.maximum(-np.log(left), 0.0))[()]
