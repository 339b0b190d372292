#include "xraycast/base/error.hpp"
#include "xraycast/image_file/image_file_scan.hpp"
#include "xraycast/image_file/image_file_stack.hpp"

#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <fstream>
#include <map>
#include <memory>
#include <zlib.h>

// NIfTI-1 and -2: https://nifti.nimh.nih.gov
namespace xraycast {
namespace {

namespace fs = std::filesystem;

/// A header's numbers, by their byte offset.
class NiftiBytes {
 public:
  explicit NiftiBytes(const fs::path& path) : path_(path) {
    // Reads plain files as they are.
    const std::unique_ptr<gzFile_s, decltype(&gzclose)> file(gzopen(path.c_str(), "rb"), &gzclose);
    const int count = file ? gzread(file.get(), bytes_.data(), kSize2) : 0;
    is_swapped_ = get<std::int32_t>(0) != kSize1 && get<std::int32_t>(0) != kSize2;
    const auto size = get<std::int32_t>(0);
    if (size != kSize1 && size != kSize2)
      throw InputError("{}: sizeof_hdr is neither {} nor {}; the header is damaged: copy the file again",
                       path.string(), kSize1, kSize2);
    if (count < size) throw InputError("{}: truncated within its header; copy the file again", path.string());
    version_ = size == kSize1 ? 1 : 2;
  }

  template <typename T>
  T get(std::size_t offset) const {
    std::array<char, sizeof(T)> bytes;
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(offset), sizeof(T), bytes.begin());
    if (is_swapped_) std::ranges::reverse(bytes);
    return std::bit_cast<T>(bytes);
  }

  /// A number that version 1 holds as First at one offset, and version 2 as Second at another; the one of
  /// `index` in a row.
  template <typename First, typename Second>
  Second get(std::size_t offset1, std::size_t offset2, std::size_t index = 0) const {
    return version_ == 1 ? static_cast<Second>(get<First>(offset1 + sizeof(First) * index))
                         : get<Second>(offset2 + sizeof(Second) * index);
  }

  int version() const { return version_; }
  /// `n+1` holds the voxels too, `ni1` has them in an .img beside it.
  bool is_pair() const { return bytes_[version_ == 1 ? 345 : 5] == 'i'; }
  bool is_big_endian() const { return is_swapped_ == (std::endian::native == std::endian::little); }

 private:
  static constexpr int kSize1 = 348, kSize2 = 540;
  fs::path path_;
  std::array<char, kSize2> bytes_{};
  bool is_swapped_ = false;
  int version_ = 1;
};

/// What both versions' headers say, as they say it: RAS.
struct NiftiHeader {
  std::vector<std::int64_t> size;
  std::array<double, 8> pixdim{};  ///< the first one is the handedness of the qform
  int intent = 0, datatype = 0, qform_code = 0, sform_code = 0, units = 0;
  double slope = 0, intercept = 0, voxels_B = 0;
  std::array<double, 6> qform{};   ///< quaternion's b, c, d and the origin
  std::array<double, 12> sform{};  ///< three rows
  bool is_pair = false, is_big_endian = false;
  int version = 1;
};

NiftiHeader read_nifti_header(const fs::path& path) {
  const NiftiBytes bytes(path);
  NiftiHeader header;
  header.version = bytes.version();
  const auto dimensions = bytes.get<std::int16_t, std::int64_t>(40, 16);
  if (dimensions < 1 || dimensions > 7)
    throw InputError(
        "{}: dim holds {} as the number of dimensions; the header is damaged: copy the file again",
        path.string(), dimensions);
  for (std::size_t d = 1; d <= static_cast<std::size_t>(dimensions); ++d) {
    header.size.push_back(bytes.get<std::int16_t, std::int64_t>(40, 16, d));
    if (header.size.back() < 1)
      throw InputError("{}: dim holds {}; sizes must be above zero: copy the file again", path.string(),
                       header.size.back());
  }
  for (std::size_t i = 0; i < 8; ++i) header.pixdim[i] = bytes.get<float, double>(76, 104, i);
  header.intent = bytes.get<std::int16_t, std::int32_t>(68, 504);
  header.datatype = bytes.get<std::int16_t>(header.version == 1 ? 70 : 12);
  header.voxels_B = header.version == 1 ? static_cast<double>(bytes.get<float>(108))
                                        : static_cast<double>(bytes.get<std::int64_t>(168));
  header.slope = bytes.get<float, double>(112, 176);
  header.intercept = bytes.get<float, double>(116, 184);
  header.units = bytes.version() == 1 ? bytes.get<std::uint8_t>(123) : bytes.get<std::int32_t>(500);
  header.qform_code = bytes.get<std::int16_t, std::int32_t>(252, 344);
  header.sform_code = bytes.get<std::int16_t, std::int32_t>(254, 348);
  for (std::size_t i = 0; i < 6; ++i) header.qform[i] = bytes.get<float, double>(256, 352, i);
  for (std::size_t i = 0; i < 12; ++i) header.sform[i] = bytes.get<float, double>(280, 400, i);
  header.is_pair = bytes.is_pair();
  header.is_big_endian = bytes.is_big_endian();
  return header;
}

void require_finite(const fs::path& path, const char* field, std::span<const double> values) {
  for (const double value : values)
    if (!std::isfinite(value))
      throw InputError("{}: {} holds {}; export the file again with its orientation", path.string(), field,
                       value);
}

// ---- where the voxels lie ----------------------------------------------------------------------------

/// In RAS, in the file's unit.
struct NiftiAxes {
  std::array<glm::dvec3, 3> step;
  glm::dvec3 origin;
};

NiftiAxes axes_of_sform(const NiftiHeader& header) {
  const auto column = [&](std::size_t c) {
    return glm::dvec3(header.sform[c], header.sform[4 + c], header.sform[8 + c]);
  };
  return {{column(0), column(1), column(2)}, column(3)};
}

NiftiAxes axes_of_qform(const NiftiHeader& header) {
  auto [b, c, d, x, y, z] = header.qform;
  double a = 1 - (b * b + c * c + d * d);
  if (a < 1e-7) {
    // Half a turn, and rounding.
    const double length = std::sqrt(b * b + c * c + d * d);
    a = 0, b /= length, c /= length, d /= length;
  } else {
    a = std::sqrt(a);
  }
  const double handedness = header.pixdim[0] < 0 ? -1 : 1;
  return {
      {header.pixdim[1] * glm::dvec3(a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c)),
       header.pixdim[2] * glm::dvec3(2 * (b * c - a * d), a * a + c * c - b * b - d * d, 2 * (c * d + a * b)),
       handedness * header.pixdim[3] *
           glm::dvec3(2 * (b * d + a * c), 2 * (c * d - a * b), a * a + d * d - b * b - c * c)},
      {x, y, z}};
}

