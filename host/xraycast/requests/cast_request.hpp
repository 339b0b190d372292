#pragma once

#include "xraycast/casting/basis.hpp"
#include "xraycast/casting/body_map.hpp"
#include "xraycast/casting/spectral_scan.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/motion/motion_request.hpp"
#include "xraycast/volume/scan_info.hpp"

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace xraycast {

/// What the shells of a map follow.
enum class ShellOutline { body, circle };

/// `body` or `circle`. Throws InputError for another name.
ShellOutline parse_shell_outline(const std::string& name);

/// `equal-area`, `equal-thickness` or `near-skin`. Throws InputError for another name.
RadiiRule parse_radii_rule(const std::string& name);

/// The centre line of an axis that leans as the body does.
inline constexpr const char* kBodyLine = "body";

/// From a scan to a body map, and to its basis where that is asked for. What is not given follows from the
/// scan's body. Messages name the fields in backquotes, for with_names().
struct CastRequest {
  RayLayout projection = RayLayout::cylinder;
  std::optional<int> layers{};  ///< of cylinder and sphere; 1, or what `radii` make
  std::optional<int> angles{};  ///< of cylinder and sphere, a turn; 360
  std::optional<int> views{};   ///< of a rectangle; 36

  /// Of cylinder and sphere: a rule, by default RadiiRule::near_skin or, of circles, equal_area; or all edges
  /// in mm, innermost first. Under a body's outline, edges up to 1 are shares of how far it reaches.
  std::optional<std::variant<RadiiRule, std::vector<double>>> radii{};
  std::optional<double> radius_mm{};      ///< limits the outline too; else the body's
  std::vector<double> centre_mm{};        ///< x, y, and z of a sphere alone; else the body's centroid
  std::string centre_line{};              ///< of a cylinder: CurvedAxis::from_file, or kBodyLine
  std::optional<ShellOutline> outline{};  ///< else the body's, or circles where no body is found
  bool keep_table = false;                ///< the outline encloses everything
  Attenuation opacity = Opacity::paper();
  std::filesystem::path iodine{};           ///< with a spectrum: a mask of vessels, on the scan's grid
  std::filesystem::path without_vessels{};  ///< a folder of `mask.nrrd`: see WithoutVessels

  /// Of the scan, which is cast as it is at that instant; or, where none is given, at the keys of the motion,
  /// between which a map is blended as the body moves (BodyMap::keys).
  MotionRequest motion{};
  std::map<std::string, int> keys{};  ///< of modes by name: the number of their key phases; see key_phases()

  std::optional<std::int64_t> memory_limit_B{};  ///< beyond it, slabs are cast; the device's largest buffer

  bool makes_map = true;
  std::optional<std::vector<double>> knots_hu{};  ///< makes a basis; of useful_knots_hu() where empty
  bool measures_outside = false;                  ///< see Casting::outside_share

  bool moves() const { return motion.is_of_all_instants(); }
  bool has_body_outline() const {
    return projection != RayLayout::rectangle && outline != ShellOutline::circle;
  }
};

/// The centroid of a tree as CastRequest::centre_mm.
std::vector<double> centre_of(const VesselTree& tree, RayLayout ray_layout);

/// What a request makes.
struct Casting {
  BodyMap map{};  ///< empty where the request makes none
  std::optional<Basis> basis{};
  std::vector<std::string> notes{};  ///< on what was chosen or could be better, one line each
  std::string cut_off{};             ///< where the scan ends within the body, one line; or empty
  std::string left_out{};            ///< what lies outside of the outline, one line; empty for circles

  /// The share of the scan's attenuation that lies outside of the shells, by a coarse projection. Of a whole
  /// scan's map by an opacity, with a body's outline about a straight axis.
  std::optional<double> outside_share{};

  LoadTimings load{};
  double outline_ms = 0;  ///< to find the outline, and the share outside of it
  double kernel_ms = 0, basis_ms = 0;

  MotionOfRequest motion{};  ///< at which instant the scan was taken

  /// What the files of map and basis say of the scan, and of the instant.
  void describe(const std::string& source, const std::string& frame_of_reference_uid);
};

/// Throws InputError for what makes no map of any scan. Reads no file.
void check(const CastRequest& request);

/// Whether the request can be cast from a scan that is on the device: it stays as it is, and is not too
/// large.
bool takes_resident(const CastRequest& request, const VolumeGeometry& volume, const ComputeDevice& device);

/// For a scan that is cast on the device: finds the body as the request wants it.
OutlineFinder outline_finder(const CastRequest& request, const VolumeGeometry& volume);

/// Opens the scan that is cast; called again where its slices are read twice.
using ScanOpener = std::function<Scan(Progress& progress)>;

/// Casts a scan while it is read, or slab by slab where it exceeds the limit of memory or where that is
/// faster. Stages "reading", or "looking" where slabs need the body's outline first; "casting", for each
/// material of a spectrum; "weighing" for a basis; "projecting" for the share outside.
///
/// Throws InputError as check(), and for a scan that the request does not fit.
Casting cast(const CastRequest& request, const ScanOpener& open, ComputeDevice& device, Progress& progress);

/// The same of a scan that is on the device, and of what the request's outline_finder() has seen of it; one
/// that has found the skin serves circles too. Ignores `iodine`, `without_vessels`, `motion` and the limit of
/// memory.
Casting cast(const CastRequest& request, const SpectralScan& scan, const OutlineFinder& body,
             const SliceSource::HuRange& hu, Progress& progress);

}  // namespace xraycast
