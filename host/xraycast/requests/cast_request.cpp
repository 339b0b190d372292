#include "xraycast/requests/cast_request.hpp"

#include "xraycast/attenuation/vessel_removal.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/geometry/curved_axis.hpp"
#include "xraycast/motion/moved_scan.hpp"
#include "xraycast/requests/body_fit.hpp"
#include "xraycast/requests/moving_caster.hpp"
#include "xraycast/requests/rays_within.hpp"
#include "xraycast/requests/slab_caster.hpp"
#include "xraycast/scan/scan.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <iterator>
#include <numeric>

namespace xraycast {
namespace {

constexpr int kAngles = 360, kViews = 36;

std::string listed(const std::vector<double>& numbers) { return fmt::format("{}", fmt::join(numbers, ",")); }

[[noreturn]] void reject_radii(const std::string& radii) {
  throw InputError(
      "`radii` {}: must be equal-area, equal-thickness, near-skin or all edges in mm, innermost first",
      radii);
}

/// The edges that are given, in mm or as shares; null where there is a rule.
const std::vector<double>* given_edges(const CastRequest& request) {
  return request.radii ? std::get_if<std::vector<double>>(&*request.radii) : nullptr;
}

bool has_shares(const CastRequest& request) {
  const std::vector<double>* edges = given_edges(request);
  return edges && request.has_body_outline() && edges->back() <= 1;
}

/// Rejects fields that have no effect on the chosen projection.
void check_applies(const CastRequest& request) {
  const auto check = [&](bool is_given, const char* field, std::initializer_list<RayLayout> projections) {
    if (is_given && std::ranges::find(projections, request.projection) == projections.end())
      throw InputError("`{}` does not apply to `projection` {}; leave it out", field,
                       to_string(request.projection));
  };
  using enum RayLayout;
  check(request.layers.has_value(), "layers", {cylinder, sphere});
  check(request.radii.has_value(), "radii", {cylinder, sphere});
  check(request.angles.has_value(), "angles", {cylinder, sphere});
  check(request.views.has_value(), "views", {rectangle});
  check(!request.centre_line.empty(), "centre_line", {cylinder});
  check(request.outline.has_value(), "outline", {cylinder, sphere});
  check(request.keep_table, "keep_table", {cylinder, sphere});
  if (request.keep_table && !request.has_body_outline())
    throw InputError(
        "`keep_table`: circles always include the table; leave out `keep_table` or `outline` circle");
  if (!request.centre_line.empty() && !request.centre_mm.empty())
    throw InputError("`centre_mm` {} and `centre_line` {}: give only one of them", listed(request.centre_mm),
                     request.centre_line);
}

void check_instant(const CastRequest& request) {
  if (!request.moves()) {
    check(request.motion);
    if (request.keys.empty()) return;
    if (request.motion.is_given())
      throw InputError("`keys` are those of a map that moves; leave out `phase` and `time`, or `keys`");
    throw InputError("`keys` need a motion; give `motion` too");
  } else if (request.projection == RayLayout::rectangle) {
    throw InputError(
        "`projection` rectangle: its pictures do not move; give an instant by `phase` or `time`");
  }
}

void check_values(const CastRequest& request) {
  if (request.layers && (*request.layers < 1 || *request.layers > kMaxLayers))
    throw InputError("`layers` {}: must be 1 to {}", *request.layers, kMaxLayers);
  if (request.radius_mm && !(std::isfinite(*request.radius_mm) && *request.radius_mm > 0))
    throw InputError("`radius_mm` is {} mm, but must be above 0", *request.radius_mm);
  if (const std::vector<double>* edges = given_edges(request); edges && edges->size() < 2)
    reject_radii(listed(*edges));
  const std::size_t numbers = request.centre_mm.size();
  if (numbers != 0 && numbers != 2 && !(numbers == 3 && request.projection == RayLayout::sphere))
    throw InputError("`centre_mm` {}: must be X,Y in mm, and for a sphere also X,Y,Z",
                     listed(request.centre_mm));
}

/// The knots of the basis in HU; none where none is made.
std::vector<double> resolve_knots(const CastRequest& request) {
  if (!request.knots_hu) return {};
  const auto* opacity = std::get_if<Opacity>(&request.opacity);
  if (!opacity || request.projection != RayLayout::cylinder)
    throw InputError("only cylinder maps cast with an opacity have a basis");
  const std::vector<double>& given = *request.knots_hu;
  std::vector<double> knots_hu = given.empty() ? useful_knots_hu(*opacity) : given;
  validate_knots(knots_hu, given.empty() ? "opacity " + opacity->name() : "`knots_hu` " + listed(given));
  return knots_hu;
}

std::vector<double> resolve_edges(const CastRequest& request, std::vector<double> edges, double radius_mm) {
  if (request.layers && static_cast<std::size_t>(*request.layers) + 1 != edges.size())
    throw InputError("`radii` {} makes {}, but `layers` asks for {}; leave `layers` out", listed(edges),
                     pluralize(edges.size() - 1, "layer"), *request.layers);
  if (has_shares(request)) {
    for (double& edge : edges) edge *= radius_mm;
    return edges;
  }
  if (request.radius_mm && *request.radius_mm != edges.back())
    throw InputError("`radii` {} ends at a radius other than `radius_mm` {}; leave `radius_mm` out",
                     listed(edges), *request.radius_mm);
  return edges;
}

std::vector<double> resolve_radii(const CastRequest& request, double radius_mm) {
  if (const std::vector<double>* edges = given_edges(request))
    return resolve_edges(request, *edges, radius_mm);
  const RadiiRule rule = request.radii                ? std::get<RadiiRule>(*request.radii)
                         : request.has_body_outline() ? RadiiRule::near_skin
                                                      : RadiiRule::equal_area;
  return shell_radii_mm(rule, request.layers.value_or(1), radius_mm);
}

/// Suggests a smaller radius where a small part of the body, such as the arms, widens all shells.
std::optional<std::string> radius_hint(const CastRequest& request, const BodyOutline& body) {
  constexpr double kMuch = 0.85;  // shells get at least 15 % thinner; heads and trunks without arms lie above
  const bool is_free = request.centre_mm.empty() && !request.radius_mm && request.centre_line.empty() &&
                       !request.radii && !request.has_body_outline();
  const double radius_99_mm = std::ceil(body.radius_99_mm);
  if (!is_free || request.projection != RayLayout::cylinder || request.layers.value_or(1) < 2 ||
      radius_99_mm >= kMuch * body.radius_mm)
    return {};
  return fmt::format(
      "99 % of the body lies within {:g} mm of the axis, the rest extends to {:.0f} mm: `radius_mm` {:g} "
      "crops it and shows the body more sharply",
      radius_99_mm, body.radius_mm, radius_99_mm);
}

/// Of a map that reaches as far: the scan's field of view ends within the body, as often at the arms.
std::string cut_off_of(const BodyOutline& body, const MapGeometry& map, const FieldOfView& field) {
  const glm::dvec2 centre_mm = map.centre_mm.front();
  const glm::dvec2 room_mm =
      glm::min(glm::dvec2(field.upper_mm) - centre_mm, centre_mm - glm::dvec2(field.lower_mm));
  if (body.cut_sides.empty() || map.radius_mm() < std::min(room_mm.x, room_mm.y)) return {};
  return fmt::format(
      "cut off: the scan ends within the body at its {} side; pictures that are wider than the scan have "
      "straight edges there",
      fmt::join(body.cut_sides, " and "));
}

/// The centre and radius as given, else from the body.
BodyOutline resolve_outline(const CastRequest& request, const OutlineFinder& finder,
                            std::vector<std::string>& notes) {
  BodyOutline outline{};
  if (request.centre_mm.empty() || !request.radius_mm) outline = finder.finish();
  if (const auto hint = radius_hint(request, outline)) notes.push_back(*hint);
  if (outline.limbs > 0)
    notes.push_back(fmt::format("{} beside the trunk {} in the map", pluralize(outline.limbs, "limb"),
                                outline.limbs == 1 ? "is" : "are"));
  if (const double lean = glm::length(outline.lean);
      lean > kMostLean && request.centre_line.empty() && request.projection == RayLayout::cylinder)
    notes.push_back(
        fmt::format("the body leans by {:.0f} deg in the scan; `centre_line` {} lets the axis follow it",
                    glm::degrees(std::atan(lean)), kBodyLine));
  if (!request.centre_mm.empty()) outline.centre_mm = {request.centre_mm[0], request.centre_mm[1]};
  outline.radius_mm = request.radius_mm.value_or(outline.radius_mm);
  return outline;
}

MapGeometry resolve_sphere(const CastRequest& request, const VolumeGeometry& volume,
                           const BodyOutline& outline) {
  const double z_mm = request.centre_mm.size() == 3 ? request.centre_mm[2]
                                                    : 0.5 * (volume.lower_mm().z + volume.upper_mm().z);
  double radius_mm = outline.radius_mm;
  if (!request.radius_mm)  // must enclose the body at both ends of the scan too
    radius_mm = std::hypot(radius_mm, std::max(volume.upper_mm().z - z_mm, z_mm - volume.lower_mm().z));
  return sphere_map(volume, request.angles.value_or(kAngles), resolve_radii(request, radius_mm),
                    {outline.centre_mm, z_mm});
}

/// Through the trunk's centroid, as the trunk leans.
CurvedAxis line_through(const BodyOutline& outline, const VolumeGeometry& volume) {
  std::vector<glm::dvec3> points_mm;
  for (const double z_mm : {volume.lower_mm().z, volume.upper_mm().z})
    points_mm.emplace_back(outline.centre_mm + outline.lean * (z_mm - volume.middle_mm().z), z_mm);
  return {std::move(points_mm), "the body's axis"};
}

MapGeometry resolve_cylinder(const CastRequest& request, const VolumeGeometry& volume,
                             const BodyOutline& outline) {
  const int angles = request.angles.value_or(kAngles);
  if (request.centre_line.empty())
    return cylinder_map(volume, angles, resolve_radii(request, outline.radius_mm), outline.centre_mm);
  const CurvedAxis axis = request.centre_line == kBodyLine ? line_through(outline, volume)
                                                           : CurvedAxis::from_file(request.centre_line);
  const std::vector<glm::dvec2> centre_mm = axis.centre_of_rows_mm(volume);
  double radius_mm = outline.radius_mm;
  if (!request.radius_mm) {  // must enclose the body wherever the centre goes
    double farthest_mm = 0;
    for (const glm::dvec2& centre : centre_mm)
      farthest_mm = std::max(farthest_mm, glm::distance(centre, outline.centre_mm));
    radius_mm += farthest_mm;
  }
  return cylinder_map(volume, angles, resolve_radii(request, radius_mm), centre_mm);
}

MapGeometry resolve_geometry(const CastRequest& request, const VolumeGeometry& volume,
                             const BodyOutline& outline) {
  if (request.projection == RayLayout::rectangle)
    return rectangle_map(volume, request.views.value_or(kViews), outline.radius_mm, outline.centre_mm);
  return request.projection == RayLayout::sphere ? resolve_sphere(request, volume, outline)
                                                 : resolve_cylinder(request, volume, outline);
}

/// The same with shells that follow the body, unless circles are asked for. Where there is no body, and its
/// outline was not asked for, they are circles too.
MapGeometry resolve_shells(const CastRequest& request, const VolumeGeometry& volume,
                           const OutlineFinder& finder, Casting& casting,
                           std::span<const glm::dvec3> further_skin_mm = {}) {
  const BodyOutline outline = resolve_outline(request, finder, casting.notes);
  MapGeometry circles = resolve_geometry(request, volume, outline);
  casting.cut_off = cut_off_of(outline, circles, field_of(volume));
  if (!request.has_body_outline()) return circles;
  try {
    return fit_to_body(circles, finder, further_skin_mm);
  } catch (const InputError& error) {
    if (request.outline || has_shares(request)) throw;
    casting.notes.push_back(fmt::format("the shells are circles: {}", error.what()));
    CastRequest as_circles = request;
    as_circles.outline = ShellOutline::circle;
    return resolve_geometry(as_circles, volume, outline);
  }
}

double share_outside(const ResidentScan& scan, const MapGeometry& geometry, const Opacity& opacity,
                     Progress& progress) {
  constexpr double kPixel_mm = 4;
  const VolumeGeometry& volume = scan.geometry();
  View view{.centre_mm = volume.middle_mm(), .pixel_mm = kPixel_mm};
  view = fitted(view, volume,
                {glm::dvec2(view.centre_mm),
                 0.5 * glm::distance(glm::dvec2(volume.lower_mm()), glm::dvec2(volume.upper_mm()))});
  const auto sum = [](const std::vector<float>& taus) {
    return std::accumulate(taus.begin(), taus.end(), 0.0);
  };
  std::vector<RaySegment> segments;
  for (const PixelSegment& part : segments_within(view, geometry)) segments.push_back(part.segment);
  // One small picture takes less time than finding the constant blocks of the scan.
  const double whole = sum(project(scan, view, opacity, progress, {}, Sampling::everywhere).tau);
  return whole > 0 ? std::max(0.0, 1 - sum(project(scan, segments, opacity, progress)) / whole) : 0;
}

std::string left_out_of(const MapGeometry& geometry, const std::optional<double>& share, bool keeps_table) {
  constexpr double kLeast = 1e-4;
  if (share)
    return fmt::format(
        "left out: {} % of the scan's attenuation, outside the outline (table, clothes, and air where "
        "the opacity lets it attenuate)",
        *share < kLeast ? fmt::format("less than {:g}", 100 * kLeast) : fmt::format("{:.2g}", 100 * *share));
  if (!geometry.has_outline()) return "";
  return keeps_table ? "left out: everything outside the outline, which includes the table"
                     : "left out: everything outside the outline; `keep_table` includes the table";
}

void put(CastResult result, Casting& casting) {
  casting.map = std::move(result.map);
  casting.kernel_ms = result.kernel_ms;
}

/// The scan, without the vessels that are to be removed, and moved.
Scan open_scan_of(const CastRequest& request, const MotionOfRequest& motion, const ScanOpener& open,
                  Progress& progress) {
  Scan scan = open(progress);
  if (!request.without_vessels.empty()) {
    const std::filesystem::path file = request.without_vessels / "mask.nrrd";
    std::error_code error;
    if (std::filesystem::is_directory(request.without_vessels, error) &&
        !std::filesystem::exists(file, error))
      throw InputError(
          "`without_vessels` {}: the folder has no mask of the vessels; make it by `segment`, or by "
          "`vessels` with `like`",
          request.without_vessels.string());
    const Scan vessels = open_scan(file, {}, progress);
    check_mask_grid(vessels.source->geometry(), scan.source->geometry(),
                    "`without_vessels` " + file.string());
    scan.source =
        std::make_unique<WithoutVessels>(std::move(scan.source), collect(*vessels.source, progress));
  }
  scan.info.warnings.clear();  // the opener has told of them
  return moved(std::move(scan), motion, progress);
}

/// The bytes above which a scan is cast by slabs.
std::int64_t memory_limit_B(const CastRequest& request, const ComputeDevice& device) {
  return request.memory_limit_B.value_or(device.info().max_allocation_B);
}

/// Reads the scan twice if the body's outline is needed first.
Casting cast_slabs(const CastRequest& request, const MotionOfRequest& motion, const ScanOpener& open,
                   Scan scan, std::int64_t limit_B, ComputeDevice& device, Progress& progress) {
  if (request.knots_hu) throw InputError("a basis needs the whole scan in memory; raise `memory_limit_B`");
  const VolumeGeometry volume = scan.source->geometry();
  const std::int64_t slices = slab_slices_within(volume, limit_B);
  const auto* opacity = std::get_if<Opacity>(&request.opacity);
  if (!opacity) throw InputError("a spectrum map needs the whole scan in memory; raise `memory_limit_B`");
  OutlineFinder finder = outline_finder(request, volume);
  Casting casting{.notes = scan.info.warnings};
  if (request.centre_mm.empty() || !request.radius_mm || request.has_body_outline()) {
    const Stopwatch looking;
    look_through(*scan.source, finder, progress);
    scan.source.reset();  // before the next one takes memory
    scan = open_scan_of(request, motion, open, progress);
    casting.load.read_ms = looking.ms();
  }
  const Stopwatch finding;
  const MapGeometry geometry = resolve_shells(request, volume, finder, casting);
  casting.outline_ms = finding.ms();
  put(cast_by_slabs(device, *scan.source, geometry, *opacity, slices, casting.load, progress), casting);
  std::ranges::move(scan.source->hu_range().warnings(), std::back_inserter(casting.notes));
  std::ranges::move(opacity_hints(*opacity, scan.source->hu_range()), std::back_inserter(casting.notes));
  casting.left_out = left_out_of(geometry, {}, request.keep_table);
  return casting;
}

/// Whether the geometry is known before the first slice is read, and nothing needs the scan afterwards: slabs
/// then need less memory, and therefore less time. A scan in motion is in memory anyway.
bool is_best_by_slabs(const CastRequest& request, const VolumeGeometry& volume) {
  return volume.size.z > kMaxSlabSlices && !request.motion.is_given() && !request.centre_mm.empty() &&
         request.radius_mm && request.centre_line.empty() && !request.knots_hu &&
         request.projection == RayLayout::cylinder && !request.has_body_outline() &&
         std::holds_alternative<Opacity>(request.opacity);
}

}  // namespace

ShellOutline parse_shell_outline(const std::string& name) {
  if (name == "body") return ShellOutline::body;
  if (name == "circle") return ShellOutline::circle;
  throw InputError("`outline` {}: must be body or circle", name);
}

RadiiRule parse_radii_rule(const std::string& name) {
  if (name == "equal-area") return RadiiRule::equal_area;
  if (name == "equal-thickness") return RadiiRule::equal_thickness;
  if (name == "near-skin") return RadiiRule::near_skin;
  reject_radii(name);
}

std::vector<double> centre_of(const VesselTree& tree, RayLayout ray_layout) {
  const glm::dvec3 centre_mm = centroid_mm(tree);
  std::vector<double> numbers{centre_mm.x, centre_mm.y};
  if (ray_layout == RayLayout::sphere) numbers.push_back(centre_mm.z);
  return numbers;
}

void Casting::describe(const std::string& source, const std::string& frame_of_reference_uid) {
  const auto set = [&](auto& file) {
    file.source = source + motion.suffix();
    file.frame_of_reference_uid = frame_of_reference_uid;
  };
  set(map);
  if (basis) set(*basis);
}

void check(const CastRequest& request) {
  check_applies(request);
  check_values(request);
  check_iodine(request.iodine, request.opacity);
  check_instant(request);
  resolve_knots(request);
  MapGeometry of_one_row;
  of_one_row.ray_layout = request.projection;
  of_one_row.width = request.angles.value_or(kAngles);
  of_one_row.height = 1;
  of_one_row.views = request.views.value_or(kViews);
  of_one_row.radii_mm = resolve_radii(request, request.radius_mm.value_or(1));
  of_one_row.centre_mm = {request.centre_mm.empty() ? glm::dvec2(0)
                                                    : glm::dvec2(request.centre_mm[0], request.centre_mm[1])};
  validate(of_one_row, "map");
}

bool takes_resident(const CastRequest& request, const VolumeGeometry& volume, const ComputeDevice& device) {
  return request.iodine.empty() && request.without_vessels.empty() && !request.motion.is_given() &&
         resident_bytes(volume) <= memory_limit_B(request, device);
}

OutlineFinder outline_finder(const CastRequest& request, const VolumeGeometry& volume) {
  return OutlineFinder(volume, {.finds_skin = request.has_body_outline(), .keeps_table = request.keep_table});
}

Casting cast(const CastRequest& request, const SpectralScan& scan, const OutlineFinder& body,
             const SliceSource::HuRange& hu, Progress& progress) {
  check(request);
  Casting casting{.notes = opacity_hints(request.opacity, hu)};
  const Stopwatch finding;
  const MapGeometry geometry = resolve_shells(request, scan.native.geometry(), body, casting);
  casting.outline_ms = finding.ms();
  const auto* opacity = std::get_if<Opacity>(&request.opacity);
  if (request.makes_map) put(cast(scan, geometry, request.opacity, progress), casting);
  if (request.knots_hu) {
    const Stopwatch making;
    casting.basis = make_basis(scan.native, geometry, resolve_knots(request), progress);
    casting.basis_ms = making.ms();
  }
  if (request.measures_outside && opacity && geometry.has_outline() && geometry.centre_mm.size() == 1) {
    const Stopwatch projecting;
    casting.outside_share = share_outside(scan.native, geometry, *opacity, progress);
    casting.outline_ms += projecting.ms();
  }
  casting.left_out = left_out_of(geometry, casting.outside_share, request.keep_table);
  return casting;
}

namespace {

/// Throws InputError for displacements that do not cover the body; warns of what else is worth a look. Each
/// mode at each of its fields, the others at rest.
std::vector<std::string> checked(const Motion& motion, const Volume& volume) {
  std::vector<std::string> warnings = motion.warnings();
  for (std::size_t m = 0; m < motion.modes().size(); ++m)
    for (const KeyPhase& key : motion.modes()[m].keys) {
      std::vector<double> phases(motion.modes().size(), 0.0);
      phases[m] = key.phase;
      const HeldMotion held = motion.held_at(phases);
      if (!key.moves || held.is_still()) continue;
      for (std::string& warning : check_motion(volume, held, motion.name()))
        if (std::ranges::find(warnings, warning) == warnings.end()) warnings.push_back(std::move(warning));
    }
  return warnings;
}

/// The key maps of a motion.
Casting cast_moving(const CastRequest& request, const ScanOpener& open, ComputeDevice& device,
                    Progress& progress) {
  const Motion motion = read_motion(request.motion.motion);
  const KeyPhases phases = key_phases(motion, request.keys);
  Scan scan = open_scan_of(request, {}, open, progress);
  const VolumeGeometry grid = scan.source->geometry();
  if (const std::int64_t limit_B = memory_limit_B(request, device); resident_bytes(grid) > limit_B)
    throw InputError(
        "`motion`: key maps need the whole scan in memory, {} MB of {}; raise `memory_limit_B`, or convert "
        "the "
        "scan to larger voxels",
        resident_bytes(grid) >> 20, limit_B >> 20);
  Casting casting;
  const Stopwatch reading;
  const Volume volume = collect(*scan.source, progress);
  casting.notes = checked(motion, volume);
  const double read_ms = reading.ms();
  OutlineFinder finder = outline_finder(request, grid);
  VolumeSource slices(volume);
  const SpectralScan resident = load(device, slices, request.iodine, finder, casting.load, progress);
  casting.load.read_ms += read_ms;

  const Stopwatch finding;
  std::vector<glm::dvec3> skin_mm;
  if (request.has_body_outline()) skin_mm = moved_skin_mm(finder, grid, motion, phases);
  const MapGeometry geometry = resolve_shells(request, grid, finder, casting, skin_mm);
  casting.outline_ms = finding.ms();
  if (request.makes_map)
    put(cast_keys(resident, geometry, request.opacity, motion, phases, progress), casting);
  if (request.knots_hu) {
    const Stopwatch making;
    casting.basis =
        make_key_basis(resident.native, geometry, resolve_knots(request), motion, phases, progress);
    casting.basis_ms = making.ms();
  }
  casting.left_out = left_out_of(geometry, {}, request.keep_table);
  const SliceSource::HuRange hu = scan.source->hu_range();
  std::ranges::move(opacity_hints(request.opacity, hu), std::back_inserter(casting.notes));
  std::ranges::move(hu.warnings(), std::back_inserter(casting.notes));
  return casting;
}

Casting cast_at(const MotionOfRequest& motion, const CastRequest& request, const ScanOpener& open,
                ComputeDevice& device, Progress& progress) {
  Scan scan = open_scan_of(request, motion, open, progress);
  const VolumeGeometry volume = scan.source->geometry();
  const std::int64_t limit_B = memory_limit_B(request, device);
  if (resident_bytes(volume) > limit_B || is_best_by_slabs(request, volume))
    return cast_slabs(request, motion, open, std::move(scan), limit_B, device, progress);
  OutlineFinder finder = outline_finder(request, volume);
  LoadTimings load_timings;
  const SpectralScan resident =
      load(device, *scan.source, request.iodine, finder, load_timings, progress, motion.held);
  Casting casting = cast(request, resident, finder, scan.source->hu_range(), progress);
  std::ranges::move(scan.source->hu_range().warnings(), std::back_inserter(casting.notes));
  std::ranges::move(scan.info.warnings, std::back_inserter(casting.notes));
  casting.load = load_timings;
  return casting;
}

}  // namespace

Casting cast(const CastRequest& request, const ScanOpener& open, ComputeDevice& device, Progress& progress) {
  check(request);
  if (request.moves()) return cast_moving(request, open, device, progress);
  MotionOfRequest motion = held_motion(request.motion);
  Casting casting = cast_at(motion, request, open, device, progress);
  casting.motion = std::move(motion);
  return casting;
}

}  // namespace xraycast