bool is_singular(const NiftiAxes& axes) {
  const auto& [i, j, k] = axes.step;
  return !(std::abs(glm::dot(glm::cross(i, j), k)) > 1e-6 * glm::length(i) * glm::length(j) * glm::length(k));
}

/// How far two sets of axes are apart: at the first voxel or in an axis' whole length, and in direction.
struct AxesDifference {
  double mm = 0, deg = 0;
};

AxesDifference difference(const NiftiAxes& a, const NiftiAxes& b, std::span<const std::int64_t> size,
                          double mm_per_unit) {
  AxesDifference result{mm_per_unit * glm::distance(a.origin, b.origin), 0};
  for (std::size_t axis = 0; axis < size.size(); ++axis) {
    const double length_a = glm::length(a.step[axis]), length_b = glm::length(b.step[axis]);
    const double cosine = glm::dot(a.step[axis], b.step[axis]) / (length_a * length_b);
    result.mm =
        std::max(result.mm, mm_per_unit * std::abs(length_a - length_b) * static_cast<double>(size[axis]));
    result.deg = std::max(result.deg, glm::degrees(std::acos(std::clamp(cosine, -1.0, 1.0))));
  }
  return result;
}

/// Rounding in a header's 32-bit numbers makes far less of either.
void warn_of_difference(const NiftiHeader& header, double mm_per_unit, std::vector<std::string>& warnings) {
  constexpr double kSame_mm = 0.1, kSame_deg = 0.1;
  const auto size = std::span(header.size).first(std::min<std::size_t>(3, header.size.size()));
  const auto [mm, deg] = difference(axes_of_sform(header), axes_of_qform(header), size, mm_per_unit);
  if (mm <= kSame_mm && deg <= kSame_deg) return;
  warnings.push_back(
      fmt::format("sform and qform place the patient differently, by {:.3g} mm and {:.3g} deg; the sform was "
                  "taken, as most programs do{}",
                  mm, deg, deg > kSame_deg ? ": check left and right" : ""));
}

/// The sform, as most programs do, else the qform. Of a singular sform nothing can be made.
NiftiAxes axes_of(const fs::path& path, const NiftiHeader& header, double mm_per_unit,
                  std::vector<std::string>& warnings) {
  require_finite(path, "pixdim", std::span(header.pixdim).first(4));
  const std::size_t spaced = std::min<std::size_t>(3, header.size.size());
  require_spacing(path, "pixdim", std::span(header.pixdim).subspan(1, spaced));
  if (header.qform_code > 0) require_finite(path, "qform", header.qform);
  if (header.sform_code > 0) {
    require_finite(path, "sform", header.sform);
    const NiftiAxes axes = axes_of_sform(header);
    if (is_singular(axes)) {
      if (header.qform_code <= 0 || is_singular(axes_of_qform(header)))
        throw InputError(
            "{}: sform (srow_x, srow_y, srow_z) is a singular matrix; export the file again with its "
            "orientation",
            path.string());
      warnings.emplace_back(
          "sform (srow_x, srow_y, srow_z) is a singular matrix; the qform was taken: check left and right");
      return axes_of_qform(header);
    }
    if (header.qform_code > 0) warn_of_difference(header, mm_per_unit, warnings);
    return axes;
  }
  if (header.qform_code > 0) return axes_of_qform(header);
  return {{glm::dvec3(header.pixdim[1], 0, 0), glm::dvec3(0, header.pixdim[2], 0),
           glm::dvec3(0, 0, header.pixdim[3])},
          glm::dvec3(0)};
}

