#include "frames.hpp"

#include "xraycast/base/stopwatch.hpp"
#include "xraycast/casting/caster.hpp"
#include "xraycast/drawing/grey_picture.hpp"
#include "xraycast/fluoroscope/fluoroscope.hpp"
#include "xraycast/fluoroscope/subtraction.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/motion/moving_points.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/requests/moving_caster.hpp"
#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/contrast_surface.hpp"
#include "xraycast/scene/pulse_blur.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <sys/wait.h>
#include <unistd.h>

namespace xraycast::bench {
namespace {

constexpr double kPulse_s = 1.0 / 15;

}  // namespace

struct Frames::Gl {
  Renderer renderer;
  gl::Target target{GL_RGBA8};
  gl::Framebuffer framebuffer;
};

Frames::Frames(const ResidentScan& scan, const MapGeometry& geometry, int width, int height,
               bool with_vessels, Compositing compositing, const CArmPose& pose)
    : pose_(pose), bounds_(bounds_of(geometry)), width_(width), height_(height) {
  gl_ = std::make_unique<Gl>();
  Progress progress;
  gl_->renderer.set_map(std::make_shared<BodyMap>(cast(scan, geometry, Opacity::paper(), progress).map));
  if (with_vessels) {
    constexpr int kSides = 6;  // 31,248 triangles
    Surface vessels{tube_mesh(VesselTree(make_phantom("thorax").vessel_branches(), "thorax"), kSides)};
    gl_->renderer.set_surfaces(std::span(&vessels, 1));
    style_.look = Look::surface;
  }
  style_.sampling.compositing = compositing;
  style_.pixels_per_column = kLivePixelsPerColumn;
  gl_->target.resize(width, height);
  next_ms();  // compiles the shaders
}

Frames::~Frames() = default;

Renderer& Frames::renderer() { return gl_->renderer; }

double Frames::next_ms() {
  const Stopwatch stopwatch;
  pose_.rotate(7);
  glBindFramebuffer(GL_FRAMEBUFFER, gl_->framebuffer.id());
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, gl_->target.texture(), 0);
  gl_->renderer.draw(view_of(pose_, bounds_, width_, height_), style_);
  glFinish();
  return stopwatch.ms();
}

MovingFrames::MovingFrames(const SpectralScan& scan, const MapGeometry& geometry, const Motion& motion,
                           const KeyPhases& keys, int width, int height)
    : Frames(scan.native, geometry, width, height, false), rhythm_(keys.rhythm()) {
  Progress progress;
  renderer().set_map(
      std::make_shared<BodyMap>(cast_keys(scan, geometry, Opacity::paper(), motion, keys, progress).map));
  next_ms();
}

double MovingFrames::next_ms() {
  const Stopwatch stopwatch;
  renderer().set_phases(rhythm_.phases_at(time_s_ += kPulse_s));
  Frames::next_ms();
  return stopwatch.ms();
}

ObjectFrames::ObjectFrames(const ResidentScan& scan, const MapGeometry& geometry, int width, int height)
    : Frames(scan, geometry, width, height, false) {
  constexpr int kRings = 250, kSides = 200;
  constexpr double kRadius_mm = 20, kTitanium_per_mm = 0.25;
  VesselBranch ball;
  ball.parent = -1;
  for (int i = 1; i < kRings; ++i) {
    const double turn = std::numbers::pi * i / kRings;
    ball.points.push_back(
        {bounds_.centre_mm + glm::dvec3(0, 0, -kRadius_mm * std::cos(turn)), kRadius_mm * std::sin(turn)});
  }
  renderer().set_implants({{tube_mesh(VesselTree({ball}, "ball"), kSides), kTitanium_per_mm}});
  style_.look = Look::fluoro;
  next_ms();
}

OpacityFrames::OpacityFrames(const ResidentScan& scan, const MapGeometry& geometry, int width, int height)
    : Frames(scan, geometry, width, height, false),
      basis_([&] {
        Progress progress;
        return make_basis(scan, geometry, useful_knots_hu(Opacity::paper()), progress);
      }()),
      session_(scan.device(), basis_) {
  for (const double hu : basis_.knots_hu) knots_.push_back({hu, Opacity::paper().mu_per_mm(hu)});
}

