#pragma once

#include <glm/vec3.hpp>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// A centreline as a file has it, which may run together with others: see tree_of_lines.
struct CentrelineLine {
  std::vector<glm::dvec3> points_mm;  ///< LPS
  std::vector<double> radii_mm;       ///< one per point, above zero
  std::string name = {};              ///< what the file calls it, if anything
  int parent =
      -1;  ///< the line at whose last point it starts; -1 for a root, and where the file does not say
};

/// Axes of coordinates: to the patient's left, back and head, or right, front and head.
enum class PatientFrame { lps, ras };

/// What a file of centrelines may leave out.
struct CentrelineOptions {
  PatientFrame frame = PatientFrame::lps;  ///< of a file that does not say it
  double scale_mm = 1;                     ///< millimetres in the file's unit
  std::optional<double> radius_mm = {};    ///< of points without a radius
};

/// Whether read_centreline_lines reads a file of that name, by its extension.
bool is_centreline_file(const std::filesystem::path& path);

/// Reads centrelines, by the extension:
/// - `.vtp` and `.vtk`: PolyData's lines with the point array `MaximumInscribedSphereRadius` or `Radius`, as
///   VMTK leaves them. Tracts (`CenterlineIds`, `TractIds`) are joined to one line for each target again.
///   The file's `SPACE` says its frame; `ParentIds` of write_tree are kept.
/// - `.mrk.json`: 3D Slicer's curves and lines, the polygons of their control points, in the frame and unit
///   that they state, with the measurement `radius` of each control point.
/// - `.swc`: samples (id, type, x, y, z, radius, parent); a line from each root or fork to the next one or an
///   end, with parents.
/// - `.csv`: columns x, y, z (or 3D Slicer's l, p, s or r, a, s), radius or diameter, and branch; other
///   columns are ignored.
/// - `.json`, or a folder with tree.vtp or tree.json: read_tree's.
///
/// Nothing in the file is trusted. Throws InputError, naming file and field, also for points without a radius
/// where none is given (`radius_mm`), one that is given where all have theirs, and for numbers beyond any
/// body (`unit`).
std::vector<CentrelineLine> read_centreline_lines(const std::filesystem::path& path,
                                                  const CentrelineOptions& options = {});

}  // namespace xraycast
