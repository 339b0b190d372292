// The arrays of VMTK's centrelines: http://www.vmtk.org/tutorials/Centerlines.html and
// GeometricAnalysis.html.
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/centrelines/stored_centrelines.hpp"
#include "xraycast/geometry/legacy_vtk.hpp"
#include "xraycast/geometry/vtp.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

namespace xraycast {
namespace {

constexpr double kSamePlace_mm = 1e-3;

/// A number of each line, where the file has that array; verts come before lines.
const double* line_numbers(const PolyData& data, std::string_view name) {
  const PolyData::Array* array = find_array(data.cell_arrays, name);
  return array && array->components == 1 ? array->values.data() + data.verts.size() : nullptr;
}

const PolyData::Array* radius_array(const PolyData& data) {
  for (const char* const name : {"maximuminscribedsphereradius", "radius"})
    for (const PolyData::Array& array : data.point_arrays)
      if (lower_case(array.name) == name && array.components == 1) return &array;
  return nullptr;
}

std::vector<CentrelineLine> lines_of(const PolyData& data) {
  const PolyData::Array* const radius = radius_array(data);
  std::vector<CentrelineLine> lines(data.lines.size());
  for (std::size_t i = 0; i < lines.size(); ++i)
    for (const std::uint32_t point : data.lines[i]) {
      lines[i].points_mm.push_back(data.points_mm[point]);
      if (radius) lines[i].radii_mm.push_back(radius->values[point]);
    }
  return lines;
}

void set_parents(std::vector<CentrelineLine>& lines, const double* parents, const std::string& name) {
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (!(parents[i] >= -1 && parents[i] < static_cast<double>(lines.size())) ||
        parents[i] != std::floor(parents[i]))
      throw InputError("{}: ParentIds: line {}: its parent {} does not exist", name, i, parents[i]);
    lines[i].parent = static_cast<int>(parents[i]);
  }
}

/// Whether a tract goes on where the one before it ends.
bool goes_on(const CentrelineLine& before, const CentrelineLine& tract) {
  if (before.points_mm.empty() || tract.points_mm.empty()) return true;
  const double within_mm =
      before.radii_mm.empty() ? kSamePlace_mm : std::max(kSamePlace_mm, before.radii_mm.back());
  return glm::distance(before.points_mm.back(), tract.points_mm.front()) <= within_mm;
}

void append(CentrelineLine& line, const CentrelineLine& tract) {
  const bool shares_end = !line.points_mm.empty() && !tract.points_mm.empty() &&
                          glm::distance(line.points_mm.back(), tract.points_mm.front()) <= kSamePlace_mm;
  line.points_mm.insert(line.points_mm.end(), tract.points_mm.begin() + shares_end, tract.points_mm.end());
  if (!tract.radii_mm.empty())
    line.radii_mm.insert(line.radii_mm.end(), tract.radii_mm.begin() + shares_end, tract.radii_mm.end());
}

/// vmtkbranchextractor cuts the line to each target into tracts, and repeats those that lines share.
std::vector<CentrelineLine> joined_tracts(const std::vector<CentrelineLine>& tracts,
                                          const double* centrelines, const double* positions) {
  std::vector<std::size_t> order(tracts.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) {
    return std::pair(centrelines[a], positions[a]) < std::pair(centrelines[b], positions[b]);
  });
  std::vector<CentrelineLine> lines;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const CentrelineLine& tract = tracts[order[k]];
    if (k == 0 || centrelines[order[k]] != centrelines[order[k - 1]] || !goes_on(lines.back(), tract))
      lines.emplace_back();
    append(lines.back(), tract);
  }
  return lines;
}

bool are_finite(const double* numbers, std::size_t count) {
  return std::all_of(numbers, numbers + count, [](double number) { return std::isfinite(number); });
}

}  // namespace

StoredCentrelines read_polydata_lines(const std::filesystem::path& path) {
  const PolyData data = extension_of(path) == ".vtk" ? read_legacy_vtk(path) : read_vtp(path);
  StoredCentrelines stored{lines_of(data), data.says_space};
  const std::size_t lines = stored.lines.size();
  const double* const centrelines = line_numbers(data, "CenterlineIds");
  const double* const tracts = line_numbers(data, "TractIds");
  if (const double* const parents = line_numbers(data, "ParentIds"))
    set_parents(stored.lines, parents, path.string());
  else if (centrelines && tracts && are_finite(centrelines, lines) && are_finite(tracts, lines))
    stored.lines = joined_tracts(stored.lines, centrelines, tracts);
  return stored;
}

}  // namespace xraycast
