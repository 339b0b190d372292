#pragma once

#include "calls/device.hpp"
#include "xraycast/casting/spectral_scan.hpp"
#include "xraycast/scan/scan.hpp"
#include "xraycast/volume/body_outline.hpp"

#include <memory>
#include <nanobind/nanobind.h>
#include <optional>
#include <string>

namespace xraycast::python {

namespace nb = nanobind;

/// From where a scan was read.
struct ScanFile {
  std::string path;  ///< absolute
  ScanOptions options;
};

/// A scan in memory; on the device and with its body's outline once these are needed. The calls that take a
/// DeviceUse are for its holder only.
class HeldScan {
 public:
  HeldScan(Volume volume, ScanInfo info, std::string source)
      : volume_(std::make_shared<Volume>(std::move(volume))),
        info_(std::move(info)),
        source_(std::move(source)) {}

  const std::shared_ptr<Volume>& volume() const { return volume_; }
  const VolumeGeometry& geometry() const { return volume_->geometry(); }
  glm::dvec3 middle_mm() const { return geometry().middle_mm(); }
  const ScanInfo& info() const { return info_; }
  const std::string& source() const { return source_; }  ///< for messages and in files
  void describe(ScanInfo info, std::string source) {
    info_ = std::move(info);
    source_ = std::move(source);
  }

  /// Of its voxels before clamping; {0, 0} where that is unknown.
  const SliceSource::HuRange& hu_range() const { return hu_range_; }
  void set_hu_range(const SliceSource::HuRange& range) { hu_range_ = range; }

  /// For pickles; none for a scan that was not read from a file.
  const std::optional<ScanFile>& file() const { return file_; }
  void set_file(ScanFile file) { file_ = std::move(file); }

  /// Throws DeviceError when the device has not enough memory.
  const SpectralScan& resident(const DeviceUse& device);

  /// Of the body, with its skin, or of everything.
  const OutlineFinder& outline(const DeviceUse& device, bool keeps_table = false);
  const BodyOutline& body(const DeviceUse& device);

 private:
  std::shared_ptr<Volume> volume_;
  ScanInfo info_;
  std::string source_;
  SliceSource::HuRange hu_range_;
  std::optional<ScanFile> file_;
  std::optional<SpectralScan> resident_;
  std::optional<OutlineFinder> outlines_[2];  ///< without and with the table
  std::optional<BodyOutline> body_;
};

/// Open, phantom and Scan.
void add_scan(nb::module_& module);

/// Scan's project, cast and cast_basis, and segment.
void add_projection(nb::class_<HeldScan>& scan);
void add_casting(nb::module_& module, nb::class_<HeldScan>& scan);
void add_segmentation(nb::module_& module, nb::class_<HeldScan>& scan);

}  // namespace xraycast::python
