#pragma once

#include "xraycast/geometry/nurbs_curve.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/motion/motion.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"
#include "xraycast/scene/scene.hpp"

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// Vessels as a surface to draw: a mesh (see read_mesh), or a folder that `segment` or `phantom --truth`
/// wrote, with surface.vtp or surface.stl, or else its tree, which is meshed as tubes. In fluoro they hold
/// blood with this iodine concentration. Throws InputError.
Surface read_vessels(const std::filesystem::path& path, double contrast_mg_ml);

/// Vessels that hold blood with this iodine concentration. Throws InputError for one beyond
/// kMaxContrast_mg_ml.
Surface filled_vessels(Mesh mesh, double contrast_mg_ml);

/// Vessels where the motion has taken them. Adds to `notes`, with `name` in front, how many of their points
/// have no place there.
Surface moved(Surface vessels, const HeldMotion& motion, const std::string& name,
              std::vector<std::string>& notes);

/// A warning when most of the vessels lie outside a map's body, as when they belong to another scan; or none.
std::vector<std::string> notes_on_place(std::span<const glm::vec3> vessels_mm, const BodyBounds& bounds,
                                        const std::string& name);
std::vector<std::string> notes_on_place(const VesselTree& vessels, const BodyBounds& bounds,
                                        const std::string& name);

/// The colour of shaded catheters.
inline constexpr glm::dvec3 kCatheterColour{0.25, 0.55, 0.95};

/// A catheter as a surface to draw, 2 mm thick: a CSV of control points x, y, z (LPS, mm) of a NURBS curve.
/// Throws InputError, naming file and line.
Surface read_catheter(const std::filesystem::path& path);

/// Radiopaque tubing is filled with some 40 % of barium sulphate by weight, which makes its density about 1.6
/// g/ml; the mean over wall and lumen.
double catheter_per_mm();

/// A tube around a curve, with the given numbers of rings per control point and of sides.
Mesh tube_mesh(const NurbsCurve& curve, double radius_mm, int rings_per_point = 16, int sides = 12);

}  // namespace xraycast
