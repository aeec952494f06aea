"""Files of pictures: EXR, PNG, TIFF, DNG, camera raw, maps and video."""
