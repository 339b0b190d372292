#include "xraycast/series/seg_reader.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/series/dicom_header.hpp"
#include "xraycast/series/dicom_tags.hpp"

#include <fmt/ranges.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <map>
#include <optional>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

constexpr DicomTag kSegmentationType = 0x00620001, kMaximumFractionalValue = 0x0062000e;
constexpr std::size_t kMostSegments = 255;

struct StoredSegment {
  int number;
  std::string label;
};

std::vector<StoredSegment> segments_of(const DicomHeader& header, const std::string& name) {
  std::vector<StoredSegment> segments;
  for (const DicomItem& item : header.items(kSegments)) {
    const auto number = item.unsigned_short(kSegmentNumber);
    if (!number) throw InputError("{}: SegmentNumber (0062,0004) is missing; export the file again", name);
    constexpr int kBackground = 0;  // of a label map
    if (*number != kBackground) segments.push_back({*number, item.text(kSegmentLabel)});
  }
  if (segments.empty()) throw InputError("{}: SegmentSequence (0062,0002) has no segments", name);
  return segments;
}

std::vector<StoredSegment> chosen(const std::vector<StoredSegment>& all,
                                  const std::vector<std::string>& labels, const std::string& name) {
  std::vector<StoredSegment> segments;
  for (const std::string& label : labels) {
    const auto found = std::ranges::find_if(all, [&](const StoredSegment& segment) {
      return lower_case(segment.label) == lower_case(label) || fmt::format("{}", segment.number) == label;
    });
    if (found == all.end()) {
      std::vector<std::string> present;
      for (const StoredSegment& segment : all)
        if (present.size() < 20)
          present.push_back(fmt::format("{} ({})", segment.number, excerpt(segment.label)));
      throw InputError("{}: `labels` {}: there is no such segment; the file has {}", name, excerpt(label),
                       fmt::join(present, ", "));
    }
    segments.push_back(*found);
  }
  return labels.empty() ? all : segments;
}

/// A direction along an axis of the patient.
struct AxisStep {
  int axis;
  double mm;  ///< below zero towards lower coordinates
};

AxisStep axis_step(const glm::dvec3& direction, double mm, const std::string& name) {
  for (int axis = 0; axis < 3; ++axis)
    if (std::abs(std::abs(direction[axis]) - 1) < 1e-4) return {axis, std::copysign(mm, direction[axis])};
  throw InputError("{}: its frames lie oblique to the patient's axes; resample it to the scan's grid", name);
}

/// One frame: where its first pixel lies, and which segment it shows; 0 of a label map.
struct SegFrame {
  glm::dvec3 position_mm;
  int segment;
};

class SegReader {
 public:
  explicit SegReader(const fs::path& path) : path_(path), name_(path.string()), header_(path) {
    const std::string type = header_.text(kSegmentationType);
    const auto bits = header_.unsigned_short(kBitsAllocated).value_or(0);
    is_labelmap_ = type == "LABELMAP";
    bits_ = bits;
    if (bits != 8 && !(bits == 1 && type == "BINARY") && !(bits == 16 && is_labelmap_))
      throw InputError("{}: SegmentationType (0062,0001) {} of {} bits is not supported; export it as BINARY",
                       name_, excerpt(type), bits);
    const auto most = header_.unsigned_short(kMaximumFractionalValue).value_or(1);
    least_ = type == "FRACTIONAL" ? (most + 1) / 2 : 1;
  }

  SegContent read(const std::vector<std::string>& labels) {
    const std::vector<StoredSegment> segments = chosen(segments_of(header_, name_), labels, name_);
    if (segments.size() > kMostSegments)
      throw InputError("{}: has {} segments, but at most {} can be read; choose some with `labels`", name_,
                       segments.size(), kMostSegments);
    read_planes();
    const std::vector<SegFrame> frames = read_frames();
    SegContent content{grid_of(frames), {}, {}};
    validate(content.geometry, name_);
    std::map<int, std::uint8_t> number_of;
    for (const StoredSegment& segment : segments) {
      content.labels.push_back(segment.label);
      number_of.emplace(segment.number, static_cast<std::uint8_t>(content.labels.size()));
    }
    content.segments.assign(static_cast<std::size_t>(content.geometry.voxel_count()), 0);
    read_pixels();
    for (std::size_t f = 0; f < frames.size(); ++f) paint(f, frames[f], number_of, content);
    return content;
  }

