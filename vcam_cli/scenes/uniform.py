"""A uniform field: the same reflectance everywhere."""

from vcam_cli.scenes.base import Wave


def waves(reflectance: float) -> tuple[Wave, ...]:
    """One wave of frequency zero; reflectance 0..1, 1 the perfect white diffuser."""
    return (Wave((reflectance,)),)
