"""Embree's C functions, from the library in the embreex wheel, and the widths of packets that it traces natively."""

import ctypes
import os
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from typing import Any

from framearray_cli.base.errors import MissingExtraError
from framearray_cli.base.extras import extra
from framearray_cli.base.platform import has_wheels_of_embree, machine_name

_VERSION = (1, 2, 3)  # RTCDeviceProperty of Embree 3 and 4: major, minor, patch
# Rays per packet -> RTC_DEVICE_PROPERTY_NATIVE_RAY..._SUPPORTED.
_NATIVE = {16: 34, 8: 33, 4: 32}
WIDEST = 16


def require_embree() -> None:
    """Check that rays can be traced at all, before any work is done.

    Raises:
        MissingExtraError: embreex is not installed, or cannot be loaded; on some systems it cannot be installed either.
    """
    if not has_wheels_of_embree() and find_spec("embreex") is None:
        raise MissingExtraError(
            "rendering needs embreex, which has wheels for Linux (with glibc) and Windows on x86-64 and for macOS, but "
            f"none for this system, {machine_name()}; render on one of those: only render, check, init and report need "
            "it, and arrays that are copied here can be viewed, assembled, exported and verified"
        )
    with extra("rendering needs embreex", "embreex", reason=True):
        from embreex import rtcore_scene  # noqa: F401


@cache
def embree_library() -> ctypes.CDLL:
    """Load Embree from the embreex wheel.

    Opening the extension module again resolves every `rtc...` symbol through the module's own dependency, however the
    wheel names that library.

    Raises:
        MissingExtraError: embreex is not installed, cannot be loaded, or does not hand on Embree's functions.
    """
    require_embree()
    from embreex import rtcore_scene

    try:
        library = ctypes.CDLL(rtcore_scene.__file__)
        for name in _SIGNATURES:
            getattr(library, name)
    except (OSError, AttributeError) as error:
        raise MissingExtraError(
            f"rendering needs Embree's C functions, which {rtcore_scene.__file__} does not hand on ({error}); install "
            "embreex from its wheel"
        ) from error
    for name, (result, *arguments) in _SIGNATURES.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


_POINTER, _UINT, _SIZE, _INT = ctypes.c_void_p, ctypes.c_uint, ctypes.c_size_t, ctypes.c_int
_TRACE = (None, _POINTER, _POINTER, _POINTER, _POINTER)
_SIGNATURES: dict[str, tuple[Any, ...]] = {
    "rtcNewDevice": (_POINTER, ctypes.c_char_p),
    "rtcGetDeviceError": (_INT, _POINTER),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, _POINTER, _INT),
    "rtcReleaseDevice": (None, _POINTER),
    "rtcNewScene": (_POINTER, _POINTER),
    "rtcSetSceneFlags": (None, _POINTER, _INT),
    "rtcCommitScene": (None, _POINTER),
    "rtcReleaseScene": (None, _POINTER),
    "rtcNewGeometry": (_POINTER, _POINTER, _INT),
    "rtcSetSharedGeometryBuffer": (None, _POINTER, _INT, _UINT, _INT, _POINTER, _SIZE, _SIZE, _SIZE),
    "rtcSetGeometryUserData": (None, _POINTER, _POINTER),
    "rtcSetGeometryIntersectFilterFunction": (None, _POINTER, _POINTER),
    "rtcSetGeometryOccludedFilterFunction": (None, _POINTER, _POINTER),
    "rtcCommitGeometry": (None, _POINTER),
    "rtcAttachGeometryByID": (None, _POINTER, _POINTER, _UINT),
    "rtcReleaseGeometry": (None, _POINTER),
    **{f"rtc{query}{width}": _TRACE for query in ("Intersect", "Occluded") for width in _NATIVE},
}


def device_configuration() -> bytes | None:
    """Embree's settings for a device: none, except where tests force an instruction set."""
    return os.environ.get("FRAMEARRAY_EMBREE", "").encode() or None


@cache
def packet_width() -> int:
    """The number of rays that Embree traces together at most on this processor: 16, 8 or 4.

    Wider packets it takes apart and traces ray by ray: with AVX2 shadow rays then take more than twice as long. Kernels
    are compiled for this width. FRAMEARRAY_PACKETS names another one, for tests and measurements.
    """
    chosen = os.environ.get("FRAMEARRAY_PACKETS", "")
    if chosen in {str(width) for width in _NATIVE}:
        return int(chosen)
    try:
        return max(embree_properties().packet_widths, default=WIDEST)
    except MissingExtraError:  # only kernels without rays are compiled here
        return WIDEST


@dataclass(frozen=True, slots=True)
class EmbreeProperties:
    """Embree, and the numbers of rays per packet that it traces together on this processor, in rising order."""

    version: str
    packet_widths: tuple[int, ...]


def embree_properties() -> EmbreeProperties:
    """Ask a device of Embree for its version and widths of packets.

    Raises:
        MissingExtraError: as `embree_library`.
    """
    library = embree_library()
    device = library.rtcNewDevice(device_configuration())
    if not device:
        return EmbreeProperties("", ())
    try:
        version = ".".join(str(library.rtcGetDeviceProperty(device, key)) for key in _VERSION)
        widths = (width for width, key in sorted(_NATIVE.items()) if library.rtcGetDeviceProperty(device, key))
        return EmbreeProperties(version, tuple(widths))
    finally:
        library.rtcReleaseDevice(device)
