#include "xraycast/viewer/scene.hpp"

#include "xraycast/error.hpp"

namespace xraycast {

Look look_named(const std::string& name) {
  if (name == "surface") return Look::surface;
  if (name == "fluoro") return Look::fluoro;
  throw InputError("'{}' is not a look; there are surface and fluoro", name);
}

Compositing compositing_named(const std::string& name) {
  if (name == "wall") return Compositing::wall;
  if (name == "path") return Compositing::path;
  throw InputError("'{}' is not a compositing of body maps; there are wall and path", name);
}

std::string to_string(Look look) { return look == Look::surface ? "surface" : "fluoro"; }

std::string to_string(Compositing compositing) { return compositing == Compositing::wall ? "wall" : "path"; }

}  // namespace xraycast
