// Pages and glTF scenes as `export` writes them. What browsers make of them is tested in
// tests/systems/web_page_test.mjs.
#include "support/process.hpp"
#include "support/scan_files.hpp"
#include "support/small_session.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/casting/body_map.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstring>
#include <functional>
#include <sstream>

namespace xraycast::export_test {
namespace {

using Json = nlohmann::json;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

class Export : public testing::Test {
 protected:
  /// As a user calls it; @ stands for the test's folder.
  Finished run(const std::string& line) const {
    return run_process(command_of({XRAYCAST_PROGRAM, "export"}, line, folder_.path()));
  }

  std::string written(const std::string& line, const std::string& name) const {
    const Finished done = run(line);
    EXPECT_EQ(done.status, 0) << done.err;
    return read_bytes(folder_ / name);
  }

  static Json header_of(const std::string& page) {
    const std::string mark = "id=\"session\">";
    const std::size_t first = page.find(mark) + mark.size();
    return Json::parse(page.substr(first, page.find("</script>", first) - first));
  }

  void write_map(const BodyMap& map) const { write_body_map(map, folder_ / "map.exr"); }

  /// A straight vessel along the axis, and one that lies beside the body.
  void write_vessels() const {
    for (const auto& [name, x] : {std::pair("vessels", 0.0), std::pair("elsewhere", 500.0)}) {
      std::filesystem::create_directory(folder_ / name);
      VesselBranch branch;
      branch.points = {{{x, 0, -90}, 3}, {{x, 0, 90}, 3}};
      write_tree(VesselTree({std::move(branch)}, "tube"), folder_ / name / "tree.vtp");
    }
    std::string points;
    for (int i = 0; i <= 5000; ++i) points += "0,0," + std::to_string(i) + "\n";
    write_bytes(folder_ / "long_catheter.csv", points);
    write_bytes(folder_ / "push.csv", "time_s,insertion_mm,rotation_deg\n0,0,0\n0.2,20,0\n");
    write_bytes(
        folder_ / "pair.csv",
        "time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg\n0,10,0,20,0\n0.2,30,0,60,0\n");
    write_bytes(folder_ / "long.csv", "time_s,insertion_mm,rotation_deg\n0,0,0\n601,20,0\n");
    write_bytes(folder_ / "deep.csv", "time_s,insertion_mm,rotation_deg\n0,0,0\n20,5000,0\n");
  }

  /// As the viewer saves one with a catheter in the vessels.
  void write_session(const Json& simulation, const Json& style = Json::object()) const {
    Json session{
        {"xraycast_session", 1},
        {"files", {{"map", "map.exr"}, {"vessels", "vessels"}}},
        {"simulation", {{"nodes_mm", {{0, 0, -90}, {0, 1, -60}, {0, 0, -30}, {0, 0, 0}}}, {"radius_mm", 1}}},
        {"camera", {{"angle_deg", 30}, {"tilt_deg", 10}, {"table_mm", 5}, {"zoom", 1.5}}},
        {"style",
         {{"look", "fluoro"}, {"compositing", "path"}, {"continuous", true}, {"strengths", Json::array()}}}};
    session["simulation"].update(simulation);
    session["style"].update(style);
    write_bytes(folder_ / "session.json", session.dump());
  }

