// Runs of instruments.
#include "cli/cli_fixture.hpp"

namespace xraycast::cli_test {
namespace {

class SimulateCommand : public Cli {};

TEST_F(SimulateCommand, SimulatesTheSameRunTwice) {
  make_push_and_tree(folder_);
  const std::string line =
      "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv --plot @/forces.png -q -o ";
  const Json json = json_of(line + "@/first.csv");
  EXPECT_THAT(keys_of(json),
              ElementsAre("tree", "device_model", "entry_branch", "entry_vessel", "entry_mm", "entry_side",
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

TEST_F(SimulateCommand, NamesTheEndsThatLieAsLowAsTheEntry) {
  make_push(folder_);
  write_bytes(folder_ / "tree.json", R"({"branches": [
    {"id": 0, "parent": -1, "points": [[0, 0, 200, 8], [0, 0, 100, 8]]},
    {"id": 1, "parent": 0, "points": [[0, 0, 100, 4], [-80, 0, 0, 4]]},
    {"id": 2, "parent": 0, "points": [[0, 0, 100, 4], [80, 0, 3, 4]]}]})");
  const std::string line = "simulate @/tree.json --device-model cobra-5f --script @/push.csv -o @/log.csv";
  const Finished done = run(line);
  EXPECT_EQ(done.status, 0);
  expect_one_line(done.err,
                  "vessel ends lie equally low, within 10 mm: the instrument enters at branch 1 at (-80.0, "
                  "0.0, 0.0) mm, on the patient's right, and not at branch 2 at (80.0, 0.0, 3.0) mm, on the "
                  "patient's left; choose by --entry 1 or --entry 2\n");
  EXPECT_THAT(done.out,
              HasSubstr("entry: end of branch 1 at (-80.0, 0.0, 0.0) mm, on the patient's right; "));
  EXPECT_EQ(json_of(line + " --entry 1")["entry_side"], "right");
  EXPECT_EQ(json_of(line + " --entry 80,0,0")["entry_side"], "left");
}

TEST_F(SimulateCommand, SaysTheNamesOfVessels) {
  make_push(folder_);
  write_bytes(folder_ / "tree.json", R"({"branches": [
    {"id": 0, "parent": -1, "name": "aorta", "points": [[0, 0, 200, 8], [0, 0, 100, 8]]},
    {"id": 1, "parent": 0, "points": [[0, 0, 100, 4], [-80, 0, 0, 4]]},
    {"id": 2, "parent": 0, "points": [[0, 0, 100, 4], [80, 0, 3, 4]]}]})");
  write_bytes(folder_ / "names.json", R"({"names": [
    {"branch": 1, "name": "right iliac artery"}, {"at_mm": [78, 0, 5], "name": "left iliac artery"}]})");
  const std::string line = "simulate @/tree.json --device-model cobra-5f --script @/push.csv -o @/log.csv";
  EXPECT_THAT(run(line).err,
              HasSubstr("choose by --entry \"right iliac artery\" or --entry \"left iliac artery\""));
  const Json json = json_of(line + " --entry Left_Iliac_Artery");
  EXPECT_EQ(json["entry_vessel"], "left iliac artery");
  EXPECT_EQ(json["tip"]["vessel"], "left iliac artery");
  EXPECT_THAT(
      output_of(line + " --entry right_iliac_artery"),
      HasSubstr("entry: end of right iliac artery at (-80.0, 0.0, 0.0) mm, on the patient's right; tip: "
                "in right iliac artery, "));
  EXPECT_THAT(run(line + " --entry spleen").err,
              HasSubstr("it has aorta, left iliac artery, right iliac artery"));
}

