#include "options/scene_options.hpp"

#include "xraycast/base/error.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>

namespace xraycast::cli {

void add_scene_options(CLI::App& command, SceneOptions& options) {
  command
      .add_option(
          "--vessels", options.vessels,
          "Vessels inside the body: a surface (.vtp, .stl, .vtk, .obj, .ply), or a folder that holds one")
      ->type_name("DIR|FILE");
  command
      .add_option(
          "--contrast", options.contrast_mg_ml,
          "fluoro: iodine concentration in the vessels (default 50; undiluted contrast agent: about 350)")
      ->check(CLI::Range(0.0, kMaxContrast_mg_ml))
      ->type_name("MG/ML");
  command
      .add_option("--catheter", options.catheter,
                  "A catheter's shape: control points x,y,z in mm (LPS) of a curve")
      ->type_name("CSV");
  add_object_option(command, options.objects);
}

void add_object_option(CLI::App& command, std::vector<std::string>& objects) {
  command
      .add_option(
          "--object", objects,
          fmt::format("An object in the body, such as a plate, a screw or a valve: a closed surface in the "
                      "scan's mm, and what it is made of: {}, an element's symbol, or a formula with its "
                      "density; it lies where a pose's motion takes it. Repeat it for several",
                      fmt::join(solid_names(), ", ")))
      ->allow_extra_args(false)
      ->type_name("FILE,material=NAME[,density=G_CM3][,pose=FILE]");
}

std::vector<ImplantRequest> parse_objects(const std::vector<std::string>& objects) {
  std::vector<ImplantRequest> implants;
  for (const std::string& object : objects) implants.push_back(parse_implant(object));
  return implants;
}

std::vector<Implant> open_objects(const std::vector<ImplantRequest>& objects, const Invocation& invocation) {
  std::vector<std::string> notes;
  std::vector<Implant> implants = read_implants(objects, notes);
  invocation.say(notes);
  return implants;
}

void apply(const SceneOptions& options, ViewSession& session) {
  if (!options.vessels.empty() || !options.catheter.empty()) session.steered.reset();
  replace_file(session.vessels, options.vessels);
  replace_file(session.catheter, options.catheter);
  if (options.contrast_mg_ml) session.contrast_mg_ml = *options.contrast_mg_ml;
  if (!options.objects.empty()) session.implants = parse_objects(options.objects);
}

ViewSession resolve_scene(const std::string& session_file, const std::string& map,
                          const SceneOptions& options) {
  ViewSession scene;
  if (!session_file.empty()) scene = read_session(session_file);
  if (!map.empty()) scene.map = map;
  apply(options, scene);
  if (scene.map.empty()) throw InputError("no body map is given; give a MAP.exr or --session");
  if (options.contrast_mg_ml && scene.vessels.empty())
    throw InputError("--contrast {:g}: there are no vessels that it could fill; give --vessels too",
                     *options.contrast_mg_ml);
  return scene;
}

void replace_file(std::filesystem::path& file, const std::string& given) {
  if (given.empty()) return;
  if (!std::filesystem::exists(given)) throw InputError("{}: no such file or folder; check its name", given);
  file = given;
}

}  // namespace xraycast::cli