  TemporaryFolder folder_;
};

TEST_F(Export, WritesAPageThatLoadsNothingElse) {
  write_map(small_map());
  const std::string page = written("@/map.exr -o @/page.html --title <b>&", "page.html");
  EXPECT_THAT(page, StartsWith("<!doctype html>"));
  EXPECT_THAT(page, HasSubstr("default-src 'none'"));
  EXPECT_THAT(page, HasSubstr("Not for clinical use"));
  EXPECT_THAT(page, HasSubstr("<title>&lt;b&gt;&amp;</title>"));
  for (const char* loads : {"http:", "https:", "<link rel=\"stylesheet", " src=\"/", "@xraycast-"})
    EXPECT_THAT(page, Not(HasSubstr(loads)));
  const Json header = header_of(page);
  EXPECT_EQ(header["map"]["layers"], 2);
  EXPECT_EQ(header["map"]["precision"], "byte");
  EXPECT_TRUE(header["vessels"].is_null() && header["run"].is_null());
  EXPECT_EQ(header["parts"]["layers"][1], 2 * 16 * 40);
}

TEST_F(Export, StoresTwoBytesATexelWhereAskedFor) {
  write_map(small_map());
  const Json header = header_of(written("@/map.exr -o @/page.html --precision half", "page.html"));
  EXPECT_EQ(header["map"]["precision"], "half");
  EXPECT_EQ(header["parts"]["layers"][1], 2 * 2 * 16 * 40);
}

TEST_F(Export, SimulatesTheRunAgain) {
  write_map(small_map());
  write_vessels();
  const std::string line =
      "@/map.exr --vessels @/vessels --script @/push.csv --device-model microcatheter-27f -o @/run.html";
  const std::string page = written(line, "run.html");
  const Json run = header_of(page)["run"];
  EXPECT_EQ(run["pictures"], 4);  // at 15 a second: 0, 67, 133 and 200 ms
  ASSERT_EQ(run["instruments"].size(), 1u);
  EXPECT_EQ(run["instruments"][0]["name"], "microcatheter-27f");
  EXPECT_EQ(run["instruments"][0]["force_N"].size(), 4u);
  EXPECT_EQ(run["instruments"][0]["torque_mNm"].size(), 4u);
  EXPECT_EQ(written(line, "run.html"), page);
}

TEST_F(Export, SteersByItself) {
  write_map(small_map());
  write_vessels();
  const std::string page = written(
      "@/map.exr --vessels @/vessels --live --device-model microcatheter-27f --device-model "
      "guidewire-014-straight "
      "--devices microcatheter-24f,guidewire-014-straight --script @/pair.csv -o @/live.html",
      "live.html");
  EXPECT_THAT(page, HasSubstr("script-src 'unsafe-inline' 'wasm-unsafe-eval';"));
  EXPECT_THAT(page, HasSubstr("form-action 'none'; worker-src blob:\""));
  EXPECT_THAT(page, HasSubstr("id=\"simulation\">eNr"));  // deflated most
  const Json header = header_of(page), &choices = header["trainer"]["choices"];
  ASSERT_EQ(choices.size(), 3u);  // each once
  EXPECT_EQ(choices[2]["name"], "microcatheter-24f");
  EXPECT_EQ(header["trainer"]["used"], Json({0, 1}));
  EXPECT_EQ(header["live"]["instruments"].size(), 2u);
  EXPECT_EQ(header["run"]["pictures"], 4);  // for a browser without WebAssembly
  EXPECT_EQ(header["parts"]["trainer"][1].get<int>() % 8, 0);
  const std::string other = written("@/map.exr -o @/page.html", "page.html");
  EXPECT_THAT(other, Not(HasSubstr("'wasm-unsafe-eval';")));
  EXPECT_THAT(other, HasSubstr("id=\"simulation\"></script>"));
}

TEST_F(Export, SteersUnderTheCArmThatIsAskedFor) {
  write_map(small_map());
  write_vessels();
  const std::string line = "@/map.exr --vessels @/vessels --live --device-model microcatheter-27f ";
  const Json usual = header_of(written(line + "-o @/usual.html", "usual.html")),
             mobile = header_of(written(line + "--c-arm mobile-flat-panel --dose low --pulse-rate 7.5 "
                                               "--compression 0.4 -o @/mobile.html",
                                        "mobile.html"));
  EXPECT_EQ(usual["trainer"]["dose"], 1);
  EXPECT_EQ(usual["trainer"]["compression"], 0.6);  // the C-arm's own
  EXPECT_EQ(usual["trainer"]["pulses_per_s"], 15);
  EXPECT_TRUE(usual["cone"].is_null());
  EXPECT_EQ(mobile["trainer"]["dose"], 0);
  EXPECT_EQ(mobile["trainer"]["compression"], 0.4);
  EXPECT_EQ(mobile["trainer"]["pulses_per_s"], 7.5);
  EXPECT_GT(mobile["cone"]["source_detector_mm"], mobile["cone"]["source_axis_mm"]);  // the C-arm's
  EXPECT_GT(mobile["pose"]["zoom"], usual["pose"]["zoom"]);
}

TEST_F(Export, TellsNoFoldersOfInstruments) {
  write_map(small_map());
  write_vessels();
  std::filesystem::create_directory(folder_ / "private");
  write_bytes(folder_ / "private/mine.json",
              R"({"radius_mm": 0.18, "inner_radius_mm": 0, "density_g_cm3": 5.5, "axial_stiffness_N": 300,
                  "static_friction": 0.04, "kinetic_friction": 0.03,
                  "sections": [{"length_mm": 800, "bending_stiffness_Nmm2": 4, "torsional_stiffness_Nmm2": 3}]})");
  write_bytes(
      folder_ / "private/task.json",
      R"({"title": "Up", "task": "Go.", "instruments": ["mine.json"], "targets": [{"at_mm": [0, 0, 0]}]})");
  const std::string page = written(
      "@/map.exr --vessels @/vessels --live --device-model @/private/mine.json --script @/push.csv "
      "--exercise @/private/task.json -o @/live.html",
      "live.html");
  EXPECT_THAT(page, Not(HasSubstr("private")));
  const Json header = header_of(page);
  EXPECT_EQ(header["trainer"]["choices"][0]["name"], "mine");
  EXPECT_EQ(header["trainer"]["exercises"][0]["choices"][0]["name"], "mine");
  EXPECT_EQ(header["run"]["instruments"][0]["name"], "mine");
}

TEST_F(Export, SimulatesAWireInACatheter) {
  write_map(small_map());
  write_vessels();
  const std::string pair =
      "@/map.exr --vessels @/vessels --script @/pair.csv --device-model microcatheter-27f "
      "--device-model guidewire-014-straight -o @/";
  const Json header = header_of(written(pair + "pair.html", "pair.html")),
             &instruments = header["run"]["instruments"];
  ASSERT_EQ(instruments.size(), 2u);
  EXPECT_EQ(instruments[0]["parts"].size(), 2u);
  EXPECT_EQ(instruments[1]["parts"].size(), 2u);
  for (const char* shapes : {"shapes_0_0", "shapes_1_1"})
    EXPECT_GT(header["parts"][shapes][1].get<int>(), 4 * 20)
        << shapes;  // at 4 pictures, points of some bytes
  EXPECT_THAT(written(pair + "pair.glb", "pair.glb"),
              HasSubstr(instruments[1]["name"].get<std::string>() + ", marker 1"));
}

TEST_F(Export, KeepsEveryInstrumentOfASession) {
  write_map(small_map());
  write_vessels();
  const Json nodes{{0, 0, -90}, {0, 1, -60}, {0, 0, -30}, {0, 0, 0}};
  write_session({{"devices",
                  {{{"nodes_mm", nodes}, {"radius_mm", 1}, {"has_lumen", true}},
                   {{"nodes_mm", nodes}, {"radius_mm", 0.4}, {"has_lumen", false}}}},
                 {"road_map", false}});
  const Json header = header_of(written("--session @/session.json -o @/page.html", "page.html"));
  ASSERT_EQ(header["catheters"].size(), 3u);  // the wire has the usual coil
  EXPECT_GT(header["catheters"][2]["mu_per_mm"], header["catheters"][1]["mu_per_mm"]);
}

TEST_F(Export, BeginsTheRunAtTheScriptsFirstPose) {
  write_map(small_map());
  write_vessels();
  write_bytes(folder_ / "deeper.csv", "time_s,insertion_mm,rotation_deg\n0,60,0\n0.1,62,0\n");
  write_bytes(folder_ / "held.csv", "time_s,insertion_mm,rotation_deg\n0,60,0\n");
  const std::string model = " --vessels @/vessels --device-model microcatheter-27f -o @/run.html --script ";
  const Json run = header_of(written("@/map.exr" + model + "@/deeper.csv", "run.html"))["run"];
  EXPECT_EQ(run["pictures"], 2);
  EXPECT_NE(run["instruments"][0]["force_N"][0], 0);  // it has been pushed in
  EXPECT_EQ(header_of(written("@/map.exr" + model + "@/held.csv", "run.html"))["run"]["pictures"], 1);
}

TEST_F(Export, ShowsASessionAsItWasSaved) {
  write_map(small_map());
  write_vessels();
  write_bytes(folder_ / "s.json",
              R"({"xraycast_session": 1, "files": {"map": "map.exr", "vessels": "vessels"},
    "simulation": {"nodes_mm": [[0, 0, -90], [0, 0, -80], [0, 0, -70], [1, 0, -60]], "radius_mm": 0.8, "road_map": true},
    "camera": {"angle_deg": 30, "tilt_deg": -10, "table_mm": 20, "zoom": 1.5, "cone_mm": [780, 1200]},
    "style": {"look": "surface", "compositing": "path", "continuous": true, "strengths": [1, 0]},
    "window": {"scale": 2, "dark": 0.1, "light": 0.9, "gamma": 1.2, "inverted": true}})");
  const Json header = header_of(written("--session @/s.json -o @/page.html", "page.html"));
  EXPECT_NEAR(header["pose"]["lao_deg"].get<double>(), 30, 1e-9);
  EXPECT_NEAR(header["pose"]["cranial_deg"].get<double>(), -10, 1e-9);
  EXPECT_EQ(header["pose"]["table_mm"], 20);
  EXPECT_EQ(header["cone"]["source_detector_mm"], 1200);
  EXPECT_EQ(header["look"], "surface");
  EXPECT_EQ(header["window"]["scale"], 2);
  EXPECT_EQ(header["greys"], Json({{"gamma", 1.2}, {"inverted", true}}));
  EXPECT_EQ(header["layer_weights"], Json({1, 0}));
  EXPECT_TRUE(header["run"].is_null());  // the catheter as it stood is no run
}

