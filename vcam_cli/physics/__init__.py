"""Physics of a camera as pure functions: arrays in, arrays out, SI units, no camera model."""