 private:
  std::vector<double> numbers(const DicomItem& item, DicomTag tag, std::size_t count) const {
    std::vector<double> found = item.numbers(tag);
    if (found.size() != count || !std::ranges::all_of(found, [](double x) { return std::isfinite(x); }))
      throw InputError("{}: ({:04x},{:04x}) is missing or damaged; export the file again", name_, tag >> 16,
                       tag & 0xffff);
    return found;
  }

  const DicomItem& shared(DicomTag group) const {
    if (const auto& all = header_.items(kSharedGroups); !all.empty())
      if (const auto& items = all.front().items(group); !items.empty()) return items.front();
    for (const DicomItem& frame : header_.items(kPerFrameGroups))
      if (const auto& items = frame.items(group); !items.empty()) return items.front();
    return header_;
  }

  void read_planes() {
    columns_ = header_.unsigned_short(kColumns).value_or(0);
    rows_ = header_.unsigned_short(kRows).value_or(0);
    const DicomItem& measures = shared(kPixelMeasures);
    const auto spacing = numbers(measures, kPixelSpacing, 2);
    const auto d = numbers(shared(kPlaneOrientation), kImageOrientation, 6);
    const glm::dvec3 i(d[0], d[1], d[2]), j(d[3], d[4], d[5]);
    along_row_ = axis_step(i, spacing[1], name_);
    along_column_ = axis_step(j, spacing[0], name_);
    if (along_row_.axis == along_column_.axis)
      throw InputError("{}: ImageOrientationPatient (0020,0037) is damaged; export the file again", name_);
    across_ = 3 - along_row_.axis - along_column_.axis;
    for (const DicomTag tag : {kSpacingBetweenSlices, kSliceThickness})
      if (const auto mm = measures.numbers(tag); !(slice_mm_ > 0) && mm.size() == 1)
        slice_mm_ = std::abs(mm[0]);
  }

  std::vector<SegFrame> read_frames() const {
    std::vector<SegFrame> frames;
    for (const DicomItem& groups : header_.items(kPerFrameGroups)) {
      const auto& planes = groups.items(kPlanePosition);
      const auto at = numbers(planes.empty() ? shared(kPlanePosition) : planes.front(), kImagePosition, 3);
      const auto& own = groups.items(kSegmentIdentification);
      const DicomItem& identification = own.empty() ? shared(kSegmentIdentification) : own.front();
      const auto number = identification.unsigned_short(kReferencedSegment);
      if (!number && !is_labelmap_)
        throw InputError("{}: ReferencedSegmentNumber (0062,000b) is missing in a frame", name_);
      frames.push_back({{at[0], at[1], at[2]}, is_labelmap_ ? 0 : *number});
    }
    if (frames.empty()) throw InputError("{}: has no frames; export the file again", name_);
    return frames;
  }

  /// From the first to the last frame.
  VolumeGeometry grid_of(const std::vector<SegFrame>& frames) const {
    std::vector<double> places;
    for (const SegFrame& frame : frames) places.push_back(frame.position_mm[across_]);
    std::ranges::sort(places);
    double step_mm = slice_mm_;
    if (!(step_mm > 0))
      for (std::size_t k = 1; k < places.size(); ++k)
        if (const double mm = places[k] - places[k - 1]; mm > 1e-3 && (!(step_mm > 0) || mm < step_mm))
          step_mm = mm;
    if (!(step_mm > 0))
      throw InputError("{}: SliceThickness (0018,0050) is missing; export the file again", name_);
    VolumeGeometry grid;
    const glm::dvec3 first = frames.front().position_mm;
    const auto set = [&](const AxisStep& step, std::int64_t count) {
      grid.size[step.axis] = count;
      grid.spacing_mm[step.axis] = std::abs(step.mm);
      grid.origin_mm[step.axis] =
          std::min(first[step.axis], first[step.axis] + step.mm * static_cast<double>(count - 1));
    };
    set(along_row_, columns_);
    set(along_column_, rows_);
    grid.size[across_] = std::llround(std::min(1e6, (places.back() - places.front()) / step_mm)) + 1;
    grid.spacing_mm[across_] = step_mm;
    grid.origin_mm[across_] = places.front();
    return grid;
  }