TEST_F(Export, NamesNoFileOfThisMachine) {
  BodyMap map = small_map();
  map.source = "NRRD /home/somebody/patient.nrrd";
  write_body_map(map, folder_ / "Doe_John_1950.exr");
  for (const char* name : {"page.html", "scene.glb"}) {
    const std::string file = written("@/Doe_John_1950.exr -o @/" + std::string(name), name);
    EXPECT_THAT(file, Not(HasSubstr("somebody")));
    EXPECT_THAT(file, Not(HasSubstr("Doe")));
  }
}

TEST_F(Export, KeepsASessionsCatheterAndItsOutline) {
  write_map(small_map());
  write_vessels();
  write_session({{"road_map", false}});
  const Json header = header_of(written("--session @/session.json -o @/page.html", "page.html"));
  EXPECT_TRUE(header["run"].is_null());
  ASSERT_EQ(header["catheters"].size(), 1u);
  EXPECT_GT(header["catheters"][0]["triangles"], 100);
  EXPECT_EQ(header["shows_vessels"], false);
  EXPECT_EQ(header["shows_road_map"], false);
  EXPECT_EQ(header["full_contrast"], false);
  EXPECT_EQ(header["is_of_session"], true);
  write_session({{"road_map", true}});
  EXPECT_EQ(header_of(written("--session @/session.json -o @/page.html", "page.html"))["shows_road_map"],
            true);
}

