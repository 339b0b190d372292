"""The errors of the package; their messages are those of the command line."""


class Error(Exception):
    """A call failed, such as by a full disk."""


class InputError(Error, ValueError):
    """Data or arguments cannot be used; the message names what, and what to do."""


class DeviceError(Error, RuntimeError):
    """OpenCL is missing or failed."""
