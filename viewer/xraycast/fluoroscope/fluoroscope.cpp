#include "xraycast/fluoroscope/fluoroscope.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/display/display_chain.hpp"
#include "xraycast/fluoroscope/blur_stage.hpp"
#include "xraycast/fluoroscope/detector_view.hpp"
#include "xraycast/fluoroscope/electronics_stage.hpp"
#include "xraycast/fluoroscope/lag_stage.hpp"
#include "xraycast/fluoroscope/quanta_stage.hpp"
#include "xraycast/fluoroscope/scatter_stage.hpp"
#include "xraycast/fluoroscope/xray_generator.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <utility>

namespace xraycast {
namespace {

void check_distances(const Cone& distances) {
  constexpr double kLeast_mm = 200;  // as for C-arms
  if (!(distances.source_axis_mm >= kLeast_mm))
    throw InputError(
        "the source is {:g} mm from the isocentre: a fluoroscope's is at least {:g} mm away; increase the "
        "first distance",
        distances.source_axis_mm, kLeast_mm);
}

/// A parallel view is magnified as what lies at the isocentre.
double pixel_on_detector_mm(const View& view, const Cone& distances) {
  return view.cone ? view.pixel_mm : view.pixel_mm * distances.source_detector_mm / distances.source_axis_mm;
}

double at_isocentre_mm(double on_detector_mm, const Cone& distances) {
  return on_detector_mm * distances.source_axis_mm / distances.source_detector_mm;
}

/// Whether the body lies elsewhere in the picture, by more than half a pixel: frames averaged over time would
/// show it twice.
bool is_moved(const View& before, const View& now) {
  constexpr double kLever_mm = 150, kLeast_pixels = 0.5;  // of a body's side about the axis
  const double turned_rad = std::abs(std::remainder(now.lao_rad - before.lao_rad, 2 * std::numbers::pi)) +
                            std::abs(now.cranial_rad - before.cranial_rad);
  return glm::distance(now.centre_mm, before.centre_mm) + kLever_mm * turned_rad >
         kLeast_pixels * now.pixel_mm;
}

/// The stages behind the tube, in their order, for pictures of one size.
struct DetectionChain {
  DetectionChain(const FluoroscopyOptions& options, const View& view)
      : seen(options, view),
        absorption(seen.size),
        quanta(options.stages.quanta, options.seed),
        blur(options.stages.blur ? BlurStage(seen.size, view.pixel_mm, options.c_arm) : BlurStage(seen.size)),
        electronics(options.stages.electronics, options.c_arm.detector, view.pixel_mm, options.seed),
        display(seen.size, at_isocentre_mm(view.pixel_mm, options.c_arm.distances),
                options.range_compression()) {
    if (options.stages.scatter) scatter.emplace(seen, options.c_arm.grid);
    if (options.stages.lag) lag.emplace(seen.size, options.c_arm.detector.lag, options.pulses_per_s);
  }

  DetectorView seen;
  AbsorptionStage absorption;
  std::optional<ScatterStage> scatter;
  QuantaStage quanta;
  BlurStage blur;
  std::optional<LagStage> lag;
  ElectronicsStage electronics;
  DisplayChain display;
};

}  // namespace

struct Fluoroscope::State {
  State(FluoroscopyOptions options, const View& first_view, WaterPath path)
      : generator(std::move(options), std::move(path)) {
    set_view(first_view);
  }

  void set_view(const View& next);
  void set_picture(const std::optional<Collimation>& collimation, std::optional<double> compression);
  const FluoroscopyFrame& expose(const RayDepths& rays);
  void settle(const RayDepths& rays);
  void begin_run(double pause_s);

  // The steps of a pulse.
  void pass_patient(const RayDepths& rays);
  void absorb_quanta(const QuantaStage& quanta);
  enum class Use { measured, fills_traps, read_out };
  void collect_light(Use use);
  void show();

