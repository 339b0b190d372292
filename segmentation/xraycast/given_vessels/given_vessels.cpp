#include "xraycast/given_vessels/given_vessels.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/given_vessels/labelled_mask.hpp"
#include "xraycast/given_vessels/place_in_scan.hpp"
#include "xraycast/given_vessels/vessels_of_mask.hpp"
#include "xraycast/given_vessels/vessels_of_surface.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace xraycast {
namespace {

enum class Kind { surface, mask };

Kind kind_of(const std::filesystem::path& input) {
  constexpr std::array kSurfaces{".stl", ".vtp", ".obj", ".ply", ".vtk"};
  const std::string extension = extension_of(input);
  return std::ranges::find(kSurfaces, extension) != kSurfaces.end() ? Kind::surface : Kind::mask;
}

glm::dvec3 in_lps_mm(const glm::dvec3& point, const GivenVesselsRequest& request) {
  const double turned = request.is_ras ? -1 : 1;
  return request.unit_mm * glm::dvec3(turned * point.x, turned * point.y, point.z);
}

Mesh read_surface(const GivenVesselsRequest& request) {
  Mesh surface = read_mesh(request.input);
  for (glm::vec3& point : surface.points_mm) point = in_lps_mm(point, request);
  return surface;
}

void reject(bool is_given, const char* field, const std::string& name, const char* what) {
  if (is_given) throw InputError("{} does not apply to {}, {}; leave it out", field, name, what);
}

}  // namespace

double unit_mm(const std::string& name) {
  if (name == "mm") return 1;
  if (name == "cm") return 10;
  if (name == "m") return 1000;
  throw InputError("`unit` {}: must be mm, cm or m", printable(name));
}

bool is_ras(const std::string& frame) {
  if (frame == "lps") return false;
  if (frame == "ras") return true;
  throw InputError("`frame` {}: must be lps or ras", printable(frame));
}

void check(const GivenVesselsRequest& request) {
  if (request.options.triangles < 100)
    throw InputError("`triangles` {}: must be 100 or more", request.options.triangles);
  if (request.radius_mm && !(*request.radius_mm > 0 && std::isfinite(*request.radius_mm)))
    throw InputError("`radius_mm` {:g}: must be above zero", *request.radius_mm);
  const std::string name = request.input.string();
  if (kind_of(request.input) == Kind::surface) {
    reject(!request.labels.empty(), "`labels`", name, "a surface");
    reject(request.radius_mm.has_value(), "`radius_mm`", name, "a surface");
  } else {
    reject(request.unit_mm != 1, "`unit`", name, "a mask, whose header has its spacing");
    reject(request.is_ras, "`frame`", name, "a mask, whose header has its orientation");
    reject(request.radius_mm.has_value(), "`radius_mm`", name, "a mask");
  }
}

Vessels given_vessels(const GivenVesselsRequest& request, const Volume* scan, Progress& progress) {
  check(request);
  const CancelScope scope(progress);
  const std::string name = request.input.string();
  GivenVesselsOptions options = request.options;
  if (scan != nullptr) options.grid = scan->geometry();
  if (kind_of(request.input) == Kind::mask)
    return vessels_of_mask(read_labelled_mask(request.input, request.labels, progress), scan, options, name,
                           progress);
  progress.begin("reading", 1, "surfaces");
  const Mesh surface = read_surface(request);
  progress.advance();
  std::vector<std::string> notes;
  if (scan != nullptr) notes = check_place(surface.points_mm, scan->geometry(), name);
  Vessels vessels = vessels_of_surface(surface, options, name, progress);
  vessels.notes.insert(vessels.notes.begin(), notes.begin(), notes.end());
  return vessels;
}

}  // namespace xraycast
