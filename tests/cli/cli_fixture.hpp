#pragma once

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

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

/// A folder's files with their bytes' hash, and its folders.
using Snapshot = std::map<std::string, std::size_t>;

inline Snapshot snapshot(const fs::path& folder) {
  Snapshot all;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    all[entry.path().string()] =
        entry.is_regular_file() ? std::hash<std::string>()(read_bytes(entry.path())) : 0;
  return all;
}

inline std::vector<std::string> keys_of(const Json& json) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : json.items()) keys.push_back(key);
  return keys;
}

/// 8 x 8 x 4 voxels of 1 mm from the origin on, all of them water.
inline NiftiFile little_scan() {
  NiftiFile file;
  file.dim = {3, 8, 8, 4, 1, 1, 1, 1};
  file.sform = {-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0};  // LPS, so that nothing needs reorienting
  file.voxels = std::string(8 * 8 * 4 * 2, '\0');
  return file;
}

/// The same of more slices.
inline NiftiFile water(std::int16_t slices) {
  NiftiFile file = little_scan();
  file.dim[3] = slices;
  file.voxels = std::string(static_cast<std::size_t>(8 * 8 * slices * 2), '\0');
  return file;
}

/// The program as a user meets it: exit status, stdout, stderr, and the files that are there afterwards.
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

inline std::string nrrd_of(const std::string& sizes, const std::string& dimension = "3") {
  return "NRRD0004\ntype: short\ndimension: " + dimension + "\nsizes: " + sizes +
         "\nencoding: raw\nendian: little\n\nvoxels";
}

inline void make_push(const TemporaryFolder& f) {
  write_bytes(f / "push.csv", "time_s,insertion_mm,rotation_deg\n0,0,0\n0.5,20,90\n1,20,90\n");
}

inline void make_push_and_tree(const TemporaryFolder& f) {
  make_push(f);
  write_bytes(f / "tree.json",
              R"({"branches": [{"id": 0, "parent": -1, "points": [[0, 0, 0, 0.5], [0, 0, 100, 0.5]]}]})");
}

/// A map of one layer and five rows.
inline void write_small_map(const TemporaryFolder& folder) {
  BodyMap map;
  map.geometry.width = 8;
  map.geometry.height = 5;
  map.geometry.radii_mm = {0, 10};
  map.geometry.centre_mm = {{0, 0}};
  map.tau.assign(map.layer_size(), 0.5f);
  write_body_map(map, folder / "map.exr");
}

/// A catheter's run with a map to draw it in.
inline void make_run(const TemporaryFolder& folder) {
  make_push_and_tree(folder);
  write_small_map(folder);
}

}  // namespace xraycast::cli_test
