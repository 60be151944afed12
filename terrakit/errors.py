"""Everything that terrakit raises on purpose.

::

    TerrakitError                     one line for the user; the command line exits with 2
    ├── InputError (ValueError)       a file, array or mesh that cannot be used
    ├── ParameterError (ValueError)   a value outside what its operator declares
    ├── RecipeError (ValueError)      a recipe that does not describe a run
    ├── PluginError                   a plugin that raised or returned rubbish; exit 1
    ├── DeviceError (RuntimeError)    no device, or a device that cannot do the work
    ├── KernelError (RuntimeError)    a kernel that does not build; exit 1
    ├── OutputError (OSError)         a place that cannot be written
    ├── ResourceError (MemoryError)   more memory or disk than there is
    └── Cancelled                     the user asked to stop; exit 130
"""

from __future__ import annotations


class TerrakitError(Exception):
    """Base class: the message is one sentence that names the value, the limit and the way out."""

    exit_code = 2


class InputError(TerrakitError, ValueError):
    """A file, array or mesh that cannot be used as it is."""


class ParameterError(TerrakitError, ValueError):
    """A parameter outside what its operator declares."""


class RecipeError(TerrakitError, ValueError):
    """A recipe that does not describe a run."""


class PluginError(TerrakitError):
    """A plugin that raised, exited, returned rubbish or clashes with another."""

    exit_code = 1


class DeviceError(TerrakitError, RuntimeError):
    """No such device, or a device that cannot do the work."""


class KernelError(TerrakitError, RuntimeError):
    """A kernel that does not build on this device."""

    exit_code = 1


class OutputError(TerrakitError, OSError):
    """A place that cannot be written, or a write that failed."""


class ResourceError(TerrakitError, MemoryError):
    """A run that would need more memory or disk than there is."""


class Cancelled(TerrakitError):  # noqa: N818  (reads as the event that it is)
    """The user asked to stop; nothing half-written is left behind."""

    exit_code = 130
