#pragma once

#include <cstdint>
#include <memory>

namespace xraycast {

class TemporaryFolderOnDisk;

/// Where PoCL, the OpenCL implementation for CPUs, stores compiled kernels: the user's cache folder,
/// $XDG_CACHE_HOME or ~/.cache. Without a writable one PoCL finds no device, on a full disk it aborts the
/// process, and without a home it uses a folder in which other users could plant kernels. In these cases a
/// KernelCache makes it use a new private folder for the lifetime of the object. A POCL_CACHE_DIR set by the
/// user is not changed.
class KernelCache {
 public:
  /// Space that must be left on its disk: more than all kernels take.
  static constexpr std::uintmax_t kRoom_B = 16'000'000;

  /// Before OpenCL is first used, and before other threads are started: it changes the environment.
  KernelCache();

  /// Removes the private folder, if there is one. The folder of a killed process is removed when the next one
  /// is made.
  ~KernelCache();
  KernelCache(const KernelCache&) = delete;
  KernelCache& operator=(const KernelCache&) = delete;

 private:
  std::unique_ptr<TemporaryFolderOnDisk> own_;  ///< the private folder; none while the user's is used
};

/// Throws DeviceError, before PoCL is used, where its folder or the one that a KernelCache looked for cannot
/// be written to or is on a full disk.
void require_kernel_cache();

}  // namespace xraycast
