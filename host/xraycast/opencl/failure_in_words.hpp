#pragma once

namespace xraycast {

/// Rethrows the exception that is being handled as one that a user can act on: DeviceError for OpenCL's own
/// errors, InputError for paths that cannot be used, Error if no thread could be started; others unchanged.
[[noreturn]] void rethrow_in_words();

}  // namespace xraycast
