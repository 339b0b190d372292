#include "xraycast/opencl/compute_device.hpp"

#include "xraycast/base/device_choice.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/memory_limit.hpp"
#include "xraycast/kernels/embedded_kernels.h"
#include "xraycast/opencl/kernel_cache.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <numeric>
#include <sstream>
#include <thread>
#include <unistd.h>

namespace xraycast {
namespace {

// Measured with PoCL 3.1: the driver with LLVM and a thread a core, and the compiler's own memory, with a
// third more.
constexpr MemoryNeed kDriver{300 << 20, 100 << 20}, kCompiler{100 << 20, 80 << 20};
constexpr std::int64_t kThread_B = 10 << 20;  ///< of address space
constexpr std::int64_t kMuch_B = 16 << 20;    ///< the needs above have room for less

struct Candidate {
  cl::Device device;
  ComputeDevice::Info info;
};

ComputeDevice::Info describe(const cl::Device& device, const std::string& platform, int index) {
  ComputeDevice::Info info;
  info.index = index;
  info.name = device.getInfo<CL_DEVICE_NAME>();
  info.platform = platform;
  info.version = device.getInfo<CL_DEVICE_VERSION>();
  info.is_gpu = (device.getInfo<CL_DEVICE_TYPE>() & CL_DEVICE_TYPE_GPU) != 0;
  info.has_images = device.getInfo<CL_DEVICE_IMAGE_SUPPORT>() == CL_TRUE;
  info.compute_units = static_cast<int>(device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>());
  info.memory_B = static_cast<std::int64_t>(device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>());
  info.max_allocation_B = static_cast<std::int64_t>(device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>());
  return info;
}

std::vector<Candidate> candidates() {
  require_memory(
      "OpenCL's driver",
      {kDriver.address_space_B + kThread_B * std::thread::hardware_concurrency(), kDriver.resident_B});
  std::vector<Candidate> found;
  std::vector<cl::Platform> platforms;
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error&) {
    return found;  // the loader reports "no platform" as an error
  }
  for (const cl::Platform& platform : platforms) {
    std::vector<cl::Device> devices;
    try {
      platform.getDevices(CL_DEVICE_TYPE_ALL, &devices);
    } catch (const cl::Error&) {
      continue;  // a platform without devices
    }
    for (const cl::Device& device : devices)
      found.push_back(
          {device, describe(device, platform.getInfo<CL_PLATFORM_NAME>(), static_cast<int>(found.size()))});
  }
  return found;
}

std::string names_of(const std::vector<Candidate>& found) {
  std::string names;
  for (const auto& [device, info] : found)
    names += fmt::format("{}{}: {}", names.empty() ? "" : ", ", info.index, info.name);
  return names;
}

const Candidate& choose(const std::vector<Candidate>& found, const std::string& choice) {
  if (found.empty()) {
    require_kernel_cache();
    throw DeviceError(
        "no OpenCL device: install a driver, such as Debian's pocl-opencl-icd, which runs on any processor");
  }
  if (choice.empty()) {
    const auto gpu = std::ranges::find_if(found, [](const Candidate& c) { return c.info.is_gpu; });
    return gpu != found.end() ? *gpu : found.front();
  }
  const auto fits = std::ranges::find_if(
      found, [&](const Candidate& c) { return names_device(choice, c.info.index, c.info.name); });
  if (fits == found.end())
    throw DeviceError("no OpenCL device matches '{}'; available: {}", choice, names_of(found));
  return *fits;
}

bool is_in_path(const std::string& program) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');)
    if (access((std::filesystem::path(folder) / program).c_str(), X_OK) == 0) return true;
  return false;
}

/// PoCL writes and links a kernel when it first runs, and ends the process where that fails.
void check_compiler(const ComputeDevice::Info& info) {
  if (info.platform != "Portable Computing Language") return;
  require_kernel_cache();
  if (!is_in_path("ld"))
    throw DeviceError(
        "{} links kernels with the program ld, which is not in PATH: install Debian's package binutils",
        info.name);
}

