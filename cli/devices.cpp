#include "options/command.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/opencl/compute_device.hpp"

#include <fmt/format.h>

namespace xraycast::cli {
namespace {

void list_devices(const Invocation& invocation) {
  Json devices = Json::array();
  std::string text;
  for (const ComputeDevice::Info& info : ComputeDevice::list()) {
    ComputeDevice device(std::to_string(info.index));
    const auto [buffers, images] = device.self_test();
    devices.push_back({{"index", info.index},
                       {"name", info.name},
                       {"platform", info.platform},
                       {"version", info.version},
                       {"gpu", info.is_gpu},
                       {"compute_units", info.compute_units},
                       {"memory_B", info.memory_B},
                       {"max_allocation_B", info.max_allocation_B},
                       {"self_test", {{"buffers", buffers}, {"images", images}}}});
    text += fmt::format(
        "{}: {}\n   {}, {}, {}, {:.1f} GiB, buffers up to {:.1f} GiB\n   self-test: buffers "
        "{}, images {}\n",
        info.index, info.name, info.platform, info.version, pluralize(info.compute_units, "compute unit"),
        static_cast<double>(info.memory_B) / (1 << 30),
        static_cast<double>(info.max_allocation_B) / (1 << 30),
        buffers ? "ok" : "WRONG: do not use this device",
        images            ? "ok"
        : info.has_images ? "WRONG: not used"
                          : "none, not needed");
  }
  if (devices.empty()) ComputeDevice none;  // says what to install
  invocation.answer(devices, text);
}

}  // namespace

void add_devices(CLI::App& app, Invocation& invocation) {
  add_command(app, invocation, "devices", "List the OpenCL devices and test each",
              "  xraycast devices\n  xraycast devices --json", [&invocation] { list_devices(invocation); });
}

}  // namespace xraycast::cli
