"""From a camera to all that follows from it before any light is known, once a frame."""
