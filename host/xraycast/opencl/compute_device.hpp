#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <vector>

// The OpenCL version that the project targets; defined only here.
#define CL_HPP_ENABLE_EXCEPTIONS
#define CL_HPP_MINIMUM_OPENCL_VERSION 120
#define CL_HPP_TARGET_OPENCL_VERSION 120
#include <CL/opencl.hpp>

namespace xraycast {

/// One OpenCL device: its context, an in-order queue with profiling, and the programs built so far. Passed
/// explicitly; objects that hold one keep a reference, so it must outlive them.
class ComputeDevice {
 public:
  struct Info {
    int index = 0;  ///< number for `--device`
    std::string name;
    std::string platform;
    std::string version;
    bool is_gpu = false;
    bool has_images = false;
    int compute_units = 0;
    std::int64_t memory_B = 0;
    std::int64_t max_allocation_B = 0;
  };

  /// All devices of all platforms, in the platforms' order; empty when no platform is installed.
  static std::vector<Info> list();

  /// Chooses by number or by part of the name, case ignored. An empty choice takes the environment's
  /// XRAYCAST_DEVICE, and without that the first GPU or else the first device. Throws DeviceError when there
  /// is no device, or none that matches (naming the available ones), and when the linker that the driver
  /// needs for kernels is missing.
  explicit ComputeDevice(const std::string& choice = "");

  const Info& info() const { return info_; }
  cl::Context& context() { return context_; }
  cl::CommandQueue& queue() { return queue_; }

  /// Kernel `entry` of kernels/`file`.cl, built with `options` at first use. Throws DeviceError with the end
  /// of the build log. Drivers cache binaries on disk, so only the first build on a machine is slow.
  cl::Kernel kernel(const std::string& file, const std::string& entry, const std::string& options = "");

  /// A buffer of `bytes`, checked against the device's largest allocation first. Throws DeviceError.
  cl::Buffer buffer(cl_mem_flags flags, std::int64_t bytes, void* host = nullptr);

  /// A read-only 3-D image, and whether the device supports one of that size. Throws DeviceError.
  cl::Image3D image(const cl::ImageFormat& format, std::int64_t width, std::int64_t height,
                    std::int64_t depth);
  bool takes_image(std::int64_t width, std::int64_t height, std::int64_t depth) const;

  /// Copies a buffer's texels, x fastest, to `count` whole slices of a 3-D image. Throws DeviceError.
  void copy_slices(const cl::Buffer& from, const cl::Image3D& image, std::int64_t first, std::int64_t count);

  /// Enqueues a kernel over a global size, in work-groups of `local` where that is given; the global size is
  /// then rounded up, so kernels check their bounds. Work items are counted from `first` on. Throws
  /// DeviceError.
  cl::Event run(const cl::Kernel& kernel, std::array<std::int64_t, 3> global,
                std::array<std::int64_t, 3> local = {}, std::array<std::int64_t, 3> first = {});

  /// Blocking copies of whole spans. Throw DeviceError.
  template <typename T>
  cl::Buffer upload(std::span<const T> values, cl_mem_flags flags = CL_MEM_READ_ONLY) {
    cl::Buffer target = buffer(flags, static_cast<std::int64_t>(values.size_bytes()));
    write(target, values.data(), values.size_bytes());
    return target;
  }
  template <typename T>
  void download(const cl::Buffer& source, std::span<T> values) {
    read(source, values.data(), values.size_bytes());
  }

  /// Waits until the kernels' writes to a CL_MEM_USE_HOST_PTR buffer are in host memory; a CPU driver writes
  /// there directly. Throws DeviceError.
  void bring_to_host(const cl::Buffer& buffer);

  /// Waits for all enqueued commands. Throws DeviceError.
  void finish();

  /// Writes and reads back known values through a buffer and, where the device has them, through a 3-D image.
  struct SelfTest {
    bool buffers = false;
    bool images = false;  ///< false too where the device has no images
  };
  SelfTest self_test();

 private:
  /// Turns OpenCL's errors into DeviceError.
  template <typename Call>
  void guarded(const char* doing, const Call& call) const;
  /// Lets a processor's driver take the memory now. PoCL would at first use, and ends the process where there
  /// is none. Throws Error when limits leave less.
  template <typename Memory>
  Memory taken(std::int64_t bytes, const Memory& memory);
  void write(const cl::Buffer& target, const void* values, std::size_t bytes);
  void read(const cl::Buffer& source, void* values, std::size_t bytes);

  Info info_;
  cl::Device device_;
  cl::Context context_;
  cl::CommandQueue queue_;
  std::mutex programs_mutex_;
  std::map<std::string, cl::Program> programs_;  ///< by file and options
};

/// Sets all of a kernel's arguments, in the order of its declaration. Their types must be the kernel's own
/// (cl_int for int, cl_long for long); buffers must outlive the run.
template <typename... Arguments>
void set_args(cl::Kernel& kernel, const Arguments&... arguments) {
  cl_uint index = 0;
  (kernel.setArg(index++, arguments), ...);
}

/// Wall time on the device from the start to the end of a finished, profiled command.
double duration_ms(const cl::Event& event);

/// The name of an OpenCL status such as CL_OUT_OF_RESOURCES, or its number.
std::string status_name(cl_int status);

}  // namespace xraycast
