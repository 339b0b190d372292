#pragma once

#include <cstdint>
#include <filesystem>

namespace xraycast {

/// Where PoCL, the OpenCL of processors, keeps the kernels that it has compiled. That is the user's cache
/// folder, $XDG_CACHE_HOME or ~/.cache. Without one that can be written to PoCL finds no device, on a full
/// disk it ends the process, and without a home it takes /tmp/pocl, where others can leave kernels to be run.
/// While a KernelCache lives it takes a new folder of this process alone in these cases. POCL_CACHE_DIR,
/// where the user sets it, is left alone.
class KernelCache {
 public:
  /// What has to be left on its disk: more than all kernels take.
  static constexpr std::uintmax_t kRoom_B = 16'000'000;

  /// Before OpenCL is first used, and before other threads are started: it changes the environment.
  KernelCache();

  /// Removes the folder, where it is our own.
  ~KernelCache();
  KernelCache(const KernelCache&) = delete;
  KernelCache& operator=(const KernelCache&) = delete;

 private:
  std::filesystem::path own_;  ///< empty where the user's serves
};

/// Throws DeviceError, before PoCL is used, where its folder or the one that a KernelCache looked for cannot
/// be written to or is on a full disk.
void require_kernel_cache();

}  // namespace xraycast
