// Segmentation, and what is done with its vessels.
#include "cli/cli_fixture.hpp"

namespace xraycast::cli_test {
namespace {

class SegmentCommand : public Cli {};

TEST_F(SegmentCommand, SegmentsAPhantomsVessels) {
  output_of("phantom thorax -o @/thorax.nrrd --spacing 2 --truth @/truth -q");
  const Json json = json_of("segment @/thorax.nrrd -o @/vessels -q");
  EXPECT_THAT(keys_of(json), ElementsAre("input", "folder", "seg", "no_seg", "voxels", "lumen_mm3",
                                         "evidence", "window_hu", "noise_hu", "weak_share", "branches",
                                         "loops", "gaps_mm", "parts_left_out", "triangles", "timings_ms"));
  for (const char* name : {"mask.nrrd", "lumen.nrrd", "tree.vtp", "tree.json", "names.json", "surface.vtp",
                           "surface.stl", "report.png"})
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

TEST_F(SegmentCommand, SegmentExplainsItsSteps) {
  output_of("phantom thorax -o @/thorax.nrrd --spacing 3 -q");
  output_of("segment @/thorax.nrrd -o @/vessels --explain @/steps -q");
  for (const char* name :
       {"1-window.nrrd", "2-body.nrrd", "3-bone.nrrd", "4-chambers.nrrd", "5-trabecular-bone.nrrd",
        "6-gaps.nrrd", "7-selection.nrrd", "8-filling.nrrd", "steps.png"})
    EXPECT_TRUE(fs::exists(folder_ / "steps" / name)) << name;
  EXPECT_EQ(read_bytes(folder_ / "steps" / "8-filling.nrrd"), read_bytes(folder_ / "vessels" / "mask.nrrd"));
}

TEST_F(SegmentCommand, SegmentExplainsItsStepsInNoise) {
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

TEST_F(SegmentCommand, SegmentBeginsInTheAortaWhereNoContrastShows) {
  output_of("phantom abdomen -o @/abdomen.nrrd --spacing 2.5 -q");
  const Finished finished = run("segment @/abdomen.nrrd -o @/vessels");
  EXPECT_EQ(finished.status, 0);
  EXPECT_THAT(finished.err, HasSubstr("by its place and shape the aorta"));
  EXPECT_THAT(finished.err, HasSubstr("give --seed in the vessels that are meant"));
}

TEST_F(SegmentCommand, SegmentTellsWhichOptionGivesASeedBack) {
  output_of("phantom abdomen -o @/abdomen.nrrd --spacing 2.5 -q");
  const auto message = [&](const std::string& options) {
    const Finished finished = run("segment @/abdomen.nrrd -o @/vessels -q " + options);
    EXPECT_EQ(finished.status, 3);
    return finished.err;
  };
  expect_one_line(message("--seed 6,-10,-95 --window 250,400"), "leave --window out");
  expect_one_line(message("--seed -110,-20,-20"), "raise --max-radius");
  expect_one_line(message("--seed 0,-180,-40"), "lies in air (-");
}

TEST_F(SegmentCommand, SegmentedVesselsServeTheRest) {
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

TEST_F(SegmentCommand, CastsWithoutVesselsBySlabsToo) {
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

TEST_F(SegmentCommand, SegmentCountsOneBranch) {
  NiftiFile scan = water(40), mask = scan;
  for (int z = 4; z < 36; ++z)
    for (const int y : {3, 4})
      for (const int x : {3, 4}) mask.voxels[static_cast<std::size_t>(2 * (x + 8 * (y + 8 * z)))] = 1;
  write_bytes(folder_ / "ct.nii", scan.bytes());
  write_bytes(folder_ / "mask.nii", mask.bytes());
  EXPECT_THAT(output_of("segment @/ct.nii -o @/vessels --from-mask @/mask.nii"),
              HasSubstr(": 1 branch, 0 loops, "));
}

TEST_F(SegmentCommand, SegmentsFromAMask) {
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

TEST_F(SegmentCommand, VesselnessIsAFieldOnTheScansGrid) {
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

TEST_F(SegmentCommand, VesselsOfOtherProgramsMakeTheSameFolder) {
  output_of("phantom thorax -o @/thorax.nrrd --spacing 4 --truth @/truth -q");
  const Json json = json_of("vessels @/truth/surface.vtp -o @/vessels --like @/thorax.nrrd -q");
  EXPECT_THAT(keys_of(json),
              ElementsAre("input", "folder", "branches", "loops", "triangles", "notes", "timings_ms"));
  EXPECT_EQ(json["branches"], 24);
  for (const char* name : {"mask.nrrd", "lumen.nrrd", "tree.vtp", "tree.json", "names.json", "surface.vtp",
                           "surface.stl", "report.png"})
    EXPECT_TRUE(fs::exists(folder_ / "vessels" / name)) << name;
  // Without a scan there is no mask, and that of another one is removed.
  json_of("vessels @/vessels/tree.vtp -o @/vessels -q");
  EXPECT_FALSE(fs::exists(folder_ / "vessels" / "mask.nrrd"));
  EXPECT_THAT(run("vessels @/truth/surface.vtp -o @/none --unit inch").err,
              HasSubstr("--unit inch: must be mm, cm, m or um"));
  EXPECT_FALSE(fs::exists(folder_ / "none"));
}

TEST_F(SegmentCommand, NamesThatAreEditedStayWhenTheFolderIsWrittenAgain) {
  write_bytes(folder_ / "lines.csv",
              "branch,x,y,z,radius\ntrunk,0,0,90,9\ntrunk,0,0,40,9\ntrunk,0,0,-60,9\n"
              "side,0,0,40,3\nside,50,0,40,3\n");
  output_of("vessels @/lines.csv -o @/vessels -q");
  write_bytes(folder_ / "vessels" / "names.json", R"({"names": [{"at_mm": [40, 0, 40], "name": "mine"}]})");
  for (int run = 0; run < 2; ++run) {
    const Json json = json_of("vessels @/lines.csv -o @/vessels -q");
    EXPECT_THAT(json["notes"].dump(), HasSubstr("kept as edited"));
    EXPECT_THAT(read_bytes(folder_ / "vessels" / "names.json"), HasSubstr("\"name\": \"mine\""));
  }
  // Elsewhere there is no such vessel, and the file stays.
  write_bytes(folder_ / "lines.csv", "x,y,z,radius\n0,300,0,9\n0,300,100,9\n");
  const std::string earlier = read_bytes(folder_ / "vessels" / "names.json");
  EXPECT_THAT(json_of("vessels @/lines.csv -o @/vessels -q")["notes"].dump(),
              HasSubstr("names-earlier.json"));
  EXPECT_EQ(read_bytes(folder_ / "vessels" / "names-earlier.json"), earlier);
  // What is no file cannot be kept, which is said before the work.
  fs::remove(folder_ / "vessels" / "names.json");
  fs::create_directory(folder_ / "vessels" / "names.json");
  const Finished refused = run("vessels @/lines.csv -o @/vessels -q");
  EXPECT_EQ(refused.status, 3);
  expect_one_line(refused.err, "names.json: ");
}

}  // namespace
}  // namespace xraycast::cli_test
