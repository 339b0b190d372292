#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/export/recorded_run.hpp"
#include "xraycast/fluoroscope/fluoroscope_request.hpp"
#include "xraycast/motion/body_request.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"
#include "xraycast/scene/scene.hpp"
#include "xraycast/scene/session_file.hpp"
#include "xraycast/simulation/exercise.hpp"
#include "xraycast/trainer/trainer_setup.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

enum class ExportFormat {
  page,  ///< a web page, .html
  gltf,  ///< a glTF scene without the map, .glb
};

/// The format of a file by its name. Throws InputError.
ExportFormat export_format(const std::string& file);

/// A run that goes on while the page is open, of which `serve --web` tells the page, or its own simulation
/// (see BrowserMessage).
struct LiveRun {
  std::vector<InstrumentModel> instruments;  ///< from the outermost on
  Surface contrast;                          ///< all drums of a ContrastSurface
  bool has_hub = true;                       ///< the page moves the hubs; otherwise something else does
  std::vector<std::string> modes{};          ///< of the body's motion, in order; none where it is still
  std::vector<std::string> vessels{};        ///< the branches of the tree in words
};

/// A task in a page that steers, with what its simulation takes.
struct SteeredExercise {
  Exercise exercise;
  TrainerSetup setup;
};

/// A session to be shown elsewhere.
struct ExportRequest {
  ExportFormat format = ExportFormat::page;
  std::string title = "Fluoroscopy";  ///< not a file's name, which may be the patient's
  std::shared_ptr<const BodyMap> map{};
  MapPrecision precision = MapPrecision::byte;  ///< of the page's copy of the map: byte or float16
  /// How the body of a map that moves does at first. Without a motion vessels stay where they are. In a run
  /// that was recorded in a body that moves it follows the run's time instead, which knows no gate.
  BodyRequest body{};
  std::optional<Surface> vessels{};  ///< in the scan
  std::vector<Surface> catheters{};  ///< that do not move
  std::vector<Surface> implants{};   ///< objects, which do not move either
  std::optional<RecordedRun> run{};
  std::optional<LiveRun> live{};
  std::optional<TrainerSetup> trainer{};     ///< with `live`: the page simulates its run itself
  std::vector<SteeredExercise> exercises{};  ///< with `trainer`: one of which is chosen in the page
  FluoroscopyOptions fluoroscope{};          ///< with `trainer`: the page's own
  CArmPose pose{};
  Style style{};
  bool has_window =
      false;  ///< style.window was chosen; otherwise it is automatic, but for gamma and inversion
  bool is_of_session = false;  ///< the pose is one that a viewer saved; otherwise it shows the whole body
  /// As a lumen that holds contrast agent; as an outline. Over a run it is the outline alone, as in the
  /// operating room.
  bool shows_vessels = true, shows_road_map = false;
  std::string still_png{};  ///< what a page shows where it cannot draw; see still_png()
  std::string map_name = "map", vessels_name = "vessels";  ///< in front of messages
};

/// What a page may hold, so that it opens on a telephone: texels of a map, which become three times as many
/// 16-bit floats on the GPU; sizes that every WebGL 2 takes; and triangles of a surface.
inline constexpr std::int64_t kMostWebTexels = 16'777'216;
inline constexpr int kMostWebAngles = 2047, kMostWebRows = 8192, kMostWebLayers = 128;
inline constexpr std::size_t kMostWebTriangles = 2'000'000;
/// Of all key maps of a body that moves, which become twice as many bytes on the GPU; and of its modes.
inline constexpr std::size_t kMostWebKeyTexels = 67'108'864, kMostWebModes = 2;

/// Whether the page shows a body that moves: its map does, and so did it in a run, or does in a live session,
/// if there is one. A live session's page stands still where its key maps do not fit into a page.
bool moves(const ExportRequest& request);

/// Of the modes of a map that moves, in order, as a page without a run opens.
std::vector<double> first_phases(const ExportRequest& request);

/// Whether a page can show a map at all: a cylinder about a straight axis under one outline, with optical
/// depths.
bool suits_web(const BodyMap& map);

/// Throws InputError for a map that a page cannot show, and for surfaces that are too large or of another
/// scan. Returns notes: what of a session a page does not show.
std::vector<std::string> check(const ExportRequest& request);

/// What a viewer's session shows, with its vessels and catheter read from their files. Throws InputError.
ExportRequest exported_session(const ViewSession& session, std::shared_ptr<const BodyMap> map);

/// A session that goes on while its page is open (see `serve --web`), with the vessels of `session`. The page
/// begins from the pose given. Throws InputError.
ExportRequest live_session(const ViewSession& session, const CArmPose& pose,
                           std::shared_ptr<const BodyMap> map, const RunRequest& run, bool has_hub);

/// Makes the page of a request steer the run's instruments by itself, from its first exposure on, with the
/// run's and these others to choose from. The request has vessels. The page's fluoroscope has the C-arm, dose
/// level, pulse rate, compression and seed that are asked for, and controls its exposure by itself. Under a
/// C-arm that is named the page opens at its distances and, unless the pose is a session's, with its largest
/// field over the entry. Throws InputError for what does not fit, and for what else is asked of the
/// fluoroscope.
void make_steered(ExportRequest& request, const RunRequest& run, const std::vector<InstrumentModel>& others,
                  const FluoroscopeRequest& fluoroscope = {});

/// Exercises in the tree of a page that steers. Throws InputError where instruments do not fit.
void add_exercises(ExportRequest& request, const std::vector<Exercise>& exercises);

/// An instrument's name as an export shows it: of one that was read from a file without a name, that of the
/// file, without its folder.
std::string shown_name(const std::string& instrument);

/// The file. Throws InputError as check() does, and Error where there is not enough memory to pack it.
std::string export_bytes(const ExportRequest& request);

}  // namespace xraycast
