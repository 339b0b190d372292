#include "calls/device.hpp"

#include "calls/owning_process.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/opencl/kernel_cache.hpp"

#include <utility>

namespace xraycast::python {
namespace {

OwningProcess device_owner;
std::recursive_mutex device_mutex;
std::string chosen_device;  ///< guarded by device_mutex, as the others are
/// Neither is destroyed when the process ends: drivers may have cleaned up before, and a forked process would
/// remove its parent's folder.
KernelCache* kernels = nullptr;
ComputeDevice* opened_device = nullptr;

[[noreturn]] void tell_of_fork() {
  throw DeviceError(
      "the OpenCL device was in use when this process was forked, and cannot be used here; start processes "
      "by "
      "multiprocessing's method `spawn`");
}

/// Makes this process the one that uses OpenCL, and keeps other threads from it. Throws DeviceError in a
/// forked process.
std::unique_lock<std::recursive_mutex> own_device() {
  if (!device_owner.claim()) tell_of_fork();
  std::unique_lock lock(device_mutex);
  if (!kernels) kernels = new KernelCache;
  return lock;
}

}  // namespace

DeviceUse::DeviceUse() : lock_(own_device()) {
  if (!opened_device) opened_device = new ComputeDevice(chosen_device);
}

ComputeDevice& DeviceUse::operator*() const { return *opened_device; }

void choose_device(const std::string& choice) {
  if (device_owner.is_another()) tell_of_fork();
  const std::lock_guard lock(device_mutex);
  if (opened_device && choice != chosen_device)
    throw InputError("device {}: {} is in use already; choose before the first call that needs a device",
                     choice, opened_device->info().name);
  chosen_device = choice;
}

std::vector<std::string> device_names() {
  const auto lock = own_device();
  std::vector<std::string> names;
  for (const ComputeDevice::Info& info : ComputeDevice::list()) names.push_back(info.name);
  return names;
}

void clean_up_after_device() {
  if (!device_owner.is_this()) return;
  const std::lock_guard lock(device_mutex);
  delete std::exchange(kernels, nullptr);
}

}  // namespace xraycast::python
