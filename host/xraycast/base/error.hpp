#pragma once

#include "xraycast/base/printable.hpp"

#include <fmt/format.h>

#include <stdexcept>

namespace xraycast {

/// A failure caused neither by the user's input nor by the OpenCL device, such as a full disk. `what()` is
/// one line, fit for a terminal, that says what to do; the command line prints it and exits with 1.
class Error : public std::runtime_error {
 public:
  template <typename... Args>
  explicit Error(fmt::format_string<Args...> format, Args&&... args)
      : std::runtime_error(printable_line(fmt::format(format, std::forward<Args>(args)...))) {}
};

/// The user's data or arguments cannot be used; names the file and the field. Exit status 3.
class InputError : public Error {
  using Error::Error;
};

/// OpenCL is missing or failed. Exit status 4.
class DeviceError : public Error {
  using Error::Error;
};

/// `Progress::cancel` was called; thrown by the next `Progress::advance`. Exit status
/// 128 + the signal that cancelled.
class Cancelled : public Error {
 public:
  Cancelled() : Error("cancelled") {}
};

}  // namespace xraycast