double OpacityFrames::next_ms() {
  const Stopwatch stopwatch;
  knots_[knots_.size() / 2].mu_per_mm = 0.02 + 0.001 * (++moves_ % 10);
  renderer().set_map(std::make_shared<BodyMap>(session_.recast(Opacity("edited", knots_))));
  Frames::next_ms();
  return stopwatch.ms();
}

struct FluoroscopyFrames::Chain {
  Fluoroscope fluoroscope;
  GreyPicture picture;
  std::optional<Subtraction> subtraction;
  MaximumOpacification opacified;
  std::vector<float> difference;

  void subtract(const FluoroscopyFrame& frame, int width, int height) {
    const std::vector<float> depths = measured_depths(frame);
    if (subtraction->mask_frames() == 0) subtraction->add_to_mask(depths);
    difference.resize(depths.size());
    subtraction->subtract(depths, difference);
    opacified.add(difference);
    picture.set(subtraction_greys(difference, {}), width, height);
  }
};

FluoroscopyFrames::FluoroscopyFrames(const ResidentScan& scan, const MapGeometry& geometry, int width,
                                     int height, PulseDisplay display)
    : Frames(scan, geometry, width, height, false), width_(width), height_(height) {
  const View view = view_of(pose_, bounds_, width, height);
  FluoroscopyOptions options;
  options.c_arm = CArm::named("fixed-single-plane");
  if (display != PulseDisplay::compressed) options.compression = 0;
  // The body's height fits into the picture, which a detector's pixels do not: its own, so that the blur is
  // as wide as on a detector.
  View on_detector = view;
  on_detector.pixel_mm = options.c_arm.detector.width_mm / width;
  on_detector.cone = options.c_arm.distances;
  chain_.reset(new Chain{Fluoroscope(options, on_detector, WaterPath(Opacity::paper())), {}, {}, {}, {}});
  chain_->fluoroscope.settle(renderer().tau(view, style_));
  if (display == PulseDisplay::subtracted) {
    chain_->subtraction.emplace(width, height);
    chain_->subtraction->shift_mask({0.5, 0});
    chain_->fluoroscope.hold_technique(true);
  }
  next_ms();
}

FluoroscopyFrames::~FluoroscopyFrames() = default;

double FluoroscopyFrames::next_ms() {
  const Stopwatch stopwatch;
  pose_.rotate(7);
  expose(view());
  return stopwatch.ms();
}

View FluoroscopyFrames::view() const { return view_of(pose_, bounds_, width_, height_); }

void FluoroscopyFrames::expose(const View& view) {
  const FluoroscopyFrame& frame = chain_->fluoroscope.expose(renderer().tau(view, style_));
  if (chain_->subtraction)
    chain_->subtract(frame, width_, height_);
  else
    chain_->picture.set(frame.shown, width_, height_);
  chain_->picture.draw(0, 0, width_, height_);
  glFinish();
}

/// What is in the body, and moves with it.
struct SteeredPulses::Inside {
  Motion rhythm;
  ContrastSurface contrast;
  std::vector<std::vector<double>> iodine_mg_ml;
  std::vector<InstrumentModel> instruments;
  MovingPoints contrast_points, nodes;
};

namespace {

VesselTree thorax_tree() {
  return {make_phantom("thorax", {.coronaries = true}).vessel_branches(), "thorax"};
}

/// Along the middle of the longest vessel.
std::vector<glm::vec3> nodes_within(const VesselTree& tree) {
  const auto longest = std::ranges::max_element(
      tree.branches(), {}, [](const VesselBranch& branch) { return branch.arc_length_mm.back(); });
  std::vector<glm::vec3> nodes_mm;
  for (const auto& point : longest->points) nodes_mm.emplace_back(point.position_mm);
  return nodes_mm;
}

}  // namespace

