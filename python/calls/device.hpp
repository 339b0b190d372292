#pragma once

#include "xraycast/opencl/compute_device.hpp"

#include <mutex>
#include <string>
#include <vector>

namespace xraycast::python {

/// The one OpenCL device of the process, which all calls share, one at a time. Opened when it is first used;
/// stays open until the process ends. Not with the interpreter's lock held, since another thread may be
/// waiting for that while it uses the device.
class DeviceUse {
 public:
  /// Throws DeviceError where there is no device, or where the process was forked from one that used it: the
  /// driver's threads are not there.
  DeviceUse();
  ComputeDevice& operator*() const;
  ComputeDevice* operator->() const { return &**this; }

 private:
  std::unique_lock<std::recursive_mutex> lock_;
};

/// Chooses the device as `--device` does. Throws InputError once another one is in use. Without the
/// interpreter's lock, as device_names.
void choose_device(const std::string& choice);

/// The devices' names, in the order of their numbers.
std::vector<std::string> device_names();

/// Removes what the device left on the disk. When the interpreter exits.
void clean_up_after_device();

}  // namespace xraycast::python
