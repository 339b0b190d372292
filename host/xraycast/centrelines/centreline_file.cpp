#include "xraycast/centrelines/centreline_file.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/centrelines/stored_centrelines.hpp"
#include "xraycast/geometry/body_bounds.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <string_view>

namespace xraycast {
namespace {

StoredCentrelines read_own_tree(const std::filesystem::path& path) {
  StoredCentrelines stored{{}, true};
  const VesselTree tree = read_tree(path);
  for (const VesselBranch& branch : tree.branches()) {
    CentrelineLine& line = stored.lines.emplace_back();
    for (const VesselPoint& point : branch.points) {
      line.points_mm.push_back(point.position_mm);
      line.radii_mm.push_back(point.radius_mm);
    }
    line.parent = branch.parent;
    line.name = branch.name;
  }
  return stored;
}

/// 3D Slicer's or xraycast's.
StoredCentrelines read_json_lines(const std::filesystem::path& path) {
  if (has_extension(path, ".mrk.json")) return read_markups(path);
  const nlohmann::json document = parse_json(read_whole_file(path), path.string());
  return document.is_object() && document.contains("markups") ? read_markups(path) : read_own_tree(path);
}

struct CentrelineFormat {
  std::string_view extension;
  StoredCentrelines (*read)(const std::filesystem::path&);
};
constexpr CentrelineFormat kCentrelineFormats[] = {{".vtp", read_polydata_lines},
                                                   {".vtk", read_polydata_lines},
                                                   {".json", read_json_lines},
                                                   {".swc", read_swc},
                                                   {".csv", read_centreline_csv}};

const CentrelineFormat* centreline_format(const std::filesystem::path& path) {
  const auto* const format =
      std::ranges::find(kCentrelineFormats, extension_of(path), &CentrelineFormat::extension);
  return format == std::end(kCentrelineFormats) ? nullptr : format;
}

bool has_all_radii(const CentrelineLine& line) {
  return !line.radii_mm.empty() &&
         std::ranges::none_of(line.radii_mm, [](double radius_mm) { return !(radius_mm > 0); });
}

/// The line's points in LPS millimetres, with a radius each.
class CentrelineCompletion {
 public:
  CentrelineCompletion(std::string name, bool is_lps, const CentrelineOptions& options)
      : name_(std::move(name)),
        sign_(!is_lps && options.frame == PatientFrame::ras ? -1 : 1),
        options_(options) {}

  void complete(CentrelineLine& line, std::size_t index) const {
    const std::string field = line.name.empty()
                                  ? fmt::format("{}: line {}", name_, index)
                                  : fmt::format("{}: line {} (\"{}\")", name_, index, excerpt(line.name));
    if (line.radii_mm.empty()) {
      if (!options_.radius_mm) throw InputError("{}: has no radii; give `radius_mm`, in mm", field);
      line.radii_mm.assign(line.points_mm.size(), 0);
    }
    if (options_.radius_mm) fill_gaps(line.radii_mm);
    for (std::size_t k = 0; k < line.points_mm.size(); ++k) {
      line.points_mm[k] = scaled(line.points_mm[k], field, k);
      line.radii_mm[k] = scaled_radius(line.radii_mm[k], field, k);
    }
  }

 private:
  /// Between points that have radii the others' are in between.
  static void fill_gaps(std::vector<double>& radii) {
    const auto is_known = [](double radius) { return radius > 0; };
    for (auto known = std::ranges::find_if(radii, is_known); known != radii.end();) {
      const auto next = std::find_if(known + 1, radii.end(), is_known);
      if (next == radii.end()) return;
      for (auto between = known + 1; between != next; ++between)
        *between = std::lerp(*known, *next,
                             static_cast<double>(between - known) / static_cast<double>(next - known));
      known = next;
    }
  }

  glm::dvec3 scaled(glm::dvec3 point, const std::string& field, std::size_t k) const {
    point *= options_.scale_mm * glm::dvec3(sign_, sign_, 1);
    for (int axis = 0; axis < 3; ++axis) {
      if (!std::isfinite(point[axis]))
        throw InputError("{}: point {} is not finite; correct the file", field, k);
      if (std::abs(point[axis]) > kFarthest_mm)
        throw InputError(
            "{}: point {} lies {:g} mm from the origin, more than {:g}; give `unit`, that of the file", field,
            k, std::abs(point[axis]), kFarthest_mm);
    }
    return point;
  }

  double scaled_radius(double radius, const std::string& field, std::size_t k) const {
    if (!(radius > 0)) {
      if (!options_.radius_mm)
        throw InputError("{}: point {}: the radius {:g} is not above zero; give `radius_mm`, in mm", field, k,
                         radius);
      return *options_.radius_mm;
    }
    radius *= options_.scale_mm;
    if (!(radius <= kLargestRadius_mm))
      throw InputError("{}: point {}: the radius {:g} mm is more than {:g}; give `unit`, that of the file",
                       field, k, radius, kLargestRadius_mm);
    if (!(radius > 0))
      throw InputError("{}: point {}: the radius is too small; give a larger `unit`", field, k);
    return radius;
  }

  std::string name_;
  double sign_;  ///< of x and y
  const CentrelineOptions& options_;
};

}  // namespace

bool is_centreline_file(const std::filesystem::path& path) { return centreline_format(path) != nullptr; }

std::vector<CentrelineLine> read_centreline_lines(const std::filesystem::path& path,
                                                  const CentrelineOptions& options) {
  if (!(options.scale_mm > 0) || !std::isfinite(options.scale_mm))
    throw InputError("`unit` {:g}: must be above zero", options.scale_mm);
  if (options.radius_mm && !(*options.radius_mm > 0 && *options.radius_mm <= kLargestRadius_mm))
    throw InputError("`radius_mm` {:g}: must be above zero and at most {:g} mm", *options.radius_mm,
                     kLargestRadius_mm);
  return with_remedy(path, "correct the file, or export the centrelines again", [&] {
    std::error_code error;
    const bool is_folder = std::filesystem::is_directory(path, error);
    const CentrelineFormat* const format = centreline_format(path);
    if (!is_folder && !format)
      throw InputError("{}: centrelines are read from .vtp, .vtk, .mrk.json, .json, .swc or .csv, not \"{}\"",
                       path.string(), extension_of(path));
    StoredCentrelines stored = is_folder ? read_own_tree(path) : format->read(path);
    if (stored.lines.empty()) throw InputError("{}: the file has no lines", path.string());
    if (options.radius_mm && std::ranges::all_of(stored.lines, has_all_radii))
      throw InputError("{}: `radius_mm` does not apply, as all points have radii; leave it out",
                       path.string());
    const CentrelineCompletion completion(path.string(), stored.is_lps, options);
    for (std::size_t i = 0; i < stored.lines.size(); ++i) completion.complete(stored.lines[i], i);
    return std::move(stored.lines);
  });
}

}  // namespace xraycast
