#include "xraycast/lesions/edit.hpp"

#include "options/command.hpp"
#include "vessels/scan_beside.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/reports/vessel_report.hpp"
#include "xraycast/scan/scan.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace xraycast::cli {
namespace {

namespace fs = std::filesystem;

struct EditArguments {
  std::string input, folder, scan, edits;
  std::vector<std::string> stenoses, aneurysms, removed, scales;
  int random = 0;
  std::uint64_t seed = EditRequest{}.seed;
};

/// Those of a file first, then those of the options, in their order.
EditRequest edit_request_of(const EditArguments& options) {
  EditRequest request;
  request.input = options.input;
  if (!options.edits.empty()) request.edits = read_edits(options.edits);
  for (const std::string& words : options.stenoses) request.edits.stenoses.push_back(stenosis_of(words));
  for (const std::string& words : options.aneurysms) request.edits.aneurysms.push_back(aneurysm_of(words));
  for (const std::string& words : options.removed) request.edits.removed.push_back(words);
  for (const std::string& words : options.scales) request.edits.scales.push_back(scale_of(words));
  request.random = options.random;
  request.seed = options.seed;
  check(request);
  return request;
}

/// All files or none: a tree beside other vessels' lesions would be misleading.
void write_all_edited(EditedVessels& edited, const ScanInfo& scan, const EditArguments& options,
                      Invocation& invocation) {
  make_folder(options.folder, "-o " + options.folder);
  OutputSet outputs;
  write_edited(edited, scan, options.input, options.folder, invocation.progress);
  const Volume* const volume = edited.scan ? &*edited.scan : nullptr;
  write_picture(given_vessel_report(options.input, edited.vessels, edits_in_words(edited), volume),
                fs::path(options.folder) / "report.png");
  outputs.commit();
}

void report_edits(const EditedVessels& edited, const EditArguments& options, double total_ms,
                  const Invocation& invocation) {
  invocation.say(edited.vessels.notes);
  std::string text;
  for (const Lesion& lesion : edited.lesions) text += lesion.in_words() + "\n";
  const std::size_t branches = edited.vessels.centrelines.tree.branches().size();
  text += fmt::format("{}: {}, {}, {:.0f} ms; check {}\n", options.folder,
                      pluralize(std::ssize(edited.lesions), "lesion"), pluralize(branches, "branch"),
                      total_ms, (fs::path(options.folder) / "report.png").string());
  invocation.report({{"input", options.input},
                     {"folder", options.folder},
                     {"branches", branches},
                     {"lesions", Json::parse(lesions_text(edited.lesions))},
                     {"notes", edited.vessels.notes},
                     {"timings_ms", {{"total", total_ms}}}},
                    text);
}

void edit(const EditArguments& options, Invocation& invocation) {
  const Stopwatch stopwatch;
  const EditRequest request = edit_request_of(options);
  std::vector<const char*> files(kVesselFiles.begin(), kVesselFiles.end());
  files.insert(files.end(), {"report.png", kEditsFile, kEditedScanFile});
  check_folder(options.folder, files, "-o " + options.folder);
  check_names(options.folder);
  ScanBeside scan = read_scan_beside(options.scan, {}, invocation);
  EditedVessels edited = edit_vessels(request, std::move(scan.volume), invocation.progress);
  write_all_edited(edited, scan.info, options, invocation);
  report_edits(edited, options, stopwatch.ms(), invocation);
}

}  // namespace

void add_edit(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<EditArguments>();
  CLI::App* command = add_command(
      app, invocation, "edit", "Narrow, widen and remove vessels of a tree, and give them aneurysms",
      "  xraycast edit vessels -o stenosed --stenosis \"left renal artery,12,10,60\"\n"
      "  xraycast edit vessels -o stenosed --stenosis 3,20,15,75a,eccentric=left\n"
      "  xraycast edit vessels -o variant --remove \"right renal artery\" --scale radii,0.9\n"
      "  xraycast edit vessels -o aneurysm --aneurysm 12,-20,140,8,4\n"
      "  xraycast edit vessels -o stenosed --scan cta.nii.gz --stenosis 3,20,15,70,calcium\n"
      "  xraycast edit vessels -o patient-7 --random 3 --seed 7\n"
      "  xraycast edit vessels -o again --edits stenosed/edits.json",
      [options, &invocation] { edit(*options, invocation); });
  const auto repeated = [command](const char* name, std::vector<std::string>& values, const char* purpose,
                                  const char* words) {
    command->add_option(name, values, purpose)->allow_extra_args(false)->type_name(words);
  };
  command
      ->add_option("TREE", options->input,
                   "A folder that `segment`, `vessels`, `phantom --truth` or `edit` wrote, or a tree's file "
                   "(.vtp, .json)")
      ->required();
  command->add_option("-o,--output", options->folder, "Folder for the edited vessels, of the same files")
      ->required()
      ->type_name("DIR");
  repeated(
      "--stenosis", options->stenoses,
      "Narrow a branch, by its number or name: the middle in mm from its start, the length, and percent "
      "of the diameter, or of the area, as 75a. Behind that: eccentric, or eccentric=SIDE (left, right, "
      "anterior, posterior, cranial, caudal), for a throat at one wall; calcium or thrombus instead of soft "
      "plaque; repeatable",
      "BRANCH,AT,LENGTH,PERCENT");
  repeated("--aneurysm", options->aneurysms,
           "Add a ball beside the vessel at a point on its wall, mm (LPS), of a diameter, with an opening as "
           "wide as "
           "its neck; repeatable",
           "X,Y,Z,DIAMETER,NECK");
  repeated("--remove", options->removed, "Remove a branch with all behind it; repeatable", "BRANCH");
  repeated("--scale", options->scales,
           "Radii of a branch, of all (radii), or the whole tree (size), times a factor; repeatable",
           "BRANCH|radii|size,FACTOR");
  command
      ->add_option(
          "--scan", options->scan,
          "Also write this scan of the vessels with the lesions, edited.nii.gz: plaque where lumen was, "
          "blood with contrast agent in new lumen, with the scan's own blur and noise")
      ->type_name("SCAN");
  command
      ->add_option("--random", options->random,
                   "Besides, so many lesions whose kinds, places and severities are drawn by chance")
      ->type_name("N");
  command->add_option("--seed", options->seed, "Seed of --random")->capture_default_str()->type_name("N");
  command
      ->add_option("--edits", options->edits,
                   "Make the edits of an edits.json, before those of other options")
      ->type_name("FILE");
}

}  // namespace xraycast::cli
