#include "xraycast/base/pluralize.hpp"
#include "xraycast/image_file/image_file_scan.hpp"
#include "xraycast/image_file/image_file_stack.hpp"
#include "xraycast/image_file/raw_voxels.hpp"
#include "xraycast/image_file/text_header.hpp"

#include <algorithm>
#include <array>
#include <map>

// The format is that of https://itk.org/Wiki/ITK/MetaIO/Documentation.
namespace xraycast {
namespace {

namespace fs = std::filesystem;

bool is_true(const std::string& value) {
  return !value.empty() && std::string_view("Tt1").find(value[0]) != std::string_view::npos;
}

/// The first of several fields that has a value.
const char* given_one(const TextHeader& text, std::initializer_list<const char*> fields) {
  const auto* const found = std::ranges::find_if(fields, [&](const char* field) { return text.has(field); });
  return found == fields.end() ? *fields.begin() : *found;
}

VoxelType meta_type(const fs::path& path, const std::string& name) {
  static const std::map<std::string, VoxelType> types{
      {"MET_CHAR", VoxelType::int8},       {"MET_UCHAR", VoxelType::uint8},
      {"MET_SHORT", VoxelType::int16},     {"MET_USHORT", VoxelType::uint16},
      {"MET_INT", VoxelType::int32},       {"MET_UINT", VoxelType::uint32},
      {"MET_LONG", VoxelType::int32},      {"MET_ULONG", VoxelType::uint32},
      {"MET_LONG_LONG", VoxelType::int64}, {"MET_ULONG_LONG", VoxelType::uint64},
      {"MET_FLOAT", VoxelType::float32},   {"MET_DOUBLE", VoxelType::float64}};
  const auto found = types.find(name);
  if (found == types.end())
    throw InputError("{}: ElementType '{}' is not supported; save the scan as MET_SHORT", path.string(),
                     excerpt(name));
  return found->second;
}

ImageHeader meta_image_header(const TextHeader& text) {
  const fs::path& path = text.path;
  ImageHeader header;
  header.path = path;
  const auto dimensions = text.number<std::int64_t>("NDims");
  constexpr std::int64_t kMaxDimensions = 10;
  if (dimensions < 1 || dimensions > kMaxDimensions)
    throw InputError("{}: NDims is {}; a scan has 3: extract one volume", path.string(), dimensions);
  const auto count = static_cast<std::size_t>(dimensions);
  header.size = text.numbers<std::int64_t>("DimSize", count);

  const char* const spacing_field = given_one(text, {"ElementSpacing", "ElementSize"});
  const std::vector<double> spacing_mm =
      text.numbers<double>(spacing_field, count, std::vector<double>(count, 1));
  require_spacing(path, spacing_field, spacing_mm);
  std::vector<double> identity(count * count);
  for (std::size_t d = 0; d < count; ++d) identity[d * (count + 1)] = 1;
  const std::vector<double> matrix =
      text.finite(given_one(text, {"TransformMatrix", "Rotation", "Orientation"}), count * count, identity);
  const std::vector<double> origin_mm =
      text.finite(given_one(text, {"Offset", "Position", "Origin"}), count, std::vector<double>(count, 0));
  for (std::size_t axis = 0; axis < std::min<std::size_t>(3, count); ++axis) {
    for (std::size_t d = 0; d < std::min<std::size_t>(3, count); ++d)
      header.step_mm[axis][static_cast<int>(d)] = matrix[axis * count + d] * spacing_mm[axis];
    header.origin_mm[static_cast<int>(axis)] = origin_mm[axis];
  }

  header.numbers_per_voxel = text.number<std::int64_t>("ElementNumberOfChannels", {1});
  header.type = meta_type(path, text.get("ElementType"));
  header.is_big_endian =
      is_true(text.get("BinaryDataByteOrderMSB")) || is_true(text.get("ElementByteOrderMSB"));
  return header;
}

// ---- where the voxels are ------------------------------------------------------------------------

/// `name%03d.raw FIRST LAST STEP`, the last three numbers 1, the number of slices and 1 unless given.
std::vector<std::string> names_by_pattern(const fs::path& path, const std::string& text,
                                          std::int64_t slices) {
  const std::vector<std::string> words = words_of(text);
  const std::string& pattern = words[0];
  const auto percent = pattern.find('%');
  const auto letter = pattern.find_first_not_of("0123456789", percent + 1);
  const std::string width_text = pattern.substr(percent + 1, std::min(letter, pattern.size()) - percent - 1);
  std::int64_t width = 0, first = 1, last = slices, step = 1;
  const bool is_plain = letter != std::string::npos && pattern[letter] == 'd' &&
                        pattern.find('%', letter) == std::string::npos &&
                        (width_text.empty() || (parse_whole(width_text, width) && width < 10));
  if (!is_plain || (words.size() > 1 && !parse_whole(words[1], first)) ||
      (words.size() > 2 && !parse_whole(words[2], last)) ||
      (words.size() > 3 && !parse_whole(words[3], step)))
    throw InputError("{}: ElementDataFile '{}' is not a pattern; write one such as slice%03d.raw 1 20 1",
                     path.string(), excerpt(text));
  constexpr std::int64_t kMost = 1'000'000;
  if (words.size() == 2 && first <= kMost && slices <= kMost) last = first + slices - 1;
  if (step < 1 || first < 0 || last < first || last > kMost || (last - first) / step + 1 != slices)
    throw InputError("{}: ElementDataFile '{}' does not name {} files; name one per slice", path.string(),
                     excerpt(text), slices);
  std::vector<std::string> names;
  for (std::int64_t number = first; number <= last; number += step) {
    const std::string digits = std::to_string(number);
    const std::string padding(static_cast<std::size_t>(std::max<std::int64_t>(0, width - std::ssize(digits))),
                              width_text.starts_with('0') ? '0' : ' ');
    names.push_back(
        fmt::format("{}{}{}{}", pattern.substr(0, percent), padding, digits, pattern.substr(letter + 1)));
  }
  return names;
}

/// The files of a LIST or pattern, one a slice, all of them there.
PlainVoxels several_files(const TextHeader& text, const ImageHeader& header) {
  const fs::path& path = text.path;
  const std::string& data_file = text.get("ElementDataFile");
  const std::int64_t slices = header.size.size() < 3 ? 1 : header.size[2];
  const bool is_list = data_file.starts_with("LIST");
  if (is_list && data_file != "LIST" && data_file != "LIST 2" && data_file != "LIST 2D")
    throw InputError("{}: ElementDataFile '{}' is not supported; list one file per slice", path.string(),
                     excerpt(data_file));
  const std::vector<std::string> names = is_list ? text.rest : names_by_pattern(path, data_file, slices);
  if (std::ssize(names) != slices)
    throw InputError("{}: ElementDataFile lists {} for {}; list one file per slice", path.string(),
                     pluralize(std::ssize(names), "file"), pluralize(slices, "slice"));
  PlainVoxels voxels;
  for (const std::string& name : names) voxels.files.push_back(data_file_beside(path, name));
  return voxels;
}

StoredVoxels meta_image_voxels(const TextHeader& text, const ImageHeader& header) {
  const fs::path& path = text.path;
  if (text.has("BinaryData") && !is_true(text.get("BinaryData")))
    throw InputError("{}: BinaryData is False: voxels as text are not supported; save them as binary",
                     path.string());
  const std::string& data_file = text.get("ElementDataFile");
  const bool is_packed = is_true(text.get("CompressedData"));
  const auto header_B = text.number<std::int64_t>("HeaderSize", {0});
  constexpr std::int64_t kMaxHeader_B = std::int64_t{1} << 40;
  if (header_B < -1 || header_B > kMaxHeader_B || (header_B < 0 && is_packed))
    throw InputError("{}: HeaderSize is {}; save the file again without it", path.string(), header_B);

  if (data_file.starts_with("LIST") || data_file.find('%') != std::string::npos) {
    if (is_packed)
      throw InputError("{}: ElementDataFile '{}' names several files; save their voxels uncompressed",
                       path.string(), excerpt(data_file));
    PlainVoxels voxels = several_files(text, header);
    voxels.offset_B = header_B < 0 ? PlainVoxels::kAtTheEnd : header_B;
    return voxels;
  }

  const bool is_local = data_file == "LOCAL" || data_file == "Local" || data_file == "local";
  const fs::path file = is_local ? path : data_file_beside(path, data_file);
  const std::int64_t start_B = header_B > 0 ? header_B : is_local ? text.end_B : 0;
  if (!is_packed) return PlainVoxels{{file}, header_B < 0 ? PlainVoxels::kAtTheEnd : start_B, start_B};
  if (const auto packed_B = text.number<std::int64_t>("CompressedDataSize", {0}); packed_B > 0)
    RawVoxels(file, start_B, packed_B);
  return PackedVoxels{file, start_B, 0};
}

}  // namespace

ImageFile read_meta_image(const fs::path& path) {
  const TextHeader text = read_meta_image_header(path);
  ImageHeader header = meta_image_header(text);
  StoredVoxels voxels = meta_image_voxels(text, header);
  return {std::move(header), std::move(voxels), {}};
}

Scan open_meta_image(const fs::path& path, const ScanOptions& options, Progress& progress) {
  progress.begin("opening", 1, "files");
  ImageFile file = read_meta_image(path);
  progress.advance();
  return deliver_image(std::move(file), "MetaImage", options);
}

bool is_meta_image(const std::string& leading_bytes) {
  const auto line_end = leading_bytes.find('\n');
  const auto equals = leading_bytes.find('=');
  if (line_end == std::string::npos || equals == std::string::npos || equals > line_end) return false;
  const std::string_view key = trimmed(std::string_view(leading_bytes).substr(0, equals));
  constexpr std::array kFirstKeys{"ObjectType", "NDims", "Comment", "ObjectSubType", "Name", "ID"};
  return std::ranges::find(kFirstKeys, key) != kFirstKeys.end() &&
         leading_bytes.find("NDims") != std::string::npos;
}

}  // namespace xraycast
