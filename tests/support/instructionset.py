"""The instructions that Embree runs with, and a way to force fewer.

`make test-avx2` sets FRAMEARRAY_EMBREE to Embree's own words for it, `isa=avx2`. The program passes them to each device
that it makes. embreex makes its devices without any options; it gets one of ours here.
"""

import ctypes
import os
from typing import Any

from embreex import mesh_construction, rtcore, rtcore_scene

from framearray_cli.engine.embree.library import embree_library

_NATIVE_RAY16_SUPPORTED = 34  # RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED: packets of 16 need AVX-512

FORCED = os.environ.get("FRAMEARRAY_EMBREE", "")

_scene_of = rtcore_scene.EmbreeScene
assert mesh_construction  # on loading it takes the class of scenes, and needs the true one


def has_packets_of_16(device: int) -> bool:
    """Whether a device traces 16 rays at once; with AVX2 it takes them apart."""
    property_of = embree_library().rtcGetDeviceProperty
    property_of.restype, property_of.argtypes = ctypes.c_ssize_t, (ctypes.c_void_p, ctypes.c_int)
    return bool(property_of(device, _NATIVE_RAY16_SUPPORTED))


def forced_device() -> Any:
    """An embreex device that runs with the forced instructions.

    embreex has no argument for it, so exchange the pointer in its object for that of another device.
    """
    device = rtcore.EmbreeDevice()
    pointer = device_pointer(device)
    embree_library().rtcReleaseDevice(pointer.value)
    pointer.value = embree_library().rtcNewDevice(FORCED.encode())
    return device


def device_pointer(device: Any) -> ctypes.c_void_p:
    """Where an embreex device keeps Embree's: the one field behind the header of its object."""
    assert type(device).__basicsize__ == object.__basicsize__ + ctypes.sizeof(ctypes.c_void_p)
    return ctypes.c_void_p.from_address(id(device) + object.__basicsize__)


def forced_scene() -> Any:
    """A scene of embreex on a forced device."""
    return _scene_of(forced_device())


def force_embreex() -> None:
    """Make every scene of embreex on a forced device."""
    rtcore_scene.EmbreeScene = forced_scene
