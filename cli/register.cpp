#include "options/command.hpp"
#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/registration/camera_file.hpp"
#include "xraycast/registration/registration.hpp"
#include "xraycast/registration/scan_stack.hpp"
#include "xraycast/registration/start_pose.hpp"
#include "xraycast/registration/xray_file.hpp"
#include "xraycast/reports/registration_overlay.hpp"
#include "xraycast/scan/scan.hpp"

#include <fmt/format.h>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace xraycast::cli {
namespace {

namespace fs = std::filesystem;

struct RegisterArguments {
  std::string input, output, overlay, mask, start, search = "15,40", opacity = "bilinear", spacing;
  std::vector<std::string> xrays, cameras;
  ScanOptions scan;
  std::uint64_t seed = 1;
  bool mirror = false, track = false;
};

RegisterRequest request_of(const RegisterArguments& options) {
  RegisterRequest request;
  request.opacity = Opacity::named(options.opacity);
  const std::vector<double> search = parse_numbers(options.search, "--search");
  if (search.size() != 2) throw InputError("--search {}: must be DEG,MM, such as 15,40", options.search);
  request.search_deg = search[0];
  request.search_mm = search[1];
  request.seed = options.seed;
  for_option("--search", [&] { check(request); });
  return request;
}

Volume read_scan(const RegisterArguments& options, Invocation& invocation) {
  if (!options.spacing.empty()) {
    const std::vector<double> mm = parse_numbers(options.spacing, "--spacing");
    if (mm.size() != 3) throw InputError("--spacing {}: must be X,Y,Z in mm", options.spacing);
    return read_stack(options.input, {mm[0], mm[1], mm[2]}, invocation.progress);
  }
  const Scan scan = open_scan(options.input, options.scan, invocation.progress);
  invocation.say_about(scan.info);
  Volume volume = collect(*scan.source, invocation.progress, options.input);
  invocation.say_about(*scan.source);
  return volume;
}

/// One byte a voxel; empty without a mask.
std::vector<std::uint8_t> read_mask(const RegisterArguments& options, const Volume& scan,
                                    Invocation& invocation) {
  if (options.mask.empty()) return {};
  const Scan file = open_scan(options.mask, {}, invocation.progress);
  const Volume mask = collect(*file.source, invocation.progress, options.mask);
  if (mask.geometry().size != scan.geometry().size)
    throw InputError("--mask {}: must be on the scan's grid", options.mask);
  std::vector<std::uint8_t> bytes;
  for (const std::int16_t value : mask.hu()) bytes.push_back(value > 0);
  if (std::ranges::count(bytes, 1) == 0) throw InputError("--mask {}: is empty", options.mask);
  return bytes;
}

/// The frames of each X-ray file, with their cameras.
std::vector<std::vector<Xray>> read_films(const RegisterArguments& options, const Volume& scan) {
  if (!options.cameras.empty() && options.cameras.size() != options.xrays.size())
    throw InputError("--camera: give one for each of the {}", pluralize(options.xrays.size(), "X-ray"));
  std::vector<std::vector<Xray>> films;
  for (std::size_t v = 0; v < options.xrays.size(); ++v) {
    films.push_back(read_xrays(options.xrays[v]));
    if (!options.track && films.back().size() > 1)
      throw InputError("{}: has {} frames; give --track to follow the pose through them", options.xrays[v],
                       films.back().size());
    const std::vector<PinholeCamera> cameras =
        options.cameras.empty() ? std::vector<PinholeCamera>{} : read_cameras(options.cameras[v]);
    for (std::size_t f = 0; f < films.back().size(); ++f) {
      Xray& xray = films.back()[f];
      if (!cameras.empty()) {
        xray.camera = cameras[cameras.size() == 1 ? 0 : std::min(f, cameras.size() - 1)];
        if (xray.camera->width == 0) {
          xray.camera->width = xray.width;
          xray.camera->height = xray.height;
        }
      } else if (xray.camera) {
        xray.camera = looking_at(*xray.camera, scan.geometry());
      } else {
        throw InputError("{}: does not say how it was taken; give --camera FILE with K and RT", xray.name);
      }
    }
  }
  for (const auto& film : films)
    if (film.size() != films.front().size())
      throw InputError("the X-rays have {} and {} frames; films must be as long as each other",
                       films.front().size(), film.size());
  return films;
}

std::vector<Xray> frame_of(const std::vector<std::vector<Xray>>& films, std::size_t frame) {
  std::vector<Xray> xrays;
  for (const auto& film : films) xrays.push_back(film[frame]);
  return xrays;
}

/// What was found, by which of a stack's two mirror images.
struct Found {
  std::vector<Registration> frames;
  bool is_mirrored = false;
  double similarity() const {
    double sum = 0;
    for (const Registration::View& view : frames.front().views) sum += view.similarity;
    return sum / static_cast<double>(frames.front().views.size());
  }
};

Found find(ComputeDevice& device, const Volume& scan, const std::vector<std::uint8_t>& mask,
           const RegisterRequest& request, const std::vector<std::vector<Xray>>& films,
           Invocation& invocation) {
  Registrar registrar(device, scan, mask, request);
  std::vector<std::vector<Xray>> frames;
  for (std::size_t f = 0; f < films.front().size(); ++f) frames.push_back(frame_of(films, f));
  return {.frames = registrar.track(frames, invocation.progress)};
}

Json rows(const glm::dmat3& rotation, const glm::dvec3& translation) {
  Json matrix = Json::array();
  for (int row = 0; row < 3; ++row)
    matrix.push_back({rotation[0][row], rotation[1][row], rotation[2][row], translation[row]});
  return matrix;
}

Json rows(const glm::dmat3& k) {
  Json matrix = Json::array();
  for (int row = 0; row < 3; ++row) matrix.push_back({k[0][row], k[1][row], k[2][row]});
  return matrix;
}

Json json_of(const Found& found) {
  Json poses = Json::array();
  double rms_mm = 0, sd_mm = 0, sd_deg = 0, seconds = 0;
  std::int64_t evaluations = 0;
  bool is_sure = true;
  for (const Registration& frame : found.frames) {
    for (const Registration::View& view : frame.views)
      poses.push_back({{"image", view.image},
                       {"K", rows(view.camera.intrinsics)},
                       {"RT", rows(view.camera.rotation, view.camera.translation_mm)},
                       {"lao_deg", glm::degrees(view.lao_rad)},
                       {"cranial_deg", glm::degrees(view.cranial_rad)},
                       {"similarity", view.similarity},
                       {"motion", rows(frame.motion.rotation, frame.motion.translation_mm)}});
    rms_mm = std::max(rms_mm, frame.rms_mm);
    sd_mm = std::max(sd_mm, frame.sd_mm);
    sd_deg = std::max(sd_deg, frame.sd_deg);
    seconds += frame.seconds;
    evaluations += frame.evaluations;
    is_sure = is_sure && frame.is_sure;
  }
  Json json{{"poses", poses},       {"rms_mm", rms_mm},
            {"sd_mm", sd_mm},       {"sd_deg", sd_deg},
            {"converged", is_sure}, {"evaluations", evaluations},
            {"seconds", seconds},   {"mirrored", found.is_mirrored}};
  return json;
}

std::string text_of(const Found& found) {
  std::string text;
  for (const Registration& frame : found.frames)
    for (const Registration::View& view : frame.views)
      text += fmt::format("{}: {} {:.1f} / {} {:.1f} deg, similarity {:.3f}\n", view.image,
                          view.lao_rad < 0 ? "RAO" : "LAO", std::abs(glm::degrees(view.lao_rad)),
                          view.cranial_rad < 0 ? "CAU" : "CRA", std::abs(glm::degrees(view.cranial_rad)),
                          view.similarity);
  const Registration& last = found.frames.back();
  text += fmt::format("{}standard deviation {:.2f} mm and {:.2f} deg, {} in {:.1f} s{}\n",
                      found.is_mirrored ? "the mirrored stack fits; " : "", last.sd_mm, last.sd_deg,
                      pluralize(last.evaluations, "projection"), last.seconds,
                      last.is_sure ? "" : "; not to be relied on");
  return text;
}

void register_scan(const RegisterArguments& options, Invocation& invocation) {
  RegisterRequest request = request_of(options);
  check_writable(options.output);
  if (!options.overlay.empty()) check_picture_name(options.overlay, "--overlay " + options.overlay);
  if (options.mirror && options.spacing.empty())
    throw InputError("--mirror: only a stack of pictures, read by --spacing, may be mirrored");
  Volume scan = read_scan(options, invocation);
  const std::vector<std::uint8_t> mask = read_mask(options, scan, invocation);
  const std::vector<std::vector<Xray>> films = read_films(options, scan);
  if (!options.start.empty())
    request.start = read_start(options.start, *films.front().front().camera, scan.geometry());
  ComputeDevice device(invocation.device);
  Found found = find(device, scan, mask, request, films, invocation);
  if (options.mirror) {
    mirror(scan);
    Found mirrored = find(device, scan, mask, request, films, invocation);
    mirrored.is_mirrored = true;
    if (mirrored.similarity() > found.similarity())
      found = std::move(mirrored);
    else
      mirror(scan);
  }
  invocation.say(notes_of(found.frames));
  const Json result = json_of(found);
  OutputSet outputs;
  write_whole_file(options.output, result.dump(2) + "\n");
  if (!options.overlay.empty())
    write_picture(registration_overlay(frame_of(films, films.front().size() - 1), found.frames.back(),
                                       upload(device, scan), request.opacity, invocation.progress),
                  options.overlay);
  outputs.commit();
  invocation.report(result, text_of(found) + options.output + ": written\n");
}

}  // namespace

