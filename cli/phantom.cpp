#include "xraycast/phantom/phantom.hpp"

#include "options/command.hpp"
#include "options/motion_options.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/geometry/branch_names.hpp"
#include "xraycast/phantom/phantom_motion_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <map>
#include <memory>
#include <vector>

namespace xraycast::cli {
namespace {

struct PhantomArguments {
  std::string name, output, size, truth, motion;
  std::vector<std::string> phases;
  double motion_spacing_mm = 4;
  PhantomOptions phantom;
};

void write_vessels(const std::vector<VesselBranch>& branches, const std::string& name,
                   const std::filesystem::path& folder, const std::string& suffix) {
  const VesselTree tree(branches, name);
  write_tree(tree, folder / ("tree" + suffix + ".vtp"));
  write_names(tree, folder / ("names" + suffix + ".json"));
  write_mesh(tube_mesh(tree), folder / ("surface" + suffix + ".vtp"));
}

/// The ground truth for segmentations of the phantom.
void write_truth(const Phantom& phantom, const std::filesystem::path& folder, ComputeDevice& device,
                 Progress& progress) {
  const std::string name = "phantom " + phantom.name();
  write_vessels(phantom.vessel_branches(), name, folder, "");
  write_mask(phantom.geometry(), vessel_mask(phantom), folder / "mask.nrrd");
  for (const PhantomPart& part : phantom.parts()) {
    const std::string suffix = "_" + part.name;
    write_mask(phantom.geometry(), part_mask(phantom, part.name, device, progress),
               folder / ("mask" + suffix + ".nrrd"));
    if (!part.vessels.empty()) write_vessels(part.vessels, name, folder, suffix);
  }
}

void check_truth_folder(const Phantom& phantom, const std::string& folder) {
  if (phantom.vessel_branches().empty())
    throw InputError(
        "--truth: the phantom {} has no vessels; make thorax, head or abdomen, or leave --truth out",
        phantom.name());
  make_folder(folder, "--truth " + folder);
  check_writable(std::filesystem::path(folder) / "tree.vtp");
}

void make(PhantomArguments options, Invocation& invocation) {
  if (!options.size.empty()) {
    const auto size = parse_sizes(options.size, 3, "--size");
    options.phantom.size = Index3(size[0], size[1], size[2]);
  }
  options.phantom.phase = parse_phases(options.phases);
  const Phantom phantom = make_phantom(options.name, options.phantom);
  check_volume_format(options.output);
  check_writable(options.output);
  if (options.phantom.table && phantom.vessel_branches().empty())
    throw InputError(
        "--table: the phantom {} has no table; make thorax, head or abdomen, or leave --table out",
        phantom.name());
  if (!options.motion.empty()) check_motion(phantom, options.motion_spacing_mm);
  if (!options.truth.empty()) check_truth_folder(phantom, options.truth);
  if (!options.motion.empty()) {
    make_folder(options.motion, "--motion " + options.motion);
    check_writable(std::filesystem::path(options.motion) / "motion.json");
  }

  ComputeDevice device(invocation.device);
  OutputSet outputs;
  write_volume(generate(phantom, device, invocation.progress), options.output, invocation.progress);
  if (!options.truth.empty()) write_truth(phantom, options.truth, device, invocation.progress);
  if (!options.motion.empty())
    write_motion(phantom, options.motion, options.motion_spacing_mm, invocation.progress);
  outputs.commit();
  const VolumeGeometry& g = phantom.geometry();
  invocation.report({{"phantom", options.name}, {"output", options.output}, {"volume", to_json(g)}},
                    fmt::format("{}: {} phantom, {} x {} x {} voxels of {:.3g} x {:.3g} x {:.3g} mm\n",
                                options.output, options.name, g.size.x, g.size.y, g.size.z, g.spacing_mm.x,
                                g.spacing_mm.y, g.spacing_mm.z));
}

}  // namespace

void add_phantom(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<PhantomArguments>();
  CLI::App* command =
      add_command(app, invocation, "phantom", "Make a synthetic CT scan of known anatomy",
                  "  xraycast phantom thorax -o thorax.nrrd --truth thorax-truth/\n"
                  "  xraycast phantom thorax -o inspired.nrrd --phase breath=1 --phase heart=0.4\n"
                  "  xraycast phantom thorax -o thorax.nrrd --coronaries --motion thorax-motion/\n"
                  "  xraycast phantom thorax -o hip.nrrd --hip-prosthesis 20000\n"
                  "  xraycast phantom head -o head.nii.gz --size 256x256x256\n"
                  "  xraycast phantom shepp-logan -o shepp-logan.mha --spacing 2",
                  [options, &invocation] { make(*options, invocation); });
  command->add_option("NAME", options->name, fmt::format("{}", fmt::join(phantom_names(), ", ")))
      ->required()
      ->check(CLI::IsMember(phantom_names()));
  command->add_option("-o,--output", options->output, ".nrrd, .nii, .nii.gz, .mha or .mhd")
      ->required()
      ->type_name("VOLUME");
  command
      ->add_option("--size", options->size, "Number of voxels; without --spacing, the field of view is kept")
      ->type_name("NXxNYxNZ");
  command
      ->add_option("--spacing", options->phantom.spacing_mm,
                   "Voxel size along all axes; without --size, the field of view is kept")
      ->type_name("MM");
  command->add_option("--noise", options->phantom.noise_hu, "Standard deviation of the image noise")
      ->type_name("HU");
  command->add_option("--seed", options->phantom.seed, "Seed of the noise")
      ->capture_default_str()
      ->type_name("N");
  command->add_flag("--table", options->phantom.table, "Include the patient table or the headrest");
  command->add_flag("--coronaries", options->phantom.coronaries,
                    "Include the coronary arteries of the thorax");
  command
      ->add_option("--hip-prosthesis", options->phantom.hip_prosthesis_hu,
                   "Give the thorax a left hip of metal with so many HU, 3100 to 30000")
      ->type_name("HU");
  command
      ->add_option(
          "--phase", options->phases,
          "Hold a movement at a phase, 0 to 1: breath and heart of the thorax, turn of the head; may "
          "be given once for each")
      ->allow_extra_args(false)
      ->type_name("NAME=0..1");
  CLI::Option* motion =
      command
          ->add_option("--motion", options->motion,
                       "Also write how the phantom moves: motion.json and fields of displacements")
          ->type_name("DIR");
  command
      ->add_option("--motion-spacing", options->motion_spacing_mm,
                   "Distance between the nodes of these fields")
      ->needs(motion)
      ->capture_default_str()
      ->type_name("MM");
  command
      ->add_option(
          "--truth", options->truth,
          "Also write the vessels' ground truth: mask.nrrd, tree.vtp and surface.vtp; for the abdomen "
          "these are the arteries, with a mask_PART.nrrd of each vessel system and each organ")
      ->type_name("DIR");
}

}  // namespace xraycast::cli
