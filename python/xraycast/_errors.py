"""The errors of the package; their messages are those of the command line."""


class Error(Exception):
    """A call failed, for example because the disk is full."""


class InputError(Error, ValueError):
    """Data or arguments cannot be used; the message names them and says what to do."""


class DeviceError(Error, RuntimeError):
    """OpenCL is missing or failed."""