TEST_F(SimulateCommand, FollowsAnExercise) {
  make_push_and_tree(folder_);
  const auto write_exercise = [&](const std::string& targets) {
    write_bytes(
        folder_ / "exercise.json",
        R"({"title": "Up", "task": "Go up.", "instruments": ["microcatheter-27f"], "reference": "push.csv",
                    "limits": {"force_N": 3}, "targets": )" +
            targets + "}");
  };
  write_exercise(R"([{"name": "half way", "at_mm": [0, 0, 10]}, {"at_mm": [0, 0, 90]}])");
  const std::string line = "simulate @/tree.json --exercise @/exercise.json -o @/log.csv --report @/report";
  const Json report = json_of(line + ".json")["report"];
  EXPECT_FALSE(report["exercise"]["is_complete"]);
  EXPECT_NEAR(report["exercise"]["targets"][0]["reached_s"], 0.15, 0.05);
  EXPECT_EQ(report["exercise"]["targets"][1]["reached_s"], nullptr);
  EXPECT_NEAR(report["instruments"][0]["tip_path_mm"], 20, 1);
  EXPECT_FALSE(report.contains("fluoroscopy_s"));
  Json saved = Json::parse(read_bytes(folder_ / "report.json"));
  EXPECT_EQ(saved["name"], "report");
  EXPECT_EQ(saved["exercise"], report["exercise"]);
  EXPECT_GT(saved["series"]["time_s"].size(), 4);
  EXPECT_THAT(output_of(line + ".csv"), HasSubstr("Up: not complete; half way after 0.1"));
  EXPECT_THAT(read_bytes(folder_ / "report.csv"), StartsWith("run,exercise,is_complete,is_passed,time_s,"));
  output_of(line + ".html");
  EXPECT_THAT(read_bytes(folder_ / "report.html"), HasSubstr("data:image/png;base64,"));

  EXPECT_THAT(run(line + ".txt").err, HasSubstr("report.txt: must end in .html"));
  EXPECT_THAT(run(line + ".json --device-model guidewire-014-angled").err,
              HasSubstr("is not allowed in the exercise \"Up\"; take microcatheter-27f"));
  write_exercise(R"([{"at_mm": [0, 0, 190]}])");
  const Finished outside = run(line + ".json");
  EXPECT_EQ(outside.status, 3);
  expect_one_line(outside.err, "mm outside the vessels");
  EXPECT_EQ(run("simulate @/tree.json -o @/log.csv --script @/push.csv").status, 2);
  Command nameless = command("simulate @/tree.json -o @/log.csv --exercise");
  nameless.words.emplace_back();
  expect_one_line(run_process(nameless).err, "--exercise: names no file");
}

TEST_F(SimulateCommand, LaysReportsSideBySide) {
  make_push_and_tree(folder_);
  const std::string line = "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv ";
  for (const std::string run : {"a", "b", "best"})
    output_of(line + "-o @/" + run + ".csv --report @/" + run + ".json");
  EXPECT_EQ(json_of("report @/a.json @/b.json --reference @/best.json -o @/all.html")["runs"], 2);
  EXPECT_THAT(read_bytes(folder_ / "all.html"),
              HasSubstr("<th>best (reference)</th><th>1. a</th><th>2. b</th>"));
  output_of("report @/a.json @/b.json -o @/all.json");
  EXPECT_EQ(json_of("report @/all.json @/best.json -o @/all.csv")["runs"], 3);
  EXPECT_EQ(std::ranges::count(read_bytes(folder_ / "all.csv"), '\n'), 4);
  // Files of one name, as pages save them for each pupil.
  for (const char* pupil : {"anna", "ben"}) {
    std::filesystem::create_directory(folder_ / pupil);
    std::filesystem::copy_file(folder_ / "a.json", folder_ / pupil / "report.json");
  }
  output_of("report @/anna/report.json @/ben/report.json @/ben/report.json @/b.json -o @/class.csv");
  EXPECT_THAT(read_bytes(folder_ / "class.csv"),
              testing::AllOf(HasSubstr("\n\"anna: report\","), HasSubstr("\n\"ben: report\","),
                             HasSubstr("\n\"ben: report (2)\","), HasSubstr("\n\"b\",")));
  EXPECT_EQ(run("report @/push.csv -o @/all.csv").status, 3);
  EXPECT_THAT(run("report @/a.json -o @/all.pdf").err, HasSubstr("must end in .html"));
  EXPECT_THAT(run("report @/a.json --reference @/all.json -o @/all.csv").err,
              HasSubstr("has 2 runs; give one"));
  EXPECT_THAT(run("report @/a.json -o @/all.csv --title Mine").err,
              HasSubstr("--title does not apply to a table or JSON"));
  EXPECT_THAT(run("report @/a.json -o @/a.json").err, HasSubstr("is also given as RUN and would overwrite"));
  EXPECT_THAT(run(line + "-o @/x.csv --report @/x.csv").err, HasSubstr("is also given as --report"));
}

