#include "xraycast/opencl/failure_in_words.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/opencl/compute_device.hpp"

#include <filesystem>
#include <system_error>

namespace xraycast {

void rethrow_in_words() {
  try {
    throw;
  } catch (const cl::Error& error) {
    throw DeviceError("{} failed with {}", error.what(), status_name(error.err()));
  } catch (const std::filesystem::filesystem_error& error) {
    throw InputError("{}: {}", error.path1().string(), error.code().message());
  } catch (const std::system_error& error) {
    if (error.code() != std::errc::resource_unavailable_try_again) throw;
    throw Error(
        "no thread could be started: raise the limits of memory (`ulimit -v`) and processes (`ulimit -u`)");
  }
}

}  // namespace xraycast
