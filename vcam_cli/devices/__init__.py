"""Where light and noise are computed: the processor, or a graphics processor."""
