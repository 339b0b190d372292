#include "device.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/opencl/kernel_cache.hpp"

#include <memory>
#include <optional>
#include <unistd.h>

namespace xraycast::python {
namespace {

std::recursive_mutex device_mutex;
std::string chosen_device;  ///< guarded by device_mutex, as the others are
std::unique_ptr<KernelCache> kernels;
/// Never destroyed: when the process ends, drivers may have cleaned up before.
ComputeDevice* opened_device = nullptr;
pid_t opened_in = 0;

}  // namespace

DeviceUse::DeviceUse() : lock_(device_mutex) {
  if (opened_device && opened_in != getpid())
    throw DeviceError(
        "the OpenCL device was in use when this process was forked, and cannot be used here; start processes "
        "by "
        "multiprocessing's method `spawn`");
  if (opened_device) return;
  if (!kernels) kernels = std::make_unique<KernelCache>();
  opened_device = new ComputeDevice(chosen_device);
  opened_in = getpid();
}

ComputeDevice& DeviceUse::operator*() const { return *opened_device; }

void choose_device(const std::string& choice) {
  const std::lock_guard lock(device_mutex);
  if (opened_device && choice != chosen_device)
    throw InputError("device {}: {} is in use already; choose before the first call that needs a device",
                     choice, opened_device->info().name);
  chosen_device = choice;
}

void clean_up_after_device() {
  const std::lock_guard lock(device_mutex);
  if (opened_in == getpid()) kernels.reset();
}

}  // namespace xraycast::python
