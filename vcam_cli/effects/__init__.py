"""Effects: what a camera does to the light, one file an effect; `order.py` comes first."""
