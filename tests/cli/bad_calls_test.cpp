// What the program says of bad calls and of missing drivers.
#include "cli/cli_fixture.hpp"
#include "xraycast/image_file/vector_image.hpp"

namespace xraycast::cli_test {
namespace {

void make_backward_heart(const TemporaryFolder& folder) {
  make_run(folder);
  write_bytes(folder / "backwards.csv", "time_s,flow_ml_s\n0,0\n0.4,-100\n0.8,0\n");
}

class Refusals : public Cli {};

struct BadCall {
  const char* name;
  const char* line;
  int status;
  const char* message;
  void (*make)(const TemporaryFolder&) = [](const TemporaryFolder&) {};  ///< what lies in the folder
};

DicomFile slice() { return {8, 8, std::vector<std::int16_t>(64)}; }

#define SIMULATE_DSA                                                                                        \
  "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv --map @/map.exr " \
  "--cine @/c.gif --look dsa"

/// A breath by a field of 8 mm on a cube of 40 mm that starts at a corner.
void write_motion(const TemporaryFolder& folder, const glm::dvec3& corner_mm, const char* period_s = "4") {
  write_vector_image({{{3, 3, 3}, corner_mm, glm::dmat3(20)}, std::vector<glm::vec3>(27, {0, 0, 8})},
                     folder / "f.nrrd");
  write_bytes(folder / "m.json", fmt::format(R"({{"version": 1, "modes": [{{"name": "breath", "period_s": {},
      "phases": [{{"phase": 0}}, {{"phase": 1, "field": "f.nrrd"}}]}}]}})",
                                             period_s));
}
void write_fitting_motion(const TemporaryFolder& folder) { write_motion(folder, glm::dvec3(-20)); }

