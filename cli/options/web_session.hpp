#pragma once

#include "xraycast/export/web_page.hpp"
#include "xraycast/scene/session_file.hpp"

#include <string>

namespace xraycast::cli {

/// Throws InputError for a map that a page cannot hold, with the option that makes it fit.
void check_web_map(const BodyMap& map, const std::string& name);

/// Throws InputError for a --web-host that browsers cannot have as the host of an address.
void check_web_host(const std::string& name);

/// Throws InputError for a surface that a page cannot hold, or of another scan than the map's.
void check_web_surface(const Surface& surface, const BodyBounds& bounds, const std::string& name);

/// The page of a session that goes on while it is open (see `serve --web`), from --vessels of its scene; it
/// begins from the pose given. The map is one that check_web_map accepts. Throws InputError for vessels
/// that a page cannot hold.
std::string live_page(const ViewSession& scene, const CArmPose& pose,
                      const std::shared_ptr<const BodyMap>& map, const VesselTree& tree,
                      const std::vector<InstrumentModel>& devices, bool has_hub);

/// What a page shows where it cannot draw. It takes an OpenGL context of its own.
std::string still_png(const WebSession& web);

}  // namespace xraycast::cli