std::string_view source_of(const std::string& file) {
  for (const EmbeddedKernel& kernel : embedded_kernels())
    if (kernel.name == file) return kernel.source;
  throw DeviceError("no kernel file '{}' is embedded", file);
}

/// The last lines of a build log, on one line: the error message must fit one.
std::string tail(std::string log) {
  while (!log.empty() && std::isspace(static_cast<unsigned char>(log.back()))) log.pop_back();
  constexpr std::size_t kMost = 600;
  if (log.size() > kMost) log = "..." + log.substr(log.size() - kMost);
  std::ranges::replace(log, '\n', ' ');
  return log;
}

}  // namespace

std::vector<ComputeDevice::Info> ComputeDevice::list() {
  std::vector<Info> infos;
  for (const Candidate& candidate : candidates()) infos.push_back(candidate.info);
  return infos;
}

ComputeDevice::ComputeDevice(const std::string& choice) {
  const char* environment = std::getenv("XRAYCAST_DEVICE");
  const auto found = candidates();
  const Candidate& chosen = choose(found, choice.empty() && environment ? environment : choice);
  check_compiler(chosen.info);
  try {
    device_ = chosen.device;
    info_ = chosen.info;
    context_ = cl::Context(device_);
    queue_ = cl::CommandQueue(context_, device_, CL_QUEUE_PROFILING_ENABLE);
  } catch (const cl::Error& error) {
    throw DeviceError("OpenCL device {} cannot be used: {} failed with {}", chosen.info.name, error.what(),
                      status_name(error.err()));
  }
}

cl::Kernel ComputeDevice::kernel(const std::string& file, const std::string& entry,
                                 const std::string& options) {
  const std::lock_guard lock(programs_mutex_);
  const std::string key = file + '\n' + options;
  auto known = programs_.find(key);
  if (known == programs_.end()) {
    require_memory("compiling a kernel", kCompiler);
    cl::Program program(context_, std::string(source_of(file)));
    try {
      // The build of xraycast lints the kernels. On processors without AVX-512, clang warns of vectors of 16
      // that functions pass to each other, and PoCL prints the number of warnings.
      program.build(device_, ("-cl-std=CL1.2 -w " + options).c_str());
    } catch (const cl::BuildError& error) {
      std::string log;
      for (const auto& [device, text] : error.getBuildLog()) log += text;
      throw DeviceError("kernels/{}.cl does not build on {}: {}", file, info_.name, tail(log));
    }
    known = programs_.emplace(key, std::move(program)).first;
  }
  try {
    return {known->second, entry.c_str()};
  } catch (const cl::Error& error) {
    throw DeviceError("kernels/{}.cl has no kernel '{}' on {}: {}", file, entry, info_.name,
                      status_name(error.err()));
  }
}

template <typename Memory>
Memory ComputeDevice::taken(std::int64_t bytes, const Memory& memory) {
  if (info_.is_gpu || bytes < kMuch_B) return memory;
  require_memory(fmt::format("OpenCL on {}", info_.name), {bytes, bytes});
  queue_.enqueueMigrateMemObjects({memory}, CL_MIGRATE_MEM_OBJECT_CONTENT_UNDEFINED);
  return memory;
}

cl::Buffer ComputeDevice::buffer(cl_mem_flags flags, std::int64_t bytes, void* host) {
  if (bytes > info_.max_allocation_B)
    throw DeviceError("{} allows buffers of up to {} MiB, but {} MiB are needed", info_.name,
                      info_.max_allocation_B >> 20, bytes >> 20);
  try {
    const cl::Buffer buffer(context_, flags, static_cast<cl::size_type>(bytes), host);
    return host != nullptr ? buffer : taken(bytes, buffer);
  } catch (const cl::Error& error) {
    throw DeviceError("{} has no memory left for a buffer of {} MiB: {}", info_.name, bytes >> 20,
                      status_name(error.err()));
  }
}

