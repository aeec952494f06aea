"""Image formation: from the radiance of a scene to the mean rate of electrons in every pixel."""