SteeredPulses::SteeredPulses(const SpectralScan& scan, const MapGeometry& geometry, const Motion& motion,
                             const KeyPhases& keys, int width, int height, const LivePulses& live)
    : FluoroscopyFrames(scan.native, geometry, width, height, PulseDisplay::compressed), live_(live) {
  Progress progress;
  renderer().set_map(
      std::make_shared<BodyMap>(cast_keys(scan, geometry, Opacity::paper(), motion, keys, progress).map));
  const VesselTree tree = thorax_tree();
  ContrastSurface contrast(tree);
  std::vector<glm::vec3> points_mm = contrast.whole().mesh.points_mm;
  inside_.reset(new Inside{keys.rhythm(),
                           std::move(contrast),
                           {},
                           {InstrumentModel::named("cobra-5f"), InstrumentModel::named("guidewire-035-j")},
                           MovingPoints(std::move(points_mm), motion, progress),
                           MovingPoints(nodes_within(tree), motion, progress)});
  constexpr double kIodine_mg_ml = 50;
  for (const VesselBranch& branch : tree.branches())
    inside_->iodine_mg_ml.emplace_back(branch.points.size() - 1, kIodine_mg_ml);
  next_ms();
}

SteeredPulses::~SteeredPulses() = default;

/// As a pulse of 5 ms in the middle of that time sees it.
void SteeredPulses::place(double time_s) {
  const PulseBlur blur{.pulse_s = 0.005, .pixel_mm = pixel_at_axis_mm(view())};
  const auto at = [&](double from_middle_s) {
    const std::vector<double> phases = inside_->rhythm.phases_at(time_s + from_middle_s);
    std::vector<glm::dvec3> nodes_mm;
    for (const glm::vec3& node_mm : inside_->nodes.at(phases)) nodes_mm.emplace_back(node_mm);
    std::vector<Surface> surfaces;
    for (const InstrumentModel& instrument : inside_->instruments)
      for (Surface& surface : instrument_surfaces(nodes_mm, instrument))
        surfaces.push_back(std::move(surface));
    surfaces.push_back(inside_->contrast.filled(inside_->iodine_mg_ml, inside_->contrast_points.at(phases)));
    return surfaces;
  };
  const double apart_s = live_.moves ? blur.from_middle_s() : 0;
  const std::vector<Surface> seen = seen_by_pulse(at(-apart_s), at(0), at(apart_s), blur.pixel_mm);
  for (std::size_t s = 0; s < seen.size(); ++s) renderer().replace_surface(s, seen[s]);
  renderer().set_phases(inside_->rhythm.phases_at(time_s));
}

double SteeredPulses::next_ms() {
  const Stopwatch stopwatch;
  if (live_.moves) time_s_ += kPulse_s;
  place(time_s_);
  if (live_.turns) pose_.rotate(7);
  View seen = view();
  if (!live_.turns) seen.cone = Cone{1000, 1500};
  expose(seen);
  return stopwatch.ms();
}

VtkRayCaster::VtkRayCaster(const std::filesystem::path& scan, int width, int height) {
  int to[2], from[2];
  if (pipe(to) != 0 || pipe(from) != 0) return;
  process_ = fork();
  if (process_ == 0) {
    dup2(to[0], STDIN_FILENO);
    dup2(from[1], STDOUT_FILENO);
    for (const int end : {to[0], to[1], from[0], from[1]}) close(end);
    const std::string w = std::to_string(width), h = std::to_string(height);
    execl("/usr/bin/python3", "python3", VTK_FRAMES_SCRIPT, scan.c_str(), w.c_str(), h.c_str(), nullptr);
    _exit(127);
  }
  close(to[0]);
  close(from[1]);
  questions_ = fdopen(to[1], "w");
  answers_ = fdopen(from[0], "r");
  if (ask("frame") > 0) return;
  std::fclose(answers_);
  answers_ = nullptr;
}

VtkRayCaster::~VtkRayCaster() {
  if (questions_) std::fclose(questions_);  // ends the process
  if (answers_) std::fclose(answers_);
  if (process_ > 0) waitpid(process_, nullptr, 0);
}

double VtkRayCaster::ask(const char* what) {
  fmt::print(questions_, "{}\n", what);
  std::fflush(questions_);
  double ms = 0;
  return std::fscanf(answers_, "%lf", &ms) == 1 ? ms : 0;
}

}  // namespace xraycast::bench
