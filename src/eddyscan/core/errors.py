"""Every error eddyscan raises on purpose, drawn as a tree.

    EddyscanError
    |-- InputError              what was given cannot be used: exit code 2
    |   |-- FileError           a file is missing, empty, truncated or of another kind
    |   |-- TechniqueError      a value in technique.toml, rig.toml or a case file
    |   |-- GeometryError       a cloud, mesh or plan breaks a geometric rule
    |   |-- RegistrationError   views that cannot be brought together
    |   |-- CoverageError       a plan that misses its technique's coverage
    |   `-- TravelError         a target outside an axis limit or in a keep-out zone
    `-- WorkError               the work failed on the way: exit code 1
        |-- DeviceError         a device refused, failed or lost its link
        |   |-- LinkError       no answer, dropped or garbled
        |   `-- MotionError     stalled, not where it should be, driver off
        `-- ScanAborted         stopped by a person or a guard; the record is whole

A message names the fault, the value, the limit, the place and the way out.
"""

from __future__ import annotations


class EddyscanError(Exception):
    """Base of all errors raised on purpose."""

    exit_code = 1


class InputError(EddyscanError):
    """What was given cannot be used."""

    exit_code = 2


class FileError(InputError):
    """A file is missing, empty, truncated or of another kind."""


class TechniqueError(InputError):
    """A setting is unknown, out of range or contradicts another."""


class GeometryError(InputError):
    """A cloud, mesh or plan breaks a geometric rule."""


class RegistrationError(InputError):
    """Views that cannot be brought into one frame."""


class CoverageError(InputError):
    """A plan that covers less than its technique demands."""


class TravelError(InputError):
    """A target outside an axis limit or inside a keep-out zone."""


class WorkError(EddyscanError):
    """The work failed on the way."""


class DeviceError(WorkError):
    """A device refused, failed or lost its link."""


class LinkError(DeviceError):
    """No answer, a dropped link or a garbled reply."""


class MotionError(DeviceError):
    """An axis stalled, missed its target or has its driver off."""


class ScanAborted(WorkError):
    """Stopped by a person or a guard; everything recorded so far is kept."""
