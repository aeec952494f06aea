"""The illuminants that ship, for those who name them only: their spectra need NumPy."""

LAMPS = {
    "A": "tungsten lamp, black body of 2856 K",
    "C": "average daylight of 6774 K, no longer a standard",
    "D50": "daylight of 5003 K, that of printing",
    "D55": "daylight of 5503 K, mid-morning",
    "D65": "daylight of 6504 K, white of sRGB",
    "D75": "daylight of 7504 K, north sky",
    "FL1": "fluorescent, daylight, 6430 K",
    "FL2": "fluorescent, cool white, 4230 K",
    "FL3": "fluorescent, white, 3450 K",
    "FL4": "fluorescent, warm white, 2940 K",
    "FL5": "fluorescent, daylight, 6350 K",
    "FL6": "fluorescent, light white, 4150 K",
    "FL7": "fluorescent of broad bands, like D65, 6500 K",
    "FL8": "fluorescent of broad bands, like D50, 5000 K",
    "FL9": "fluorescent of broad bands, cool white deluxe, 4150 K",
    "FL10": "fluorescent of three narrow bands, 5000 K",
    "FL11": "fluorescent of three narrow bands, 4000 K",
    "FL12": "fluorescent of three narrow bands, 3000 K",
    "E": "the same power at every wavelength",
    "equal-energy": "the same power at every wavelength",
}
"""Illuminant -> the light that it represents (CIE 015:2004, tables T.1 and T.7)."""
