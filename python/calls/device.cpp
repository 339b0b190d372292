#include "calls/instrument.hpp"
#include "calls/owning_process.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/opencl/kernel_cache.hpp"

#include <utility>

namespace xraycast::python {
namespace {

OwningProcess instrument_owner;
std::recursive_mutex instrument_mutex;
std::string chosen_instrument;  ///< guarded by instrument_mutex, as the others are
/// Neither is destroyed when the process ends: drivers may have cleaned up before, and a forked process would
/// remove its parent's folder.
KernelCache* kernels = nullptr;
ComputeDevice* opened_instrument = nullptr;

[[noreturn]] void tell_of_fork() {
  throw DeviceError(
      "the OpenCL device was in use when this process was forked, and cannot be used here; start processes "
      "by "
      "multiprocessing's method `spawn`");
}

/// Makes this process the one that uses OpenCL, and keeps other threads from it. Throws DeviceError in a
/// forked process.
std::unique_lock<std::recursive_mutex> own_instrument() {
  if (!instrument_owner.claim()) tell_of_fork();
  std::unique_lock lock(instrument_mutex);
  if (!kernels) kernels = new KernelCache;
  return lock;
}

}  // namespace

DeviceUse::DeviceUse() : lock_(own_instrument()) {
  if (!opened_instrument) opened_instrument = new ComputeDevice(chosen_instrument);
}

ComputeDevice& DeviceUse::operator*() const { return *opened_instrument; }

void choose_instrument(const std::string& choice) {
  if (instrument_owner.is_another()) tell_of_fork();
  const std::lock_guard lock(instrument_mutex);
  if (opened_instrument && choice != chosen_instrument)
    throw InputError(
        "instrument {}: {} is in use already; choose before the first call that needs an instrument", choice,
        opened_instrument->info().name);
  chosen_instrument = choice;
}

std::vector<std::string> instrument_names() {
  const auto lock = own_instrument();
  std::vector<std::string> names;
  for (const ComputeDevice::Info& info : ComputeDevice::list()) names.push_back(info.name);
  return names;
}

void clean_up_after_instrument() {
  if (!instrument_owner.is_this()) return;
  const std::lock_guard lock(instrument_mutex);
  delete std::exchange(kernels, nullptr);
}

}  // namespace xraycast::python
