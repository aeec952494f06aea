"""What a camera file may say of the sensor: pixel, photodetector, technology, array."""