cl::Image3D ComputeDevice::image(const cl::ImageFormat& format, std::int64_t width, std::int64_t height,
                                 std::int64_t depth) {
  try {
    const cl::Image3D image(context_, CL_MEM_READ_ONLY, format, static_cast<cl::size_type>(width),
                            static_cast<cl::size_type>(height), static_cast<cl::size_type>(depth));
    const auto voxel_B = static_cast<std::int64_t>(image.getImageInfo<CL_IMAGE_ELEMENT_SIZE>());
    return taken(width * height * depth * voxel_B, image);
  } catch (const cl::Error& error) {
    throw DeviceError("{} has no memory left for an image of {} x {} x {}: {}", info_.name, width, height,
                      depth, status_name(error.err()));
  }
}

bool ComputeDevice::takes_image(std::int64_t width, std::int64_t height, std::int64_t depth) const {
  const auto fits = [](std::int64_t size, cl::size_type limit) {
    return size <= static_cast<std::int64_t>(limit);
  };
  return info_.has_images && fits(width, device_.getInfo<CL_DEVICE_IMAGE3D_MAX_WIDTH>()) &&
         fits(height, device_.getInfo<CL_DEVICE_IMAGE3D_MAX_HEIGHT>()) &&
         fits(depth, device_.getInfo<CL_DEVICE_IMAGE3D_MAX_DEPTH>());
}

template <typename Call>
void ComputeDevice::guarded(const char* doing, const Call& call) const {
  try {
    call();
  } catch (const cl::Error& error) {
    throw DeviceError("{} failed while {}: {} returned {}", info_.name, doing, error.what(),
                      status_name(error.err()));
  }
}

cl::Event ComputeDevice::run(const cl::Kernel& kernel, std::array<std::int64_t, 3> global,
                             std::array<std::int64_t, 3> local, std::array<std::int64_t, 3> first) {
  if (local[0] > 0)
    for (int i = 0; i < 3; ++i) global[i] = (global[i] + local[i] - 1) / local[i] * local[i];
  const auto range = [](const std::array<std::int64_t, 3>& n) { return cl::NDRange(n[0], n[1], n[2]); };
  cl::Event done;
  guarded("running a kernel", [&] {
    queue_.enqueueNDRangeKernel(kernel, range(first), range(global),
                                local[0] > 0 ? range(local) : cl::NullRange, nullptr, &done);
  });
  return done;
}

void ComputeDevice::finish() {
  guarded("running a kernel", [&] { queue_.finish(); });
}

void ComputeDevice::copy_slices(const cl::Buffer& from, const cl::Image3D& image, std::int64_t first,
                                std::int64_t count) {
  guarded("copying slices", [&] {
    queue_.enqueueCopyBufferToImage(
        from, image, 0, {0, 0, static_cast<cl::size_type>(first)},
        {image.getImageInfo<CL_IMAGE_WIDTH>(), image.getImageInfo<CL_IMAGE_HEIGHT>(),
         static_cast<cl::size_type>(count)});
  });
}

void ComputeDevice::bring_to_host(const cl::Buffer& buffer) {
  guarded("downloading", [&] {
    void* memory = queue_.enqueueMapBuffer(buffer, CL_TRUE, CL_MAP_READ, 0, buffer.getInfo<CL_MEM_SIZE>());
    queue_.enqueueUnmapMemObject(buffer, memory);
    queue_.finish();
  });
}

void ComputeDevice::write(const cl::Buffer& target, const void* values, std::size_t bytes) {
  guarded("uploading", [&] { queue_.enqueueWriteBuffer(target, CL_TRUE, 0, bytes, values); });
}

