#pragma once

namespace xraycast {

/// Throws the exception that is being handled again, as what a user can act on: DeviceError for OpenCL's own
/// errors, InputError for paths that cannot be used, Error where no thread could be started; others as they
/// are.
[[noreturn]] void rethrow_in_words();

}  // namespace xraycast
