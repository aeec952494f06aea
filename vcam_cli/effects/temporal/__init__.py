"""Effects of the exposure's time: what moves during it, and lamps that flicker."""
