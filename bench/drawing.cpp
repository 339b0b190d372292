// Frames of the viewer.
#include "frames.hpp"
#include "suite.hpp"
#include "xraycast/projection/projector.hpp"

#include <memory>
#include <tuple>

namespace xraycast::bench {

std::vector<Row> add_drawing(Bench& bench) {
  add("paper's 16 frames/s", [] { return 1000.0 / 16; });
  // The paper's own scene, one layer drawn as a wall around vessels, and what has become of it since.
  using enum Compositing;
  for (const auto& [name, layers, width, height, with_vessels, compositing] :
       {std::tuple{"frame_1_1280", 1, 1280, 720, true, wall},
        std::tuple{"frame_1_path_1280", 1, 1280, 720, true, path},
        std::tuple{"frame_8_1280", 8, 1280, 720, false, path},
        std::tuple{"frame_8_vessels_1280", 8, 1280, 720, true, path},
        std::tuple{"frame_8_640", 8, 640, 480, false, path}}) {
    auto frames = std::make_shared<Frames>(bench.scan, bench.body_map(layers), width, height, with_vessels,
                                           compositing);
    add(name, [frames] { return frames->next_ms(); });
  }
  auto object = std::make_shared<ObjectFrames>(bench.scan, bench.body_map(8), 640, 480);
  add("frame_object_640", [object] { return object->next_ms(); });
  using enum PulseDisplay;
  for (const auto& [name, width, height, display] :
       {std::tuple{"frame_fluoro_640", 640, 480, fixed}, std::tuple{"frame_fluoro_1280", 1280, 720, fixed},
        std::tuple{"frame_compressed_640", 640, 480, compressed},
        std::tuple{"frame_compressed_1280", 1280, 720, compressed},
        std::tuple{"frame_dsa_640", 640, 480, subtracted},
        std::tuple{"frame_dsa_1280", 1280, 720, subtracted}}) {
    auto pulses = std::make_shared<FluoroscopyFrames>(bench.scan, bench.body_map(8), width, height, display);
    add(name, [pulses] { return pulses->next_ms(); });
  }
  for (const auto& [name, width, height] :
       {std::tuple{"frame_moving_8_640", 640, 480}, std::tuple{"frame_moving_8_1280", 1280, 720}}) {
    auto moving = std::make_shared<MovingFrames>(bench.whole, bench.body_map(8), bench.motion, bench.keys,
                                                 width, height);
    add(name, [moving] { return moving->next_ms(); });
  }
  for (const auto& [name, live] :
       {std::pair{"frame_fluoro_moving_1280", LivePulses{.moves = true, .turns = true}},
        std::pair{"pulse_held_1280", LivePulses{}},
        std::pair{"pulse_moving_1280", LivePulses{.moves = true}}}) {
    auto pulses = std::make_shared<SteeredPulses>(bench.whole, bench.body_map(8), bench.motion, bench.keys,
                                                  1280, 720, live);
    add(name, [pulses] { return pulses->next_ms(); });
  }
  constexpr double kTilt_rad = 0.35;
  auto circles = std::make_shared<Frames>(bench.scan, bench.map(8), 640, 480, false);
  add("frame_circles_8_640", [circles] { return circles->next_ms(); });
  auto tilted = std::make_shared<Frames>(bench.scan, bench.body_map(8), 640, 480, false, path,
                                         CArmPose{.cranial_rad = kTilt_rad, .cone = Cone{1000, 1500}});
  add("frame_8_cone_tilt_640", [tilted] { return tilted->next_ms(); });
  auto pictures = std::make_shared<Frames>(bench.scan, bench.pictures(36), 640, 480, false);
  add("frame_rectangle_640", [pictures] { return pictures->next_ms(); });
  auto recast = std::make_shared<OpacityFrames>(bench.scan, bench.body_map(8), 640, 480);
  add("opacity_to_frame_8_640", [recast] { return recast->next_ms(); });
  add("frame_drr_640", [&bench, angle_deg = 0.0]() mutable {
    const View view = c_arm(angle_deg += 5, 0);
    return wall_ms([&] { project(bench.scan, view, Opacity::paper(), bench.progress); });
  });
  if (auto vtk = std::make_shared<VtkRayCaster>(bench.file, 640, 480); vtk->is_there()) {
    add("VTK frame", [vtk] { return vtk->frame_ms(); });
    add("VTK opacity to frame", [vtk] { return vtk->opacity_ms(); });
  }
  using enum Row::Bar;
  return {{"frame_1_1280", "paper's 16 frames/s", at_least, 3},
          {"frame_1_path_1280", "paper's 16 frames/s", reported, 0},
          {"frame_8_vessels_1280", "paper's 16 frames/s", reported, 0},
          {"frame_8_1280", "paper's 16 frames/s", at_least, 1.5},
          {"frame_8_640", "VTK frame", at_least, 25},
          {"frame_object_640", "frame_8_640", at_most_more_ms, 5},
          {"frame_moving_8_640", "frame_8_640", at_most, 1.35},
          {"frame_moving_8_1280", "frame_8_1280", at_most, 1.35},
          {"frame_fluoro_moving_1280", "paper's 16 frames/s", at_most, 1},
          {"pulse_moving_1280", "pulse_held_1280", reported, 0},
          {"frame_circles_8_640", "frame_8_640", reported, 0},
          {"frame_8_cone_tilt_640", "frame_8_640", reported, 0},
          {"frame_rectangle_640", "frame_8_640", reported, 0},
          {"opacity_to_frame_8_640", "VTK opacity to frame", at_least, 15},
          {"frame_fluoro_640", "frame_8_640", at_most_more_ms, 4},
          {"frame_fluoro_1280", "frame_8_1280", at_most_more_ms, 12},
          {"frame_compressed_640", "frame_8_640", at_most_more_ms, 6},
          {"frame_compressed_1280", "frame_8_1280", at_most_more_ms, 18},
          {"frame_dsa_640", "frame_fluoro_640", at_most_more_ms, 4},
          {"frame_dsa_1280", "frame_fluoro_1280", at_most_more_ms, 12},
          {"frame_drr_640", "VTK frame", at_least, 12}};
}

}  // namespace xraycast::bench
