"""A uniform field: the same reflectance everywhere."""

from vcam_cli.scenes.waves import Wave


def waves(reflectance: float) -> tuple[Wave, ...]:
    """Return one wave of frequency zero.

    Parameters
    ----------
    reflectance : float
        Reflectance, from 0 to 1, the perfect diffuser.

    Returns
    -------
    tuple of Wave
        The wave.
    """
    return (Wave((reflectance,)),)
