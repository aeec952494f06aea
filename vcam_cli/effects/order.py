"""The order in which light becomes numbers. Read this first.

    in                     kind               effects                        out
    ---------------------  -----------------  -----------------------------  -----------------------
    radiance of the scene  (always there)     camera equation, eq 2.18       photons / (s m2 m)
    radiance of the scene  ImageMotion        motion                         the same, elsewhere
    radiance of the scene  StillWarp          distortion, lateral_color      the same, elsewhere
    spectrum of the image  Blur               diffraction, aberration,       electrons / s, blurred
                                              depth
    spectrum of the image  Blur               jitter                         electrons / s, blurred
    spectrum of the image  SeparableTransfer  low_pass, pixel_aperture       electrons / s, blurred
    spectrum of the image  Blur               charge_diffusion               electrons / s, blurred
    electrons / s          Gain               off_axis                       electrons / s
    electrons / s          VeilingGlare       stray_light                    electrons / s
    electrons / s          Gain               pixel_vignetting, microlens    electrons / s
    electrons / s          TemporalGain       flicker                        electrons / s
    electrons / s          NeighborSharing    crosstalk                      electrons / s
    electrons / s          ColumnSpread       smear                          electrons / s
    electrons / s          Charge             dark_current                   electrons (mean signal)
    electrons              Retention          lag                            electrons (mean signal)
    electrons              Transport          charge_transfer                electrons (mean signal)
    electrons              before_shot        fpn, fpn_maps                  electrons (mean signal)
    electrons              NoiseSource        shot_noise, fpn, fpn_shading,  electrons
                                              fpn_maps, reset_noise,
                                              read_noise,
                                              heavy_tailed_noise,
                                              correlated_row_noise,
                                              telegraph_noise
    electrons              Overflow           blooming                       electrons
    electrons              Limit              saturation                     electrons
    electrons              NoiseSource        adc_noise                      electrons
    electrons              Quantizer          quantization                   DN

`base.py` says where the classes of the kinds are; an aberration that changes over the field is a
FieldTransfer, a low_pass along a diagonal a Blur; `before_shot` is a method of a NoiseSource: it
changes the mean signal whose shot noise is drawn. Behind shot_noise, blooming moves charge, and
then crosstalk couples sense nodes. Warps are composed in their order, from the scene to the sensor;
where nothing else warps, motion may be a transfer function. Transfer functions multiply, so their
order does not matter. Gains act on the blurred image: they are taken as constant over a pixel and a
point spread function.

Within a kind the order of this tuple is the order of action; that of the noise in front of the ADC,
which an automatic offset makes room for, is in `noise/sources.py`. It is written nowhere else.
"""

from __future__ import annotations

from vcam_cli.effects.base import Effect
from vcam_cli.effects.noise.adc_noise import AdcNoise
from vcam_cli.effects.noise.quantization import Quantization
from vcam_cli.effects.noise.sources import SOURCES
from vcam_cli.effects.optics.aberration import Aberration
from vcam_cli.effects.optics.depth import Depth
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.effects.optics.distortion import Distortion
from vcam_cli.effects.optics.lateral_color import LateralColor
from vcam_cli.effects.optics.low_pass import LowPass
from vcam_cli.effects.optics.off_axis import OffAxis
from vcam_cli.effects.optics.stray_light import StrayLight
from vcam_cli.effects.pixel.blooming import Blooming
from vcam_cli.effects.pixel.charge_diffusion import ChargeDiffusion
from vcam_cli.effects.pixel.charge_transfer import ChargeTransfer
from vcam_cli.effects.pixel.crosstalk import Crosstalk
from vcam_cli.effects.pixel.dark_current import DarkCurrent
from vcam_cli.effects.pixel.lag import Lag
from vcam_cli.effects.pixel.microlens import Microlens
from vcam_cli.effects.pixel.pixel_aperture import PixelAperture
from vcam_cli.effects.pixel.pixel_vignetting import PixelVignetting
from vcam_cli.effects.pixel.saturation import Saturation
from vcam_cli.effects.pixel.smear import Smear
from vcam_cli.effects.temporal.flicker import Flicker
from vcam_cli.effects.temporal.jitter import Jitter
from vcam_cli.effects.temporal.motion import Motion

ORDER: tuple[type[Effect], ...] = (
    Motion,
    Distortion,
    LateralColor,
    Diffraction,
    Aberration,
    Depth,
    Jitter,
    LowPass,
    PixelAperture,
    ChargeDiffusion,
    OffAxis,
    StrayLight,
    PixelVignetting,
    Microlens,
    Flicker,
    Crosstalk,
    Smear,
    DarkCurrent,
    Lag,
    ChargeTransfer,
    *SOURCES,
    Blooming,
    Saturation,
    AdcNoise,
    Quantization,
)
