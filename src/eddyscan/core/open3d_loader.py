"""The one way to Open3D: preloads libusb, which its wheel needs and slim machines lack."""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from typing import Any

from eddyscan.core.errors import WorkError


@cache
def load_open3d() -> Any:
    """Import Open3D on first use (about two seconds) and return the module.

    Raises
    ------
    WorkError
        When a system library that Open3D needs is missing; the message says how to install it.
    """
    _preload_libusb()
    try:
        import open3d
    except (ImportError, OSError) as error:
        raise WorkError(
            f"Open3D cannot be loaded: {error}. It needs libGL, libEGL, libX11 and libgomp from the system; "
            "`make demo` installs or names them (Debian: apt-get install libgl1 libegl1 libx11-6 libgomp1)."
        ) from error
    open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
    return open3d


def _preload_libusb() -> None:
    try:
        ctypes.CDLL("libusb-1.0.so.0", mode=ctypes.RTLD_GLOBAL)
    except OSError:
        import libusb_package

        found = sorted(Path(libusb_package.__file__).parent.glob("libusb-1.0*"))
        if found:
            ctypes.CDLL(str(found[0]), mode=ctypes.RTLD_GLOBAL)