void ComputeDevice::read(const cl::Buffer& source, void* values, std::size_t bytes) {
  guarded("downloading", [&] { queue_.enqueueReadBuffer(source, CL_TRUE, 0, bytes, values); });
}

ComputeDevice::SelfTest ComputeDevice::self_test() {
  SelfTest result;
  try {
    constexpr int n = 1000;
    std::vector<float> in(n), out(n, -1.0f);
    std::iota(in.begin(), in.end(), 0.0f);
    cl::Buffer in_buffer = buffer(CL_MEM_READ_ONLY | CL_MEM_COPY_HOST_PTR, n * sizeof(float), in.data());
    cl::Buffer out_buffer = buffer(CL_MEM_WRITE_ONLY, n * sizeof(float));
    cl::Kernel run = kernel("selftest", "selftest_buffer");
    set_args(run, in_buffer, out_buffer, n);
    queue_.enqueueNDRangeKernel(run, cl::NullRange, cl::NDRange(1024));
    queue_.enqueueReadBuffer(out_buffer, CL_TRUE, 0, n * sizeof(float), out.data());
    result.buffers = true;
    for (int i = 0; i < n; ++i)
      result.buffers = result.buffers && out[i] == 2.0f * static_cast<float>(i) + 1.0f;
  } catch (const std::exception&) {
    result.buffers = false;
  }
  if (!info_.has_images) return result;
  try {
    constexpr int w = 7, h = 5, d = 3;
    std::vector<float> in(w * h * d), out(w * h * d, -1.0f);
    std::iota(in.begin(), in.end(), 1.0f);
    cl::Image3D image(context_, CL_MEM_READ_ONLY | CL_MEM_COPY_HOST_PTR, cl::ImageFormat(CL_R, CL_FLOAT), w,
                      h, d, 0, 0, in.data());
    cl::Buffer out_buffer = buffer(CL_MEM_WRITE_ONLY, static_cast<std::int64_t>(out.size() * sizeof(float)));
    cl::Kernel run = kernel("selftest", "selftest_image");
    set_args(run, image, out_buffer);
    queue_.enqueueNDRangeKernel(run, cl::NullRange, cl::NDRange(8, 8, 4));
    queue_.enqueueReadBuffer(out_buffer, CL_TRUE, 0, out.size() * sizeof(float), out.data());
    result.images = in == out;
  } catch (const std::exception&) {
    result.images = false;
  }
  return result;
}

double duration_ms(const cl::Event& event) {
  const auto start = event.getProfilingInfo<CL_PROFILING_COMMAND_START>();
  const auto end = event.getProfilingInfo<CL_PROFILING_COMMAND_END>();
  return static_cast<double>(end - start) * 1e-6;
}

std::string status_name(cl_int status) {
  switch (status) {
    case CL_DEVICE_NOT_AVAILABLE:
      return "CL_DEVICE_NOT_AVAILABLE";
    case CL_MEM_OBJECT_ALLOCATION_FAILURE:
      return "CL_MEM_OBJECT_ALLOCATION_FAILURE";
    case CL_OUT_OF_RESOURCES:
      return "CL_OUT_OF_RESOURCES";
    case CL_OUT_OF_HOST_MEMORY:
      return "CL_OUT_OF_HOST_MEMORY";
    case CL_BUILD_PROGRAM_FAILURE:
      return "CL_BUILD_PROGRAM_FAILURE";
    case CL_INVALID_KERNEL_NAME:
      return "CL_INVALID_KERNEL_NAME";
    case CL_INVALID_KERNEL_ARGS:
      return "CL_INVALID_KERNEL_ARGS";
    case CL_INVALID_BUFFER_SIZE:
      return "CL_INVALID_BUFFER_SIZE";
    case CL_INVALID_WORK_GROUP_SIZE:
      return "CL_INVALID_WORK_GROUP_SIZE";
    default:
      return fmt::format("OpenCL status {}", status);
  }
}

}  // namespace xraycast
