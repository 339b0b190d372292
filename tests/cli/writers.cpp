#include "cli/writers.hpp"

#include "support/leftover.hpp"
#include "support/scan_files.hpp"
#include "xraycast/casting/basis_file.hpp"
#include "xraycast/casting/body_map.hpp"
#include "xraycast/scan/scan.hpp"
#include "xraycast/series/ct_series.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <sstream>
#include <thread>

namespace xraycast {
namespace {

namespace fs = std::filesystem;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using Clock = std::chrono::steady_clock;

constexpr char kTree[] =
    R"({"branches": [{"id": 0, "parent": -1, "points": [[0, 0, 0, 2], [0, 0, 100, 2]]}]})";

constexpr Writer kWriters[] = {
    {"Phantom", "phantom sphere --size 24x24x24 --noise 20 -o @/out/ct.mhd"},
    {"PhantomPacked", "phantom sphere --size 24x24x24 --noise 20 -o @/out/ct.nii.gz"},
    {"PhantomWithTruth", "phantom thorax --spacing 12 -o @/out/ct.nrrd --truth @/out/truth"},
    {"Convert", "convert @/ct.nrrd -o @/out/ct.mha"},
    {"ConvertToDicom", "convert @/ct.nrrd -o @/out/series", Appearing::as_a_new_folder},
    {"Vesselness", "vesselness @/ct.nrrd --scales 2 -o @/out/v.nrrd"},
    {"Cast",
     "cast @/ct.nrrd --layers 2 --angles 60 -o @/out/map.exr --preview @/out/map.png --keep-basis @/out/b"},
    {"Recast", "recast @/ct.basis --opacity paper -o @/out/map.exr --preview @/out/map.png"},
    {"RecastTiff", "recast @/ct.basis --opacity paper -o @/out/map.exr --preview @/out/map.tif"},
    {"ProjectExr", "project @/ct.nrrd --size 48x48 -o @/out/p.exr"},
    {"ProjectTiff", "project @/ct.nrrd --size 48x48 -o @/out/p.tif"},
    {"ProjectNrrd", "project @/ct.nrrd --size 48x48 -o @/out/p.nrrd"},
    {"ProjectPng", "project @/ct.nrrd --size 48x48 -o @/out/p.png"},
    {"ProjectDicom", "project @/ct.nrrd --size 48x48 --cone 900,1200 -o @/out/p.dcm"},
    {"Segment", "segment @/ct.nrrd -o @/out --from-mask @/mask.nrrd --surface tubes"},
    {"SegmentSeries", "segment @/series -o @/out --from-mask @/mask.nrrd --surface tubes"},
    {"Vessels", "vessels @/mask.nrrd -o @/out --triangles 400"},
    {"PhantomMotion", "phantom head --spacing 16 -o @/out/ct.nrrd --motion @/out/motion"},
    {"CastMoving",
     "cast @/ct.nrrd --layers 2 --angles 60 --motion @/motion.json -o @/out/map.exr --keep-basis @/out/b -q"},
    {"Register", "register @/ct.nrrd @/xray.dcm --search 0,0 -o @/out/pose.json --overlay @/out/fits.png"},
    {"Render", "render @/map.exr --size 48x48 -o @/out/f.png"},
    {"RenderJpeg", "render @/map.exr --size 48x48 -o @/out/f.jpg"},
    {"RenderHdr", "render @/map.exr --size 48x48 -o @/out/f.hdr"},
    {"RenderGif", "render @/map.exr --size 48x48 --cine 0:270:90 -o @/out/f.gif"},
    {"RenderDicom", "render @/map.exr --size 48x48 --cone 900,1200 --cine 0:60:20 -o @/out/f.dcm"},
    {"ExportPage", "export @/map.exr -o @/out/page.html"},
    {"ExportGltf", "export @/map.exr -o @/out/session.glb"},
    {"RenderFrames", "render @/map.exr --size 48x48 --cine 0:270:90 -o @/out/frames", Appearing::one_by_one},
    {"Compare", "compare @/ct.nrrd @/cast.exr --views 2 --plot @/out/p.png --pictures @/out/pictures",
     Appearing::one_by_one},
    {"Simulate",
     "simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/out/log.csv --plot "
     "@/out/p.png --report @/out/run.html"},
    {"Report", "report @/run.json -o @/out/runs.html"},
};

}  // namespace

Content content_of(const fs::path& folder) {
  Content all;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) {
      const std::string bytes = read_bytes(entry.path());
      all[fs::relative(entry.path(), folder)] = {bytes.size(), std::hash<std::string>()(bytes)};
    }
  return all;
}

std::span<const Writer> writers() { return kWriters; }

// ---- runs in a folder -------------------------------------------------------------------------------

