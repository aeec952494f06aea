"""Effects of the lens on the light: blur by the pupil, relative illumination, stray light."""
