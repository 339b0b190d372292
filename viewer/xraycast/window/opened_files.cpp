#include "xraycast/window/opened_files.hpp"

#include "xraycast/casting/basis_file.hpp"
#include "xraycast/requests/cast_request.hpp"
#include "xraycast/scan/scan.hpp"
#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/map_motion.hpp"
#include "xraycast/scene/same_scan.hpp"
#include "xraycast/scene/vessels.hpp"

#include <algorithm>
#include <iterator>

namespace xraycast {
namespace {

void check_scan(const OpenedFiles& opened, const VolumeGeometry& scan) {
  if (!opened.session.map.empty())
    check_same_scan(opened.map->geometry, opened.session.map.string(), scan, opened.session.scan.string());
}

/// What was seen of a scan on its way to the device.
struct SeenScan {
  OutlineFinder body;
  SliceSource::HuRange hu;
};

/// Uploads the scan to a device.
SeenScan load_scan(OpenedFiles& opened, const std::string& device, Progress& progress) {
  const Scan scan = open_scan(opened.session.scan, {}, progress);
  opened.warnings = scan.info.warnings;
  check_scan(opened, scan.source->geometry());
  OutlineFinder finder(scan.source->geometry(), {.finds_skin = true});
  LoadTimings timings;
  opened.scan = std::make_shared<OpenedFiles::ScanOnDevice>(device);
  opened.scan->scan = SpectralScan{load(opened.scan->device, *scan.source, finder, timings, progress), {}};
  std::ranges::copy(scan.source->hu_range().warnings(), std::back_inserter(opened.warnings));
  return {std::move(finder), scan.source->hu_range()};
}

void cast_scan(OpenedFiles& opened, const SeenScan& seen, const std::string& device, Progress& progress) {
  CastRequest request{.outline = ShellOutline::body, .knots_hu = std::vector<double>()};
  request.layers = 16;  // ribs show, and a frame takes a quarter longer than one of 8
  if (seen.hu.is_subtracted()) request.opacity = Opacity::subtracted();
  Casting casting = cast(request, *opened.scan->scan, seen.body, seen.hu, progress);
  opened.map = std::make_shared<BodyMap>(std::move(casting.map));
  opened.recast = std::make_shared<OpenedFiles::RecastOnDevice>(device, std::move(*casting.basis));
}

void open_vessels(OpenedFiles& opened, const OpenedFiles& before) {
  const ViewSession &session = opened.session, &last = before.session;
  const bool is_same = session.vessels == last.vessels;
  if (!session.vessels.empty() && !session.steered)
    opened.vessels = is_same && session.contrast_mg_ml == last.contrast_mg_ml && before.vessels
                         ? before.vessels
                         : std::make_shared<Surface>(read_vessels(session.vessels, session.contrast_mg_ml));
  if (is_same && before.tree)
    opened.tree = before.tree;
  else if (!session.vessels.empty() && (session.steered || !tree_file_in(session.vessels).empty()))
    opened.tree = std::make_shared<VesselTree>(read_tree(session.vessels));
}

void open_catheter(OpenedFiles& opened, const OpenedFiles& before) {
  const ViewSession &session = opened.session, &last = before.session;
  if (session.steered)
    opened.steered = steered_surfaces(*session.steered);
  else if (!session.catheter.empty())
    opened.catheter = session.catheter == last.catheter && before.catheter && !last.steered
                          ? before.catheter
                          : std::make_shared<Surface>(read_catheter(session.catheter));
}

void open_implants(OpenedFiles& opened, const OpenedFiles& before) {
  opened.implants = before.implants && opened.session.implants == before.session.implants
                        ? before.implants
                        : std::make_shared<const std::vector<Surface>>(
                              surfaces_of(read_implants(opened.session.implants, opened.warnings)));
}

void open_map_and_basis(OpenedFiles& opened, const OpenedFiles& before, bool is_same_scan,
                        const std::string& device) {
  const ViewSession &session = opened.session, &last = before.session;
  const bool is_same_map = session.map == last.map && before.map && (!session.map.empty() || is_same_scan);
  if (is_same_map)
    opened.map = before.map;
  else if (!session.map.empty())
    opened.map = std::make_shared<BodyMap>(read_body_map(session.map));
  if (is_same_map && session.basis == last.basis)
    opened.recast = before.recast;
  else if (!session.basis.empty())
    opened.recast = std::make_shared<OpenedFiles::RecastOnDevice>(device, read_basis(session.basis));
  if (opened.recast && !session.map.empty())
    check_same_scan(opened.map->geometry, session.map.string(), opened.recast->basis.geometry,
                    session.basis.string());
}

/// Vessels follow the map. Those that are not drawn, because a catheter is steered, need not.
void open_motion(OpenedFiles& opened, const OpenedFiles& before, const std::shared_ptr<const Motion>& given,
                 Progress& progress) {
  if (!opened.map) return;
  if (!opened.map->keys) {
    if (given && opened.map != before.map)
      opened.warnings.emplace_back(
          "the map stands still; one by `xraycast cast --motion` without --phase and --time moves");
    return;
  }
  if (opened.map == before.map) {
    opened.motion = before.motion;
  } else if (given) {
    check_same_modes(*opened.map, *given);
    opened.motion = given;
  } else {
    opened.motion = motion_of(*opened.map, {}, opened.warnings);
  }
  if (!opened.motion || !opened.vessels) return;
  const bool is_same = opened.vessels == before.vessels && opened.motion == before.motion;
  opened.moving_vessels =
      is_same && before.moving_vessels
          ? before.moving_vessels
          : std::make_shared<const MovingPoints>(opened.vessels->mesh.points_mm, *opened.motion, progress);
}

}  // namespace

OpenedFiles open_files(const ViewSession& session, const OpenedFiles& before, const std::string& device,
                       Progress& progress, const std::shared_ptr<const Motion>& motion) {
  OpenedFiles opened;
  opened.session = session;
  const bool is_same_scan = session.scan == before.session.scan && before.scan;
  open_vessels(opened, before);
  open_catheter(opened, before);
  open_implants(opened, before);
  open_map_and_basis(opened, before, is_same_scan, device);
  if (is_same_scan && opened.map) {
    check_scan(opened, before.scan->scan->native.geometry());
    opened.scan = before.scan;
  } else if (!session.scan.empty()) {
    const SeenScan seen = load_scan(opened, device, progress);
    if (!opened.map) cast_scan(opened, seen, device, progress);
  }
  open_motion(opened, before, motion, progress);
  return opened;
}

}  // namespace xraycast