Command CliOutput::command(const std::string& line) const {
  Command result{{XRAYCAST_PROGRAM}};
  std::istringstream words(line);
  for (std::string word; words >> word;) result.words.push_back(replaced(word));
  return result;
}

std::string CliOutput::replaced(std::string text) const {
  for (std::size_t at; (at = text.find('@')) != std::string::npos;)
    text.replace(at, 1, (folder_ / "").parent_path().string());
  return text;
}

Finished CliOutput::run_in_shell(std::string line) const {
  for (std::size_t at; (at = line.find("PROGRAM")) != std::string::npos;)
    line.replace(at, 7, XRAYCAST_PROGRAM);
  return run_process({{"/bin/bash", "-o", "pipefail", "-c", replaced(line)}});
}

void CliOutput::expect_one_line(const std::string& err, const std::string& part) {
  EXPECT_THAT(err, StartsWith("xraycast: "));
  EXPECT_THAT(err, HasSubstr(part));
  EXPECT_EQ(std::ranges::count(err, '\n'), 1) << err;
}

void CliOutput::make_inputs() const {
  Volume scan({{24, 24, 40}, {2, 2, 2}, {0, 0, 0}});
  std::mt19937 random(1);
  for (std::int16_t& hu : scan.hu())
    hu = static_cast<std::int16_t>(static_cast<int>(random() % 1000) - 900);  // does not compress
  Progress unheard;
  write_volume(scan, folder_ / "ct.nrrd", unheard);
  write_ct_series(scan, folder_ / "series", {}, {"noise"}, unheard);
  const VolumeGeometry& grid = scan.geometry();
  std::vector<std::uint8_t> mask(scan.hu().size());
  for (std::int64_t z = 4; z < 36; ++z)
    for (const std::int64_t y : {12, 13})
      for (const std::int64_t x : {12, 13}) mask[static_cast<std::size_t>(x + 24 * (y + 24 * z))] = 1;
  write_mask(grid, mask, folder_ / "mask.nrrd");

  const MapGeometry geometry = cylinder_map(grid, 60, {0, 10, 20}, {23, 23});
  BodyMap map;
  map.geometry = geometry;
  map.tau.assign(static_cast<std::size_t>(map.layer_size()) * 2, 0.5f);
  write_body_map(map, folder_ / "map.exr");
  map.source = "NRRD " + (folder_ / "ct.nrrd").string();
  write_body_map(map, folder_ / "cast.exr");
  Basis basis;
  basis.geometry = geometry;
  basis.knots_hu = {-1024, 32767};
  basis.hu_histogram.assign(256, 0);
  basis.touched.assign(static_cast<std::size_t>(tile_count(geometry)), 1);
  for (std::size_t i = 0; i < basis.touched.size() * 16; ++i)
    basis.weights.push_back(static_cast<std::uint16_t>(random()));
  write_basis(basis, folder_ / "ct.basis");

  write_bytes(folder_ / "tree.json", kTree);
  std::string script = "time_s,insertion_mm,rotation_deg\n";
  for (int i = 0; i < 300; ++i) script += fmt::format("{},{},0\n", 0.001 * i, 0.01 * i);
  write_bytes(folder_ / "push.csv", script);
  write_bytes(folder_ / "move.tfm",
              "#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
              "Parameters: 1 0 0 0 1 0 0 0 1.1 0 0 4\nFixedParameters: 0 0 0\n");
  write_bytes(folder_ / "motion.json",
              R"({"version": 1, "modes": [{"name": "breath", "period_s": 4,
 "phases": [{"phase": 0}, {"phase": 1, "field": "move.tfm"}]}]})");
  const Finished reported =
      run("simulate @/tree.json --device-model microcatheter-27f --script @/push.csv -o @/log.csv --report "
          "@/run.json");
  ASSERT_EQ(reported.status, 0) << reported.err;
  const Finished xray = run("project @/ct.nrrd --size 48x48 --cone 900,1200 -o @/xray.dcm");
  ASSERT_EQ(xray.status, 0) << xray.err;
  fs::create_directory(folder_ / "out");
}

// ---- writers ----------------------------------------------------------------------------------------

void EveryWriter::SetUp() {
  make_inputs();
  const auto start = Clock::now();
  const Finished done = run(GetParam().line);
  took_s_ = std::chrono::duration<double>(Clock::now() - start).count();
  ASSERT_EQ(done.status, 0) << done.err;
  for (const auto& [name, size_and_hash] : found()) {
    whole_[name] = size_and_hash.first;
    size_B_ += size_and_hash.first;
  }
  put_old_files();
  old_ = found();
}

