#pragma once

#include "xraycast/motion/motion_request.hpp"
#include "xraycast/scene/implant.hpp"
#include "xraycast/scene/scene.hpp"
#include "xraycast/scene/session_file.hpp"

#include <nanobind/nanobind.h>
#include <optional>
#include <vector>

namespace xraycast::python {

namespace nb = nanobind;

using InstrumentShape = SteeredInstruments::Instrument;

/// The arguments that say what lies in the body, as they were given.
struct SceneArguments {
  nb::object vessels, instruments;
  double contrast_mg_ml = kUsualContrast_mg_ml;
  MotionRequest motion{};  ///< of the vessels
  nb::object objects = nb::none();
};

/// The same as surfaces.
struct HeldScene {
  std::optional<Surface> vessels;
  std::vector<Surface> instruments;
  MotionOfRequest motion{};
  std::vector<Implant> implants{};

  /// Vessels and instruments, where no mask is taken.
  std::vector<Surface> all() const;
};

/// Vessels are Vessels, a VesselTree, a Mesh or a path; instruments are a Catheter, CoaxialInstruments, an
/// InstrumentShape, or a list of these, and objects a list of Implant, which do not move with the body.
/// Throws InputError, naming the argument.
HeldScene scene_of(const SceneArguments& arguments);

/// InstrumentShape and Implant.
void add_scene(nb::module_& module);

}  // namespace xraycast::python
