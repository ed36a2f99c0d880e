"""A hook of the build: a wheel with ready-made machine code, if `tests/distribution/ready.py` made some."""

import os
import platform
import sys
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from packaging.tags import platform_tags

FOLDER = "FRAMEARRAY_MACHINE_CODE"  # of machine code for this Python and this system


class ReadyMadeCode(BuildHookInterface):
    """Puts machine code into a wheel, which then is for one version of Python and one system."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "standard" and (folder := os.environ.get(FOLDER)):
            python = f"cp{sys.version_info.major}{sys.version_info.minor}"
            linux = f"manylinux_2_17_{platform.machine()}"  # what it calls is in libm of any glibc
            build_data["tag"] = f"{python}-{python}-{linux if sys.platform == 'linux' else next(platform_tags())}"
            build_data["pure_python"] = False
            build_data["force_include"][folder] = "framearray_cli/machine_code"
