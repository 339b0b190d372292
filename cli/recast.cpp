#include "xraycast/recast.hpp"

#include "command.hpp"
#include "xraycast/atomic_file.hpp"
#include "xraycast/basis_file.hpp"

#include <fmt/format.h>

#include <chrono>
#include <memory>

namespace xraycast::cli {
namespace {

using Clock = std::chrono::steady_clock;

double ms_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

struct Options {
  std::string basis, output, opacity, preview, window = "auto";
};

void recast_map(const Options& options, Session& session) {
  const auto start = Clock::now();
  const Opacity opacity = Opacity::named(options.opacity);
  check_writable(options.output);
  if (!options.preview.empty()) check_writable(options.preview);
  Device device(session.device);

  const auto read_start = Clock::now();
  const Basis basis = read_basis(options.basis);
  const double read_ms = ms_since(read_start);
  const auto upload_start = Clock::now();
  RecastSession recasting(device, basis);
  const double upload_ms = ms_since(upload_start);
  const BodyMap& map = recasting.recast(opacity);

  const auto write_start = Clock::now();
  write_body_map(map, options.output);
  if (!options.preview.empty())
    write_preview(map, options.window == "paper" ? PreviewWindow::paper : PreviewWindow::automatic,
                  options.preview);
  const double write_ms = ms_since(write_start), total_ms = ms_since(start);
  session.print({{"basis", {{"file", options.basis}, {"knots_hu", basis.knots_hu}}},
                 {"map", to_json(map.geometry)},
                 {"timings_ms",
                  {{"read", read_ms},
                   {"upload", upload_ms},
                   {"kernel", recasting.kernel_ms()},
                   {"write", write_ms},
                   {"total", total_ms}}}},
                fmt::format("{}: {} layers of {} angles x {} slices, opacity {}\n"
                            "read {:.0f} ms, upload {:.0f} ms, kernel {:.1f} ms, write {:.0f} ms, total "
                            "{:.0f} ms\n",
                            options.output, map.geometry.layers(), map.geometry.width, map.geometry.height,
                            opacity.name(), read_ms, upload_ms, recasting.kernel_ms(), write_ms, total_ms));
}

}  // namespace

void add_recast(CLI::App& app, Session& session) {
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      add_command(app, session, "recast", "A body map under another opacity, without the scan",
                  "  xraycast cast scans/chest/ -o chest.exr --layers 8 --keep-basis chest.basis\n"
                  "  xraycast recast chest.basis -o bone.exr --opacity bone.json --preview bone.png",
                  [options, &session] { recast_map(*options, session); });
  command->add_option("BASIS", options->basis, "What `xraycast cast --keep-basis` wrote")->required();
  command->add_option("-o,--output", options->output, "The body map, OpenEXR")
      ->required()
      ->type_name("MAP.exr");
  command
      ->add_option("--opacity", options->opacity,
                   "paper, bilinear, or a JSON file of HU and mu; all HU have to be knots of the basis")
      ->required()
      ->type_name("NAME|FILE");
  command->add_option("--preview", options->preview, "Also a picture of the layers, innermost on top")
      ->type_name("PNG");
  command
      ->add_option("--preview-window", options->window,
                   "auto: so that a person sees something; paper: exp(-tau), unscaled")
      ->check(CLI::IsMember({"auto", "paper"}))
      ->capture_default_str()
      ->type_name("auto|paper");
}

}  // namespace xraycast::cli