TEST_F(SimulateCommand, KeepsTheReferenceOfReports) {
  make_push_and_tree(folder_);
  const std::string line = "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv ";
  for (const std::string run : {"a", "best", "other"})
    output_of(line + "-o @/" + run + ".csv --report @/" + run + ".json");
  output_of("report @/a.json --reference @/best.json -o @/first.json");
  output_of("report @/a.json --reference @/other.json -o @/second.json");
  output_of("report @/first.json @/a.json -o @/all.html");
  EXPECT_THAT(read_bytes(folder_ / "all.html"),
              HasSubstr("<th>best (reference)</th><th>1. a</th><th>2. a (2)</th>"));
  expect_one_line(run("report @/first.json @/second.json -o @/all.html").err,
                  "has another reference than the files before; give one by --reference");
  output_of("report @/first.json @/second.json --reference @/best.json -o @/all.html");
}

TEST_F(SimulateCommand, DrawsTwoInstrumentsInARunsCine) {
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

TEST_F(SimulateCommand, ShowsARunInItsOwnTime) {
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

TEST_F(SimulateCommand, SaysHowMuchContrastAgentInstrumentsHoldBack) {
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

TEST_F(SimulateCommand, ParticlesInTheAgentEmboliseWhatLiesBehind) {
  make_push_and_tree(folder_);
  const std::string line =
      "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv --inject "
      "0.2,0.8 "
      "--injection-rate 2 ";
  EXPECT_FALSE(json_of(line).contains("embolised"));
  const Json run = json_of(line + "--particles 0.3 --report @/run.json");
  ASSERT_TRUE(run.contains("embolised"));
  EXPECT_NEAR(run["injected_ml"], 1.2, 1e-6);
  double particles = 0;
  for (const Json& leaf : run["embolised"]) particles += leaf["particles"].get<double>();
  EXPECT_LT(run["embolised"][0]["periphery_percent"], 100);
  // 1.2 ml of 60 mm3 a ml in spheres of 0.01414 mm3.
  EXPECT_NEAR(particles, 1.2 * 60 / 0.014137, 20);
  EXPECT_THAT(output_of(line + "--particles 0.3"), HasSubstr(" of its conductance left\n"));
  const Json report = Json::parse(read_bytes(folder_ / "run.json"));
  EXPECT_EQ(report["treatments"][0]["device"], "particles");
  EXPECT_NEAR(report["injected_ml"], 1.2, 1e-3);
}

TEST_F(SimulateCommand, SubtractsARunFromItsFramesBeforeTheInjection) {
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

  // What it chose, given, shows the same, and twice of it half the contrast, but for the rounding of two
  // greys.
  const double black = Json::parse(output_of(line + "--cine @/told --json"))["dsa_black"];
  output_of(line + fmt::format("--cine @/same --dsa-black {}", black));
  output_of(line + fmt::format("--cine @/half --dsa-black {}", 2 * black));
  EXPECT_EQ(read_bytes(folder_ / "same/frame-008.png"), read_bytes(folder_ / "dsa/frame-008.png"));
  EXPECT_NEAR(kBackground - greys("half", 8).first, 0.5 * (kBackground - greys("dsa", 8).first), 1);

  output_of(line + "--cine @/max --max-opacification --injection-rate 10");
  EXPECT_LT(greys("max", 9).first, kBackground - 70) << "still there when it is washed out";

  output_of(line + "--cine @/noisy --dose cine --seed 3");
  output_of(line + "--cine @/again --dose cine --seed 3");
  EXPECT_EQ(read_bytes(folder_ / "noisy/frame-012.png"), read_bytes(folder_ / "again/frame-012.png"));
}

}  // namespace
}  // namespace xraycast::cli_test