double mm_of_unit(int units, std::vector<std::string>& warnings) {
  constexpr int kSpace = 7, kUnknown = 0, kMetre = 1, kMillimetre = 2, kMicron = 3;
  switch (units & kSpace) {
    case kUnknown:
    case kMillimetre:
      return 1;
    case kMetre:
      return 1000;
    case kMicron:
      return 0.001;
    default:
      warnings.push_back(
          fmt::format("xyzt_units is {}, which is not a unit of length; millimetres are assumed", units));
      return 1;
  }
}

// ---- voxels ------------------------------------------------------------------------------------------

bool is_gzipped(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return stream.get() == 0x1f && stream.get() == 0x8b;
}

/// The file with a pair's voxels.
fs::path voxels_beside(const fs::path& header) {
  const fs::path stem =
      fs::path(header).replace_extension(header.extension() == ".gz" ? "" : header.extension());
  fs::path plain = fs::path(stem).replace_extension(".img"), packed = plain;
  packed += ".gz";
  std::error_code error;
  return data_file_beside(header, (fs::is_regular_file(plain, error) ? plain : packed).filename().string());
}

StoredVoxels nifti_voxels(const fs::path& path, const NiftiHeader& header) {
  // In a single file they start behind the header, whatever it says.
  const double least_B = header.is_pair ? 0 : header.version == 1 ? 348 : 540;
  if (!(std::abs(header.voxels_B) < 1e9))
    throw InputError("{}: vox_offset is {}; the header is damaged: copy the file again", path.string(),
                     header.voxels_B);
  const auto offset_B = static_cast<std::int64_t>(std::max(header.voxels_B, least_B));
  const fs::path file = header.is_pair ? voxels_beside(path) : path;
  if (is_gzipped(file)) return PackedVoxels{file, 0, offset_B};
  return PlainVoxels{{file}, offset_B};
}

VoxelType nifti_type(const fs::path& path, int datatype) {
  static const std::map<int, VoxelType> types{
      {2, VoxelType::uint8},    {4, VoxelType::int16},    {8, VoxelType::int32},    {16, VoxelType::float32},
      {64, VoxelType::float64}, {256, VoxelType::int8},   {512, VoxelType::uint16}, {768, VoxelType::uint32},
      {1024, VoxelType::int64}, {1280, VoxelType::uint64}};
  const auto found = types.find(datatype);
  if (found == types.end())
    throw InputError(
        "{}: datatype is {}: colours or vectors, or unknown; a CT scan has one integer or float per voxel: "
        "export it as such",
        path.string(), datatype);
  return found->second;
}

}  // namespace

ImageFile read_nifti(const fs::path& path) {
  const NiftiHeader nifti = read_nifti_header(path);
  ImageFile file;
  std::vector<std::string>& warnings = file.warnings;
  const double mm_per_unit = mm_of_unit(nifti.units, warnings);
  const NiftiAxes axes = axes_of(path, nifti, mm_per_unit, warnings);
  ImageHeader& header = file.header;
  header.path = path;
  header.size = nifti.size;
  header.type = nifti_type(path, nifti.datatype);
  header.is_big_endian = nifti.is_big_endian;
  const glm::dvec3 to_lps_mm = mm_per_unit * glm::dvec3(-1, -1, 1);
  for (std::size_t axis = 0; axis < std::min<std::size_t>(3, nifti.size.size()); ++axis)
    header.step_mm[axis] = to_lps_mm * axes.step[axis];
  header.origin_mm = to_lps_mm * axes.origin;
  // A slope of zero, or none, says that the voxels are not scaled.
  if (std::isfinite(nifti.slope) && nifti.slope != 0) {
    header.slope = nifti.slope;
    header.intercept = std::isfinite(nifti.intercept) ? nifti.intercept : 0;
  }
  if (nifti.qform_code <= 0 && nifti.sform_code <= 0)
    warnings.push_back(unknown_orientation("neither qform nor sform", header));
  // As ITK has it: displacements are RAS, other vectors are as they are.
  constexpr int kDisplacementVector = 1006;
  if (nifti.intent == kDisplacementVector)
    for (int axis = 0; axis < 2; ++axis) header.vector_to_lps[axis][axis] = -1;
  file.voxels = nifti_voxels(path, nifti);
  return file;
}

Scan open_nifti(const fs::path& path, const ScanOptions& options, Progress& progress) {
  progress.begin("opening", 1, "files");
  ImageFile file = read_nifti(path);
  progress.advance();
  return deliver_image(std::move(file), "NIfTI", options);
}

}  // namespace xraycast
