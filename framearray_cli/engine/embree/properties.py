"""What the installed Embree can do on this machine."""

from dataclasses import dataclass

from ..embree_c import device_configuration, embree_library, native_widths

_VERSION = (1, 2, 3)  # RTCDeviceProperty of Embree 3 and 4: major, minor, patch


@dataclass(frozen=True, slots=True)
class EmbreeProperties:
    """Version of Embree, and the numbers of rays per packet that it traces together on this processor."""

    version: str
    widths: tuple[int, ...]


def embree_properties() -> EmbreeProperties | None:
    """Ask Embree; None where its functions cannot be reached, and rays go through embreex."""
    library = embree_library()
    if library is None:
        return None
    device = library.rtcNewDevice(device_configuration())
    if not device:
        return None
    try:
        version = ".".join(str(library.rtcGetDeviceProperty(device, key)) for key in _VERSION)
        return EmbreeProperties(version, tuple(sorted(native_widths())))
    finally:
        library.rtcReleaseDevice(device)
