#include "xraycast/given_vessels/given_vessels.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/given_vessels/labelled_mask.hpp"
#include "xraycast/given_vessels/place_in_scan.hpp"
#include "xraycast/given_vessels/vessels_of_lines.hpp"
#include "xraycast/given_vessels/vessels_of_mask.hpp"
#include "xraycast/given_vessels/vessels_of_surface.hpp"
#include "xraycast/segmentation/poor_results.hpp"
#include "xraycast/vessel_names/artery_names.hpp"

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace xraycast {
namespace {

/// A folder that this program made, or one like it.
bool is_tree_folder(const std::filesystem::path& path) { return !tree_file_in(path).empty(); }

/// Masks are known by their content: of any name that is none of a surface or of centrelines.
bool is_mask(const GivenVesselsRequest& request) {
  return !is_surface_file(request.input) && !is_centreline_file(request.input) &&
         !is_tree_folder(request.input);
}

Mesh read_surface(const GivenVesselsRequest& request) {
  Mesh surface = read_mesh(request.input);
  const double turned = !surface.says_space && request.frame == PatientFrame::ras ? -1 : 1;
  for (glm::vec3& point : surface.points_mm)
    point = request.unit_mm * glm::dvec3(turned * point.x, turned * point.y, point.z);
  return surface;
}

std::vector<std::string> placed(const std::vector<glm::vec3>& points_mm, const Volume* scan,
                                const std::string& name) {
  return scan != nullptr ? check_place(points_mm, *scan, name) : std::vector<std::string>();
}

Vessels with_notes(std::vector<std::string> notes, Vessels vessels) {
  vessels.notes.insert(vessels.notes.begin(), notes.begin(), notes.end());
  return vessels;
}

Vessels with_note_on_loops(const std::string& name, Vessels vessels) {
  if (const std::size_t loops = vessels.centrelines.loops.size(); loops > 0)
    vessels.notes.push_back(fmt::format("{}: {} cut where the thinnest piece meets the wider vessel", name,
                                        pluralize(loops, "loop")));
  return vessels;
}

/// Thinner than vessels of a body are, and shorter: as those of a file in cm are.
void note_on_size(const std::string& name, Vessels& vessels) {
  constexpr double kLong_mm = 100, kWide_mm = 1.5;
  glm::dvec3 low(std::numeric_limits<double>::infinity()), high(-low);
  double widest_mm = 0;
  for (const VesselBranch& branch : vessels.centrelines.tree.branches())
    for (const VesselPoint& point : branch.points) {
      low = glm::min(low, point.position_mm);
      high = glm::max(high, point.position_mm);
      widest_mm = std::max(widest_mm, 2 * point.radius_mm);
    }
  const double long_mm = glm::distance(low, high);
  if (long_mm < kLong_mm && widest_mm < kWide_mm)
    vessels.notes.push_back(fmt::format(
        "{}: the vessels are at most {:.1f} mm wide, and {:.0f} mm long in all; if the file's lengths "
        "are in cm, give `unit` cm",
        name, widest_mm, long_mm));
}

Vessels of_lines(const GivenVesselsRequest& request, const GivenVesselsOptions& options, const Volume* scan,
                 Progress& progress) {
  const std::string name = request.input.string();
  const std::vector<CentrelineLine> lines =
      read_centreline_lines(request.input, {request.frame, request.unit_mm, request.radius_mm});
  std::vector<glm::vec3> points_mm;
  for (const CentrelineLine& line : lines)
    points_mm.insert(points_mm.end(), line.points_mm.begin(), line.points_mm.end());
  std::vector<std::string> notes = placed(points_mm, scan, name);
  return with_notes(std::move(notes), vessels_of_lines(lines, options, name, progress));
}

void reject(bool is_given, const char* field, const std::string& name, const char* what) {
  if (is_given) throw InputError("{} does not apply to {}, {}; leave it out", field, name, what);
}

}  // namespace

double unit_mm(const std::string& name) {
  if (name == "mm") return 1;
  if (name == "cm") return 10;
  if (name == "m") return 1000;
  if (name == "um") return 0.001;
  throw InputError("`unit` {}: must be mm, cm, m or um", printable(name));
}

PatientFrame patient_frame(const std::string& name) {
  if (name == "lps") return PatientFrame::lps;
  if (name == "ras") return PatientFrame::ras;
  throw InputError("`frame` {}: must be lps or ras", printable(name));
}

void check(const GivenVesselsRequest& request) {
  if (request.options.triangles < 100)
    throw InputError("`triangles` {}: must be 100 or more", request.options.triangles);
  if (request.radius_mm && !(*request.radius_mm > 0 && std::isfinite(*request.radius_mm)))
    throw InputError("`radius_mm` {:g}: must be above zero", *request.radius_mm);
  const std::string name = request.input.string();
  if (!is_mask(request)) return reject(!request.labels.empty(), "`labels`", name, "which is no mask");
  reject(request.unit_mm != 1, "`unit`", name, "a mask, whose header has its spacing");
  reject(request.frame != PatientFrame::lps, "`frame`", name, "a mask, whose header has its orientation");
  reject(request.radius_mm.has_value(), "`radius_mm`", name, "a mask");
}

namespace {

Vessels vessels_of(const GivenVesselsRequest& request, const Volume* scan, Progress& progress) {
  const std::string name = request.input.string();
  GivenVesselsOptions options = request.options;
  if (scan != nullptr) options.grid = scan->geometry();
  if (is_mask(request))
    return with_note_on_loops(
        name, vessels_of_mask(read_labelled_mask(request.input, request.labels, progress), scan, options,
                              name, progress));
  progress.begin("reading", 1, "files");
  Mesh surface;
  if (is_surface_file(request.input)) surface = read_surface(request);
  progress.advance();
  // A file of VTK may hold either.
  if (surface.triangles.empty() && (is_centreline_file(request.input) || is_tree_folder(request.input)))
    return of_lines(request, options, scan, progress);
  if (request.radius_mm) reject(true, "`radius_mm`", name, "a surface");
  std::vector<std::string> notes = placed(surface.points_mm, scan, name);
  return with_notes(std::move(notes),
                    with_note_on_loops(name, vessels_of_surface(surface, options, name, progress)));
}

}  // namespace

Vessels given_vessels(const GivenVesselsRequest& request, const Volume* scan, Progress& progress) {
  check(request);
  const CancelScope scope(progress);
  Vessels found = vessels_of(request, scan, progress);
  // Folders of this program are in mm.
  if (scan == nullptr && !is_mask(request) && !is_tree_folder(request.input) && request.unit_mm == 1)
    note_on_size(request.input.string(), found);
  found.centrelines.tree = with_artery_names(found.centrelines.tree);
  std::ranges::move(far_root(found.centrelines.tree, request.options.root_mm, request.input.string()),
                    std::back_inserter(found.notes));
  return found;
}

}  // namespace xraycast