void EveryWriter::put_old_files() const {
  if (GetParam().appearing == Appearing::as_a_new_folder) {
    for (const auto& entry : fs::directory_iterator(folder_ / "out")) fs::remove_all(entry.path());
    return;
  }
  for (const auto& [name, content] : found())
    if (is_kept_copy(name, content)) fs::remove(folder_ / "out" / name);
  for (const auto& [name, size] : whole_) {
    fs::create_directories((folder_ / "out" / name).parent_path());
    write_bytes(folder_ / "out" / name, "an older " + name);
  }
}

Command EveryWriter::on_disk_of(std::uintmax_t size_B) const {
  Command command = this->command(GetParam().line);
  command.environment = {{"LD_PRELOAD", FULL_DISK_LIBRARY},
                         {"FULL_DISK", (folder_ / "out").string()},
                         {"FULL_DISK_B", std::to_string(size_B)}};
  return command;
}

Command EveryWriter::on_late_disk() const {
  Command command = on_disk_of(0);
  command.environment["FULL_DISK_LATE"] = "1";
  return command;
}

void EveryWriter::expect_failure(const Command& on_full_disk, const std::string& when) const {
  const Finished done = run_process(on_full_disk);
  EXPECT_EQ(done.status, 1) << when << ": " << done.err;
  EXPECT_EQ(done.out, "") << when;
  expect_one_line(done.err, "could not be written completely");
  EXPECT_THAT(done.err, HasSubstr((folder_ / "out").string())) << when;
  EXPECT_THAT(done.err, HasSubstr("the disk may be full: make room ")) << when;
  if (GetParam().appearing == Appearing::one_by_one)
    expect_whole_or_old_files(false);
  else
    EXPECT_EQ(found(), old_) << when;
  put_old_files();
}

bool EveryWriter::is_whole(const std::string& name, std::uintmax_t size_B) const {
  // Hashes do not tell: EXR and TIFF files hold the second in which they were written. UIDs, of which a DICOM
  // file has a few, are numbers of different lengths; and so are the seconds that a pose took.
  constexpr std::uintmax_t kUids_B = 32;
  const auto whole = whole_.find(name);
  if (whole == whole_.end()) return false;
  if (name == "pose.json") return nlohmann::json::accept(read_bytes(folder_ / "out" / name));
  const std::uintmax_t slack_B = name.ends_with(".dcm") ? kUids_B : 0;
  return size_B + slack_B >= whole->second && size_B <= whole->second + slack_B;
}

/// A user's names that could not be read, which may be worth the work to mend them.
bool EveryWriter::is_kept_copy(const std::string& name, const Content::mapped_type& content) const {
  const auto names = old_.find("names.json");
  return names != old_.end() && name.starts_with("names-earlier") && content == names->second;
}

void EveryWriter::expect_whole_or_old_files(bool may_leave_parts) const {
  for (const auto& [name, content] : found()) {
    if ((may_leave_parts && is_leftover(name)) || is_kept_copy(name, content)) continue;
    const auto old = old_.find(name);
    EXPECT_TRUE(is_whole(name, content.first) || (old != old_.end() && content == old->second))
        << name << " is partial or was left behind";
  }
}

void EveryWriter::expect_whole_files() const {
  Content all = found();
  std::erase_if(all, [&](const auto& file) { return is_kept_copy(file.first, file.second); });
  EXPECT_EQ(all.size(), whole_.size()) << "what a killed run left stays behind";
  for (const auto& [name, content] : all)
    EXPECT_TRUE(is_whole(name, content.first)) << name << " is partial or was left behind";
}

bool EveryWriter::expect_survival(int signal, double latest_s, std::mt19937& random) const {
  put_old_files();
  Process process(command(GetParam().line));
  std::uniform_real_distribution moment_s(0.0, latest_s);
  std::this_thread::sleep_for(std::chrono::duration<double>(moment_s(random)));
  process.send(signal);
  const Finished done = process.finish();
  EXPECT_THAT(done.status, AnyOf(0, 128 + signal)) << done.err;

  if (signal == SIGKILL) {
    expect_whole_or_old_files(true);
    // The name of a new folder has to be free.
    if (GetParam().appearing == Appearing::as_a_new_folder) fs::remove_all(folder_ / "out/series");
    EXPECT_EQ(run(GetParam().line).status, 0);
    expect_whole_files();
  } else if (done.status == 0) {
    expect_whole_files();
  } else if (GetParam().appearing == Appearing::one_by_one) {
    expect_whole_or_old_files(false);
  } else {
    EXPECT_EQ(found(), old_) << "after signal " << signal;
  }
  if (done.status != 0 && !done.err.empty()) expect_one_line(done.err, "cancelled");
  return done.status != 0;
}

}  // namespace xraycast
