// What the subcommands answer where all goes well.
#include "cli/cli_fixture.hpp"

namespace xraycast::cli_test {
namespace {

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

TEST_F(Cli, AMapMovesFromCastToCine) {
  output_of("phantom thorax --size 64x64x64 -o @/ct.nrrd --motion @/motion --motion-spacing 10");
  const Json said = json_of(
      "cast @/ct.nrrd -o @/moving.exr --layers 6 --motion @/motion/motion.json --keys breath=3 --keys "
      "heart=4 "
      "--keep-basis @/b.basis");
  EXPECT_EQ(said["keys"]["maps"], 12);
  EXPECT_EQ(said["map"]["precision"], "byte");
  EXPECT_LT(said["keys"]["bytes"], 12 * 6 * 360 * 64);  // the heart's keys are of fewer rows
  const Json described = json_of("info @/moving.exr");
  EXPECT_EQ(described["keys"]["modes"], said["keys"]["modes"]);
  EXPECT_EQ(described["keys"]["motion"], (folder_ / "motion/motion.json").string());
  EXPECT_EQ(json_of("recast @/b.basis -o @/recast.exr --opacity bilinear")["keys"], said["keys"]);

  // As close to the scan at an instant as a map that was cast from it, which a still map is not.
  const std::string instant = " --motion @/motion/motion.json --phase breath=0.8 --phase heart=0.3";
  output_of("cast @/ct.nrrd -o @/then.exr --layers 6" + instant);
  const auto psnr_db = [&](const std::string& maps) {
    return json_of("compare @/ct.nrrd " + maps + " --views 2" + instant);
  };
  const Json both = psnr_db("@/moving.exr @/then.exr")["maps"];
  EXPECT_NEAR(both[0]["mean"]["psnr_db"], both[1]["mean"]["psnr_db"], 1);
  EXPECT_EQ(json_of("compare @/ct.nrrd @/moving.exr --views 2 --phase breath=0.8 --phase heart=0.3")["mean"],
            both[0]["mean"]);
  output_of("cast @/ct.nrrd -o @/still.exr --layers 6");
  EXPECT_THAT(run("compare @/ct.nrrd @/then.exr").err,
              HasSubstr("then.exr shows the body at breath 0.8, heart 0.3, but"));
  EXPECT_THAT(run("compare @/ct.nrrd @/still.exr" + instant).err,
              HasSubstr("still.exr shows the body at rest"));

  EXPECT_THAT(run("render @/moving.exr -o @/f.exr --size 60x60").err, HasSubstr("this is phase 0"));
  const Json frame = json_of("render @/moving.exr -o @/g.exr --size 60x60 --time 2");
  EXPECT_EQ(keys_of(frame["phases"]), (std::vector<std::string>{"breath", "heart"}));
  EXPECT_NE(read_bytes(folder_ / "f.exr"), read_bytes(folder_ / "g.exr"));
  EXPECT_EQ(json_of("render @/moving.exr -o @/breath.gif --size 60x60 --seconds 0.5")["frames"], 10);
  EXPECT_THAT(run("render @/still.exr -o @/h.png --phase breath=1").err, HasSubstr("the map stands still"));
}

TEST_F(Cli, CastFollowsTheBody) {
  output_of("phantom thorax --size 80x80x40 --spacing 5 -o @/ct.nrrd");
  const Json said = json_of("cast @/ct.nrrd -o @/map.exr --layers 4 --keep-basis @/b.basis");
  EXPECT_EQ(said["map"]["outline"], "body");
  EXPECT_GT(said["outside_share"], 0);
  EXPECT_LT(said["outside_share"], 0.5);
  const MapGeometry map = read_body_map(folder_ / "map.exr").geometry;
  EXPECT_EQ(map.outline_mm.size() % 360, 0u);
  EXPECT_NEAR(said["map"]["radii_mm"][4], std::ranges::max(map.outline_mm), 1e-3);
  // A recast keeps the outline, and frames are compared with what lies within.
  EXPECT_EQ(json_of("recast @/b.basis -o @/recast.exr --opacity bilinear")["map"]["outline"], "body");
  const Json body = json_of("compare @/ct.nrrd @/map.exr --views 2")["mean"];
  output_of("cast @/ct.nrrd -o @/circle.exr --layers 4 --outline circle");
  const Json circle = json_of("compare @/ct.nrrd @/circle.exr --views 2")["mean"];
  EXPECT_GT(body["psnr_db"], circle["psnr_db"]);
  EXPECT_THAT(keys_of(body), ElementsAre("psnr_db", "ssim", "rmse", "whole_psnr_db"));
  // Another scan may have the same grid.
  fs::copy(folder_ / "ct.nrrd", folder_ / "other.nrrd");
  const Finished other = run("compare @/other.nrrd @/map.exr --views 1");
  EXPECT_EQ(other.status, 0);
  expect_one_line(other.err, "was cast from NRRD ");
  EXPECT_THAT(other.err, HasSubstr("other.nrrd is the same scan"));
  fs::create_directory(folder_ / "b");
  fs::copy(folder_ / "ct.nrrd", folder_ / "b" / "ct.nrrd");
  EXPECT_THAT(run("compare @/b/ct.nrrd @/map.exr --views 1").err, HasSubstr("b/ct.nrrd is the same scan"));
  EXPECT_EQ(run("compare @/ct.nrrd @/map.exr --views 1").err, "");

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

TEST_F(Cli, RenderAnnotatesAndWeighsLayers) {
  output_of("-q phantom head --size 48x48x40 -o @/ct.nrrd");
  output_of("-q cast @/ct.nrrd -o @/map.exr --layers 4 --angles 90");
  output_of("-q render @/map.exr -o @/without.png");
  for (const char* option : {"--annotations", "--layer-weights 1,0,1,0.5"}) {
    output_of("-q render @/map.exr -o @/with.png " + std::string(option));
    EXPECT_NE(read_bytes(folder_ / "with.png"), read_bytes(folder_ / "without.png")) << option;
  }
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

  output_of("-q compare @/ct.nrrd @/few.exr --angles 100:100.0003:0.0001 --pictures @/close");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "close"), {}), 3);

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

TEST_F(Cli, RenderMovesVesselsButNoRoadMap) {
  output_of(
      "phantom thorax --spacing 8 --noise 0 -o @/ct.nrrd --truth @/truth --motion @/motion --motion-spacing "
      "12 --quiet");
  output_of("cast @/ct.nrrd -o @/rest.exr --layers 2 --quiet");
  output_of("cast @/ct.nrrd -o @/in.exr --layers 2 --motion @/motion/motion.json --phase breath=1 --quiet");
  const std::string moves = " --motion @/motion/motion.json --phase breath=1",
                    look = " --vessels @/truth --look surface";
  EXPECT_EQ(json_of("render @/in.exr -o @/moved.png" + look + moves)["motion"]["breath"], 1);
  expect_one_line(run("render @/in.exr -o @/stayed.png" + look).err, "vessels are drawn as they are");
  EXPECT_NE(read_bytes(folder_ / "moved.png"), read_bytes(folder_ / "stayed.png"));
  expect_one_line(run("render @/rest.exr -o @/p.png" + look + moves).err, "give both of one instant");

  // The vessels in a map that moves follow it, by the motion that it names.
  output_of(
      "cast @/ct.nrrd -o @/moving.exr --layers 2 --motion @/motion/motion.json --keys breath=2 --keys "
      "heart=2 --quiet");
  output_of("render @/moving.exr -o @/inhaled.png --phase breath=1 --quiet" + look);
  output_of("render @/moving.exr -o @/exhaled.png --phase breath=0 --quiet" + look);
  EXPECT_NE(read_bytes(folder_ / "inhaled.png"), read_bytes(folder_ / "exhaled.png"));
  write_bytes(folder_ / "other.json", R"({"version": 1, "modes": [{"name": "turn", "period_s": 4,
    "phases": [{"phase": 0}, {"phase": 1}]}]})");
  expect_one_line(run("render @/moving.exr -o @/p.png --phase breath=1 --motion @/other.json" + look).err,
                  "other.json: has other modes than the map");

  // So do body and contrast agent in a run's cine.
  write_bytes(folder_ / "push.csv", "time_s,insertion_mm,rotation_deg\n0,5,0\n0.3,20,0\n");
  const auto cine = [&](const std::string& phase) {
    output_of(
        "simulate @/truth --device-model cobra-5f --script @/push.csv -o @/log.csv --map @/moving.exr "
        "--quiet "
        "--inject 0,0.3 --motion @/motion/motion.json --phase breath=" +
        phase + " --phase heart=0 --cine @/run" + phase);
    return read_bytes(folder_ / ("run" + phase) / "frame-002.png");
  };
  EXPECT_NE(cine("0"), cine("1"));

  write_bytes(folder_ / "s.json", R"({"xraycast_session": 1, "files": {"map": "in.exr", "vessels": "truth"},
    "simulation": {"nodes_mm": [[0, 0, -90], [0, 0, -80], [0, 0, -70], [1, 0, -60]], "radius_mm": 0.8, "road_map": true},
    "camera": {"angle_deg": 0, "tilt_deg": 0, "table_mm": 0, "zoom": 1},
    "style": {"look": "fluoro", "compositing": "path", "continuous": true, "strengths": []}})");
  const auto session = [&](const std::string& options) {
    output_of("render --session @/s.json -o @/s.png --quiet" + options);
    return read_bytes(folder_ / "s.png");
  };
  const std::string taken_at_rest = session("");
  EXPECT_EQ(session(moves), taken_at_rest);
  EXPECT_NE(session(moves + " --road-map-phase breath=1"), taken_at_rest);
}

}  // namespace
}  // namespace xraycast::cli_test