TEST_F(Export, SaysWhichShellsOfASessionItCannotKeep) {
  write_map(small_map());
  write_vessels();
  write_session({{"road_map", false}});
  EXPECT_THAT(run("--session @/session.json -o @/page.html").err, Not(HasSubstr("not exported")));
  write_session({{"road_map", false}}, {{"continuous", false}});
  EXPECT_THAT(run("--session @/session.json -o @/page.html").err,
              HasSubstr("constant shells are not exported"));
}

TEST_F(Export, WritesGltfWithoutTheMap) {
  write_map(small_map());
  write_vessels();
  const std::string file = written(
      "@/map.exr --vessels @/vessels --script @/push.csv --device-model microcatheter-27f "
      "-o @/run.glb",
      "run.glb");
  ASSERT_THAT(file, StartsWith("glTF"));
  std::uint32_t length = 0, text = 0;
  std::memcpy(&length, &file[8], 4);
  std::memcpy(&text, &file[12], 4);
  EXPECT_EQ(length, file.size());
  const Json scene = Json::parse(file.substr(20, text));
  std::vector<std::string> names;
  for (const Json& node : scene["nodes"]) names.push_back(node["name"]);
  EXPECT_THAT(names, testing::ElementsAre("vessels", "microcatheter-27f", "microcatheter-27f, marker 1",
                                          "axis", "C-arm"));
  // The vessel's end at z = 93 mm is above the origin, in metres.
  EXPECT_NEAR(scene["accessors"][0]["max"][1].get<double>(), 0.093, 1e-4);
}