  void read_pixels() {
    const auto& pixels = header_.pixel_data();
    if (!pixels) throw InputError("{}: is cut off before its pixels; copy the file again", name_);
    if (pixels->encapsulated || header_.deflated_B())
      throw InputError("{}: is compressed; decompress it, with `gdcmconv --raw`", name_);
    pixels_.resize(static_cast<std::size_t>(pixels->length_B));
    std::ifstream file(path_, std::ios::binary);
    file.seekg(pixels->offset_B);
    file.read(pixels_.data(), pixels->length_B);
    is_swapped_ = pixels->byte_swapped;
  }

  /// A pixel of all frames, one behind the other.
  int value(std::size_t pixel) const {
    const std::size_t byte = pixel * static_cast<std::size_t>(bits_) / 8;
    if (byte + (bits_ == 16 ? 1 : 0) >= pixels_.size())
      throw InputError("{}: truncated, its pixels end within a frame; copy the file again", name_);
    const auto at = [&](std::size_t i) { return static_cast<unsigned char>(pixels_[i]); };
    if (bits_ == 1) return at(byte) >> (pixel % 8) & 1;
    if (bits_ == 8) return at(byte);
    return is_swapped_ ? at(byte) << 8 | at(byte + 1) : at(byte + 1) << 8 | at(byte);
  }

  void paint(std::size_t frame, const SegFrame& of, const std::map<int, std::uint8_t>& number_of,
             SegContent& content) const {
    const VolumeGeometry& grid = content.geometry;
    const glm::dvec3 at = grid.to_index(of.position_mm);
    const Index3 first(glm::round(at));
    constexpr double kTolerance = 0.1;  // of a voxel
    if (glm::length(at - glm::dvec3(first)) > kTolerance)
      throw InputError(
          "{}: its frames do not lie on one grid: frame {} is off by {:.2g} voxels; resample it to "
          "the scan's grid",
          name_, frame + 1, glm::length(at - glm::dvec3(first)));
    Index3 across_columns(0), across_rows(0);
    across_columns[along_row_.axis] = along_row_.mm > 0 ? 1 : -1;
    across_rows[along_column_.axis] = along_column_.mm > 0 ? 1 : -1;
    const auto own = number_of.find(of.segment);
    if (!is_labelmap_ && own == number_of.end()) return;
    std::size_t pixel = frame * static_cast<std::size_t>(rows_ * columns_);
    for (std::int64_t row = 0; row < rows_; ++row)
      for (std::int64_t column = 0; column < columns_; ++column) {
        const int stored = value(pixel++);
        if (stored < least_) continue;
        const auto segment = is_labelmap_ ? number_of.find(stored) : own;
        if (segment == number_of.end()) continue;
        const Index3 voxel = first + row * across_rows + column * across_columns;
        std::uint8_t& there = content.segments[static_cast<std::size_t>(
            (voxel.z * grid.size.y + voxel.y) * grid.size.x + voxel.x)];
        if (there == 0) there = segment->second;
      }
  }

  fs::path path_;
  std::string name_;
  DicomHeader header_;
  bool is_labelmap_ = false, is_swapped_ = false;
  int bits_ = 1, least_ = 1;
  std::int64_t columns_ = 0, rows_ = 0;
  AxisStep along_row_{0, 1}, along_column_{1, 1};
  int across_ = 2;
  double slice_mm_ = 0;
  std::vector<char> pixels_;
};

}  // namespace

bool is_seg_file(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return false;
  std::string leading(256, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(leading.data(), std::ssize(leading));
  leading.resize(static_cast<std::size_t>(file.gcount()));
  if (!is_dicom(leading)) return false;
  const std::string sop_class = DicomHeader(path).text(kObjectClass);
  return sop_class == "1.2.840.10008.5.1.4.1.1.66.4" || sop_class == "1.2.840.10008.5.1.4.1.1.66.7";
}

SegContent read_seg(const fs::path& path, const std::vector<std::string>& labels) {
  return SegReader(path).read(labels);
}

}  // namespace xraycast
