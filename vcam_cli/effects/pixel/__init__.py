"""Effects of the pixel before noise: its aperture, its light path, its charge."""
