"""Effects that vary from frame to frame or from pixel to pixel, and quantization."""
