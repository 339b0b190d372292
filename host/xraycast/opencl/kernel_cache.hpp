#pragma once

#include <filesystem>

namespace xraycast {

/// Where PoCL, the OpenCL implementation for CPUs, stores compiled kernels: the user's cache folder,
/// $XDG_CACHE_HOME or ~/.cache. Without a writable one PoCL finds no device, and without a home it uses
/// /tmp/pocl, where other users could plant kernels. In both cases a KernelCache makes it use a new private
/// folder for the lifetime of the object. A POCL_CACHE_DIR set by the user is not changed.
class KernelCache {
 public:
  /// Before OpenCL is first used, and before other threads are started: it changes the environment.
  KernelCache();

  /// Removes the private folder, if there is one.
  ~KernelCache();
  KernelCache(const KernelCache&) = delete;
  KernelCache& operator=(const KernelCache&) = delete;

 private:
  std::filesystem::path own_;  ///< the private folder; empty while the user's is used
};

}  // namespace xraycast
