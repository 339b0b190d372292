#include "xraycast/window/opened_files.hpp"

#include "xraycast/casting/basis_file.hpp"
#include "xraycast/casting/body_fit.hpp"
#include "xraycast/casting/caster.hpp"
#include "xraycast/scan/scan.hpp"
#include "xraycast/scene/catheter_surface.hpp"
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

/// The parameters of a map of a scan.
struct CastParameters {
  OutlineFinder body;
  Opacity opacity;
};

/// Uploads the scan to a device.
CastParameters load_scan(OpenedFiles& opened, const std::string& device, Progress& progress) {
  const Scan scan = open_scan(opened.session.scan, {}, progress);
  opened.warnings = scan.info.warnings;
  check_scan(opened, scan.source->geometry());
  OutlineFinder finder(scan.source->geometry(), {.finds_skin = true});
  LoadTimings timings;
  opened.scan = std::make_shared<OpenedFiles::ScanOnDevice>(device);
  opened.scan->scan.emplace(load(opened.scan->device, *scan.source, finder, timings, progress));
  std::ranges::copy(scan.source->hu_range().warnings(), std::back_inserter(opened.warnings));
  const bool is_subtracted = scan.source->hu_range().is_subtracted();
  return {std::move(finder), is_subtracted ? Opacity::subtracted() : Opacity::paper()};
}

void cast_scan(OpenedFiles& opened, const CastParameters& parameters, const std::string& device,
               Progress& progress) {
  constexpr int kLayers = 16, kAngles = 360;  // ribs show, and a frame takes a quarter longer than one of 8
  const ResidentScan& scan = *opened.scan->scan;
  const auto& [body, opacity] = parameters;
  const MapGeometry geometry = body_map(scan.geometry(), kAngles, kLayers, body);
  opened.map = std::make_shared<BodyMap>(cast(scan, geometry, opacity, progress).map);
  opened.recast = std::make_shared<OpenedFiles::RecastOnDevice>(
      device, make_basis(scan, geometry, useful_knots_hu(opacity), progress));
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
  else if (!session.vessels.empty() &&
           (session.steered || std::filesystem::exists(session.vessels / "tree.vtp")))
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

}  // namespace

OpenedFiles open_files(const ViewSession& session, const OpenedFiles& before, const std::string& device,
                       Progress& progress) {
  OpenedFiles opened;
  opened.session = session;
  const bool is_same_scan = session.scan == before.session.scan && before.scan;
  open_vessels(opened, before);
  open_catheter(opened, before);
  open_map_and_basis(opened, before, is_same_scan, device);
  if (is_same_scan && opened.map) {
    check_scan(opened, before.scan->scan->geometry());
    opened.scan = before.scan;
  } else if (!session.scan.empty()) {
    const CastParameters parameters = load_scan(opened, device, progress);
    if (!opened.map) cast_scan(opened, parameters, device, progress);
  }
  return opened;
}

}  // namespace xraycast
