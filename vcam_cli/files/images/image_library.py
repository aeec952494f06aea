"""OpenImageIO, loaded whole: an interrupt within its C++ part would abort the process."""

from vcam_cli.interrupts import defer_interrupts

with defer_interrupts():
    import OpenImageIO as oiio

__all__ = ["oiio"]