  XrayGenerator generator;
  View view;
  std::optional<DetectionChain> chain;
  std::uint32_t frame_number = 0;
  bool is_held = false;
  FluoroscopyFrame frame;
};

void Fluoroscope::State::set_view(const View& next) {
  const Cone distances = next.cone.value_or(generator.options().c_arm.distances);
  const bool is_other = next.width != view.width || next.height != view.height ||
                        next.pixel_mm != view.pixel_mm || distances != generator.options().c_arm.distances;
  if (next.cone) check_distances(distances);
  if (is_other) {
    const double pixel_mm = pixel_on_detector_mm(next, distances);
    FluoroscopyOptions moved = generator.options();
    moved.c_arm.distances = distances;
    View on_detector = next;
    on_detector.pixel_mm = pixel_mm;
    DetectionChain other(moved, on_detector);  // which may throw, and then nothing has changed
    generator.set_detector(distances, pixel_mm);
    chain = std::move(other);
  } else if (is_moved(view, next)) {
    chain->display.forget();
  }
  view = next;
  if (!is_other) return;
  const std::size_t pixels = chain->seen.size.pixels();
  frame.mean_kev = 0;
  frame.signal_kev.assign(pixels, 0);
  frame.logarithm.assign(pixels, 0);
  frame.codes.assign(pixels, 0);
  frame.shown.assign(pixels, 0);
}

void Fluoroscope::State::set_picture(const std::optional<Collimation>& collimation,
                                     std::optional<double> compression) {
  FluoroscopyOptions options = generator.options();
  options.collimation = collimation;
  options.compression = compression;
  check(options);
  View on_detector = view;
  on_detector.pixel_mm = pixel_on_detector_mm(view, options.c_arm.distances);
  DetectionChain other(options, on_detector);  // which may throw, and then nothing has changed
  other.lag = std::move(chain->lag);
  generator.set_picture(collimation, compression);
  chain = std::move(other);
}

// ---- a pulse --------------------------------------------------------------------------------------------

/// Shares of the open field behind the patient, blurred along the rows, and what scatters.
void Fluoroscope::State::pass_patient(const RayDepths& rays) {
  DetectionChain& stages = *chain;
  const DetectorView& seen = stages.seen;
  const BeamAndTable beam = generator.beam_and_table();
  stages.absorption.begin(beam, rays);
  for_bands(seen.size, [&](int first, int end) {
    for (int j = first; j < end; ++j) {
      stages.absorption.absorb_row(j, beam, rays);
      const float* const share = stages.absorption.share.data() + seen.size.row(j);
      if (stages.scatter) stages.scatter->gather_row(j, share, seen.field.data() + seen.size.row(j));
      stages.blur.primary.pass_along(j, share);
    }
    if (stages.scatter) stages.scatter->weigh_band(first, *beam.table, generator.path());
  });
  if (stages.scatter) stages.scatter->spread();
}

/// The energy of the quanta in every pixel, as light that has spread along the rows.
void Fluoroscope::State::absorb_quanta(const QuantaStage& quanta) {
  DetectionChain& stages = *chain;
  const DetectorView& seen = stages.seen;
  const AbsorptionStage& absorption = stages.absorption;
  const double open_quanta = generator.open_quanta();
  for_bands(seen.size, [&](int first, int end) {
    thread_local PixelPlane primary, scattered, energy_kev;
    for (PixelPlane* row : {&primary, &scattered, &energy_kev})
      row->assign(static_cast<std::size_t>(seen.size.width), 0.0f);
    for (int j = first; j < end; ++j) {
      const std::size_t at = seen.size.row(j);
      stages.blur.primary.pass_down(j, 1, primary.data());
      if (stages.scatter) stages.scatter->row(j, scattered.data());
      quanta.absorb_row({primary.data(), seen.field.data() + at, scattered.data(),
                         absorption.mean_kev.data() + at, absorption.spread_kev.data() + at},
                        open_quanta, at, frame_number, energy_kev);
      stages.blur.scintillate_along(j, energy_kev.data());
    }
  });
}

/// The signal in every pixel, measured by the exposure control, which keeps no charge of earlier pulses, and
/// then used.
void Fluoroscope::State::collect_light(Use use) {
  DetectionChain& stages = *chain;
  DetectorView& seen = stages.seen;
  const int width = seen.size.width;
  if (use == Use::read_out) {
    stages.electronics.set_full_scale(generator.full_scale_kev());
    const auto& [codes_per_kev, dark, most] = stages.electronics.digitiser();
    const auto quantum_kev = static_cast<float>(generator.beam_and_table().beam->open.mean_kev());
    stages.display.set_codes(generator.options().c_arm.detector.bits,
                             {.dark = dark,
                              .electronic = stages.electronics.rms_kev() * codes_per_kev,
                              .per_code = quantum_kev * codes_per_kev});
  }
  for_bands(seen.size, [&](int first, int end) {
    for (int j = first; j < end; ++j) {
      const std::size_t at = seen.size.row(j);
      float* const signal = frame.signal_kev.data() + at;
      stages.blur.scintillate_down(j, signal);
      seen.measured.measure_row(j, signal, stages.absorption.share.data() + at, seen.field.data() + at);
      if (use == Use::fills_traps && stages.lag) stages.lag->fill_row(j, signal);
      if (use != Use::read_out) continue;
      if (stages.lag) stages.lag->hold_row(j, signal);
      stages.electronics.read_row(at, frame_number, width, signal, frame.codes.data() + at);
      stages.display.take_logarithm(frame.codes.data() + at, width, frame.logarithm.data() + at);
    }
  });
  frame.mean_kev = seen.measured.take_mean();
}

void Fluoroscope::State::show() {
  DetectionChain& stages = *chain;
  const FluoroscopyOptions& options = generator.options();
  const auto logarithm_of = [&](double kev) {
    return std::log(std::max(1.0, kev * stages.electronics.digitiser().codes_per_kev));
  };
  const double open_kev = generator.open_quanta() * generator.beam_and_table().beam->open.mean_kev();
  stages.display.show({.logarithm = frame.logarithm,
                       .left = stages.absorption.share,
                       .field = stages.seen.field,
                       .codes = &frame.codes},
                      {.measured = logarithm_of(frame.mean_kev),
                       .open = logarithm_of(std::min(open_kev, generator.full_scale_kev()))},
                      options.dose == DoseLevel::cine, options.stages.display, frame.shown.data());
}

const FluoroscopyFrame& Fluoroscope::State::expose(const RayDepths& rays) {
  pass_patient(rays);
  absorb_quanta(chain->quanta);
  collect_light(Use::read_out);
  show();
  frame.is_saturated = frame.mean_kev > generator.full_scale_kev();
  frame.technique = generator.technique();
  generator.count_pulse(chain->seen.open_area_cm2);
  ++frame_number;
  generator.follow(frame.mean_kev, is_held);
  return frame;
}

void Fluoroscope::State::settle(const RayDepths& rays) {
  constexpr int kMostPulses = 8;
  const bool follows = generator.options().is_automatic() && !is_held;
  for (int pulse = 0; follows && pulse < kMostPulses; ++pulse) {
    pass_patient(rays);
    absorb_quanta(chain->quanta);
    collect_light(Use::measured);
    if (!generator.follow(frame.mean_kev, false)) break;
  }
  if (!chain->lag) return;
  const QuantaStage without_noise(false, 0);
  pass_patient(rays);
  absorb_quanta(without_noise);
  collect_light(Use::fills_traps);
}

void Fluoroscope::State::begin_run(double pause_s) {
  if (chain->lag) chain->lag->pause(pause_s);
  chain->display.forget();
}

std::vector<float> measured_depths(const FluoroscopyFrame& frame) {
  std::vector<float> depths(frame.logarithm.size());
  std::transform(frame.logarithm.begin(), frame.logarithm.end(), depths.begin(), std::negate{});
  return depths;
}

// ---- the class ------------------------------------------------------------------------------------------

Fluoroscope::Fluoroscope(FluoroscopyOptions options, const View& view, WaterPath path)
    : state_(std::make_unique<State>(std::move(options), view, std::move(path))) {}
Fluoroscope::~Fluoroscope() = default;
Fluoroscope::Fluoroscope(Fluoroscope&&) noexcept = default;
Fluoroscope& Fluoroscope::operator=(Fluoroscope&&) noexcept = default;

const FluoroscopyFrame& Fluoroscope::expose(const RayDepths& rays) { return state_->expose(rays); }
void Fluoroscope::settle(const RayDepths& rays) { state_->settle(rays); }

void Fluoroscope::set_view(const View& view) { state_->set_view(view); }
void Fluoroscope::set_path(WaterPath path) { state_->generator.set_path(std::move(path)); }
void Fluoroscope::begin_run(double pause_s) { state_->begin_run(pause_s); }
void Fluoroscope::set_dose(DoseLevel dose) { state_->generator.set_dose(dose); }
void Fluoroscope::set_picture(const std::optional<Collimation>& collimation,
                              std::optional<double> compression) {
  state_->set_picture(collimation, compression);
}
void Fluoroscope::hold_technique(bool is_held) { state_->is_held = is_held; }

const FluoroscopyOptions& Fluoroscope::options() const { return state_->generator.options(); }
const DoseRecord& Fluoroscope::dose() const { return state_->generator.dose(); }
Technique Fluoroscope::technique() const { return state_->generator.technique(); }
double Fluoroscope::kerma_rate_mGy_min() const { return state_->generator.kerma_rate_mGy_min(); }
std::span<const float> Fluoroscope::field() const { return state_->chain->seen.field; }
void Fluoroscope::clear_behind_blades(std::span<float> difference) const {
  constexpr float kOpen = 0.5f;
  std::transform(difference.begin(), difference.end(), field().begin(), difference.begin(),
                 [](float value, float open) { return open < kOpen ? 0 : value; });
}
double Fluoroscope::target_kev() const { return state_->generator.target_kev(); }
double Fluoroscope::open_quanta() const { return state_->generator.open_quanta(); }
int Fluoroscope::bits() const { return state_->generator.options().c_arm.detector.bits; }

}  // namespace xraycast
