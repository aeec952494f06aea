"""Effects: what a camera does to the light, one file an effect; `order.py` comes first.

optics/      blur by the lens, relative illumination, stray light
temporal/    motion during the exposure, lamps that flicker
pixel/       aperture, microlens, diffusion, dark current, transfer, full well
noise/       noise of photons and circuits, fixed pattern, quantization
"""
