// The program as a user meets it: exit status, stdout, stderr, and the files that are there afterwards.
#include "support/pictures.hpp"
#include "support/process.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/casting/body_map.hpp"
#include "xraycast/scan/scan.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstring>
#include <regex>
#include <sched.h>
#include <sstream>
#include <sys/mount.h>

namespace xraycast::cli_test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

/// A folder's files with their bytes' hash, and its folders.
using Snapshot = std::map<std::string, std::size_t>;

Snapshot snapshot(const fs::path& folder) {
  Snapshot all;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    all[entry.path().string()] =
        entry.is_regular_file() ? std::hash<std::string>()(read_bytes(entry.path())) : 0;
  return all;
}

std::vector<std::string> keys_of(const Json& json) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : json.items()) keys.push_back(key);
  return keys;
}

/// 8 x 8 x 4 voxels of 1 mm from the origin on, all of them water.
NiftiFile little_scan() {
  NiftiFile file;
  file.dim = {3, 8, 8, 4, 1, 1, 1, 1};
  file.sform = {-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0};  // LPS, so that nothing needs reorienting
  file.voxels = std::string(8 * 8 * 4 * 2, '\0');
  return file;
}

/// The same of more slices.
NiftiFile water(std::int16_t slices) {
  NiftiFile file = little_scan();
  file.dim[3] = slices;
  file.voxels = std::string(static_cast<std::size_t>(8 * 8 * slices * 2), '\0');
  return file;
}

class Cli : public testing::Test {
 protected:
  /// `line` is what follows the program's name, its words apart by spaces; @ stands for the test's folder.
  Command command(const std::string& line) const {
    return command_of({XRAYCAST_PROGRAM}, line, folder_.path());
  }

  Finished run(const std::string& line) const { return run_process(command(line)); }

  /// The same, of which no complaint is expected.
  std::string output_of(const std::string& line) const {
    const Finished done = run(line);
    EXPECT_EQ(done.status, 0) << line;
    EXPECT_EQ(done.err, "") << line;
    return done.out;
  }
  Json json_of(const std::string& line) const { return Json::parse(output_of(line + " --json")); }

  static void expect_one_line(const std::string& err, const std::string& part) {
    EXPECT_THAT(err, StartsWith("xraycast: "));
    EXPECT_THAT(err, HasSubstr(part));
    EXPECT_EQ(std::ranges::count(err, '\n'), 1) << err;
    EXPECT_EQ(err.back(), '\n');
  }

  TemporaryFolder folder_;
};

// ---- what goes wrong ------------------------------------------------------------------------------

struct BadCall {
  const char* name;
  const char* line;
  int status;
  const char* message;
  void (*make)(const TemporaryFolder&) = [](const TemporaryFolder&) {};  ///< what lies in the folder
};

DicomFile slice() { return {8, 8, std::vector<std::int16_t>(64)}; }

std::string nrrd_of(const std::string& sizes, const std::string& dimension = "3") {
  return "NRRD0004\ntype: short\ndimension: " + dimension + "\nsizes: " + sizes +
         "\nencoding: raw\nendian: little\n\nvoxels";
}

void make_push(const TemporaryFolder& f) {
  write_bytes(f / "push.csv", "time_s,insertion_mm,rotation_deg\n0,0,0\n0.5,20,90\n1,20,90\n");
}

void make_push_and_tree(const TemporaryFolder& f) {
  make_push(f);
  write_bytes(f / "tree.json",
              R"({"branches": [{"id": 0, "parent": -1, "points": [[0, 0, 0, 0.5], [0, 0, 100, 0.5]]}]})");
}

/// A map of one layer and five rows.
void write_small_map(const TemporaryFolder& folder) {
  BodyMap map;
  map.geometry.width = 8;
  map.geometry.height = 5;
  map.geometry.radii_mm = {0, 10};
  map.geometry.centre_mm = {{0, 0}};
  map.tau.assign(map.layer_size(), 0.5f);
  write_body_map(map, folder / "map.exr");
}

/// A catheter's run with a map to draw it in.
void make_run(const TemporaryFolder& folder) {
  make_push_and_tree(folder);
  write_small_map(folder);
}
#define SIMULATE_DSA                                                                                        \
  "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv --map @/map.exr " \
  "--cine @/c.gif --look dsa"

