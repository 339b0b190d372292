// Registration of an X-ray, on a scan whose levels are made.
#include "suite.hpp"
#include "xraycast/projection/projector.hpp"
#include "xraycast/registration/registration.hpp"

#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include <cmath>
#include <memory>
#include <stdexcept>

namespace xraycast::bench {
namespace {

/// A picture of 512 x 512 pixels of the phantom, and a registrar that starts 7 degrees and 30 mm off.
struct Task {
  Xray xray;
  RegisterRequest request;
  std::unique_ptr<Registrar> registrar;
  Registration found;
};

PinholeCamera camera_over(const VolumeGeometry& scan) {
  PinholeCamera camera;
  camera.width = camera.height = 512;
  constexpr double kSourceAxis_mm = 785, kSourceDetector_mm = 1200, kPixel_mm = 0.75;
  const double focal = kSourceDetector_mm / kPixel_mm, middle = 0.5 * (camera.width - 1);
  camera.intrinsics = glm::dmat3(focal, 0, 0, 0, focal, 0, middle, middle, 1);
  camera.rotation = glm::transpose(glm::dmat3(1, 0, 0, 0, 0, -1, 0, -1, 0));  // seen from the detector
  const glm::dvec3 centre = 0.5 * (scan.lower_mm() + scan.upper_mm());
  camera.translation_mm = glm::dvec3(0, 0, kSourceAxis_mm) - camera.rotation * centre;
  return camera;
}

std::shared_ptr<Task> make_task(Bench& bench) {
  auto task = std::make_shared<Task>();
  const PinholeCamera camera = camera_over(bench.scan.geometry());
  task->xray = {
      .name = "the X-ray", .width = camera.width, .height = camera.height, .pixels = {}, .camera = {}};
  for (const float tau : project(bench.scan, camera, Opacity::bilinear(), bench.progress))
    task->xray.pixels.push_back(std::exp(-0.6F * tau));
  task->xray.camera = camera;
  const glm::dvec3 centre = 0.5 * (bench.scan.geometry().lower_mm() + bench.scan.geometry().upper_mm());
  task->request.start = turned_and_moved(glm::radians(glm::dvec3(4, -5, 3)), glm::dvec3(20, -15, 15), centre);
  task->registrar =
      std::make_unique<Registrar>(bench.device, bench.volume, std::span<const std::uint8_t>{}, task->request);
  const auto find = [&] { task->found = task->registrar->find(std::span(&task->xray, 1), bench.progress); };
  find();  // makes the levels of the scan
  if (glm::length(task->found.motion(centre) - centre) > 2)
    throw std::runtime_error("the registration found another pose, and is no measure");
  return task;
}

}  // namespace

std::vector<Row> add_registering(Bench& bench) {
  const auto task = std::make_shared<std::shared_ptr<Task>>();  // made when it is first run
  const auto ready = [&bench, task]() -> Task& {
    if (!*task) *task = make_task(bench);
    return **task;
  };
  add("register_512", [&bench, ready] {
    Task& one = ready();
    return wall_ms([&] { one.found = one.registrar->find(std::span(&one.xray, 1), bench.progress); });
  });
  add("track_512", [&bench, ready] {
    Task& one = ready();
    return wall_ms([&] { one.registrar->follow(std::span(&one.xray, 1), one.found, bench.progress); });
  });
  using enum Row::Bar;
  return {{"register_512", "3 s", at_most, 1}, {"track_512", "0.3 s", at_most, 1}};
}

}  // namespace xraycast::bench
