"""What the installed Embree can do on this machine."""

import ctypes
from dataclasses import dataclass

from ..library import device_configuration, embree_library

# RTCDeviceProperty of Embree 3 and 4.
_VERSION = (1, 2, 3)  # major, minor, patch
_NATIVE_WIDTHS = {4: 32, 8: 33, 16: 34}


@dataclass(frozen=True, slots=True)
class EmbreeProperties:
    """Version of Embree, and the numbers of rays per packet that it traces with instructions of that width."""

    version: str
    widths: tuple[int, ...]


def embree_properties() -> EmbreeProperties | None:
    """Ask Embree; None where its functions cannot be reached, and rays go through embreex."""
    library = embree_library()
    if library is None:
        return None
    ask = library.rtcGetDeviceProperty
    ask.restype, ask.argtypes = ctypes.c_ssize_t, (ctypes.c_void_p, ctypes.c_int)
    device = library.rtcNewDevice(device_configuration())
    try:
        version = ".".join(str(ask(device, key)) for key in _VERSION)
        return EmbreeProperties(version, tuple(n for n, key in _NATIVE_WIDTHS.items() if ask(device, key)))
    finally:
        library.rtcReleaseDevice(device)