void add_register(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<RegisterArguments>();
  CLI::App* command = add_command(
      app, invocation, "register", "Find from where X-rays of a scan were taken",
      "  xraycast register ct/ run.dcm -o pose.json --overlay fits.png\n"
      "  xraycast register ct.nii.gz ap.tif lateral.tif --camera ap.json --camera lateral.json -o pose.json\n"
      "  xraycast register radius.tif xray1.tif xray2.tif --camera cam1.txt --camera cam2.txt -o pose.json "
      "\\\n"
      "    --spacing 0.4,0.4,0.6 --mirror --opacity grey.json --start near.json --search 15,20\n"
      "The pose is the camera matrix RT from the scan's mm to the camera's, as in Python. All X-rays show "
      "the\n"
      "scan at the same time, from different sides. Their brightness and contrast do not matter.",
      [options, &invocation] { register_scan(*options, invocation); });
  add_scan_argument(*command, options->input);
  command
      ->add_option("XRAY", options->xrays,
                   "X-rays: DICOM (XA, RF, DX, CR), or pictures of 8 or 16 bits with a --camera each")
      ->required()
      ->type_name("XRAY");
  command->add_option("-o,--output", options->output, "The poses, as JSON")->required()->type_name("JSON");
  command
      ->add_option(
          "--camera", options->cameras,
          "The camera of each X-ray, in order: JSON with K and RT, which is where the search starts, "
          "OpenCV's YAML, or Autoscoper's text")
      ->type_name("FILE");
  command
      ->add_option("--start", options->start,
                   "Where to start instead: LAO,CRANIAL in degrees for the first X-ray, or a file with a "
                   "`motion` of the scan, as this command writes")
      ->type_name("LAO,CRA|JSON");
  command
      ->add_option("--search", options->search,
                   "How far the scan may be turned about each axis, and lie off; towards the detector three "
                   "times as far unless another X-ray sees that from the side. 0,0 refines the start")
      ->capture_default_str()
      ->type_name("DEG,MM");
  command
      ->add_option("--opacity", options->opacity,
                   "Attenuation of CT numbers: paper, bilinear, or a JSON file")
      ->capture_default_str()
      ->type_name("NAME|FILE");
  command
      ->add_option("--mask", options->mask,
                   "The part of the scan that is looked for, such as one bone: a mask on its grid")
      ->type_name("FILE");
  command
      ->add_option("--spacing", options->spacing,
                   "INPUT is a stack of pictures, such as a TIFF of several pages, with voxels of this size")
      ->type_name("X,Y,Z");
  command->add_flag("--mirror", options->mirror,
                    "--spacing: also try the stack's mirror image, and say which fits");
  command->add_flag("--track", options->track,
                    "Follow the pose through the frames of films, from each to the next");
  command->add_option("--seed", options->seed, "Of the search")->capture_default_str()->type_name("N");
  command
      ->add_option("--overlay", options->overlay,
                   "A picture for each X-ray: itself, the projection, its edges on the X-ray, a checkerboard")
      ->type_name("IMAGE");
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
