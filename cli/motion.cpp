#include "options/command.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/parametric_motion/parametric_motion.hpp"
#include "xraycast/scan/scan.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>

namespace xraycast::cli {
namespace {

namespace fs = std::filesystem;

struct MotionArguments {
  std::string input, folder, heart_mask;
  ScanOptions scan;
  ParametricMotionRequest request;
};

void make(const MotionArguments& options, Invocation& invocation) {
  ParametricMotionRequest request = options.request;
  request.heart_mask = options.heart_mask;
  // A mask says that there is a heart to beat.
  request.heart = request.heart || !options.heart_mask.empty();
  check(request);
  const fs::path folder = options.folder;
  check_folder(folder, {"motion.json"}, "--output " + options.folder);
  const Scan scan = open_scan(options.input, options.scan, invocation.progress);
  invocation.say_about(scan.info);
  const Volume volume = collect(*scan.source, invocation.progress, options.input);
  invocation.say_about(*scan.source);
  const ParametricMotion motion = parametric_motion(volume, request, options.input, invocation.progress);
  invocation.say(motion.notes);
  make_folder(folder, "--output " + options.folder);
  write_motion(motion.modes, folder, invocation.progress);
  Json modes = Json::array();
  std::string names;
  for (const ScaledMode& mode : motion.modes) {
    modes.push_back({{"name", mode.name}, {"nodes", to_json(mode.nodes)}});
    names += (names.empty() ? "" : " and ") + mode.name;
  }
  const std::string file = (folder / "motion.json").string();
  invocation.report({{"input", options.input}, {"output", file}, {"modes", modes}},
                    fmt::format("{}: {} of {}\n", file, names, options.input));
}

}  // namespace

void add_motion(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<MotionArguments>();
  CLI::App* command =
      add_command(app, invocation, "motion", "Model how the body in a scan breathes and its heart beats",
                  "  xraycast motion chest.nii.gz --breath 12 --heart -o chest-motion/\n"
                  "  xraycast motion chest.nii.gz --heart-mask heart.nii.gz -o chest-motion/",
                  [options, &invocation] { make(*options, invocation); });
  add_scan_argument(*command, options->input);
  command->add_option("-o,--output", options->folder, "Folder for motion.json and the fields it names")
      ->required()
      ->type_name("DIR");
  command
      ->add_option("--breath", options->request.breath_mm,
                   "Breathe quietly, with this excursion of the diaphragm; 12 is usual")
      ->type_name("MM");
  command->add_flag("--heart", options->request.heart, "Let the heart beat, where it is found in the chest");
  command
      ->add_option("--heart-mask", options->heart_mask,
                   "Let the heart beat that this mask on the scan's grid holds")
      ->type_name("FILE");
  command->add_option("--spacing", options->request.spacing_mm, "Distance between the nodes of the fields")
      ->capture_default_str()
      ->type_name("MM");
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