const BadCall kBadCalls[] = {
    // Motion.
    {"MotionAtNoInstant", "project @/ct.nii -o @/p.png --motion @/m.json", 3,
     "at which instant? Give --phase or --time", write_fitting_motion},
    {"KeysOfNoMotion", "cast @/ct.nii -o @/c.exr --keys breath=3", 3,
     "--keys need a motion; give --motion too", write_fitting_motion},
    {"KeysOfAnInstant", "cast @/ct.nii -o @/c.exr --motion @/m.json --phase breath=1 --keys breath=3", 3,
     "leave out --phase and --time, or --keys", write_fitting_motion},
    {"KeysOfAnotherMode", "cast @/ct.nii -o @/c.exr --motion @/m.json --keys heart=3", 3,
     "has no such mode; choose one of breath", write_fitting_motion},
    {"KeysThatAreNone", "cast @/ct.nii -o @/c.exr --motion @/m.json --keys breath=1", 3,
     "--keys breath=1: must be 2 to 64", write_fitting_motion},
    {"KeysWithoutNumber", "cast @/ct.nii -o @/c.exr --motion @/m.json --keys breath", 3,
     "--keys breath: must be a mode and the number", write_fitting_motion},
    {"KeysTwice", "cast @/ct.nii -o @/c.exr --motion @/m.json --keys breath=3 --keys breath=4", 3,
     "breath is given twice", write_fitting_motion},
    {"KeysOfRectangles", "cast @/ct.nii -o @/c.exr --motion @/m.json --projection rectangle", 3,
     "--projection rectangle: its pictures do not move", write_fitting_motion},
    {"KeysInFloats", "cast @/ct.nii -o @/c.exr --motion @/m.json --precision float", 3,
     "--precision float: a map that moves is stored in bytes", write_fitting_motion},
    {"KeysBeyondMemory", "cast @/ct.nii -o @/c.exr --motion @/m.json --memory-limit 0.001M", 3,
     "key maps need the whole scan in memory", write_fitting_motion},
    {"MotionAtTwoInstants", "cast @/ct.nii -o @/c.exr --motion @/m.json --phase breath=1 --time 2", 3,
     "--phase and --time name two instants", write_fitting_motion},
    {"MotionIsMissing", "convert @/ct.nii -o @/c.nrrd --phase breath=1", 2, "--phase requires --motion"},
    {"MotionOfAPhaseTwice", "project @/ct.nii -o @/p.png --motion @/m.json --phase breath=1 --phase breath=0",
     3, "--phase breath=0: breath is given twice", write_fitting_motion},
    {"MotionOfAnotherMode", "project @/ct.nii -o @/p.png --motion @/m.json --phase heart=1", 3,
     "has no such mode; choose one of breath", write_fitting_motion},
    {"MotionBeyondItsPhases", "convert @/ct.nii -o @/c.nrrd --motion @/m.json --phase breath=1.5", 3,
     "--phase breath=1.5: must be 0 to 1", write_fitting_motion},
    {"MotionOfAPeriodOfZero", "project @/ct.nii -o @/p.png --motion @/m.json --time 1", 3,
     "mode breath: period_s is 0; it must be 0.001 to",
     [](const TemporaryFolder& f) { write_motion(f, glm::dvec3(-20), "0"); }},
    {"MotionOfAnotherFrame", "convert @/ct.nii -o @/c.nrrd --motion @/m.json --phase breath=1", 3,
     "its displacements lie elsewhere than the body",
     [](const TemporaryFolder& f) { write_motion(f, glm::dvec3(500)); }},

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
     "--entry femoral: no branch of the tree has this name; its branches have no names; give a number",
     make_push_and_tree},
    {"SimulateInNoVessels", "simulate @/vessels --device-model cobra-5f --script @/push.csv -o @/log.csv", 3,
     "vessels: no such file or folder; check its name", make_push},
    {"SimulateInAScan", "simulate @/ct.nii --device-model cobra-5f --script @/push.csv -o @/log.csv", 3,
     "ct.nii: a vessel tree is a folder, or a file that ends in .vtp or .json; give one of these", make_push},
    {"SimulateEntryFarAway",
     "simulate @/tree.json --device-model cobra-5f --script @/push.csv -o @/log.csv --entry 0,0,900", 3,
     "mm away", make_push_and_tree},
    {"SimulateTooThick", "simulate @/tree.json --device-model cobra-5f --script @/push.csv -o @/log.csv", 3,
     "nor into any other end; choose a thinner instrument", make_push_and_tree},
    {"SimulateUnknownInstrument", "simulate @/tree.json --device-model asp --script @/push.csv -o @/log.csv",
     3, "asp: unknown instrument; choose one of guidewire-035-j", make_push_and_tree},
    {"SimulateMisspelledCatheter",
     "simulate @/tree.json --device-model cobra5f --script @/push.csv -o @/log.csv", 3,
     "cobra5f: unknown instrument; did you mean cobra-5f? Else choose one of guidewire-035-j, ",
     make_push_and_tree},
    {"SimulateMisspelledWire",
     "simulate @/tree.json --device-model guidewire-35-angled --script @/push.csv -o @/log.csv", 3,
     "guidewire-35-angled: unknown instrument; did you mean guidewire-035-angled? Else", make_push_and_tree},
    {"SimulateTwoInstrumentsInOneOption",
     "simulate @/tree.json --device-model cobra-5f,guidewire-035-j --script @/push.csv -o @/log.csv", 2,
     "cobra-5f,guidewire-035-j: one instrument an option; give --device-model cobra-5f --device-model "
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
     3, "push.csv: line 1: no column insertion_2_mm; a script of 2 instruments has", make_push_and_tree},
    {"SimulateFourByAScriptForOne",
     "simulate @/tree.json --device-model guide-6f --device-model jb1-5f --device-model microcatheter-24f "
     "--device-model guidewire-014-angled --script @/push.csv -o @/log.csv",
     3, "4 instruments; give one to 3", make_push_and_tree},
    {"SimulateThickInThinByAScriptForOne",
     "simulate @/tree.json --device-model microcatheter-27f --device-model cobra-5f --script @/push.csv -o "
     "@/log.csv",
     3, "list the outermost instrument first", make_push_and_tree},
    {"SimulateIntoAnotherFormat",
     "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv --map @/map.exr "
     "--cine @/run.mp4",
     3, "run.mp4: must be a folder for PNGs, whose name has no ending, or end in .gif or .dcm", make_run},
    {"InjectThroughAWire",
     "simulate @/tree.json --device-model guidewire-014-angled --script @/push.csv -o @/log.csv --map "
     "@/map.exr --cine @/c.gif --inject 0.2,2",
     3, "--inject 0.2,2: guidewire-014-angled has no lumen; leave --inject out, or give a catheter",
     make_run},
    {"InjectWithoutPictures",
     "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv "
     "--mask-shift 1,1",
     3, "--mask-shift does not apply without pictures of the run; leave it out or give --cine too", make_run},
    {"ParticlesOfNoInjection", SIMULATE_DSA " --particles 0.5", 2, "--particles requires --inject", make_run},
    {"ParticlesOfNoSize", SIMULATE_DSA " --inject 0.5,0.9 --particles 3", 3,
     "--particles 3: must be 0, for none, or a diameter of 0.1 to 1.2 mm", make_run},
    {"ParticlesTooWide", SIMULATE_DSA " --inject 0.5,0.9 --particles 1.2", 3,
     "--particles 1.2: they pass no lumen, whose widest is 0.64 mm; take smaller ones", make_run},
    {"SimulateInAMapWithoutPictures",
     "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv --map @/map.exr",
     3, "--map does not apply without pictures of the run", make_run},
    {"InjectAtARateNothing", SIMULATE_DSA " --injection-rate 4", 2, "--injection-rate requires --inject",
     make_run},
    {"InjectAVolumeNever", SIMULATE_DSA " --injection-volume 4", 2, "--injection-volume requires --inject",
     make_run},
    {"IodineOfNoInjection", SIMULATE_DSA " --iodine 300", 2, "--iodine requires --inject", make_run},
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
    {"FlowInNoTree", "flow @/nothing.vtp", 3, "nothing.vtp"},
    {"FlowAtNoRate", "flow @/tree.json --heart-rate 7", 3,
     "--heart-rate 7: must be 0, for a steady flow, or 20 to 250", make_run},
    {"SimulateAtNoRate", SIMULATE_DSA " --inject 0.5,0.9 --heart-rate 7", 3,
     "--heart-rate 7: must be 0, for a steady flow, or 20 to 250", make_run},
    {"FlowOfABackwardHeart", "flow @/tree.json --heart-waveform @/backwards.csv", 3,
     "backwards.csv: its mean is -50 ml/s; a heart gives 1 to 1000 ml/s: turn the sign", make_backward_heart},
    {"FlowOfAScript", "flow @/tree.json --heart-waveform @/push.csv", 3,
     "push.csv: line 2: \"0,0,0\" must be a time in s and a flow in ml/s, such as 0.12,310", make_run},
    {"FlowOfTwoHearts", "flow @/tree.json --heart-waveform @/push.csv --heart-rate 60", 2,
     "--heart-rate excludes --heart-waveform", make_run},
    {"SubtractNothing", SIMULATE_DSA, 3, "--look dsa: there is no contrast agent to show; add --inject",
     make_run},
    {"BlackOfNothing", SIMULATE_DSA " --inject 0.5,0.9 --dsa-black 0", 3, "--dsa-black 0: must be 0.01 to 10",
     make_run},
    {"BlackOfNothingInAFolder",
     "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv --map @/map.exr "
     "--cine @/frames --look dsa --inject 0.5,0.9 --dsa-black 11",
     3, "--dsa-black 11: must be 0.01 to 10", make_run},
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
    {"SeriesOfNrrd", "info @/a.nrrd --series 3", 3,
     "a.nrrd: not DICOM, so there are no series to choose from; leave out --series 3",
     [](const TemporaryFolder& f) { write_bytes(f / "a.nrrd", nrrd_of("8 8 4")); }},
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
     "neither tree.vtp nor tree.json; give one that `xraycast segment` or `xraycast vessels` wrote",
     [](const TemporaryFolder& f) {
       make_push_and_tree(f);
       fs::rename(f / "tree.json", f / "vessels.json");
     }},
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
    {"PhaseWithoutNumber", "phantom thorax -o @/out.nrrd --phase breath", 3,
     "--phase breath: must be a mode and its phase, such as breath=0.3"},
    {"PhaseTwice", "phantom thorax -o @/out.nrrd --phase breath=0 --phase breath=1", 3,
     "--phase breath=1: breath is given twice"},
    {"PhaseOfNoMovement", "phantom head -o @/out.nrrd --phase breath=1", 3,
     "--phase breath: the phantom head has no such movement; choose one of turn"},
    {"CoronariesOfAHead", "phantom head -o @/out.nrrd --coronaries", 3,
     "the phantom head has none; make thorax"},
    {"HipOfWater", "phantom thorax -o @/out.nrrd --hip-prosthesis 0", 3,
     "--hip-prosthesis 0: must be 3100 to 30000 HU"},
    {"SpacingWithoutMotion", "phantom thorax -o @/out.nrrd --motion-spacing 3", 2,
     "--motion-spacing requires --motion"},
    {"MotionOfABox", "phantom box -o @/out.nrrd --motion @/motion", 3, "the phantom box does not move"},
    {"MotionFromAPhase", "phantom thorax -o @/out.nrrd --motion @/motion --phase heart=0.4", 3,
     "--motion is that of the phantom at rest; leave --phase out"},
    {"MotionOfPhasesByAModel", "motion @/ct.nii @/ct.nii --breath 12 -o @/motion", 3,
     "--breath does not apply to PHASE scans"},
    {"MotionOfAModelWithPhases", "motion @/ct.nii --breath 12 --grid 20 -o @/motion", 3,
     "--grid does not apply without PHASE scans"},
    {"MotionOfPhasesInDisorder", "motion @/ct.nii @/ct.nii @/ct.nii --at 0.5,0.4 -o @/motion", 3,
     "--at 0.4: phases must ascend"},
    {"MotionOfTooFewPhases", "motion @/ct.nii @/ct.nii --at 0.5,0.7 -o @/motion", 3,
     "--at holds 2 phases for 1 scan"},
    {"RenderMovesNothing", "render @/map.exr -o @/p.png --motion @/m.json --phase breath=1", 3,
     "m.json: moves vessels; give --vessels too", write_fitting_motion},
    {"RoadMapOfNoSession",
     "render @/map.exr -o @/p.png --vessels @/ct.nii --motion @/m.json --phase breath=1 --road-map-phase "
     "breath=0",
     3, "--road-map-phase breath=0: there is no road map", write_fitting_motion},
    {"MotionWithoutMovement", "motion @/chest.nrrd -o @/motion", 3, "give --breath, --heart or both"},
    {"MotionOfADeepBreath", "motion @/chest.nrrd --breath 80 -o @/motion", 3,
     "--breath 80: must be 1 to 40 mm"},
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
    {"CineIntoAnotherFormat", "render @/map.exr -o @/turn.mp4 --cine 0:360:90", 3,
     "turn.mp4: must be a folder for PNGs, whose name has no ending, or end in .gif or .dcm"},
    {"CineIntoAPicture", "render @/map.exr -o @/c.png --cine 0:360:90", 3, "must be a folder for PNGs"},
    {"RenderOfMissingVessels", "render @/map.exr -o @/out.png --vessels @/gone", 3,
     "gone: no such file or folder", write_small_map},
    {"ViewOfAnInstrumentWithoutARun", "view @/map.exr --device-model simmons2-5f", 3,
     "--device-model does not apply without a run; leave it out or give --simulate too", write_small_map},
    {"ViewByAHandWithoutARun", "view @/map.exr --haptic mouse", 3,
     "--haptic does not apply without a run; leave it out or give --simulate too", write_small_map},
    {"ViewOfMasksOfAStillBody", "view @/map.exr --mask-phase matched", 3,
     "--mask-phase matched: the body is still; give --motion too, or leave it out", write_small_map},
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

TEST_F(Refusals, SaysWhatToInstallWithoutAnOpenClDriver) {
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
TEST_F(Refusals, SaysWhatToInstallWithoutALinker) {
  Command box = command("phantom box -o @/box.nrrd --size 8x8x8");
  box.environment["PATH"] = folder_ / "";
  const Finished done = run_process(box);
  EXPECT_EQ(done.status, 4);
  expect_one_line(done.err, "install Debian's package binutils");
}

TEST_F(Refusals, SaysHowMuchTheDeviceLacks) {
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

TEST_F(Refusals, TakesTheDeviceFromTheEnvironmentUnlessToldOtherwise) {
  Command box = command("phantom box -o @/box.nrrd --size 8x8x8");
  box.environment["XRAYCAST_DEVICE"] = "abacus";
  const Finished refused = run_process(box);
  EXPECT_EQ(refused.status, 4);
  expect_one_line(refused.err, "no OpenCL device matches 'abacus'");
  box.words.insert(box.words.end(), {"--device", "0"});
  EXPECT_EQ(run_process(box).status, 0);
}

TEST_F(Refusals, TakesTheOpenGlDeviceFromTheEnvironment) {
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

}  // namespace
}  // namespace xraycast::cli_test
