#include "xraycast/image_file/image_file_scan.hpp"
#include "xraycast/image_file/image_file_stack.hpp"
#include "xraycast/image_file/text_header.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <span>

// "Definition of NRRD File Format", https://teem.sourceforge.net/nrrd/format.html
namespace xraycast {
namespace {

namespace fs = std::filesystem;

template <typename... Args>
[[noreturn]] void fail_nrrd(const TextHeader& text, fmt::format_string<Args...> format, Args&&... args) {
  throw InputError("{}: {}; export the file again", text.path.string(),
                   fmt::format(format, std::forward<Args>(args)...));
}

// ---- space -------------------------------------------------------------------------------------------

/// The world that directions and origin refer to.
struct NrrdSpace {
  std::size_t dimensions = 0;  ///< 0 where there is none, 4 with time
  bool is_of_patient = false;  ///< its axes are the patient's
  glm::dvec3 to_lps{1, 1, 1};
};

NrrdSpace named_space(const TextHeader& text) {
  static const std::map<std::string, NrrdSpace> spaces{{"rightanteriorsuperior", {3, true, {-1, -1, 1}}},
                                                       {"ras", {3, true, {-1, -1, 1}}},
                                                       {"leftanteriorsuperior", {3, true, {1, -1, 1}}},
                                                       {"las", {3, true, {1, -1, 1}}},
                                                       {"leftposteriorsuperior", {3, true, {1, 1, 1}}},
                                                       {"lps", {3, true, {1, 1, 1}}},
                                                       {"scannerxyz", {3, false, {1, 1, 1}}},
                                                       {"3drighthanded", {3, false, {1, 1, 1}}},
                                                       {"3dlefthanded", {3, false, {1, 1, 1}}}};
  std::string name = lower_case(text.get("space"));
  std::erase_if(name, [](char c) { return c == '-' || c == ' '; });
  std::size_t times = 0;
  for (const std::string_view suffix : {"time", "t"})
    if (times == 0 && name.ends_with(suffix)) {
      name.resize(name.size() - suffix.size());
      times = 1;
    }
  const auto found = spaces.find(name);
  if (found == spaces.end()) fail_nrrd(text, "space '{}' is unknown", excerpt(text.get("space")));
  NrrdSpace space = found->second;
  space.dimensions += times;
  return space;
}

NrrdSpace space_of(const TextHeader& text) {
  if (text.has("space") && text.has("space dimension"))
    fail_nrrd(text, "it has both space and space dimension");
  if (text.has("space")) return named_space(text);
  const NrrdSpace space{text.number<std::size_t>("space dimension", {0})};
  for (const char* field : {"space directions", "space origin", "space units"})
    if (text.has(field) && space.dimensions == 0) fail_nrrd(text, "{} needs a space", field);
  return space;
}

// ---- where the voxels lie ----------------------------------------------------------------------------

/// The axes that span the volume, as `kinds` tells; the others hold the numbers of a voxel.
std::vector<std::size_t> domain_axes(const TextHeader& text, std::size_t axes) {
  constexpr std::array kDomains{"domain", "space", "time", "???", "none"};
  const std::vector<std::string> kinds = words_of(text.get("kinds"));
  if (!kinds.empty() && kinds.size() != axes)
    fail_nrrd(text, "kinds holds {} words instead of {}", kinds.size(), axes);
  std::vector<std::size_t> domain;
  for (std::size_t axis = 0; axis < axes; ++axis)
    if (kinds.empty() || std::ranges::find(kDomains, lower_case(kinds[axis])) != kDomains.end())
      domain.push_back(axis);
  return domain;
}

/// Of the one unit that all axes have; others get a warning.
double mm_of_units(const TextHeader& text, const char* field, std::vector<std::string>& warnings) {
  static const std::map<std::string, double> lengths{
      {"mm", 1},       {"millimeter", 1}, {"millimetre", 1}, {"cm", 10},    {"m", 1000},
      {"meter", 1000}, {"metre", 1000},   {"um", 0.001},     {"µm", 0.001}, {"micron", 0.001}};
  std::vector<std::string> words = words_of(text.get(field));
  words.resize(std::min<std::size_t>(3, words.size()));
  std::set<std::string> units;
  for (std::string& word : words) {
    std::erase(word, '"');
    if (!word.empty()) units.insert(word);
  }
  if (units.empty()) return 1;
  const auto length = lengths.find(*units.begin());
  if (units.size() == 1 && length != lengths.end()) return length->second;
  warnings.push_back(fmt::format("{} is {}, which is not one unit of length; millimetres are assumed", field,
                                 excerpt(text.get(field))));
  return 1;
}

/// `(1,0,0) none (0,0,2)`: empty for none, and for vectors of NaN.
std::vector<std::vector<double>> space_vectors(const TextHeader& text, const char* field, std::size_t count,
                                               std::size_t dimensions) {
  if (!text.has(field)) return std::vector<std::vector<double>>(count);
  std::vector<std::vector<double>> vectors;
  std::string_view left = text.get(field);
  while (!(left = trimmed(left)).empty()) {
    constexpr std::string_view kNone = "none";
    const auto end = left.starts_with(kNone) ? kNone.size() - 1 : left.find(')');
    if (end == std::string_view::npos || (left[0] != '(' && left[0] != kNone[0]))
      fail_nrrd(text, "{} holds '{}', not a vector such as (1,0,0)", field, excerpt(left));
    std::string numbers(left[0] == '(' ? left.substr(1, end - 1) : "");
    left.remove_prefix(end + 1);
    std::ranges::replace(numbers, ',', ' ');
    std::vector<double>& vector = vectors.emplace_back();
    if (!numbers.empty()) vector = text.parsed<double>(field, numbers, dimensions);
    const auto is_nan = [](double number) { return std::isnan(number); };
    if (std::ranges::all_of(vector, is_nan)) vector.clear();
    for (const double number : vector)
      if (!std::isfinite(number)) fail_nrrd(text, "{} holds {}", field, number);
  }
  if (vectors.size() != count)
    fail_nrrd(text, "{} holds {} vectors instead of {}", field, vectors.size(), count);
  return vectors;
}

/// Without its time.
glm::dvec3 in_space(const std::vector<double>& vector) {
  glm::dvec3 result(0);
  for (std::size_t d = 0; d < std::min<std::size_t>(3, vector.size()); ++d)
    result[static_cast<int>(d)] = vector[d];
  return result;
}

void place_by_directions(const TextHeader& text, const NrrdSpace& space, std::size_t axes,
                         std::span<const std::size_t> domain, ImageHeader& header,
                         std::vector<std::string>& warnings) {
  if (space.dimensions != domain.size())
    fail_nrrd(text, "its space has {} dimensions for {} axes", space.dimensions, domain.size());
  constexpr const char* kBlanksAndNan = "\" \tnaN";
  for (const char* field : {"spacings", "axis mins", "axis maxs", "units"})
    if (text.get(field).find_first_not_of(kBlanksAndNan) != std::string::npos)
      fail_nrrd(text, "{} contradicts its space", field);
  const glm::dvec3 to_lps_mm = mm_of_units(text, "space units", warnings) * space.to_lps;
  const auto directions = space_vectors(text, "space directions", axes, space.dimensions);
  for (std::size_t axis = 0; axis < std::min<std::size_t>(3, domain.size()); ++axis) {
    const std::vector<double>& direction = directions[domain[axis]];
    if (direction.empty())
      header.step_mm[axis][static_cast<int>(axis)] = 1;
    else
      header.step_mm[axis] = to_lps_mm * in_space(direction);
  }
  header.origin_mm = to_lps_mm * in_space(space_vectors(text, "space origin", 1, space.dimensions)[0]);
}

/// `axis mins` and `axis maxs` are those of the voxels' faces, or of their centres where these are nodes.
void place_by_spacings(const TextHeader& text, std::size_t axes, std::span<const std::size_t> domain,
                       ImageHeader& header, std::vector<std::string>& warnings) {
  const double mm = mm_of_units(text, "units", warnings);
  const std::vector<double> unknown(axes, std::numeric_limits<double>::quiet_NaN());
  std::vector<double> spacings = text.numbers<double>("spacings", axes, std::vector<double>(axes, 1));
  require_spacing(text.path, "spacings", spacings);
  const std::vector<double> mins = text.numbers<double>("axis mins", axes, unknown);
  const std::vector<double> maxs = text.numbers<double>("axis maxs", axes, unknown);
  const std::vector<std::string> centers = words_of(text.get("centers") + ' ' + text.get("centerings"));
  const bool has_origin =
      (text.has("spacings") || text.has("axis maxs")) &&
      std::ranges::all_of(domain, [&](std::size_t axis) { return std::isfinite(mins[axis]); });
  for (std::size_t d = 0; d < std::min<std::size_t>(3, domain.size()); ++d) {
    const std::size_t axis = domain[d];
    const bool is_node = axis < centers.size() && lower_case(centers[axis]) == "node";
    if (!text.has("spacings") && has_origin) {
      spacings[axis] = (maxs[axis] - mins[axis]) / static_cast<double>(header.size[d] - (is_node ? 1 : 0));
      require_spacing(text.path, "axis maxs", std::span(&spacings[axis], 1));
    }
    const int i = static_cast<int>(d);
    header.step_mm[d][i] = mm * spacings[axis];
    if (has_origin) header.origin_mm[i] = mm * (mins[axis] + (is_node ? 0 : 0.5 * spacings[axis]));
  }
}

/// The columns of the measurement frame are the axes of the vectors in the file's space. Where there is none,
/// vectors are LPS, as ITK takes them.
glm::dmat3 vectors_to_lps(const TextHeader& text, const NrrdSpace& space) {
  glm::dmat3 frame(1);
  if (space.dimensions < 3) return frame;
  const auto columns = space_vectors(text, "measurement frame", space.dimensions, space.dimensions);
  for (int column = 0; column < 3; ++column) {
    const std::vector<double>& axis = columns[static_cast<std::size_t>(column)];
    if (axis.empty()) return glm::dmat3(1);
    frame[column] = space.to_lps * in_space(axis);
  }
  return frame;
}

// ---- voxels ------------------------------------------------------------------------------------------

VoxelType nrrd_type(const TextHeader& text) {
  using enum VoxelType;
  using Names = std::vector<std::string_view>;
  static const std::pair<VoxelType, Names> types[] = {
      {int8, {"signed char", "int8", "int8_t"}},
      {uint8, {"uchar", "unsigned char", "uint8", "uint8_t"}},
      {int16, {"short", "short int", "signed short", "signed short int", "int16", "int16_t"}},
      {uint16, {"ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"}},
      {int32, {"int", "signed int", "int32", "int32_t"}},
      {uint32, {"uint", "unsigned int", "uint32", "uint32_t"}},
      {int64,
       {"longlong", "long long", "long long int", "signed long long", "signed long long int", "int64",
        "int64_t"}},
      {uint64, {"ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"}},
      {float32, {"float"}},
      {float64, {"double"}}};
  const std::string name = lower_case(text.get("type"));
  for (const auto& [type, names] : types)
    if (std::ranges::find(names, name) != names.end()) return type;
  throw InputError("{}: voxels of type '{}' are not supported; save them as short", text.path.string(),
                   excerpt(name));
}

bool is_big_endian(const TextHeader& text, VoxelType type) {
  const std::string endian = lower_case(text.get("endian"));
  if (endian.empty() && bytes_of(type) == 1) return false;
  if (endian != "little" && endian != "big")
    fail_nrrd(text, "endian is '{}', not little or big, so the header is damaged", excerpt(endian));
  return endian == "big";
}

ImageHeader nrrd_header(const TextHeader& text, std::vector<std::string>& warnings) {
  ImageHeader header;
  header.path = text.path;
  const auto axes = text.number<std::size_t>("dimension", {0});
  constexpr std::size_t kMaxAxes = 16;
  if (axes < 1 || axes > kMaxAxes)
    fail_nrrd(text, "dimension is missing or not 1 to {}, so the header is damaged", kMaxAxes);
  const auto sizes = text.numbers<std::int64_t>("sizes", axes);
  const std::vector<std::size_t> domain = domain_axes(text, axes);
  for (std::size_t axis = 0; axis < axes; ++axis)
    if (std::ranges::find(domain, axis) != domain.end())
      header.size.push_back(sizes[axis]);
    else if (sizes[axis] != 1) {
      if (header.numbers_per_voxel != 1)
        fail_nrrd(text, "two axes hold numbers of the same voxel, of {} and {}; give a file with one at most",
                  header.numbers_per_voxel, sizes[axis]);
      header.numbers_per_voxel = sizes[axis];
      header.are_numbers_apart = !header.size.empty();
      header.has_numbers_between = header.are_numbers_apart && axis < domain.back();
    }

  const NrrdSpace space = space_of(text);
  if (space.dimensions > 0)
    place_by_directions(text, space, axes, domain, header, warnings);
  else
    place_by_spacings(text, axes, domain, header, warnings);
  if (header.numbers_per_voxel == 3 && text.has("measurement frame"))
    header.vector_to_lps = vectors_to_lps(text, space);
  header.type = nrrd_type(text);
  header.is_big_endian = is_big_endian(text, header.type);
  if (!space.is_of_patient)
    warnings.push_back(unknown_orientation(
        text.has("space") ? "`space` is " + excerpt(text.get("space")) : "no `space`", header));
  return header;
}

StoredVoxels nrrd_voxels(const TextHeader& text) {
  const std::string& encoding = text.get("encoding");
  if (encoding.empty()) fail_nrrd(text, "encoding is missing, so the header is damaged");
  const bool is_packed = encoding == "gzip" || encoding == "gz";
  if (encoding != "raw" && !is_packed)
    throw InputError("{}: encoding {} is not supported; save the file as raw or gzip", text.path.string(),
                     excerpt(encoding));
  if (text.number<std::int64_t>("line skip", {0}) != 0)
    throw InputError("{}: line skip is not supported; save the file again without it", text.path.string());
  const auto skipped_B = text.number<std::int64_t>("byte skip", {0});
  constexpr std::int64_t kMaxSkip_B = std::int64_t{1} << 40;
  if (skipped_B < -1 || skipped_B > kMaxSkip_B || (skipped_B < 0 && is_packed))
    throw InputError("{}: byte skip is {}; save the file again without it", text.path.string(), skipped_B);

  const std::string& data_file = text.get("data file");
  if (data_file.starts_with("LIST") || data_file.find('%') != std::string::npos)
    throw InputError("{}: data file '{}' names several files; save the scan as one file", text.path.string(),
                     excerpt(data_file));
  const fs::path file = data_file.empty() ? text.path : data_file_beside(text.path, data_file);
  const std::int64_t start_B = data_file.empty() ? text.end_B : 0;
  if (is_packed) return PackedVoxels{file, start_B, skipped_B};
  return PlainVoxels{{file}, skipped_B < 0 ? PlainVoxels::kAtTheEnd : start_B + skipped_B, start_B};
}

}  // namespace

ImageFile read_nrrd(const fs::path& path) {
  const TextHeader text = read_nrrd_header(path);
  ImageFile file{{}, nrrd_voxels(text), {}};
  file.header = nrrd_header(text, file.warnings);
  return file;
}

Scan open_nrrd(const fs::path& path, const ScanOptions& options, Progress& progress) {
  progress.begin("opening", 1, "files");
  ImageFile file = read_nrrd(path);
  progress.advance();
  return deliver_image(std::move(file), "NRRD", options);
}

}  // namespace xraycast
