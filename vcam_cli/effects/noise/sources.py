"""Sources of noise in front of the ADC, in the order of action."""

from __future__ import annotations

from vcam_cli.effects.noise.correlated_row_noise import CorrelatedRowNoise
from vcam_cli.effects.noise.fpn import FixedPattern
from vcam_cli.effects.noise.fpn_maps import PatternMaps
from vcam_cli.effects.noise.fpn_shading import PatternShading
from vcam_cli.effects.noise.heavy_tailed_noise import HeavyTailedNoise
from vcam_cli.effects.noise.read_noise import ReadNoise
from vcam_cli.effects.noise.reset_noise import ResetNoise
from vcam_cli.effects.noise.shot_noise import ShotNoise
from vcam_cli.effects.noise.telegraph_noise import TelegraphNoise
from vcam_cli.effects.signal_chain import NoiseSource

SOURCES: tuple[type[NoiseSource], ...] = (
    ShotNoise,
    FixedPattern,
    PatternShading,
    PatternMaps,
    ResetNoise,
    ReadNoise,
    HeavyTailedNoise,
    CorrelatedRowNoise,
    TelegraphNoise,
)
