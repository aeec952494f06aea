"""Where batches of frames are computed: the processor, or a graphics processor."""
