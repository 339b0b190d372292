#include "options/session_map.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/casting/basis_file.hpp"
#include "xraycast/casting/recast.hpp"
#include "xraycast/scene/same_scan.hpp"

#include <utility>

namespace xraycast::cli {

std::shared_ptr<const BodyMap> load_map(const ViewSession& scene, const Invocation& invocation) {
  auto map = std::make_shared<BodyMap>(read_body_map(scene.map));
  const auto& weights = scene.style.layer_weights;
  if (!weights.empty() && weights.size() != static_cast<std::size_t>(map->geometry.layers()))
    throw InputError("{} for the {} of {}; give one per layer", pluralize(weights.size(), "layer weight"),
                     pluralize(map->geometry.layers(), "layer"), scene.map.string());
  if (!scene.opacity || scene.basis.empty()) return map;
  ComputeDevice device(invocation.device);
  const Basis basis = read_basis(scene.basis);
  check_same_scan(map->geometry, scene.map.string(), basis.geometry, scene.basis.string());
  RecastSession recast(device, basis);
  auto recast_map = std::make_shared<BodyMap>(recast.recast(*scene.opacity));
  recast_map->precision = map->precision;
  return recast_map;
}

}  // namespace xraycast::cli
