#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/export/recorded_run.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"
#include "xraycast/scene/scene.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// A run that goes on while the page is open, of which `serve --web` tells the page (see BrowserMessage).
struct LiveRun {
  std::vector<InstrumentModel> devices;  ///< from the outermost on
  Surface contrast;                      ///< all drums of a ContrastSurface
  bool has_hub = true;                   ///< the page moves the hubs; otherwise something else does
};

/// A session as a web page shows it.
struct WebSession {
  std::string title;
  std::shared_ptr<const BodyMap> map;
  MapPrecision precision = MapPrecision::byte;  ///< of the page's copy of the map: byte or float16
  std::optional<Surface> vessels{};
  std::vector<Surface> catheters{};  ///< that do not move
  std::optional<RecordedRun> run{};
  std::optional<LiveRun> live{};
  CArmPose pose{};
  Style style{};
  bool has_window =
      false;  ///< style.window was chosen; otherwise it is automatic, but for gamma and inversion
  bool is_of_session = false;  ///< the pose is one that a viewer saved; otherwise it shows the whole body
  /// As a lumen that holds contrast agent; as an outline. Over a run it is the outline alone, as in the
  /// operating room.
  bool shows_vessels = true, shows_road_map = false;
  std::string still_png{};  ///< what is shown where the page cannot draw
};

/// What a page may hold, so that it opens on a telephone: texels of a map, which become three times as many
/// 16-bit floats on the GPU; sizes that every WebGL 2 takes; and triangles of a surface.
inline constexpr std::int64_t kMostWebTexels = 16'777'216;
inline constexpr int kMostWebAngles = 2047, kMostWebRows = 8192, kMostWebLayers = 128;
inline constexpr std::size_t kMostWebTriangles = 2'000'000;

/// Whether a page can show a map at all: a cylinder about a straight axis under one outline, with optical
/// depths.
bool suits_web(const BodyMap& map);

/// The page: one HTML file that loads nothing else. The map suits, and is within the limits. Throws Error
/// when there is not enough memory to pack it.
std::string web_page(const WebSession& session);

}  // namespace xraycast
