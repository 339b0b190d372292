#include "xraycast/scene/session_map.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/casting/basis_file.hpp"
#include "xraycast/casting/recast.hpp"
#include "xraycast/scene/same_scan.hpp"

#include <utility>

namespace xraycast {

std::shared_ptr<const BodyMap> load_map(const ViewSession& session, const std::string& device) {
  auto map = std::make_shared<BodyMap>(read_body_map(session.map));
  const auto& weights = session.style.layer_weights;
  if (!weights.empty() && weights.size() != static_cast<std::size_t>(map->geometry.layers()))
    throw InputError("{} for the {} of {}; give one per layer", pluralize(weights.size(), "layer weight"),
                     pluralize(map->geometry.layers(), "layer"), session.map.string());
  if (!session.opacity || session.basis.empty()) return map;
  ComputeDevice opened(device);
  const Basis basis = read_basis(session.basis);
  check_same_scan(map->geometry, session.map.string(), basis.geometry, session.basis.string());
  RecastSession recast(opened, basis);
  auto recast_map = std::make_shared<BodyMap>(recast.recast(*session.opacity));
  if (!recast_map->keys) recast_map->precision = map->precision;
  return recast_map;
}

}  // namespace xraycast
