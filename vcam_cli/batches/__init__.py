"""Many frames of one camera at once, on the processor or a graphics processor."""
