"""A uniform field: the same reflectance everywhere."""

from vcam_cli.scenes.waves import Wave


def waves(reflectance: float) -> tuple[Wave, ...]:
    """Return one wave of frequency zero of a reflectance 0..1, where 1 is the perfect diffuser."""
    return (Wave((reflectance,)),)