struct BadExport {
  const char* name;
  const char* line;
  const char* message;
  std::function<void(BodyMap&)> change = [](BodyMap&) {};
};
void PrintTo(const BadExport& bad, std::ostream* out) { *out << bad.name; }

class BadExports : public Export, public testing::WithParamInterface<BadExport> {};

TEST_P(BadExports, AreToldInOneLine) {
  BodyMap map = small_map();
  GetParam().change(map);
  map.tau.assign(map.layer_size() * static_cast<std::size_t>(map.geometry.layers()), 0.5f);
  write_map(map);
  write_vessels();
  const std::string before = read_bytes(folder_ / "map.exr");
  const Finished done = run(GetParam().line);
  EXPECT_EQ(done.status, 3);
  EXPECT_THAT(done.err, StartsWith("xraycast: "));
  EXPECT_THAT(done.err, HasSubstr(GetParam().message));
  EXPECT_EQ(std::ranges::count(done.err, '\n'), 1) << done.err;
  EXPECT_FALSE(std::filesystem::exists(folder_ / "page.html"));
  EXPECT_EQ(read_bytes(folder_ / "map.exr"), before);
}

const BadExport kBadExports[] = {
    {"NoMap", "-o @/page.html", "give a MAP.exr or --session"},
    {"UnknownFormat", "@/map.exr -o @/page.pdf", "page.pdf: must end in .html, for a page, or in .glb"},
    {"OverTheMap", "@/map.exr -o @/map.exr", "is also given as MAP and would overwrite it"},
    {"OverTheScript", "@/map.exr --vessels @/vessels --script @/push.csv -o @/push.csv",
     "is also given as --script"},
    {"RunWithoutVessels", "@/map.exr --script @/push.csv -o @/page.html",
     "there are no vessels to steer in; give --vessels too"},
    {"RunInVesselsOfAnotherScan", "@/map.exr --vessels @/elsewhere --script @/push.csv -o @/page.html",
     "lies outside the body map; give the vessels of the scan that was cast"},
    {"RunDeeperThanTheInstrument",
     "@/map.exr --vessels @/vessels --script @/deep.csv --device-model microcatheter-27f -o @/page.html",
     "deep.csv"},
    {"RunTooLong", "@/map.exr --vessels @/vessels --script @/long.csv -o @/page.html",
     "long.csv: lasts 601 s, but an export holds a run of at most 600 s; shorten it"},
    {"MissingVessels", "@/map.exr --vessels @/gone -o @/page.html", "gone: no such file or folder"},
    {"TooManyLayers", "@/map.exr -o @/page.html",
     "129 layers of 16 x 40 texels, but a page holds at most 128 of them; "
     "cast it with --layers 128",
     [](BodyMap& map) { map = small_map(129); }},
    {"TooManyAngles", "@/map.exr -o @/page.html",
     "2048 angles, but a page holds at most 2047; cast it with --angles 2047",
     [](BodyMap& map) { map = small_map(2, 2048); }},
    {"TooManyTexels", "@/map.exr -o @/page.html",
     "of 2047 x 4000 texels, but a page holds at most 2 of them; cast it with --layers 2",
     [](BodyMap& map) {
       map = small_map(3, 2047);
       map.geometry.height = 4000;
     }},
    {"TooManyRows", "@/map.exr -o @/page.html", "8193 rows, one a slice, but a page holds at most 8192",
     [](BodyMap& map) {
       map = small_map(1, 4);
       map.geometry.height = 8193;
     }},
    {"CurvedAxis", "@/map.exr -o @/page.html",
     "a page shows maps about a straight axis alone; cast it without --centre-line",
     [](BodyMap& map) {
       map.geometry.centre_mm.assign(40, {1, 2});
     }},
    {"Spheres", "@/map.exr -o @/page.html",
     "a page shows cylinder maps alone; cast it with --projection cylinder",
     [](BodyMap& map) { map.geometry.ray_layout = RayLayout::sphere; }},
    {"TooManyControlPoints", "@/map.exr --catheter @/long_catheter.csv -o @/page.html",
     "long_catheter.csv: more than 5000 lines, but an export holds a catheter of at most 5000 control "
     "points; give fewer"},
    {"LiveWithoutVessels", "@/map.exr --live -o @/page.html",
     "--live: there are no vessels to steer in; give --vessels too"},
    {"LiveScene", "@/map.exr --vessels @/vessels --live -o @/page.glb", "--live does not apply to"},
    {"DevicesWithoutLive", "@/map.exr --vessels @/vessels --devices pigtail-5f -o @/page.html",
     "--devices does not apply without --live; leave it out or give --live too"},
    {"DoseWithoutLive", "@/map.exr --dose low -o @/page.html",
     "--dose does not apply without --live; leave it out or give --live too"},
    {"CompressionOfAScene", "@/map.exr --compression 0.5 -o @/page.glb", "--compression does not apply to"},
    {"TooMuchCompression", "@/map.exr --vessels @/vessels --live --compression 2 -o @/page.html",
     "compression"},
    {"UnknownDevices",
     "@/map.exr --vessels @/vessels --live --device-model microcatheter-27f --devices cobra-9f -o "
     "@/page.html",
     "--devices"},
    {"LiveGate", "@/map.exr --vessels @/vessels --live --gate heart=0.5 -o @/page.html",
     "stands still; cast one that moves with --motion alone, or leave out what moves it"},
    {"PrecisionOfAScene", "@/map.exr --precision half -o @/page.glb", "--precision does not apply to"},
    {"ScriptWithoutTheSecondsColumns",
     "@/map.exr --vessels @/vessels --script @/push.csv --device-model microcatheter-27f "
     "--device-model guidewire-014-straight -o @/page.html",
     "push.csv: line 1: "},
    {"InstrumentsInTheWrongOrder",
     "@/map.exr --vessels @/vessels --script @/pair.csv --device-model guidewire-014-straight "
     "--device-model microcatheter-27f -o @/page.html",
     "guidewire"},
    {"InstrumentWithoutRun", "@/map.exr --device-model cobra-5f -o @/page.html",
     "--device-model does not apply without a run; leave it out or give --script or --live too"},
    {"EntryWithoutRun", "@/map.exr --entry nonsense -o @/page.html",
     "--entry does not apply without a run; leave it out or give --script or --live too"},
};

INSTANTIATE_TEST_SUITE_P(Export, BadExports, testing::ValuesIn(kBadExports),
                         [](const auto& bad) { return bad.param.name; });

}  // namespace
}  // namespace xraycast::export_test
