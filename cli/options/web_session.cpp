#include "options/web_session.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/png_file.hpp"
#include "xraycast/drawing/brightness.hpp"
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/scene/contrast_surface.hpp"
#include "xraycast/scene/vessels.hpp"

#include <algorithm>

namespace xraycast::cli {
namespace {

void check_contrast(const ContrastSurface& contrast, const std::string& name) {
  const std::size_t triangles = contrast.drums() * ContrastSurface::kDrumTriangles;
  if (triangles > kMostWebTriangles)
    throw InputError("{}: {} triangles of contrast agent, but a page holds at most {}; give a shorter tree",
                     name, triangles, kMostWebTriangles);
}

}  // namespace

void check_web_map(const BodyMap& map, const std::string& name) {
  const MapGeometry& geometry = map.geometry;
  if (map.spectrum())
    throw InputError(
        "{}: holds materials for a spectrum, which a page cannot draw; cast it with --opacity paper", name);
  if (geometry.projection != Projection::cylinder)
    throw InputError("{}: a page shows cylinder maps alone; cast it with --projection cylinder", name);
  if (!suits_web(map))
    throw InputError("{}: a page shows maps about a straight axis alone; cast it without --centre-line",
                     name);
  if (geometry.width > kMostWebAngles)
    throw InputError("{}: {} angles, but a page holds at most {}; cast it with --angles {}", name,
                     geometry.width, kMostWebAngles, kMostWebAngles);
  if (geometry.height > kMostWebRows)
    throw InputError(
        "{}: {} rows, one a slice, but a page holds at most {}; cast a scan that is resampled to "
        "thicker slices",
        name, geometry.height, kMostWebRows);
  const std::int64_t area = std::int64_t{geometry.width} * geometry.height;
  static_assert(std::int64_t{kMostWebAngles} * kMostWebRows <= kMostWebTexels);  // one layer always fits
  const std::int64_t most_layers = std::min<std::int64_t>(kMostWebLayers, kMostWebTexels / area);
  if (geometry.layers() > most_layers)
    throw InputError(
        "{}: {} of {} x {} texels, but a page holds at most {} of them; cast it with --layers {}", name,
        pluralize(geometry.layers(), "layer"), geometry.width, geometry.height, most_layers, most_layers);
}

void check_web_host(const std::string& name) {
  const auto colons = std::ranges::count(name, ':');
  const bool is_v6 = name.starts_with('[') && name.find(']') != std::string::npos;
  if (name.empty() || name.find_first_of("/@ ") != std::string::npos || (colons > 1 && !is_v6))
    throw InputError(
        "--web-host {}: give the name or address alone, or NAME:PORT, without http://; IPv6 in brackets",
        name);
}

void check_web_surface(const Surface& surface, const BodyBounds& bounds, const std::string& name) {
  if (surface.mesh.triangles.size() > kMostWebTriangles)
    throw InputError("{}: {} triangles, but an export holds at most {}; segment again with fewer --triangles",
                     name, surface.mesh.triangles.size(), kMostWebTriangles);
  if (!notes_on_place(surface.mesh.points_mm, bounds, name).empty())
    throw InputError("{}: most of it lies outside the body map; give the vessels of the scan that was cast",
                     name);
}

std::string still_png(const WebSession& web) {
  constexpr int kWidth = 480, kHeight = 360;
  HeadlessContext context;
  Renderer renderer;
  renderer.set_map(web.map);
  std::vector<Surface> surfaces;
  if (web.vessels && web.shows_vessels) surfaces.push_back(*web.vessels);
  surfaces.insert(surfaces.end(), web.catheters.begin(), web.catheters.end());
  renderer.set_surfaces(surfaces);
  const View view = view_of(web.camera, bounds_of(web.map->geometry), kWidth, kHeight);
  Style style = web.style;
  style.sampling = {};
  if (!web.has_window) style.window = automatic_window(renderer, view, style);
  return png_bytes(renderer.picture(view, style), kWidth, kHeight, 3);
}

std::string live_page(const ViewSession& scene, const Camera& camera,
                      const std::shared_ptr<const BodyMap>& map, const VesselTree& tree,
                      const std::vector<InstrumentModel>& devices, bool has_hub) {
  WebSession web;
  web.title = "Live fluoroscopy";
  web.map = map;
  web.vessels =
      std::filesystem::is_directory(scene.vessels)
          ? read_vessels(scene.vessels, scene.contrast_mg_ml)
          : Surface{.mesh = tube_mesh(tree), .mu_per_mm = fluoroscopy_per_mm("I", scene.contrast_mg_ml)};
  check_web_surface(*web.vessels, bounds_of(map->geometry), scene.vessels.string());
  const ContrastSurface contrast(tree);
  check_contrast(contrast, scene.vessels.string());
  web.live = LiveRun{.devices = devices, .contrast = contrast.whole(), .has_hub = has_hub};
  web.camera = camera;
  web.is_of_session = true;
  web.style = scene.style;
  web.has_window = scene.has_window;
  web.shows_vessels = false;
  web.still_png = still_png(web);
  return web_page(web);
}

}  // namespace xraycast::cli
