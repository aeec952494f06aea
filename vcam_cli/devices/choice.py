"""The device of a name."""

from __future__ import annotations

from vcam_cli.devices.processor import PROCESSOR, Processor

DEVICES = ("cpu", "gpu")


def open_device(name: str) -> Processor:
    """Return the device of a name.

    Parameters
    ----------
    name : str
        "cpu" or "gpu".

    Raises
    ------
    ValueError
        For another name.
    CannotDo
        Where there is no such device, or no library for it.
    """
    if name == "cpu":
        return PROCESSOR
    if name != "gpu":
        raise ValueError(f"device {name!r}; write one of {', '.join(DEVICES)}")
    from vcam_cli.devices.cuda import open_cuda

    return open_cuda()
