"""How good a picture is: comparisons of linear display RGB with the ideal image."""

from vcam_cli.quality.mse import mse, psnr_db, psnr_of_mse

__all__ = ["mse", "psnr_db", "psnr_of_mse"]
