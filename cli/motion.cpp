#include "options/command.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/parametric_motion/parametric_motion.hpp"
#include "xraycast/phase_registration/motion_registration.hpp"
#include "xraycast/reports/registration_report.hpp"
#include "xraycast/scan/scan.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace xraycast::cli {
namespace {

namespace fs = std::filesystem;

struct MotionArguments {
  std::string input, folder, heart_mask, at, landmarks, mask;
  std::vector<std::string> phases;
  ScanOptions scan;
  ParametricMotionRequest request;
  MotionRegistrationRequest registration;
};

// ---- by registration ---------------------------------------------------------------------------------

Json entry_of(const PhaseRegistration& phase) {
  Json json{{"scan", phase.name},           {"phase", phase.phase},       {"longest_mm", phase.longest_mm},
            {"before_hu", phase.before_hu}, {"after_hu", phase.after_hu}, {"seconds", phase.seconds}};
  if (const auto& found = phase.landmarks)
    json["landmarks"] = {
        {"count", found->count}, {"before_mm", found->before_mm}, {"after_mm", found->after_mm}};
  return json;
}

std::string in_words(const PhaseRegistration& phase) {
  std::string words = fmt::format("phase {:.3g}: {}: up to {:.1f} mm, difference {:.0f} to {:.0f} HU",
                                  phase.phase, phase.name, phase.longest_mm, phase.before_hu, phase.after_hu);
  if (const auto& found = phase.landmarks)
    words += fmt::format(", {} {:.2f} to {:.2f} mm", pluralize(found->count, "landmark"), found->before_mm,
                         found->after_mm);
  return words + fmt::format(", {:.0f} s\n", phase.seconds);
}

void make_by_registration(const MotionArguments& options, Invocation& invocation) {
  MotionRegistrationRequest request = options.registration;
  if (!options.at.empty()) request.at = parse_numbers(options.at, "--at");
  request.landmarks = options.landmarks;
  request.mask = options.mask;
  request.spacing_mm = options.request.spacing_mm;
  check(request, options.phases.size());
  const fs::path folder = options.folder;
  check_folder(folder, {"motion.json", "report.png"}, "--output " + options.folder);
  std::vector<PhaseOfScan> phases;
  for (const std::string& phase : options.phases) phases.push_back(phase_of_file(phase, options.scan));
  const RegisteredScan reference = phase_of_file(options.input, options.scan).open(invocation.progress);
  const RegisteredMotion motion =
      register_phases(reference, options.input, phases, request, invocation.progress);
  invocation.say(motion.warnings);
  write_registration(motion, options.input, folder, invocation.progress);
  Json registered = Json::array();
  const std::string file = (folder / "motion.json").string();
  std::string words = fmt::format("{}: {} of {}, registered\n", file, motion.mode, options.input);
  for (const PhaseRegistration& phase : motion.phases) {
    registered.push_back(entry_of(phase));
    words += in_words(phase);
  }
  invocation.report(
      {{"input", options.input}, {"output", file}, {"mode", motion.mode}, {"phases", registered}}, words);
}

// ---- by a model --------------------------------------------------------------------------------------

void make_by_model(const MotionArguments& options, Invocation& invocation) {
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

/// Throws InputError for options of the one way with those of the other.
void make(const MotionArguments& options, Invocation& invocation) {
  if (options.phases.empty()) {
    check_not_given(*invocation.command, {"--mode", "--period", "--at", "--grid", "--landmarks", "--mask"},
                    "without PHASE scans; give them behind the reference");
    return make_by_model(options, invocation);
  }
  check_not_given(*invocation.command, {"--breath", "--heart", "--heart-mask"},
                  "to PHASE scans, of which the motion is found; leave it out");
  make_by_registration(options, invocation);
}

}  // namespace

void add_motion(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<MotionArguments>();
  CLI::App* command = add_command(
      app, invocation, "motion",
      "Find how the body moves in the phases of a 4D CT, or model how it breathes and its heart beats",
      "  xraycast motion 4d/phase0/ 4d/phase25/ 4d/phase50/ 4d/phase75/ -o motion/\n"
      "  xraycast motion expired.nii.gz inspired.nii.gz --at 1 --landmarks pairs.csv -o motion/\n"
      "  xraycast motion chest.nii.gz --breath 12 --heart -o chest-motion/\n"
      "  xraycast motion chest.nii.gz --heart-mask heart.nii.gz -o chest-motion/",
      [options, &invocation] { make(*options, invocation); });
  add_scan_argument(*command, options->input);
  command
      ->add_option("PHASE", options->phases,
                   "The scan's other phases, in their order, registered to it by the program elastix")
      ->type_name("PHASE...");
  command
      ->add_option("-o,--output", options->folder,
                   "Folder for motion.json and the fields it names; of phases also a report.png")
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
  command->add_option("--mode", options->registration.mode, "PHASE: the name of the movement")
      ->capture_default_str()
      ->type_name("NAME");
  command
      ->add_option("--period", options->registration.period_s,
                   "PHASE: the time of a cycle, or of the way there and back")
      ->capture_default_str()
      ->type_name("S");
  command
      ->add_option(
          "--at", options->at,
          "PHASE: their phases, above 0, which is that of the scan, and up to 1; by default evenly spaced "
          "over a cycle. 1 alone: the other end of a breath that goes there and back")
      ->type_name("0..1,...");
  command
      ->add_option(
          "--grid", options->registration.grid_mm,
          "PHASE: distance between the nodes of the B-spline that is fitted; smaller follows finer motion, "
          "and noise")
      ->capture_default_str()
      ->type_name("MM");
  command
      ->add_option(
          "--landmarks", options->landmarks,
          "PHASE: pairs of places whose distances are reported before and after: rows of the phase's number "
          "from 1, x,y,z in the scan, and x,y,z in the phase, in mm (LPS)")
      ->type_name("CSV");
  command
      ->add_option("--mask", options->mask,
                   "PHASE: a scan, above 0 where the phases are to match, such as without the table")
      ->type_name("FILE");
  command->add_option("--spacing", options->request.spacing_mm, "Distance between the nodes of the fields")
      ->capture_default_str()
      ->type_name("MM");
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