const BadCall kBadCalls[] = {
    // Vessels. The little scan is 4 slices of water.
    {"SegmentFewSlices", "segment @/ct.nii -o @/v", 3, "4 slices, too few"},
    {"SegmentNothingBright", "segment @/a.nii -o @/v", 3, "no vessel: all voxels have about 0 HU",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nii", water(12).bytes()); }},
    {"SegmentSeedOutside", "segment @/a.nii -o @/v --seed 0,0,900", 3, "lies outside the scan",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nii", water(12).bytes()); }},
    {"SegmentSeedInTheDark", "segment @/a.nii -o @/v --window 100,900 --seed 3,3,3", 3,
     "does not lie in a bright structure",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nii", water(12).bytes()); }},
    {"SegmentAllBright", "segment @/a.nii -o @/v --window -10,900", 3, "no vessel",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nii", water(12).bytes()); }},
    {"SegmentMaskOnAnotherGrid", "segment @/a.nii -o @/v --from-mask @/ct.nii", 3, "--from-mask",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nii", water(12).bytes()); }},
    {"SegmentSeedOfTwo", "segment @/ct.nii -o @/v --seed 1,2", 3, "--seed 1,2: must be X,Y,Z"},
    {"SegmentExplainsNoMask", "segment @/ct.nii -o @/v --from-mask @/ct.nii --explain @/steps", 2,
     "--explain"},
    {"SegmentExcludesFromAMask", "segment @/ct.nii -o @/v --from-mask @/ct.nii --not 1,2,3", 3,
     "--not does not apply to --from-mask"},
    {"SegmentAMaskInAWindow", "segment @/ct.nii -o @/v --from-mask @/ct.nii --window 100,900", 3,
     "--window does not apply to --from-mask"},
    {"SegmentAMaskWithoutChambers", "segment @/ct.nii -o @/v --from-mask @/ct.nii --max-radius 9", 3,
     "--max-radius does not apply to --from-mask"},
    {"SegmentWindowReversed", "segment @/ct.nii -o @/v --window 300,200", 3, "--window 300,200"},
    {"SegmentIntoAFile", "segment @/nothing -o @/ct.nii/vessels", 3,
     "ct.nii/vessels: the folder cannot be created: "},
    {"SegmentRadiusZero", "segment @/ct.nii -o @/v --max-radius 0", 3, "--max-radius 0"},

    {"VesselnessScaleOfText", "vesselness @/ct.nii -o @/v.nrrd --scales 1,wide", 3, "'wide' is not a number"},
    {"VesselnessScaleZero", "vesselness @/ct.nii -o @/v.nrrd --scales 1,0", 3,
     "--scales 1,0: 0 mm must be from 0.1 to 20 mm"},
    {"VesselnessManyScales", "vesselness @/ct.nii -o @/v.nrrd --scales 1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1", 3,
     "at most 16 scales"},
    {"VesselnessNoContrast", "vesselness @/ct.nii -o @/v.nrrd --contrast 0", 3, "--contrast 0: must be"},
    {"VesselnessAsDicom", "vesselness @/ct.nii -o @/v.dcm", 3, "v.dcm: unknown volume format"},
    {"VesselnessOverItsScan", "vesselness @/ct.nii -o @/ct.nii", 3, "would overwrite it"},
    {"VesselnessUnknownMeasure", "vesselness @/ct.nii -o @/v.nrrd --measure sato", 2, "sato not in"},
    {"VesselnessOfNothing", "vesselness @/nothing -o @/v.nrrd", 3, "nothing: no such file or folder"},

    // The catheter. A tube of one branch, 1 mm wide.
    {"SimulateNoTree", "simulate @/tree.json --device-model cobra-5f --script @/push.csv -o @/log.csv", 3,
     "tree.json: no such file", make_push},
    {"SimulateTooLong",
     "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv", 3,
     "push.csv: line 3: time_s 1e+09 is more than a day, 86400",
     [](const TemporaryFolder& f) {
       make_push_and_tree(f);
       write_bytes(f / "push.csv", "time_s,insertion_mm,rotation_deg\n0,0,0\n1e9,5,0\n");
     }},
    {"SimulateNoEntry",
     "simulate @/tree.json --device-model cobra-5f --script @/push.csv -o @/log.csv --entry 7", 3,
     "--entry 7: there is no branch 7", make_push_and_tree},
    {"SimulateEntryOfTwo",
     "simulate @/tree.json --device-model cobra-5f --script @/push.csv -o @/log.csv --entry 7,8", 3,
     "--entry 7,8: must be", make_push_and_tree},
    {"SimulateEntryOfAWord",
     "simulate @/tree.json --device-model cobra-5f --script @/push.csv -o @/log.csv --entry femoral", 3,
     "--entry femoral: must be a branch's number, as in the report.png of `xraycast segment`, or X,Y,Z in mm",
     make_push_and_tree},
    {"SimulateInNoVessels", "simulate @/vessels --device-model cobra-5f --script @/push.csv -o @/log.csv", 3,
     "vessels: no such file or folder; check its name", make_push},
    {"SimulateInAScan", "simulate @/ct.nii --device-model cobra-5f --script @/push.csv -o @/log.csv", 3,
     "ct.nii: a vessel tree is a folder, or a file that ends in .vtp or .json; give one of these", make_push},
    {"SimulateEntryFarAway",
     "simulate @/tree.json --device-model cobra-5f --script @/push.csv -o @/log.csv --entry 0,0,900", 3,
     "mm away", make_push_and_tree},
    {"SimulateTooThick", "simulate @/tree.json --device-model cobra-5f --script @/push.csv -o @/log.csv", 3,
     "nor into any other end; choose a thinner device", make_push_and_tree},
    {"SimulateUnknownDevice", "simulate @/tree.json --device-model asp --script @/push.csv -o @/log.csv", 3,
     "asp: unknown device; choose one of guidewire-035-j", make_push_and_tree},
    {"SimulateMisspelledCatheter",
     "simulate @/tree.json --device-model cobra5f --script @/push.csv -o @/log.csv", 3,
     "cobra5f: unknown device; did you mean cobra-5f? Else choose one of guidewire-035-j, ",
     make_push_and_tree},
    {"SimulateMisspelledWire",
     "simulate @/tree.json --device-model guidewire-35-angled --script @/push.csv -o @/log.csv", 3,
     "guidewire-35-angled: unknown device; did you mean guidewire-035-angled? Else", make_push_and_tree},
    {"SimulateTwoDevicesInOneOption",
     "simulate @/tree.json --device-model cobra-5f,guidewire-035-j --script @/push.csv -o @/log.csv", 2,
     "cobra-5f,guidewire-035-j: one device an option; give --device-model cobra-5f --device-model "
     "guidewire-035-j",
     make_push_and_tree},
    {"SimulateTooThickForItsLumen",
     "simulate @/tree.json --device-model microcatheter-27f --device-model guidewire-035-j --script "
     "@/push.csv "
     "-o @/log.csv",
     3, "does not fit into the lumen of microcatheter-27f, of 0.318 mm; choose a thinner one",
     [](const TemporaryFolder& f) {
       make_push_and_tree(f);
       write_bytes(f / "push.csv",
                   "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg\n0,0,0,0,0\n1,5,0,5,0\n");
     }},
    {"SimulateTwoByAScriptForOne",
     "simulate @/tree.json --device-model microcatheter-27f --device-model guidewire-014-angled --script "
     "@/push.csv -o @/log.csv",
     3, "push.csv: line 1: no column insertion_2_mm; a script of 2 devices has", make_push_and_tree},
    {"SimulateFourByAScriptForOne",
     "simulate @/tree.json --device-model guide-6f --device-model jb1-5f --device-model microcatheter-24f "
     "--device-model guidewire-014-angled --script @/push.csv -o @/log.csv",
     3, "4 devices; give one to 3", make_push_and_tree},
    {"SimulateThickInThinByAScriptForOne",
     "simulate @/tree.json --device-model microcatheter-27f --device-model cobra-5f --script @/push.csv -o "
     "@/log.csv",
     3, "list the outermost device first", make_push_and_tree},
    {"SimulateIntoAFilmOfAnotherFormat",
     "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv --map @/map.exr "
     "--cine @/run.mp4",
     3, "run.mp4: must be a folder for PNGs, whose name has no ending, or end in .gif or .dcm", make_run},
    {"InjectThroughAWire",
     "simulate @/tree.json --device-model guidewire-014-angled --script @/push.csv -o @/log.csv --map "
     "@/map.exr --cine @/c.gif --inject 0.2,2",
     3, "--inject 0.2,2: guidewire-014-angled has no lumen; leave --inject out, or give a catheter",
     make_run},
    {"InjectWithoutPictures",
     "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv --inject 0.2,2",
     3, "--inject does not apply without pictures of the run; leave it out or give --cine too", make_run},
    {"SimulateInAMapWithoutPictures",
     "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv --map @/map.exr",
     3, "--map does not apply without pictures of the run", make_run},
    {"InjectAtARateNothing", SIMULATE_DSA " --injection-rate 4", 2, "--injection-rate requires --inject",
     make_run},
    {"InjectAVolumeNever", SIMULATE_DSA " --injection-volume 4", 2, "--injection-volume requires --inject",
     make_run},
    {"IodineOfNoInjection", SIMULATE_DSA " --iodine 300", 2, "--iodine requires --inject", make_run},
    {"HeartWithoutInjection", SIMULATE_DSA " --heart-rate 80", 2, "--heart-rate requires --inject", make_run},
    {"CastWindowWithoutPreview", "cast @/nothing -o @/out.exr --preview-window paper", 2,
     "--preview-window requires --preview"},
    {"RecastWindowWithoutPreview", "recast @/nothing -o @/out.exr --opacity paper --preview-window paper", 2,
     "--preview-window requires --preview"},
    {"RenderReconstructedWalls", "render @/map.exr -o @/out.png --compositing wall --reconstruction linear",
     3, "--reconstruction linear: applies only to --compositing path; leave it out", make_run},
    {"CompareReconstructedWalls", "compare @/nothing @/map.exr --compositing wall --reconstruction constant",
     3, "--reconstruction does not apply to --compositing wall; leave it out", make_run},
    {"RenderContrastInNothing", "render @/map.exr -o @/out.png --contrast 100", 3,
     "--contrast 100: there are no vessels that it could fill; give --vessels too", make_run},
    {"ExportContrastInNothing", "export @/map.exr -o @/out.html --contrast 100", 3,
     "--contrast 100: there are no vessels that it could fill; give --vessels too", make_run},
    {"ProjectAtTwoVoltages", "project @/ct.nii -o @/out.png --opacity spectrum:80 --kvp 90", 3,
     "--kvp 90 with --opacity spectrum:80: both set the tube voltage; leave one of them out",
     [](const TemporaryFolder& f) { write_bytes(f / "ct.nii", little_scan().bytes()); }},
    {"TableOfABox", "phantom box -o @/out.nrrd --table", 3,
     "--table: the phantom box has no table; make thorax, head or abdomen, or leave --table out"},
    {"InjectBackInTime", SIMULATE_DSA " --inject 0.8,0.4", 3, "--inject 0.8,0.4: must be FROM,TO in seconds",
     make_run},
    {"InjectWithoutEnd", SIMULATE_DSA " --inject 0.5", 3, "or add --injection-volume", make_run},
    {"InjectTooLate", SIMULATE_DSA " --inject 5,6", 3, "begins after the end of", make_run},
    {"InjectNothing", SIMULATE_DSA " --inject 0.5,0.9 --injection-rate 0", 3,
     "--injection-rate 0: must be above 0 and at most 50 ml/s", make_run},
    {"InjectWithoutBound", SIMULATE_DSA " --inject 0.5 --injection-volume 1e9", 3,
     "--injection-volume 1e+09: must be above 0 and at most 300 ml", make_run},
    {"InjectForHours", SIMULATE_DSA " --inject 0.5,9000", 3, "inject at most 300 ml", make_run},
    {"InjectLead", SIMULATE_DSA " --inject 0.5,0.9 --iodine 5000", 3,
     "--iodine 5000: must be above 0 and at most 400 mg/ml", make_run},
    {"InjectWithoutAHeart", SIMULATE_DSA " --inject 0.5,0.9 --heart-rate 0", 3,
     "--heart-rate 0: must be 20 to 250 beats per minute", make_run},
    {"SubtractNothing", SIMULATE_DSA, 3, "--look dsa: there is no contrast agent to show; add --inject",
     make_run},
    {"ShiftNoMask", SIMULATE_DSA " --inject 0.5,0.9 --mask-shift 1", 3,
     "--mask-shift 1: must be RIGHT,DOWN in pixels", make_run},
    {"ShiftAMaskOfNothing",
     "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv --map @/map.exr "
     "--cine @/c.gif --mask-shift 1,1",
     3, "--mask-shift: applies only to --look dsa", make_run},
    {"SubtractMoreFramesThanDicomCounts",
     "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv --map @/map.exr "
     "--cine @/run.dcm --look dsa --inject 1,2 --size 8x8 --cone 780,1200",
     3, "run.dcm: 69996 frames; DICOM counts those of a run with a mask up to 65535: draw fewer frames",
     [](const TemporaryFolder& f) {
       make_run(f);
       write_bytes(f / "push.csv", "time_s,insertion_mm,rotation_deg\n0,0,0\n7000,5,0\n");
     }},
    {"RenderSubtractionOfNothing", "render @/map.exr -o @/out.png --look dsa", 3,
     "--look dsa: there are no vessels with contrast agent; give --vessels too", make_run},
    {"SimulateBackInTime",
     "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv", 3,
     "push.csv: line 4: time_s 1 is not later than 2",
     [](const TemporaryFolder& f) {
       make_push_and_tree(f);
       write_bytes(f / "push.csv", "time_s,insertion_mm,rotation_deg\n0,0,0\n2,5,0\n1,6,0\n");
     }},
    {"SimulateTooFar",
     "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv", 3,
     "push.csv: line 3: insertion_mm 1500; microcatheter-27f can be inserted by at most 1280 mm",
     [](const TemporaryFolder& f) {
       make_push_and_tree(f);
       write_bytes(f / "push.csv", "time_s,insertion_mm,rotation_deg\n0,0,0\n20,1500,0\n");
     }},

    // Outlines.
    {"OutlineOfARectangle", "cast @/ct.nii -o @/out.exr --projection rectangle --outline body", 3,
     "--outline does not apply to --projection rectangle; leave it out"},
    {"KeepTableOfCircles", "cast @/ct.nii -o @/out.exr --keep-table --outline circle", 3,
     "--keep-table: circles always include"},
    {"OutlineOfAir", "cast @/a.nii -o @/out.exr --outline body", 3, "nothing in the scan lies above -300 HU",
     [](const TemporaryFolder& f) {
       NiftiFile air = water(12);
       const std::vector<std::int16_t> hu(air.voxels.size() / 2, -1000);
       air.voxels.assign(reinterpret_cast<const char*>(hu.data()), 2 * hu.size());
       write_bytes(f / "a.nii", air.bytes());
     }},

    // The scan.
    {"MissingScan", "cast @/nothing -o @/out.exr", 3, "nothing: no such file or folder"},
    {"EmptyFolder", "cast @/empty -o @/out.exr", 3, "the folder is empty",
     [](const TemporaryFolder& f) { fs::create_directory(f / "empty"); }},
    {"TextFile", "cast @/a.dcm -o @/out.exr", 3, "not a scan",
     [](const TemporaryFolder& f) { write_bytes(f / "a.dcm", "this is text\n"); }},
    {"TruncatedNifti", "project @/a.nii -o @/out.exr", 3, "truncated",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nii", little_scan().bytes().substr(0, 700)); }},
    {"TruncatedNrrd", "project @/a.nrrd -o @/out.exr", 3, "truncated, 6 of 512 bytes",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nrrd", nrrd_of("8 8 4")); }},
    {"TruncatedDicom", "cast @/a -o @/out.exr", 3,
     "truncated, 123 of 128 bytes of pixel data are there; copy the file again, or leave damaged "
     "slices out by --skip-damaged",
     [](const TemporaryFolder& f) {
       slice().write(f / "a");
       const std::string whole = read_bytes(f / "a");
       write_bytes(f / "a", whole.substr(0, whole.size() - 5));
     }},
    {"TruncatedDicomAlone", "info @/a --skip-damaged", 3, "all slices of the series are damaged",
     [](const TemporaryFolder& f) {
       slice().write(f / "a");
       write_bytes(f / "a", read_bytes(f / "a").substr(0, 300));
     }},
    {"ColourScreenShot", "info @/a", 3, "such as a screen shot; give the folder of a CT series",
     [](const TemporaryFolder& f) { slice().number(0x00280002, 3).write(f / "a"); }},
    {"FolderForAMap", "render @/ -o @/out.png", 3,
     "a body map is needed; make one from a scan with `xraycast cast`"},
    {"ScanForAMap", "render @/ct.nii -o @/out.png", 3, "not a body map; make one with `xraycast cast`"},
    {"MissingMap", "render @/gone.exr -o @/out.png", 3, "gone.exr: no such file; check its name"},
    {"FolderForATree", "simulate @/ --device-model cobra-5f --script @/push.csv -o @/log.csv", 3,
     "no tree.vtp; give the one that `xraycast segment` wrote", make_push_and_tree},
    {"DicomOfReportsOnly", "info @/cd", 3, "no image slices: 1 structured report",
     [](const TemporaryFolder& f) {
       fs::create_directory(f / "cd");
       slice()
           .text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.88.11")
           .erase(0x00280010)
           .erase(0x7fe00010)
           .write(f / "cd/report");
     }},
    {"FourDimensions", "info @/a.nrrd", 3, "4 dimensions",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nrrd", nrrd_of("2 2 2 2", "4")); }},
    {"SpacingZero", "info @/a.nii", 3, "pixdim",
     [](const TemporaryFolder& f) {
       NiftiFile file = little_scan();
       file.pixdim[2] = 0;
       write_bytes(f / "a.nii", file.bytes());
     }},
    {"HugeScan", "cast @/a.nrrd -o @/out.exr", 3, "truncated, 6 of 432000000000000 bytes",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nrrd", nrrd_of("60000 60000 60000")); }},
    {"SliceWithoutThickness", "cast @/a -o @/out.exr", 3, "single slice without a thickness",
     [](const TemporaryFolder& f) { slice().erase(0x00180050).write(f / "a"); }},

    // The output.
    {"OutputFolderMissing", "cast @/ct.nii -o @/missing/out.exr", 3, "the output folder does not exist"},
    {"OutputFolderIsAFile", "project @/ct.nii -o @/ct.nii/out.png", 3, "the output folder does not exist"},
    {"OutputFolderNotWritable", "cast @/ct.nii -o /proc/out.exr", 3, "/proc/out.exr: cannot be written"},
    {"OutputIsADevice", "phantom box -o @/device.nrrd", 3, "not a regular file",
     [](const TemporaryFolder& f) { fs::create_symlink("/dev/null", f / "device.nrrd"); }},
    {"OutputIsALinkToNothing", "phantom box -o @/link.nrrd", 3, "a dangling symbolic link",
     [](const TemporaryFolder& f) { fs::create_symlink("nothing.nrrd", f / "link.nrrd"); }},
    {"OutputIsAFolder", "cast @/ct.nii -o @/folder.exr", 3, "not a regular file",
     [](const TemporaryFolder& f) { fs::create_directory(f / "folder.exr"); }},
    {"MapNotNamedExr", "cast @/ct.nii -o @/map.tif", 3, "map.tif: the file name must end in .exr"},
    {"PreviewThatIsNoPicture", "cast @/ct.nii -o @/out.exr --preview @/map.xyz", 3,
     "map.xyz: a picture's name must end in .png, .jpg, "},
    {"ProjectionOverItsScan", "project @/ct.nii -o @/./ct.nii", 3, "would overwrite it"},
    {"BasisOverItsMap", "cast @/ct.nii -o @/out.exr --keep-basis @/out.exr", 3,
     "is also given as --keep-basis"},
    {"ProjectionOfUnknownFormat", "project @/ct.nii -o @/out.xyz", 3,
     ".xyz: a single picture is written as .exr, .nrrd (float), .dcm (DICOM XA) or one of .png, .jpg, "},
    {"VolumeOfUnknownFormat", "phantom box -o @/box.dcm", 3, ".nrrd, .nii, .nii.gz, .mha or .mhd"},
    {"HeaderThatCannotNameItsVoxels", "phantom box -o @/50%.mhd", 3, "choose another name or .mha"},
    {"TruthOfNoVessels", "phantom box -o @/box.nrrd --truth @/truth", 3, "has no vessels"},

    // The opacity.
    {"OpacityUnknown", "cast @/ct.nii -o @/out.exr --opacity fog", 3, "fog: unknown opacity"},
    {"OpacityUnsorted", "cast @/ct.nii -o @/out.exr --opacity @/mu.json", 3, "sort the knots",
     [](const TemporaryFolder& f) { write_bytes(f / "mu.json", R"({"knots": [[0, 0], [-9, 1]]})"); }},
    {"OpacityNotFinite", "project @/ct.nii -o @/out.exr --opacity @/mu.json", 3,
     "mu.json: ", [](const TemporaryFolder& f) { write_bytes(f / "mu.json", R"({"knots": [[0, 1e999]]})"); }},
    {"OpacityBelowZero", "project @/ct.nii -o @/out.exr --opacity @/mu.json", 3, "not negative",
     [](const TemporaryFolder& f) { write_bytes(f / "mu.json", R"({"knots": [[0, -1]]})"); }},

    // The map.
    {"LayersZero", "cast @/ct.nii -o @/out.exr --layers 0", 3, "--layers 0: must be 1 to 256"},
    {"RadiusZero", "cast @/ct.nii -o @/out.exr --radius 0", 3, "radius is 0 mm"},
    {"RadiusOfTwoNumbers", "cast @/ct.nii -o @/out.exr --radius 3,4", 3, "one number in mm"},
    {"AnglesBelowZero", "cast @/ct.nii -o @/out.exr --angles -5", 3, "-5 angles"},
    {"AnglesZero", "cast @/ct.nii -o @/out.exr --angles 0", 3, "0 angles, but there must be 1 to 16384"},
    {"CentreOutsideTheScan", "cast @/ct.nii -o @/out.exr --centre 500,0", 3, "spans -0.5 to 7.5 mm in x"},
    {"CentreOfOneNumber", "cast @/ct.nii -o @/out.exr --centre 5", 3,
     "--centre 5: must be auto, vessels:DIR or X,Y"},
    {"CentreOfWords", "cast @/ct.nii -o @/out.exr --centre here", 3, "'here' is not a number"},
    {"RadiiDescending", "cast @/ct.nii -o @/out.exr --radii 4,2", 3, "does not exceed the one before it"},
    {"RadiiNotAsManyAsLayers", "cast @/ct.nii -o @/out.exr --radii 0,2,4 --layers 3", 3,
     "makes 2 layers, but --layers asks for 3"},
    {"RadiiOfAnotherRadius", "cast @/ct.nii -o @/out.exr --radii 0,2,4 --radius 5", 3, "leave --radius out"},
    {"RadiiOfAnotherRadiusOfCircles", "cast @/ct.nii -o @/out.exr --outline circle --radii 0,2,4 --radius 5",
     3, "leave --radius out"},
    {"RadiiOfOneEdge", "cast @/ct.nii -o @/out.exr --radii 4", 3, "all edges in mm, innermost first"},
    {"LayersOfARectangle", "cast @/ct.nii -o @/out.exr --projection rectangle --layers 8", 3,
     "--layers does not apply to --projection rectangle"},
    {"ViewsOfACylinder", "cast @/ct.nii -o @/out.exr --views 8", 3, "--views does not apply"},
    {"CentreLineOfASphere", "cast @/ct.nii -o @/out.exr --projection sphere --centre-line @/l.csv", 3,
     "--centre-line does not apply"},
    {"CentreAndCentreLine", "cast @/ct.nii -o @/out.exr --centre 1,1 --centre-line @/l.csv", 3,
     "give only one of them"},
    {"MapRefusedBeforeTheScanIsRead", "cast @/nothing -o @/out.exr --centre here", 3, "--centre"},

    // The basis.
    {"BasisOfASphere", "cast @/ct.nii -o @/out.exr --projection sphere --keep-basis @/b", 3, "cylinder maps"},
    {"BasisOfASpectrum", "cast @/ct.nii -o @/out.exr --opacity spectrum:80 --keep-basis @/b", 3,
     "with an opacity"},
    {"BasisOfASlab", "cast @/ct.nii -o @/out.exr --memory-limit 0.0001M --keep-basis @/b", 3,
     "needs the whole scan in memory"},
    {"BasisWithoutAPlace", "cast @/ct.nii -o @/out.exr --keep-basis @/missing/b", 3, "folder does not exist"},
    {"KnotsDescending", "cast @/nothing -o @/out.exr --keep-basis @/b --knots 0,-5", 3, "knot 1 at -5 HU"},
    {"KnotsWithoutABasis", "cast @/ct.nii -o @/out.exr --knots 0,5", 2, "--keep-basis"},
    {"BasisMissing", "recast @/nothing -o @/out.exr --opacity paper", 3, "nothing: no such file"},
    {"BasisIsAScan", "recast @/ct.nii -o @/out.exr --opacity paper", 3,
     "not a basis; make one with `xraycast cast --keep-basis`"},
    {"RecastUnderASpectrum", "recast @/nothing -o @/out.exr --opacity spectrum:80", 3,
     "beam hardening cannot be recast"},
    {"RecastUnderNothing", "recast @/ct.nii -o @/out.exr", 2, "--opacity is required"},

    // The picture and the phantom.
    {"ConeOfAHair", "project @/ct.nii -o @/out.exr --cone 1e-308,1500", 3, "the source must be 1 mm or more"},
    {"ConeOfNoEnd", "project @/ct.nii -o @/out.exr --cone 1000,1e7", 3, "within 1e+06 mm"},
    {"SizeOfOneNumber", "project @/ct.nii -o @/out.exr --size 640", 3, "--size 640: must be 2 numbers"},
    {"RenderOfNothing", "render -o @/out.png", 3, "give a MAP.exr or --session"},
    {"RenderOfNoMap", "render @/ct.nii -o @/out.png", 3, "not a body map; make one with"},
    {"RenderOfUnknownLook", "render @/map.exr -o @/out.png --look negative", 2, "negative not in"},
    {"RenderSurfacesOfNothing", "render @/map.exr -o @/out.exr --look surface", 3,
     "--look surface: there is nothing to shade; give --vessels or --catheter", write_small_map},
    {"GammaOfDepths", "project @/nothing -o @/out.exr --gamma 2", 3, "--gamma does not apply to"},
    {"InvertedDepths", "project @/nothing -o @/out.nrrd --inverted", 3, "--inverted does not apply to"},
    {"RenderInvertedDepths", "render @/map.exr -o @/out.tif --inverted", 3,
     "which holds values that are not displayed; leave it out or write a .png"},
    {"RenderDepthsOfFullContrast", "render @/map.exr -o @/out.exr --full-contrast", 3,
     "--full-contrast does not apply to"},
    {"RenderDepthsWithAnnotations", "render @/map.exr -o @/out.exr --annotations", 3,
     "--annotations does not apply to"},
    {"RenderWithWeightsBelowZero", "render @/map.exr -o @/out.png --layer-weights=-0.5,1", 3,
     "--layer-weights -0.5,1: each must be 0 to 100", write_small_map},
    {"RenderWithWeightsOfOtherLayers", "render @/map.exr -o @/out.png --layer-weights 1,0,1", 3,
     "3 layer weights for the 1 layer of", write_small_map},
    {"RenderSurfacesInFullContrast", "render @/map.exr -o @/out.png --look surface --full-contrast", 3,
     "--full-contrast does not apply to --look surface"},
    {"RenderOfUnknownFormat", "render @/map.exr -o @/out.xyz", 3,
     ".xyz: a single picture is written as .exr, .nrrd (float), .dcm (DICOM XA) or one of .png, .jpg, "},
    {"AnglesThatRunAway", "compare @/ct.nii @/map.exr --angles 0:30:-1", 3,
     "--angles 0:30:-1: must be FROM:TO:STEP"},
    {"WallRadiusWithoutWalls", "render @/map.exr -o @/out.png --wall-radius 100", 3, "--compositing wall",
     write_small_map},
    {"PicturesOfMapsOfOneName", "compare @/ct.nii @/map.exr @/sub/../map.exr --pictures @/p", 3,
     "two maps are named map", [](const TemporaryFolder& f) { fs::create_directory(f / "sub"); }},
    {"PicturesIntoAFile", "compare @/ct.nii @/map.exr --pictures @/ct.nii", 3, "is a file; name a folder"},
    {"PlotThatIsNoPicture", "compare @/ct.nii @/map.exr --plot @/plot.xyz", 3,
     "/plot.xyz: a picture's name must end in .png, .jpg, "},
    {"CineThatRunsAway", "render @/map.exr -o @/frames.gif --cine 0:360:-5", 3, "FROM:TO:STEP"},
    {"CineWithAnAngle", "render @/map.exr -o @/turn.gif --lao 30 --cine 0:30:10", 3,
     "--angle (--lao) 30 with --cine 0:30:10: --cine sets the angles of all frames; leave the single one "
     "out"},
    {"IsocentreOfTwo", "project @/ct.nii -o @/out.png --isocentre 4,4", 3,
     "--isocentre 4,4: must be X,Y,Z in mm"},
    {"IsocentreOutside", "render @/map.exr -o @/out.png --isocentre 0,0,900", 3,
     "--isocentre 0,0,900: lies outside the body, whose middle is 0,0,", write_small_map},
    {"CineIntoAFilmOfAnotherFormat", "render @/map.exr -o @/turn.mp4 --cine 0:360:90", 3,
     "turn.mp4: must be a folder for PNGs, whose name has no ending, or end in .gif or .dcm"},
    {"CineIntoAPicture", "render @/map.exr -o @/c.png --cine 0:360:90", 3, "must be a folder for PNGs"},
    {"RenderOfMissingVessels", "render @/map.exr -o @/out.png --vessels @/gone", 3,
     "gone: no such file or folder", write_small_map},
    {"ViewOfADeviceWithoutARun", "view @/map.exr --device-model simmons2-5f", 3,
     "--device-model does not apply without a run; leave it out or give --simulate too", write_small_map},
    {"ViewByAHandWithoutARun", "view @/map.exr --haptic mouse", 3,
     "--haptic does not apply without a run; leave it out or give --simulate too", write_small_map},
    {"CompareWithAMeasureOfNoPlot", "compare @/ct.nii @/map.exr --plot-of rmse", 3,
     "--plot-of does not apply without a plot; leave it out or give --plot too", write_small_map},
    {"ViewOfNoFile", "view @/nothing.exr", 3, "no such file"},
    {"CompareWithAnotherScan", "compare @/ct.nii @/map.exr --views 1", 3, "was not cast from",
     write_small_map},
    {"SessionThatNamesMissingFiles", "render --session @/s.json -o @/out.png", 3, "map",
     [](const TemporaryFolder& f) {
       write_bytes(f / "s.json", R"({"xraycast_session": 1, "files": {"map": "gone.exr"}})");
     }},
    {"SessionOfAnotherVersion", "render --session @/s.json -o @/out.png", 3,
     "session version 9, but this program reads version 1; use a newer xraycast",
     [](const TemporaryFolder& f) { write_bytes(f / "s.json", R"({"xraycast_session": 9})"); }},
    {"CompareWithoutViews", "compare @/ct.nii @/map.exr --views 0", 3, "--views 0"},
    {"ConeBehindTheAxis", "project @/ct.nii -o @/out.exr --cone 1000,900", 3, "beyond the axis"},
    {"AngleNotFinite", "project @/ct.nii -o @/out.exr --angle inf", 3, "finite"},
    {"PhantomLargerThanMemory", "phantom box -o @/box.nrrd --size 65536x65536x65536", 3,
     "more than this machine's memory"},

    // The words themselves.
    {"NoSubcommand", "--json", 2, "a subcommand is required"},
    {"UnknownSubcommand", "fluoro", 2, "not expected: fluoro (see `xraycast --help`)"},
    {"MisspeltSubcommand", "projct", 2, "did you mean project? See `xraycast --help`"},
    {"UnknownOption", "cast @/ct.nii -o @/out.exr --frames", 2, "--frames (see `xraycast cast --help`)"},
    {"MisspeltOption", "cast @/ct.nii -o @/out.exr --anlges=90", 2, "did you mean --angles?"},
    {"MisspeltGlobalOption", "project @/ct.nii -o @/out.exr --devise 0", 2, "did you mean --device?"},
    {"OptionNotANumber", "cast @/ct.nii -o @/out.exr --layers many", 2, "--layers"},
    {"OutputNotGiven", "cast @/ct.nii", 2, "--output is required"},
    {"PhantomUnknown", "phantom torso -o @/out.nrrd", 2, "torso not in"},
    {"ProjectionUnknown", "cast @/ct.nii -o @/out.exr --projection cone", 2, "cone not in"},

    {"DeviceUnknown", "project @/ct.nii -o @/out.exr --device abacus", 4,
     "no OpenCL device matches 'abacus'"},
};

class BadCalls : public Cli, public testing::WithParamInterface<BadCall> {};

TEST_P(BadCalls, SayWhyInOneLineAndLeaveAllFilesAlone) {
  write_bytes(folder_ / "ct.nii", little_scan().bytes());
  write_bytes(folder_ / "out.exr", "an older picture");
  GetParam().make(folder_);
  const Snapshot before = snapshot(folder_ / "");
  const Finished done = run(GetParam().line);
  EXPECT_EQ(done.status, GetParam().status);
  EXPECT_EQ(done.out, "");
  expect_one_line(done.err, GetParam().message);
  EXPECT_EQ(snapshot(folder_ / ""), before);
}

INSTANTIATE_TEST_SUITE_P(, BadCalls, testing::ValuesIn(kBadCalls),
                         [](const auto& call) { return call.param.name; });

TEST_F(Cli, SaysWhatToInstallWithoutAnOpenClDriver) {
  fs::create_directory(folder_ / "drivers");
  write_bytes(folder_ / "ct.nii", little_scan().bytes());
  for (const char* line : {"devices", "phantom box -o @/box.nrrd", "cast @/ct.nii -o @/map.exr"}) {
    Command without_driver = command(line);
    without_driver.environment["OCL_ICD_VENDORS"] = (folder_ / "drivers").string();
    const Finished done = run_process(without_driver);
    EXPECT_EQ(done.status, 4) << line;
    expect_one_line(done.err, "no OpenCL device: install a driver");
  }
}

// PoCL links what it compiles and ends the process without `ld`.
TEST_F(Cli, SaysWhatToInstallWithoutALinker) {
  Command box = command("phantom box -o @/box.nrrd --size 8x8x8");
  box.environment["PATH"] = folder_ / "";
  const Finished done = run_process(box);
  EXPECT_EQ(done.status, 4);
  expect_one_line(done.err, "install Debian's package binutils");
}

TEST_F(Cli, SaysHowMuchTheDeviceLacks) {
  // A file of holes: 300 MiB of voxels, of which PoCL, told to have 1 GiB in all, takes 256 at once.
  write_bytes(folder_ / "large.nrrd",
              "NRRD0004\ntype: short\ndimension: 3\nsizes: 512 512 600\nencoding: "
              "raw\nendian: little\nspace: left-posterior-superior\nspace directions: "
              "(1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\n\n");
  fs::resize_file(folder_ / "large.nrrd", fs::file_size(folder_ / "large.nrrd") + 512 * 512 * 600 * 2);
  Command cast = command("cast @/large.nrrd -o @/map.exr --radius 100 --memory-limit 16G");
  cast.environment["POCL_MEMORY_LIMIT"] = "1";
  const Snapshot before = snapshot(folder_ / "");
  const Finished done = run_process(cast);
  EXPECT_EQ(done.status, 4);
  expect_one_line(done.err, "allows buffers of up to 256 MiB, but 305 MiB are needed");
  EXPECT_EQ(snapshot(folder_ / ""), before);
}

TEST_F(Cli, TakesTheDeviceFromTheEnvironmentUnlessToldOtherwise) {
  Command box = command("phantom box -o @/box.nrrd --size 8x8x8");
  box.environment["XRAYCAST_DEVICE"] = "abacus";
  const Finished refused = run_process(box);
  EXPECT_EQ(refused.status, 4);
  expect_one_line(refused.err, "no OpenCL device matches 'abacus'");
  box.words.insert(box.words.end(), {"--device", "0"});
  EXPECT_EQ(run_process(box).status, 0);
}

TEST_F(Cli, TakesTheOpenGlDeviceFromTheEnvironment) {
  write_small_map(folder_);
  Command frame = command("render @/map.exr -o @/frame.png --json");
  const std::string name = Json::parse(run_process(frame).out)["device"];
  const auto with = [&](const std::string& choice) {
    frame.environment["XRAYCAST_GL_DEVICE"] = choice;
    return run_process(frame);
  };
  for (const std::string& choice : {name.substr(0, name.find(' ')), std::string("0")})
    EXPECT_EQ(Json::parse(with(choice).out)["device"], name) << choice;
  const Finished refused = with("abacus");
  EXPECT_EQ(refused.status, 3);
  expect_one_line(refused.err, "no OpenGL device matches XRAYCAST_GL_DEVICE=abacus; available: 0: " + name);
}

// ---- a full disk ----------------------------------------------------------------------------------

struct Writer {
  const char* name;
  const char* line;
};

// More than 2 MiB each; noise, because it does not compress.
const Writer kLargeWriters[] = {
    {"Nrrd", "phantom sphere --noise 20 --size 160x160x160 -o @/disk/out.nrrd"},
    {"NiftiPacked", "phantom sphere --noise 20 --size 160x160x160 -o @/disk/out.nii.gz"},
    {"MetaImage", "phantom sphere --noise 20 --size 160x160x160 -o @/disk/out.mha"},
    {"MetaImageInTwoFiles", "phantom sphere --noise 20 --size 160x160x160 -o @/disk/out.mhd"},
    {"Vesselness", "vesselness @/ct.nrrd --scales 2 -o @/disk/out.nrrd"},
    {"Map", "cast @/ct.nrrd --layers 32 -o @/disk/out.exr"},
    {"Basis", "cast @/ct.nrrd --layers 8 -o @/map.exr --keep-basis @/disk/out.basis"},
    {"ProjectionExr", "project @/ct.nrrd --size 1536x1536 -o @/disk/out.exr"},
    {"ProjectionTiff", "project @/ct.nrrd --size 1536x1536 -o @/disk/out.tif"},
    {"ProjectionBmp", "project @/ct.nrrd --size 2048x2048 -o @/disk/out.bmp"},
    {"ProjectionPpm", "project @/ct.nrrd --size 2048x2048 -o @/disk/out.ppm"},
    {"ProjectionNrrd", "project @/ct.nrrd --size 1024x1024 -o @/disk/out.nrrd"},
};

class FullDisk : public Cli, public testing::WithParamInterface<Writer> {
 protected:
  void SetUp() override {
    output_of("phantom sphere --noise 20 -q -o @/ct.nrrd");
    fs::create_directory(folder_ / "disk");
  }

  void expect_failure(const Finished& done) const {
    EXPECT_EQ(done.status, 1);
    EXPECT_EQ(done.out, "");
    expect_one_line(done.err, "could not be written");
    EXPECT_THAT(done.err, HasSubstr((folder_ / "disk/out.").string()));
    EXPECT_THAT(snapshot(folder_ / "disk"), IsEmpty());
  }
};

class WriteLimit : public FullDisk {};

TEST_P(WriteLimit, LeavesNothingBehind) {
  Command limited = command(GetParam().line);
  // PoCL writes the kernels that it builds, about 1 MB, to files of its own, under the same limit.
  limited.largest_file_B = 2 << 20;
  expect_failure(run_process(limited));
}

INSTANTIATE_TEST_SUITE_P(, WriteLimit, testing::ValuesIn(kLargeWriters),
                         [](const auto& writer) { return writer.param.name; });

const Writer kSmallWriters[] = {
    {"Png", "project @/ct.nrrd --size 512x512 -o @/disk/out.png"},
    {"Jpeg", "project @/ct.nrrd --size 512x512 -o @/disk/out.jpg"},
    {"Exr", "project @/ct.nrrd --size 512x512 -o @/disk/out.exr"},
    {"Tiff", "project @/ct.nrrd --size 512x512 -o @/disk/out.tif"},
    {"ProjectionNrrd", "project @/ct.nrrd --size 512x512 -o @/disk/out.nrrd"},
    {"Map", "cast @/ct.nrrd -o @/disk/out.exr"},
    {"Nifti", "phantom sphere --noise 20 --size 64x64x64 -o @/disk/out.nii"},
};

class SmallDisk : public FullDisk {};

TEST_P(SmallDisk, LeavesNothingBehind) {
  // Mounted where only this process sees it, and gone with it.
  if (unshare(CLONE_NEWNS) != 0 || mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
      mount("tmpfs", (folder_ / "disk").c_str(), "tmpfs", 0, "size=16k") != 0)
    GTEST_SKIP() << "mounting needs CAP_SYS_ADMIN: " << std::strerror(errno);
  expect_failure(run(GetParam().line));
  umount((folder_ / "disk").c_str());
}

INSTANTIATE_TEST_SUITE_P(, SmallDisk, testing::ValuesIn(kSmallWriters),
                         [](const auto& writer) { return writer.param.name; });

// ---- Ctrl-C ---------------------------------------------------------------------------------------

class Interrupted : public Cli {
 protected:
  /// Sends the signal once the progress bar shows `stage`.
  void expect_cancelled(const std::string& line, const std::string& stage, int signal) const {
    const Snapshot before = snapshot(folder_ / "");
    Command on_terminal = command(line);
    on_terminal.on_terminal = true;
    Process process(on_terminal);
    process.wait_for(stage);
    process.send(signal);
    const Finished done = process.finish();
    EXPECT_EQ(done.status, 128 + signal);
    EXPECT_EQ(done.out, "");
    // The bar's line is cleared first. A terminal makes \r\n of \n.
    EXPECT_THAT(done.err, ::testing::EndsWith("\r\x1b[Kxraycast: cancelled; no output was written\r\n"));
    EXPECT_EQ(snapshot(folder_ / ""), before);
  }
};

TEST_F(Interrupted, PhantomLeavesNothingBehind) {
  write_bytes(folder_ / "out.nrrd", "an older scan");
  expect_cancelled("phantom thorax --size 512x512x2000 -o @/out.nrrd", "painting", SIGINT);
}

TEST_F(Interrupted, CastLeavesNothingBehind) {
  write_bytes(folder_ / "out.exr", "an older map");
  // 1 GB of nothing on disk, turned about the patient's long axis: that takes long to read.
  const std::string header =
      "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 512 512 2000\n"
      "space directions: (0.8,0.6,0) (-0.6,0.8,0) (0,0,1)\nspace origin: (0,0,0)\n"
      "encoding: raw\nendian: little\n\n";
  TemporaryFolder elsewhere;  // the test's folder is compared byte by byte
  const fs::path scan = elsewhere / "turned.nrrd";
  write_bytes(scan, header);
  fs::resize_file(scan, header.size() + std::uintmax_t{2} * 512 * 512 * 2000);
  expect_cancelled("cast " + scan.string() + " -o @/out.exr --preview @/out.png", "reading", SIGTERM);
}

// ---- what goes right ------------------------------------------------------------------------------

TEST_F(Cli, InfoDescribesAPhantom) {
  const Json made = json_of("phantom sphere --size 64x48x32 --spacing 2 -o @/ct.nrrd");
  EXPECT_EQ(made["volume"]["size"], Json({64, 48, 32}));
  const Json info = json_of("info @/ct.nrrd");
  EXPECT_EQ(info["format"], "NRRD");
  EXPECT_EQ(info["volume"], made["volume"]);
  EXPECT_EQ(info["hu_range"], Json({-1000, 0}));
  EXPECT_THAT(output_of("info @/ct.nrrd"), HasSubstr("64 x 48 x 32, 2 x 2 x 2 mm, axes towards LPS"));
}

/// A ball of soft tissue with noise in air, stored as HU + 1024, with two voxels that are not numbers.
std::string shifted_ball() {
  constexpr int kSize = 32;
  std::vector<float> values;
  unsigned random = 1;
  for (int z = 0; z < kSize; ++z)
    for (int y = 0; y < kSize; ++y)
      for (int x = 0; x < kSize; ++x) {
        random = random * 1664525U + 1013904223U;
        const double noise = static_cast<double>(random >> 24) / 4 - 32;
        const int square = (x - 16) * (x - 16) + (y - 16) * (y - 16) + (z - 16) * (z - 16);
        values.push_back(static_cast<float>(std::max(0.0, std::round((square < 169 ? 1060 : 24) + noise))));
      }
  values[0] = values[1] = std::nanf("");
  return "NRRD0004\ntype: float\ndimension: 3\nspace: LPS\nsizes: 32 32 32\nspace directions: (2,0,0) "
         "(0,2,0) "
         "(0,0,2)\nencoding: raw\nendian: little\n\n" +
         bytes_of(std::span<const float>(values));
}

TEST_F(Cli, EveryCommandTellsOfValuesThatAreNoHounsfieldUnits) {
  write_bytes(folder_ / "ct.nrrd", shifted_ball());
  for (const char* line :
       {"convert @/ct.nrrd -o @/out.mha", "project @/ct.nrrd -o @/out.exr", "cast @/ct.nrrd -o @/out.exr",
        "segment @/ct.nrrd -o @/vessels", "cast @/ct.nrrd -o @/out.exr --radius 30 --centre 31,31",
        "vesselness @/ct.nrrd -o @/out.nrrd"}) {
    SCOPED_TRACE(line);
    const std::string err = run(line).err;
    EXPECT_THAT(err, HasSubstr("2 voxels are not numbers and count as air\n"));
    EXPECT_THAT(err, HasSubstr("the values seem to be HU + 1024; if they are, give --offset-hu -1024\n"));
    EXPECT_THAT(run(std::string(line) + " --offset-hu -1024").err, Not(HasSubstr("1024;")));
  }
  const Json info = json_of("info @/ct.nrrd");
  EXPECT_EQ(info["warnings"].size(), 2);
  EXPECT_THAT(info["warnings"][1], HasSubstr("--offset-hu -1024"));
  const Json mended = json_of("info @/ct.nrrd --offset-hu -1024");
  EXPECT_EQ(mended["warnings"].size(), 1);
  EXPECT_EQ(mended["hu_range"][0], -1024);
}

TEST_F(Cli, InfoListsTheSeriesOfAFolder) {
  for (const char* series : {"1", "2"}) {
    fs::create_directories(folder_ / "cd" / series);
    for (int k = 0; k < 4; ++k)
      if (k < 3 || series[0] == '2')
        slice()
            .position({0, 0, 1.0 * k})
            .text(0x0020000e, "UI", std::string("1.2.") + series)
            .text(0x00200011, "IS", series)
            .write(folder_ / "cd" / series / std::to_string(k));
  }
  const Json info = json_of("info @/cd");
  EXPECT_THAT(info["series"].get<std::string>(), StartsWith("2: 4 slices"));
  ASSERT_EQ(info["all_series"].size(), 2);
  EXPECT_EQ(info["all_series"][0]["chosen"], true);
  EXPECT_EQ(info["all_series"][1], Json::parse(R"({"number": "1", "description": "", "uid": "1.2.1",
      "modality": "CT", "study_date": "", "body_part": "", "slices": 3, "orientation": "axial",
      "thickness_mm": 1.0, "chosen": false})"));
  EXPECT_THAT(output_of("info @/cd"), HasSubstr("note        other series 1: 3 slices"));
}

TEST_F(Cli, CastSaysWhatItMade) {
  output_of("phantom sphere --size 64x48x32 --spacing 2 -o @/ct.nrrd");
  const Json said =
      json_of("cast @/ct.nrrd -o @/map.exr --radii 0,20,30.5 --angles 90 --centre -3.5,2 --outline circle");
  EXPECT_THAT(keys_of(said), ElementsAre("input", "map", "timings_ms"));
  EXPECT_EQ(said["input"], (folder_ / "ct.nrrd").string());
  EXPECT_EQ(said["map"], Json::parse(R"({"width": 90, "height": 32, "layers": 2,
                                         "radii_mm": [0.0, 20.0, 30.5], "centre_mm": [-3.5, 2.0],
                                         "outline": "circle", "precision": "float"})"));
  EXPECT_THAT(keys_of(said["map"]),
              ElementsAre("width", "height", "layers", "radii_mm", "centre_mm", "outline", "precision"));
  EXPECT_THAT(keys_of(said["timings_ms"]),
              ElementsAre("read", "upload", "outline", "kernel", "write", "total"));
  for (const auto& [stage, ms] : said["timings_ms"].items()) {
    EXPECT_GT(ms, 0) << stage;
    EXPECT_LE(ms, said["timings_ms"]["total"]) << stage;
  }
  const BodyMap map = read_body_map(folder_ / "map.exr");
  EXPECT_THAT(map.geometry.radii_mm, ElementsAre(0, 20, 30.5));
  EXPECT_EQ(map.geometry.width, 90);
  EXPECT_THAT(map.source, HasSubstr("ct.nrrd"));
}

TEST_F(Cli, CastFollowsTheBody) {
  output_of("phantom thorax --size 80x80x40 --spacing 5 -o @/ct.nrrd");
  const Json said = json_of("cast @/ct.nrrd -o @/map.exr --layers 4 --keep-basis @/b.basis");
  EXPECT_EQ(said["map"]["outline"], "body");
  EXPECT_GT(said["outside_share"], 0);
  EXPECT_LT(said["outside_share"], 0.5);
  const MapGeometry map = read_body_map(folder_ / "map.exr").geometry;
  EXPECT_EQ(map.outline_mm.size(), 360u);
  EXPECT_NEAR(said["map"]["radii_mm"][4], std::ranges::max(map.outline_mm), 1e-3);
  // A recast keeps the outline, and frames are compared with what lies within.
  EXPECT_EQ(json_of("recast @/b.basis -o @/recast.exr --opacity bilinear")["map"]["outline"], "body");
  const Json body = json_of("compare @/ct.nrrd @/map.exr --views 2")["mean"];
  output_of("cast @/ct.nrrd -o @/circle.exr --layers 4 --outline circle");
  const Json circle = json_of("compare @/ct.nrrd @/circle.exr --views 2")["mean"];
  EXPECT_GT(body["psnr_db"], circle["psnr_db"]);
  EXPECT_THAT(keys_of(body), ElementsAre("psnr_db", "ssim", "rmse", "whole_psnr_db"));

  const Json fractions = json_of("cast @/ct.nrrd -o @/map.exr --radii 0,0.5,1")["map"]["radii_mm"];
  EXPECT_NEAR(fractions[1], 0.5 * fractions[2].get<double>(), 1e-9);
  EXPECT_NEAR(fractions[2], said["map"]["radii_mm"][4], 1e-9);
  // Also without a leading zero, and of a radius that cuts the outline off.
  EXPECT_EQ(json_of("cast @/ct.nrrd -o @/map.exr --radii .0,.5,1")["map"]["radii_mm"], fractions);
  const Json cut_mm = json_of("cast @/ct.nrrd -o @/map.exr --radii 0,.5,1 --radius 60")["map"]["radii_mm"];
  EXPECT_EQ(cut_mm, Json::parse("[0.0, 30.0, 60.0]"));
  const Json narrow = json_of("cast @/ct.nrrd -o @/map.exr --radius 60")["map"];
  EXPECT_EQ(narrow["radii_mm"][1], 60.0);
  json_of("cast @/ct.nrrd -o @/all.exr --keep-table");
}

TEST_F(Cli, CastSaysWhatItsOutlineLeavesOut) {
  output_of("phantom thorax --size 80x80x120 --spacing 5 -o @/ct.nrrd");
  write_bytes(folder_ / "line.csv", "0,0,-400\n5,0,400\n");
  const auto said = [&](const char* options) {
    return output_of("cast @/ct.nrrd -o @/map.exr --layers 2 " + std::string(options));
  };
  const char* const cut_off = "\ncut off: the scan ends within the body at its right and left side; pictures";
  EXPECT_THAT(said("--outline circle"), HasSubstr(cut_off));
  EXPECT_THAT(said("--radius 150"), testing::Not(HasSubstr("cut off")));
  EXPECT_THAT(said(""), testing::AllOf(HasSubstr(", outline body, "), HasSubstr(cut_off),
                                       HasSubstr("% of the scan's attenuation"), HasSubstr(" ms, outline ")));
  for (const char* options : {"--opacity spectrum:80", "--memory-limit 1.2M", "--centre-line @/line.csv"}) {
    EXPECT_THAT(said(options), testing::AllOf(HasSubstr(", outline body, "),
                                              HasSubstr("\nleft out: everything outside the outline; "
                                                        "--keep-table includes the table\n")))
        << options;
    EXPECT_THAT(
        said((std::string(options) + " --keep-table").c_str()),
        testing::AllOf(HasSubstr("left out: everything outside"), testing::Not(HasSubstr("--keep-table"))))
        << options;
  }
  write_bytes(folder_ / "bone.json",
              R"({"name": "bone", "unit": "1/mm", "knots": [[150, 0], [1000, 0.06]]})");
  EXPECT_THAT(said("--opacity @/bone.json"), HasSubstr("left out: less than 0.01 % of the scan's"));
  EXPECT_THAT(said("--outline circle"),
              testing::AllOf(HasSubstr(", outline circle, "), testing::Not(HasSubstr("left out"))));
}

TEST_F(Cli, CastMakesCirclesWhereThereIsNoBody) {
  NiftiFile air = water(12);
  const std::vector<std::int16_t> hu(air.voxels.size() / 2, -1000);
  air.voxels.assign(reinterpret_cast<const char*>(hu.data()), 2 * hu.size());
  write_bytes(folder_ / "air.nii", air.bytes());
  const Finished done = run("cast @/air.nii -o @/map.exr --centre 3,3 --radius 3");
  EXPECT_EQ(done.status, 0);
  expect_one_line(done.err, "the shells are circles: nothing in the scan lies above -300 HU");
  EXPECT_FALSE(read_body_map(folder_ / "map.exr").geometry.has_outline());
}

TEST_F(Cli, MapsAreStoredInLessPrecision) {
  output_of("phantom head --size 64x64x48 -o @/ct.nrrd");
  double before_db = 200;
  std::uintmax_t before_B = 1 << 30, before_texture_B = 1 << 30;
  for (const char* precision : {"float", "half", "byte"}) {
    const std::string option = fmt::format(" --precision {}", precision);
    EXPECT_EQ(
        json_of("cast @/ct.nrrd -o @/map.exr --layers 16 --keep-basis @/b" + option)["map"]["precision"],
        precision);
    EXPECT_EQ(json_of("recast @/b -o @/recast.exr --opacity paper" + option)["map"]["precision"], precision);
    const double psnr_db = json_of("compare @/ct.nrrd @/map.exr --views 3")["mean"]["psnr_db"];
    // Half a step in 255 of a layer, of which a ray sums many, is small beside what 16 layers cannot show.
    EXPECT_NEAR(psnr_db, before_db == 200 ? psnr_db : before_db, 0.3) << precision;
    before_db = psnr_db;
    EXPECT_LT(fs::file_size(folder_ / "map.exr"), before_B) << precision;
    before_B = fs::file_size(folder_ / "map.exr");
    const std::uintmax_t texture_B = json_of("render @/map.exr -o @/f.png")["texture_B"];
    EXPECT_LT(texture_B, before_texture_B) << precision;
    before_texture_B = texture_B;
  }
}

TEST_F(Cli, ValuesBeyondHalvesNameTheOption) {
  output_of("phantom sphere --size 24x24x24 -o @/ct.nrrd");
  write_bytes(folder_ / "mu.json", R"({"knots": [[-1000, 0], [0, 1e4]]})");
  const Finished done = run("cast @/ct.nrrd -o @/map.exr --precision half --opacity @/mu.json");
  EXPECT_EQ(done.status, 3);
  expect_one_line(done.err, "map.exr: the map's values exceed 16-bit floats; give --precision float or byte");
  output_of("cast @/ct.nrrd -o @/map.exr --precision byte --opacity @/mu.json");
}

TEST_F(Cli, ASessionsOpacityKeepsTheMapsPrecision) {
  output_of("phantom head --size 48x48x40 -o @/ct.nrrd");
  output_of("cast @/ct.nrrd -o @/map.exr --layers 4 --keep-basis @/b.basis --precision byte");
  Json session = Json::parse(R"({
      "xraycast_session": 1, "files": {"map": "map.exr", "basis": "b.basis"},
      "camera": {"angle_deg": 0, "tilt_deg": 0, "table_mm": 0, "zoom": 1},
      "style": {"look": "fluoro", "compositing": "path", "continuous": true, "strengths": []}})");
  write_bytes(folder_ / "own.json", session.dump());
  session["opacity"] = Json::parse(Opacity::bilinear().to_json());
  write_bytes(folder_ / "bilinear.json", session.dump());
  const auto frame = [&](const std::string& name) {
    return json_of("render --session @/" + name + ".json -o @/" + name + ".exr --size 40x30")["texture_B"];
  };
  EXPECT_EQ(frame("bilinear"), frame("own"));
  EXPECT_NE(read_exr(folder_ / "bilinear.exr", "tau"), read_exr(folder_ / "own.exr", "tau"));
}

TEST_F(Cli, CastHintsAtASmallerRadiusWhereAnArmMakesShellsWide) {
  // A trunk of 110 mm radius in air and, in one slice of twelve, an arm that reaches 200 mm.
  NiftiFile file = water(12);
  file.dim[1] = file.dim[2] = 64;
  file.pixdim[1] = file.pixdim[2] = file.pixdim[3] = 8;
  file.sform = {-8, 0, 0, 0, 0, -8, 0, 0, 0, 0, 8, 0};
  const auto write = [&](const char* name, bool has_arm) {
    std::vector<std::int16_t> hu;
    for (int z = 0; z < 12; ++z)
      for (int y = -32; y < 32; ++y)
        for (int x = -32; x < 32; ++x) {
          const bool in_arm = has_arm && z == 5 && std::abs(y) < 2 && x > 0 && x <= 25;
          hu.push_back(in_arm || std::hypot(x, y) * 8 < 110 ? 0 : -1000);
        }
    file.voxels.assign(reinterpret_cast<const char*>(hu.data()), 2 * hu.size());
    write_bytes(folder_ / name, file.bytes());
  };
  write("arm.nii", true);
  write("trunk.nii", false);

  const auto hint = [&](const std::string& line) {
    return run("cast -o @/map.exr --outline circle " + line).err;
  };
  // Both radii are those of the body, by a grid of 8 mm.
  EXPECT_THAT(hint("@/arm.nii --layers 8"),
              testing::ContainsRegex("within 11[0-9] mm of the axis, the rest "
                                     "extends to 20[0-9] mm: --radius 11[0-9] crops"));
  for (const char* line : {"@/trunk.nii --layers 8", "@/arm.nii", "@/arm.nii --layers 8 --radius 117",
                           "@/arm.nii --layers 2 --radii 0,100,200"})
    EXPECT_EQ(hint(line), "") << line;
}

TEST_F(Cli, PaperPreviewIsPlainTransmission) {
  output_of("phantom thorax --size 64x64x40 -o @/ct.nrrd");
  const std::string said =
      output_of("cast @/ct.nrrd -o @/map.exr --layers 3 --preview @/map.png --preview-window paper --json");
  EXPECT_EQ(Json::parse(said)["preview"], (folder_ / "map.png").string());
  const BodyMap map = read_body_map(folder_ / "map.exr");
  const Png picture = read_png(folder_ / "map.png");
  // A scale to the left of the layers, a title above each.
  constexpr int kLeft = 64, kTitle = 22, kWidth = 360, kHeight = 40, kLayers = 3;
  ASSERT_GE(picture.width, kLeft + kWidth);
  ASSERT_EQ(picture.height, kLayers * (kTitle + kHeight));
  ASSERT_EQ(picture.channels, 3);
  const auto lightest_in = [&](int left, int top, int width, int height) {
    int lightest = 0;
    for (int y = top; y < top + height; ++y)
      for (int x = left; x < left + width; ++x)
        lightest =
            std::max<int>(lightest, picture.values[static_cast<std::size_t>(3 * (y * picture.width + x))]);
    return lightest;
  };
  for (int k = 0; k < kLayers; ++k) {
    const int top = k * (kTitle + kHeight) + kTitle;
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x) {
        const auto pixel = static_cast<std::size_t>((top + y) * picture.width + kLeft + x);
        const float tau = map.tau[static_cast<std::size_t>((k * kHeight + y) * kWidth + x)];
        for (std::size_t channel = 0; channel < 3; ++channel)
          ASSERT_EQ(picture.values[3 * pixel + channel], std::lround(255 * std::exp(-tau))) << k << " " << y;
      }
    // Something is written there, lighter than the paper.
    constexpr int kMuchLighter = 150;
    EXPECT_GT(lightest_in(kLeft, top - kTitle, kWidth, kTitle), kMuchLighter);
    EXPECT_GT(lightest_in(0, top, kLeft, kHeight), kMuchLighter);
  }
  EXPECT_THAT(output_of("cast @/ct.nrrd -o @/map.exr --preview @/map.png"),
              HasSubstr("map.png: preview of 1 layer"));
}

TEST_F(Cli, HintsAtAnOpacityWhereNothingLiesBelowWater) {
  NiftiFile subtracted = water(64);
  subtracted.voxels[2 * (3 + 8 * (4 + 8 * 6))] = 100;  // HU, of one voxel
  write_bytes(folder_ / "subtracted.nii", subtracted.bytes());
  NiftiFile body = subtracted;
  body.voxels.replace(0, 2, "\xff\xff");  // -1 HU
  write_bytes(folder_ / "body.nii", body.bytes());

  const auto is_hinted = [&](const std::string& line) {
    const Finished done = run(line);
    EXPECT_EQ(done.status, 0) << line;
    return done.err.find("--opacity subtracted") != std::string::npos;
  };
  EXPECT_TRUE(is_hinted("cast @/subtracted.nii -o @/map.exr"));
  EXPECT_EQ(read_body_map(folder_ / "map.exr").attenuation, Attenuation(Opacity::paper()));
  EXPECT_TRUE(is_hinted("cast @/subtracted.nii -o @/map.exr --memory-limit 0.008M"));
  EXPECT_TRUE(is_hinted("project @/subtracted.nii -o @/tau.exr --size 8x64 --pixel 1"));
  EXPECT_FALSE(is_hinted("cast @/body.nii -o @/map.exr"));

  EXPECT_FALSE(is_hinted("project @/subtracted.nii -o @/tau.exr --size 8x64 --pixel 1 --opacity subtracted"));
  const std::vector<float> tau = read_exr(folder_ / "tau.exr", "tau");
  EXPECT_EQ(*std::ranges::min_element(tau), 0);
  EXPECT_GT(*std::ranges::max_element(tau), 0);
}

TEST_F(Cli, ProjectSaysWhatItMade) {
  output_of("phantom sphere --size 64x48x32 --spacing 2 -o @/ct.nrrd");
  const Json said =
      json_of("project @/ct.nrrd -o @/p.exr --angle 30 --tilt -10 --size 40x30 --pixel 2.5 --cone 500,750");
  EXPECT_THAT(keys_of(said), ElementsAre("input", "image", "timings_ms"));
  EXPECT_THAT(keys_of(said["image"]),
              ElementsAre("width", "height", "pixel_mm", "centre_mm", "angle_deg", "tilt_deg"));
  EXPECT_EQ(said["image"]["width"], 40);
  EXPECT_EQ(said["image"]["height"], 30);
  EXPECT_EQ(said["image"]["pixel_mm"], 2.5);
  EXPECT_EQ(said["image"]["centre_mm"][2], 0);  // at mid-height; x and y are the body's
  EXPECT_EQ(said["image"]["angle_deg"], 30);
  EXPECT_EQ(said["image"]["tilt_deg"], -10);
}

TEST_F(Cli, ProjectNotesASourceWithinTheBody) {
  output_of("phantom sphere --size 64x48x32 --spacing 2 -o @/ct.nrrd");
  const Finished within = run("project @/ct.nrrd -o @/p.exr --cone 5,1500 --size 40x30");
  EXPECT_EQ(within.status, 0);
  expect_one_line(within.err, "the X-ray source lies inside the body");
  output_of("project @/ct.nrrd -o @/p.exr --cone 500,1500 --size 40x30");
}

TEST_F(Cli, ProjectsToEveryFormat) {
  output_of("phantom sphere --size 64x48x32 --spacing 2 -o @/ct.nrrd");
  for (const auto& [file, magic] :
       {std::pair{"p.exr", "\x76\x2f\x31\x01"}, std::pair{"p.tif", "II*"}, std::pair{"p.nrrd", "NRRD"},
        std::pair{"p.png", "\x89PNG"}, std::pair{"p.jpg", "\xff\xd8\xff"}, std::pair{"p.gif", "GIF89a"},
        std::pair{"p.hdr", "#?RADIANCE"}, std::pair{"p.webp", "RIFF"}}) {
    EXPECT_THAT(output_of("project @/ct.nrrd --size 40x30 -o @/" + std::string(file)),
                HasSubstr(std::string(file) + ": AP, 40 x 30 pixels"));
    EXPECT_THAT(read_bytes(folder_ / file), StartsWith(magic)) << file;
  }
}

TEST_F(Cli, RenderSaysWhatItMade) {
  output_of("-q phantom cylinder --size 48x48x20 -o @/ct.nrrd");
  output_of("-q cast @/ct.nrrd -o @/map.exr --layers 4 --angles 90");
  const Json json = json_of("render @/map.exr -o @/f.exr --angle 30 --size 40x30");
  EXPECT_THAT(keys_of(json), ElementsAre("map", "image", "device", "texture_B", "frames"));
  EXPECT_THAT(keys_of(json["image"]),
              ElementsAre("width", "height", "pixel_mm", "centre_mm", "angle_deg", "tilt_deg"));
  EXPECT_EQ(json["image"]["angle_deg"], 30);
  // The middle of a cylinder of 160 mm of water (0.02/mm), within a voxel's rounding of its edge.
  const std::vector<float> tau = read_exr(folder_ / "f.exr", "tau");
  ASSERT_EQ(tau.size(), 40u * 30);
  EXPECT_NEAR(tau[15 * 40 + 20], 3.2, 0.15);
}

TEST_F(Cli, RendersTheSameFrameTwice) {
  output_of("-q phantom head --size 48x48x40 -o @/ct.nrrd");
  output_of("-q cast @/ct.nrrd -o @/map.exr --layers 4 --angles 90");
  for (const char* file : {"a.png", "b.PNG"})
    output_of("-q render @/map.exr -o @/" + std::string(file) + " --angle 12 --cone 900,1200 --annotations");
  EXPECT_EQ(read_bytes(folder_ / "a.png"), read_bytes(folder_ / "b.PNG"));
}

TEST_F(Cli, RenderTakesOldSpellingsOfOptions) {
  output_of("-q phantom head --size 48x48x40 -o @/ct.nrrd");
  output_of("-q cast @/ct.nrrd -o @/map.exr --layers 4 --angles 90");
  output_of("-q render @/map.exr -o @/old.png --furniture --strengths 1,0,1,0.5");
  output_of("-q render @/map.exr -o @/new.png --annotations --layer-weights 1,0,1,0.5");
  output_of("-q render @/map.exr -o @/without.png");
  EXPECT_EQ(read_bytes(folder_ / "old.png"), read_bytes(folder_ / "new.png"));
  EXPECT_NE(read_bytes(folder_ / "old.png"), read_bytes(folder_ / "without.png"));
  const std::string help = output_of("render --help");
  EXPECT_THAT(help, HasSubstr("--annotations"));
  EXPECT_THAT(help, HasSubstr("--layer-weights"));
  EXPECT_THAT(help, testing::Not(HasSubstr("--furniture")));
  EXPECT_THAT(help, testing::Not(HasSubstr("--strengths")));
}

TEST_F(Cli, RendersACineIntoAFolderOrAnAnimation) {
  output_of("-q phantom sphere --size 32x32x32 -o @/ct.nrrd");
  output_of("-q cast @/ct.nrrd -o @/map.exr --angles 60");
  output_of("-q render @/map.exr -o @/frames --cine 0:360:90 --size 64x48");
  EXPECT_TRUE(fs::exists(folder_ / "frames/frame-003.png"));
  EXPECT_FALSE(fs::exists(folder_ / "frames/frame-004.png"));
  write_bytes(folder_ / "frames/notes.txt", "kept");
  output_of("-q render @/map.exr -o @/frames --cine 0:360:180 --size 64x48");
  EXPECT_THAT(snapshot(folder_ / "frames"), testing::SizeIs(3)) << "a longer cine's frames stay behind";
  output_of("-q render @/map.exr -o @/turn.gif --cine 0:360:90 --size 64x48");
  EXPECT_GT(fs::file_size(folder_ / "turn.gif"), 500u);
}

TEST_F(Cli, CompareFindsMoreLayersCloser) {
  output_of("-q phantom head --size 64x64x48 -o @/ct.nrrd");
  double before = 0;
  for (const char* layers : {"2", "8", "24"}) {
    output_of("-q cast @/ct.nrrd -o @/map.exr --layers " + std::string(layers));
    const Json json = json_of("compare @/ct.nrrd @/map.exr --views 3 --plot @/plot.png");
    EXPECT_THAT(keys_of(json["mean"]), ElementsAre("psnr_db", "ssim", "rmse", "whole_psnr_db"));
    ASSERT_EQ(json["views"].size(), 3u);
    EXPECT_EQ(json["views"][1]["angle_deg"], 120);
    EXPECT_GT(json["mean"]["psnr_db"], before + 3);
    before = json["mean"]["psnr_db"];
  }
}

TEST_F(Cli, CompareOfSeveralMapsIsThatOfEach) {
  output_of("-q phantom head --size 64x64x48 -o @/ct.nrrd");
  // Two share their true projections, the others differ in extent or opacity.
  output_of("-q cast @/ct.nrrd -o @/a.exr --layers 2");
  output_of("-q cast @/ct.nrrd -o @/b.exr --layers 8");
  output_of("-q cast @/ct.nrrd -o @/c.exr --layers 8 --outline circle --radius 60");
  output_of("-q cast @/ct.nrrd -o @/d.exr --layers 8 --opacity bilinear");
  const Json all = json_of("compare @/ct.nrrd @/a.exr @/b.exr @/c.exr @/d.exr --views 3")["maps"];
  ASSERT_EQ(all.size(), 4u);
  for (const Json& one : all) {
    const Json alone = json_of("compare @/ct.nrrd " + one["map"].get<std::string>() + " --views 3");
    EXPECT_EQ(one["mean"], alone["mean"]) << one["map"];
    EXPECT_EQ(one["views"], alone["views"]) << one["map"];
  }
}

TEST_F(Cli, FramesUnderAConeAndATiltAreAsCloseAsUprightParallelOnes) {
  output_of("-q phantom head --size 96x96x80 -o @/ct.nrrd");
  output_of("-q cast @/ct.nrrd -o @/map.exr --layers 16");
  const auto psnr_db = [&](const std::string& beam) {
    const double mean_db = json_of("compare @/ct.nrrd @/map.exr --views 3" + beam)["mean"]["psnr_db"];
    return mean_db;
  };
  const double upright_db = psnr_db("");
  // Not the same pictures again.
  EXPECT_NE(psnr_db(" --tilt 20"), upright_db);
  // What the user is promised; shells are as thick under any beam, and rows are interpolated across.
  for (const char* beam : {" --cone 1000,1500", " --tilt 20", " --cone 1000,1500 --tilt 20", " --tilt -20"})
    EXPECT_GT(psnr_db(beam), upright_db - 1.5) << beam;
}

TEST_F(Cli, CompareDrawsMapTruthAndDifferenceSideBySide) {
  output_of("-q phantom head --size 64x64x48 -o @/ct.nrrd");
  output_of("-q cast @/ct.nrrd -o @/few.exr --layers 2");
  output_of("-q cast @/ct.nrrd -o @/many.exr --layers 24");
  output_of("-q compare @/ct.nrrd @/few.exr @/many.exr --angles 0:60:30 --pictures @/pictures");
  for (const char* name : {"few-000.png", "few-030.png", "many-000.png", "many-030.png"})
    EXPECT_TRUE(fs::exists(folder_ / "pictures" / name)) << name;

  // Three pictures beside one another, with margins of 12 pixels, a title above and captions below.
  const auto difference_of = [&](const char* name) {
    const Png image = read_png(folder_ / "pictures" / name);
    EXPECT_EQ(image.channels, 1);
    const int pitch = (image.width - 12) / 3;
    double sum = 0;
    int wrong = 0;
    for (int y = 32; y < image.height - 28; ++y)
      for (int x = 12; x < pitch; ++x) {
        const auto at = [&](int picture) { return int{image.values[y * image.width + picture * pitch + x]}; };
        const bool is_paper = at(0) == 28 && at(1) == 28 && at(2) == 28;  // beside a narrow picture
        wrong += !is_paper && at(2) != std::clamp(128 + 4 * (at(0) - at(1)), 0, 255);
        sum += is_paper ? 0 : std::abs(at(2) - 128);
      }
    EXPECT_EQ(wrong, 0) << name;
    return sum;
  };
  EXPECT_GT(difference_of("few-030.png"), 2 * difference_of("many-030.png"));
}

TEST_F(Cli, DevicesPassTheirSelfTest) {
  const Json devices = json_of("devices");
  ASSERT_FALSE(devices.empty());
  for (const Json& device : devices) EXPECT_EQ(device["self_test"]["buffers"], true) << device;
  EXPECT_THAT(output_of("devices"), HasSubstr("self-test: buffers ok"));
}

TEST_F(Cli, HelpOfEverySubcommandEndsInExamples) {
  const std::string help = output_of("--help");
  for (const std::string subcommand : {"info", "phantom", "cast", "project", "segment", "vesselness",
                                       "render", "compare", "devices", "demo"}) {
    EXPECT_THAT(help, HasSubstr("\n  " + subcommand + " "));
    EXPECT_THAT(output_of(subcommand + " --help"), HasSubstr("\nExamples:\n  xraycast " + subcommand));
  }
}

TEST_F(Cli, TellsItsVersion) { EXPECT_EQ(output_of("--version"), XRAYCAST_VERSION "\n"); }

TEST_F(Cli, NotesGoToStderrAndQuietSilencesThem) {
  NiftiFile file = little_scan();
  file.sform[0] = 1;  // grows to the right, so it must be turned
  write_bytes(folder_ / "ct.nii", file.bytes());
  const char* const note = "xraycast: reoriented from RPS to LPS\n";
  const Finished told = run("cast @/ct.nii -o @/map.exr --json");
  EXPECT_EQ(told.err, note);
  EXPECT_EQ(Json::parse(told.out)["map"]["height"], 4);
  EXPECT_EQ(run("project @/ct.nii -o @/p.png").err, note);
  EXPECT_EQ(run("compare @/ct.nii @/map.exr --views 1").err, note);
  EXPECT_EQ(output_of("cast @/ct.nii -o @/map.exr --quiet"), "");
  EXPECT_EQ(output_of("-q project @/ct.nii -o @/p.png"), "");
  EXPECT_EQ(output_of("-q phantom box --size 8x8x8 -o @/box.nrrd"), "");
  // What was asked for is no note.
  EXPECT_THAT(output_of("-q info @/ct.nii"), HasSubstr("8 x 8 x 4"));
}

// Long enough for the bar to appear, half a second after a stage began.
constexpr char kLongJob[] = "phantom thorax --size 512x512x300 -o @/ct.nrrd";

TEST_F(Cli, ProgressOnATerminalShowsRateAndRemainingTime) {
  Command on_terminal = command(kLongJob);
  on_terminal.on_terminal = true;
  const Finished done = run_process(on_terminal);
  EXPECT_EQ(done.status, 0);
  EXPECT_THAT(done.err,
              ::testing::ContainsRegex("painting +\\[#+\\.*\\] +[0-9]+ %  [0-9]+ slices/s  [0-9]+ s left"));
  EXPECT_THAT(done.err, ::testing::EndsWith("\r\x1b[K"));  // the line is cleared
}

TEST_F(Cli, ProgressStaysOutOfPipes) { output_of(kLongJob); }

TEST_F(Cli, TakesPathsWithSpacesAndLettersBeyondAscii) {
  const fs::path place = folder_ / "Röntgen 体 scans";
  fs::create_directory(place);
  const auto made = [&](std::vector<std::string> words, const char* file) {
    words.insert(words.begin(), XRAYCAST_PROGRAM);
    words.insert(words.end(), {"-o", (place / file).string()});
    const Finished done = run_process({words});
    EXPECT_EQ(done.status, 0);
    EXPECT_EQ(done.err, "");
    EXPECT_GT(fs::file_size(place / file), 0) << file;
  };
  for (const char* file : {"Größe 1.nrrd", "Größe 1.nii.gz", "Größe 1.mhd"}) {
    made({"phantom", "sphere", "--size", "32x32x32"}, file);
    made({"cast", (place / file).string(), "--preview", (place / "schön 1.png").string()}, "schön 1.exr");
    EXPECT_GT(fs::file_size(place / "schön 1.png"), 0);
  }
  for (const char* picture : {"ä b.exr", "ä b.tif", "ä b.nrrd", "ä b.png"})
    made({"project", (place / "Größe 1.nrrd").string()}, picture);
  EXPECT_EQ(read_body_map(place / "schön 1.exr").source, "MetaImage " + (place / "Größe 1.mhd").string());
}

// ---- the catheter ---------------------------------------------------------------------------------

TEST_F(Cli, SimulatesTheSameRunTwice) {
  make_push_and_tree(folder_);
  const std::string line =
      "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv --plot @/forces.png -q -o ";
  const Json json = json_of(line + "@/first.csv");
  EXPECT_THAT(keys_of(json), ElementsAre("tree", "device_model", "entry_branch", "entry_mm", "entry_side",
                                         "held_s", "log", "rows", "simulated_s", "wall_s", "tip"));
  EXPECT_EQ(json["entry_mm"], Json({0, 0, 0}));  // the most inferior end
  EXPECT_EQ(json["rows"], 3);
  EXPECT_LT(json["wall_s"], json["simulated_s"]);
  // The wire went in from below by 20 mm.
  EXPECT_NEAR(json["tip"]["position_mm"][2], 20, 1);
  EXPECT_GT(fs::file_size(folder_ / "forces.png"), 0);
  output_of(line + "@/second.csv");
  const std::string log = read_bytes(folder_ / "first.csv");
  EXPECT_EQ(log, read_bytes(folder_ / "second.csv"));
  EXPECT_THAT(log, StartsWith("time_s,insertion_mm,rotation_deg,force_N,torque_Nm,tip_x_mm,"));
  EXPECT_EQ(std::ranges::count(log, '\n'), 4);
}

TEST_F(Cli, NamesTheEndsThatLieAsLowAsTheEntry) {
  make_push(folder_);
  write_bytes(folder_ / "tree.json", R"({"branches": [
    {"id": 0, "parent": -1, "points": [[0, 0, 200, 8], [0, 0, 100, 8]]},
    {"id": 1, "parent": 0, "points": [[0, 0, 100, 4], [-80, 0, 0, 4]]},
    {"id": 2, "parent": 0, "points": [[0, 0, 100, 4], [80, 0, 3, 4]]}]})");
  const std::string line = "simulate @/tree.json --device-model cobra-5f --script @/push.csv -o @/log.csv";
  const Finished done = run(line);
  EXPECT_EQ(done.status, 0);
  expect_one_line(done.err,
                  "vessel ends lie equally low, within 10 mm: the device enters at branch 1 at (-80.0, 0.0, "
                  "0.0) mm, on the patient's right, and not at branch 2 at (80.0, 0.0, 3.0) mm, on the "
                  "patient's left; choose by --entry 1 or --entry 2\n");
  EXPECT_THAT(done.out,
              HasSubstr("entry: end of branch 1 at (-80.0, 0.0, 0.0) mm, on the patient's right; "));
  EXPECT_EQ(json_of(line + " --entry 1")["entry_side"], "right");
  EXPECT_EQ(json_of(line + " --entry 80,0,0")["entry_side"], "left");
}

TEST_F(Cli, DrawsTwoDevicesInARunsCine) {
  // Wider than the little tree: a wire of 0.36 mm is less than a pixel and may lie between two.
  write_bytes(folder_ / "tree.json",
              R"({"branches": [{"id": 0, "parent": -1, "points": [[0, 0, 0, 3], [0, 0, 100, 3]]}]})");
  const std::string rows = "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg\n0,5,0,5,0\n";
  write_bytes(folder_ / "ahead.csv", rows + "0.5,20,0,60,0\n");
  write_bytes(folder_ / "level.csv", rows + "0.5,20,0,20,0\n");
  output_of("-q phantom sphere --size 32x32x32 -o @/ct.nrrd");
  output_of("-q cast @/ct.nrrd -o @/map.exr --angles 60");
  for (const std::string look : {"fluoro", "surface"}) {
    for (const std::string script : {"ahead", "level"})
      output_of(
          "-q simulate @/tree.json --device-model cobra-5f --device-model guidewire-035-angled "
          "--script @/" +
          script + ".csv -o @/log.csv --map @/map.exr --inject 0,1 --look " + look + " --cine @/" + look +
          script);
    EXPECT_NE(read_bytes(folder_ / (look + "ahead/frame-004.png")),
              read_bytes(folder_ / (look + "level/frame-004.png")))
        << look << ": the wire does not show";
  }
}

TEST_F(Cli, ShowsARunInItsOwnTime) {
  make_run(folder_);
  output_of(
      "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv --map "
      "@/map.exr "
      "--size 8x8 --cine @/run.gif -q");
  std::vector<int> delays;  // in hundredths of a second
  const std::string gif = read_bytes(folder_ / "run.gif"), control = "\x21\xF9\x04";
  for (std::size_t at = 0; (at = gif.find(control, at)) != std::string::npos; at += control.size())
    delays.push_back(static_cast<unsigned char>(gif[at + 4]) + 256 * static_cast<unsigned char>(gif[at + 5]));
  EXPECT_THAT(delays, testing::AllOf(testing::SizeIs(11), testing::Each(10)))
      << "ten a second, from 0 to 1 s";
}

TEST_F(Cli, SaysHowMuchContrastAgentDevicesHoldBack) {
  make_run(folder_);
  const std::string rows = "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg\n0,5,0,";
  write_bytes(folder_ / "in.csv", rows + "5,0\n1,10,0,10,0\n");
  write_bytes(folder_ / "out.csv", rows + "0,0\n1,10,0,0,0\n");
  const auto line = [](const std::string& script, const std::string& more) {
    return "simulate @/tree.json --device-model microcatheter-27f --device-model guidewire-014-angled "
           "--script @/" +
           script + ".csv -o @/log.csv --map @/map.exr --cine @/" + script + ".gif" + more;
  };
  const std::string inject = " --inject 0.2,0.6 --injection-rate 5";
  // To the steps of the frames, which are added up.
  const Json in = json_of(line("in", inject));
  EXPECT_NEAR(in["withheld_ml"], 2, 1e-6);
  EXPECT_EQ(in["injected_ml"], 0);
  const Json out = json_of(line("out", inject));
  EXPECT_EQ(out["withheld_ml"], 0);
  EXPECT_NEAR(out["injected_ml"], 2, 1e-6);
  EXPECT_FALSE(json_of(line("in", "")).contains("withheld_ml"));
  EXPECT_THAT(
      output_of(line("in", inject)),
      HasSubstr("2.0 ml of contrast agent were not injected: guidewire-014-angled has no lumen and lies "
                "in the others; draw it back to 0 to inject\n"));
}

TEST_F(Cli, SubtractsARunFromItsFramesBeforeTheInjection) {
  make_run(folder_);
  const std::string line =
      "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv --map "
      "@/map.exr "
      "--size 41x61 --pixel 2 --inject 0.6 --injection-volume 1 --look dsa -q ";
  const auto greys = [&](const char* folder, int frame) {
    const Png png = read_png(folder_ / folder / fmt::format("frame-{:03}.png", frame));
    return std::pair(int{std::ranges::min(png.values)}, int{std::ranges::max(png.values)});
  };
  output_of(line + "--cine @/dsa");
  // Ten a second from 0.1 to 1 s.
  EXPECT_TRUE(fs::exists(folder_ / "dsa/frame-009.png"));
  EXPECT_FALSE(fs::exists(folder_ / "dsa/frame-010.png"));
  constexpr int kBackground = 204;
  EXPECT_EQ(greys("dsa", 0), std::pair(kBackground, kBackground)) << "the first frame of the mask";
  EXPECT_LT(greys("dsa", 8).first, kBackground - 70) << "contrast agent";
  EXPECT_EQ(greys("dsa", 8).second, kBackground) << "and nothing else";

  output_of(line + "--cine @/max --max-opacification --injection-rate 10");
  EXPECT_LT(greys("max", 9).first, kBackground - 70) << "still there when it is washed out";

  output_of(line + "--cine @/noisy --dose cine --seed 3");
  output_of(line + "--cine @/again --dose cine --seed 3");
  EXPECT_EQ(read_bytes(folder_ / "noisy/frame-012.png"), read_bytes(folder_ / "again/frame-012.png"));
}

// ---- segmenting -----------------------------------------------------------------------------------

TEST_F(Cli, SegmentsAPhantomsVessels) {
  output_of("phantom thorax -o @/thorax.nrrd --spacing 2 --truth @/truth -q");
  const Json json = json_of("segment @/thorax.nrrd -o @/vessels -q");
  EXPECT_THAT(keys_of(json), ElementsAre("input", "folder", "seg", "no_seg", "voxels", "lumen_mm3",
                                         "evidence", "window_hu", "noise_hu", "weak_share", "branches",
                                         "loops", "gaps_mm", "parts_left_out", "triangles", "timings_ms"));
  for (const char* name :
       {"mask.nrrd", "lumen.nrrd", "tree.vtp", "tree.json", "surface.vtp", "surface.stl", "report.png"})
    EXPECT_TRUE(fs::exists(folder_ / "vessels" / name)) << name;
  // A map of floats that other programs and we read. The mask's wall lies where voxels are half full, so that
  // both have the same volume but for branches as thin as a voxel: those were 3 % when this was written.
  EXPECT_EQ(json_of("info @/vessels/lumen.nrrd -q")["volume"]["size"],
            json_of("info @/thorax.nrrd -q")["volume"]["size"]);
  const double mask_mm3 = 8.0 * json["voxels"].get<double>();
  EXPECT_NEAR(json["lumen_mm3"].get<double>(), mask_mm3, 0.06 * mask_mm3);
  // A voxel of 2 mm is about as wide as the thinnest of the 24 branches; most are found.
  EXPECT_GE(json["branches"], 15);
  // The results serve a cast.
  output_of("cast @/thorax.nrrd -o @/map.exr -q --opacity spectrum:80 --iodine @/vessels/mask.nrrd");
}

TEST_F(Cli, SegmentExplainsItsSteps) {
  output_of("phantom thorax -o @/thorax.nrrd --spacing 3 -q");
  output_of("segment @/thorax.nrrd -o @/vessels --explain @/steps -q");
  for (const char* name :
       {"1-window.nrrd", "2-body.nrrd", "3-bone.nrrd", "4-chambers.nrrd", "5-trabecular-bone.nrrd",
        "6-gaps.nrrd", "7-selection.nrrd", "8-filling.nrrd", "steps.png"})
    EXPECT_TRUE(fs::exists(folder_ / "steps" / name)) << name;
  EXPECT_EQ(read_bytes(folder_ / "steps" / "8-filling.nrrd"), read_bytes(folder_ / "vessels" / "mask.nrrd"));
}

TEST_F(Cli, SegmentExplainsItsStepsInNoise) {
  output_of("phantom head -o @/head.nrrd --spacing 2 --noise 900 -q");
  fs::create_directory(folder_ / "steps");
  write_bytes(folder_ / "steps" / "8-filling.nrrd", "of an earlier run");
  write_bytes(folder_ / "steps" / "8-mine.nrrd", "of the user");
  output_of("segment @/head.nrrd -o @/vessels --explain @/steps -q");
  for (const char* name : {"1-evidence.nrrd", "steps.png", "8-mine.nrrd"})
    EXPECT_TRUE(fs::exists(folder_ / "steps" / name)) << name;
  EXPECT_FALSE(fs::exists(folder_ / "steps" / "8-filling.nrrd"));
  EXPECT_EQ(read_bytes(folder_ / "steps" / "2-selection.nrrd"),
            read_bytes(folder_ / "vessels" / "mask.nrrd"));
}

TEST_F(Cli, SegmentAcceptsTheSeedsThatItNames) {
  output_of("phantom abdomen -o @/abdomen.nrrd --spacing 2.5 -q");
  const std::string message = run("segment @/abdomen.nrrd -o @/vessels -q").err;
  expect_one_line(message, "by --seed, or a mask by --from-mask");
  const std::regex point("\\((-?[0-9]+), (-?[0-9]+), (-?[0-9]+)\\) mm with");
  std::vector<std::string> seeds;
  for (std::sregex_iterator i(message.begin(), message.end(), point); i != std::sregex_iterator(); ++i)
    seeds.push_back((*i)[1].str() + "," + (*i)[2].str() + "," + (*i)[3].str());
  EXPECT_GE(seeds.size(), 1);
  for (const std::string& seed : seeds)
    EXPECT_GT(json_of("segment @/abdomen.nrrd -o @/vessels -q --seed " + seed)["voxels"], 50) << seed;
}

TEST_F(Cli, SegmentTellsWhichOptionGivesASeedBack) {
  output_of("phantom abdomen -o @/abdomen.nrrd --spacing 2.5 -q");
  const auto message = [&](const std::string& options) {
    const Finished finished = run("segment @/abdomen.nrrd -o @/vessels -q " + options);
    EXPECT_EQ(finished.status, 3);
    return finished.err;
  };
  expect_one_line(message("--seed 6,-10,-95 --window 250,400"), "leave --window out");
  expect_one_line(message("--seed -110,-20,-20"), "raise --max-radius");
  expect_one_line(message("--seed 0,-180,-40"), "lies in air (-");
  expect_one_line(message(""), "the brightest candidates are (");
}

TEST_F(Cli, SegmentedVesselsServeTheRest) {
  output_of("phantom thorax -o @/thorax.nrrd --spacing 3 --truth @/truth -q");
  output_of("segment @/thorax.nrrd -o @/vessels --from-mask @/truth/mask.nrrd -q");
  const auto cast = [&](const std::string& more) {
    return json_of("cast @/thorax.nrrd -o @/map.exr --angles 90 -q " + more)["map"];
  };
  // The aorta's arch and its branches lie left of the body's middle, some way in front of the spine.
  const Json middle = cast("")["centre_mm"], vessels = cast("--centre vessels:@/vessels")["centre_mm"];
  EXPECT_NE(middle, vessels);
  const Json tree = Json::parse(read_bytes(folder_ / "vessels" / "tree.json"));
  double weights = 0, x = 0;
  for (const Json& branch : tree["branches"])
    for (std::size_t i = 1; i < branch["points"].size(); ++i) {
      const Json &a = branch["points"][i - 1], &b = branch["points"][i];
      const auto of = [&](const Json& p, std::size_t k) { return p[k].get<double>(); };
      const double length = std::hypot(of(b, 0) - of(a, 0), of(b, 1) - of(a, 1), of(b, 2) - of(a, 2)),
                   radius = 0.5 * (of(a, 3) + of(b, 3)), weight = length * radius * radius;
      weights += weight;
      x += weight * 0.5 * (of(a, 0) + of(b, 0));
    }
  // The tree's JSON has three digits after the point.
  EXPECT_NEAR(vessels[0].get<double>(), x / weights, 0.01);
  cast("--without-vessels @/vessels");
  output_of("render @/map.exr -o @/frame.png --vessels @/vessels --look surface --size 64x64 -q");
}

TEST_F(Cli, CastsWithoutVesselsBySlabsToo) {
  NiftiFile scan = water(64);
  std::vector<std::uint8_t> mask(8 * 8 * 64);
  for (std::size_t z = 0; z < 64; ++z) {
    const std::size_t voxel = 3 + 8 * (4 + 8 * z);
    scan.voxels[2 * voxel + 1] = 2;  // 512 HU
    mask[voxel] = 1;
  }
  write_bytes(folder_ / "ct.nii", scan.bytes());
  fs::create_directory(folder_ / "vessels");
  write_mask({{8, 8, 64}, {1, 1, 1}, {0, 0, 0}}, mask, folder_ / "vessels" / "mask.nrrd");
  const auto tau = [&](const std::string& more) {
    output_of("cast @/ct.nii -o @/map.exr -q --opacity bilinear " + more);
    return read_body_map(folder_ / "map.exr").tau;
  };
  const auto whole = tau("--without-vessels @/vessels");
  EXPECT_NE(whole, tau(""));
  EXPECT_EQ(whole, tau("--without-vessels @/vessels --memory-limit 0.008M"));
}

TEST_F(Cli, SegmentCountsOneBranch) {
  NiftiFile scan = water(40), mask = scan;
  for (int z = 4; z < 36; ++z)
    for (const int y : {3, 4})
      for (const int x : {3, 4}) mask.voxels[static_cast<std::size_t>(2 * (x + 8 * (y + 8 * z)))] = 1;
  write_bytes(folder_ / "ct.nii", scan.bytes());
  write_bytes(folder_ / "mask.nii", mask.bytes());
  EXPECT_THAT(output_of("segment @/ct.nii -o @/vessels --from-mask @/mask.nii"),
              HasSubstr(": 1 branch, 0 loops, "));
}

TEST_F(Cli, SegmentsFromAMask) {
  output_of("phantom thorax -o @/thorax.nrrd --spacing 3 --truth @/truth -q");
  const Json json =
      json_of("segment @/thorax.nrrd -o @/vessels --from-mask @/truth/mask.nrrd --surface tubes -q");
  EXPECT_GE(json["branches"], 3);

  const Json tree = Json::parse(read_bytes(folder_ / "vessels" / "tree.json"))["branches"];
  const Json leaf =
      *std::ranges::find_if(tree, [](const Json& branch) { return branch["children"].empty(); });
  const Json end = leaf["points"].back();
  const auto root = [&](double off_mm) {
    return fmt::format(" --root {},{},{}", end[0].get<double>(), end[1].get<double>(),
                       end[2].get<double>() + off_mm);
  };
  output_of("segment @/thorax.nrrd -o @/rooted --from-mask @/truth/mask.nrrd -q" + root(0));
  const Json rooted = Json::parse(read_bytes(folder_ / "rooted" / "tree.json"))["branches"][0]["points"][0];
  // The same line, whose points lie a part of a voxel apart when it is laid the other way round.
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(rooted[axis].get<double>(), end[axis].get<double>(), 1);
  const Finished far = run("segment @/thorax.nrrd -o @/far --from-mask @/truth/mask.nrrd -q" + root(5000));
  EXPECT_EQ(far.status, 3);
  expect_one_line(far.err, "mm away");
  EXPECT_FALSE(fs::exists(folder_ / "far"));
}

TEST_F(Cli, VesselnessIsAFieldOnTheScansGrid) {
  NiftiFile scan = water(40);
  for (int z = 0; z < 40; ++z)  // a tube of 2 x 2 voxels of 300 HU along z
    for (const int y : {3, 4})
      for (const int x : {3, 4}) {
        const std::int16_t hu = 300;
        std::memcpy(&scan.voxels[static_cast<std::size_t>(2 * (x + 8 * (y + 8 * z)))], &hu, sizeof hu);
      }
  write_bytes(folder_ / "ct.nii", scan.bytes());
  const Json json = json_of("vesselness @/ct.nii -o @/v.nrrd --scales 1,1.5 -q");
  EXPECT_THAT(keys_of(json), ElementsAre("input", "output", "volume", "measure", "scales_mm", "timings_ms"));
  EXPECT_EQ(json["scales_mm"], Json({1, 1.5}));
  const std::string bytes = read_bytes(folder_ / "v.nrrd");
  EXPECT_THAT(bytes, HasSubstr("type: float\ndimension: 3\nspace: left-posterior-superior\nsizes: 8 8 40\n"));
  const std::size_t header = bytes.find("\n\n") + 2;
  ASSERT_EQ(bytes.size(), header + 8 * 8 * 40 * sizeof(float));
  const auto at = [&](std::size_t x, std::size_t y, std::size_t z) {
    float value = -1;
    std::memcpy(&value, &bytes[header + sizeof value * (x + 8 * (y + 8 * z))], sizeof value);
    return value;
  };
  EXPECT_GT(at(3, 3, 20), 0.9F);
  EXPECT_LT(at(0, 0, 20), 0.1F);
}

}  // namespace
}  // namespace xraycast::cli_test
