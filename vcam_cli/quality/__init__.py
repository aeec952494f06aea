"""Image quality: comparisons of pictures, and measurements of cameras by their standards."""

from vcam_cli.quality.mse import mse, psnr_db, psnr_of_mse

__all__ = ["mse", "psnr_db", "psnr_of_mse"]
