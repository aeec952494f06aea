"""What stands in front of the camera: charts and image files as light on the sensor plane."""
