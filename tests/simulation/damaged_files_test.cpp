#include "support/read_scan.hpp"
#include "support/scan_files.hpp"
#include "support/temporary_folder.hpp"
#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/attenuation/spectrum.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/casting/basis_file.hpp"
#include "xraycast/geometry/curved_axis.hpp"
#include "xraycast/geometry/mesh.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mechanics/instrument_model.hpp"
#include "xraycast/simulation/script.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <ostream>
#include <random>
#include <string_view>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

// Files of every format that is read, each damaged in many ways that a seed repeats: whatever comes of it is
// read, or refused by an InputError. Where the format has a checksum, what is read is what was written.

constexpr int kDamagesPerFormat = 200;

/// 16 x 12 x 8 voxels, no two of them in a row the same.
Volume volume() {
  Volume volume({{16, 12, 8}, {1, 1.5, 2}, {-8, -9, 3}});
  std::mt19937 random(7);
  for (std::int16_t& hu : volume.hu()) hu = static_cast<std::int16_t>(random() % 2000) - 1000;
  return volume;
}

std::string voxels() { return bytes_of(std::span<const std::int16_t>(volume().hu())); }

void write_scan(const fs::path& path) {
  Progress progress;
  write_volume(volume(), path, progress);
}

constexpr char kNrrdHeader[] =
    "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 16 12 8\n"
    "space directions: (1,0,0) (0,1.5,0) (0,0,2)\nencoding: gzip\nendian: little\nspace origin: "
    "(-8,-9,3)\n\n";
constexpr char kMetaImageHeader[] =
    "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = "
    "True\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = -8 -9 3\nElementSpacing = 1 1.5 2\nDimSize = 16 12 "
    "8\n"
    "ElementType = MET_SHORT\nElementDataFile = LOCAL\n";

VesselTree tree() {
  std::vector<VesselBranch> branches(3);
  for (int i = 0; i < 12; ++i) branches[0].points.push_back({{0.1 * i, 0.2 * i, 5.0 * i}, 6 - 0.1 * i});
  for (int side = 1; side <= 2; ++side) {
    branches[side].parent = 0;
    branches[side].points.push_back(branches[0].points.back());
    for (int i = 1; i < 9; ++i)
      branches[side].points.push_back({{1.1 + (side == 1 ? 3.0 : -3.0) * i, 2.2, 55 + 4.0 * i}, 3});
  }
  return VesselTree(std::move(branches), "tree");
}

Basis basis() {
  Basis basis;
  basis.geometry = cylinder_map(volume().geometry(), 32, {0, 10}, {0, 0});
  basis.knots_hu = {-1000, 0, 1000};
  basis.hu_histogram.assign(256, 1);
  basis.touched.assign(static_cast<std::size_t>(tile_count(basis.geometry)), 5);
  basis.weights.assign(basis.touched.size() * 2 * Basis::kTileSlices, 77);
  return basis;
}

/// What was read, to compare; empty where there is nothing to compare with.
using Content = std::string;

Content read_as_scan(const fs::path& path) {
  const Volume read = read_scan(path).volume;
  return bytes_of(std::span<const std::int16_t>(read.hu()));
}

struct Format {
  const char* name;
  const char* file;
  void (*write)(const fs::path& path);
  Content (*read)(const fs::path& path);
  /// Where what its checksum covers starts, which is all that is damaged then.
  std::optional<std::size_t> checked_from_B{};
};
void PrintTo(const Format& format, std::ostream* out) { *out << format.name; }

const Format kFormats[] = {
    {"Nifti", "a.nii", write_scan, read_as_scan},
    {"NiftiGzipped", "a.nii.gz", write_scan, read_as_scan, 0},
    {"Nrrd", "a.nrrd", write_scan, read_as_scan},
    {"NrrdGzipped", "a.nrrd",
     [](const fs::path& path) { write_bytes(path, kNrrdHeader + gzipped(voxels())); }, read_as_scan,
     sizeof kNrrdHeader - 1},
    {"NrrdGzippedHeader", "a.nrrd",
     [](const fs::path& path) { write_bytes(path, kNrrdHeader + gzipped(voxels())); }, read_as_scan},
    {"MetaImage", "a.mha", write_scan, read_as_scan},
    {"MetaImageOfTwoFiles", "a.mhd", write_scan, read_as_scan},
    {"MetaImageCompressed", "a.mha",
     [](const fs::path& path) { write_bytes(path, kMetaImageHeader + deflated(voxels())); }, read_as_scan,
     sizeof kMetaImageHeader - 1},
    {"MetaImageCompressedHeader", "a.mha",
     [](const fs::path& path) { write_bytes(path, kMetaImageHeader + deflated(voxels())); }, read_as_scan},
    {"Dicom", "a.dcm", [](const fs::path& path) { DicomFile(16, 12, volume().hu().first(192)).write(path); },
     read_as_scan},
    {"DicomImplicit", "a.dcm",
     [](const fs::path& path) { DicomFile(16, 12, volume().hu().first(192)).write(path, true); },
     read_as_scan},
    {"Genesis", "a.fro",
     [](const fs::path& path) {
       write_bytes(path, genesis_bytes({.columns = 16, .rows = 12}, std::vector<std::uint16_t>(192, 1024)));
     },
     read_as_scan},
    {"TreeVtp", "tree.vtp", [](const fs::path& path) { write_tree(tree(), path); },
     [](const fs::path& path) { return read_tree(path), Content(); }},
    {"TreeJson", "tree.json", [](const fs::path& path) { write_tree(tree(), path); },
     [](const fs::path& path) { return read_tree(path), Content(); }},
    {"SurfaceVtp", "surface.vtp", [](const fs::path& path) { write_mesh(tube_mesh(tree(), 6), path); },
     [](const fs::path& path) { return read_mesh(path), Content(); }},
    {"SurfaceStl", "surface.stl", [](const fs::path& path) { write_mesh(tube_mesh(tree(), 6), path); },
     [](const fs::path& path) { return read_mesh(path), Content(); }},
    {"Basis", "a.basis", [](const fs::path& path) { write_basis(basis(), path); },
     [](const fs::path& path) {
       const Basis read = read_basis(path);
       return bytes_of(std::span(read.touched)) + bytes_of(std::span(read.weights));
     },
     0},
    {"Opacity", "opacity.json",
     [](const fs::path& path) { write_bytes(path, Opacity::bilinear().to_json()); },
     [](const fs::path& path) { return Opacity::named(path.string()), Content(); }},
    {"Instrument", "instrument.json",
     [](const fs::path& path) {
       fs::copy_file(fs::path(XRAYCAST_SOURCE_DIR) / "simulation/instruments/cobra-5f.json", path);
     },
     [](const fs::path& path) { return InstrumentModel::named(path.string()), Content(); }},
    {"Spectrum", "beam.txt",
     [](const fs::path& path) { write_bytes(path, "# keV, photons\n20 0.5\n40 1\n60 2.25\n80 0.1\n"); },
     [](const fs::path& path) { return Spectrum::named(path.string()), Content(); }},
    {"Script", "push.csv",
     [](const fs::path& path) {
       write_bytes(path, "time_s,insertion_mm,rotation_deg\n0,0,0\n1,20,180\n4,300,180\n");
     },
     [](const fs::path& path) { return Script::read(path), Content(); }},
    {"CurvedAxis", "line.csv",
     [](const fs::path& path) { write_bytes(path, "x,y,z\n0,0,0\n1,2,3\n-1.5,2,30\n"); },
     [](const fs::path& path) { return CurvedAxis::from_file(path.string()), Content(); }},
};

/// Flips, writes, cuts, repeats or inserts bytes behind `first_B`.
void damage(std::string& bytes, std::size_t first_B, std::mt19937& random) {
  const auto below = [&](std::size_t limit) {
    return static_cast<std::size_t>(random() % std::max<std::size_t>(1, limit));
  };
  const auto somewhere = [&] { return first_B + below(bytes.size() - first_B); };
  // What changes the numbers and words of a text.
  constexpr std::string_view kText = "0123456789-+.eE%naif\\\"{}[]:=,() \n\t";
  for (std::size_t times = 1 + below(3); times > 0 && bytes.size() > first_B; --times) switch (below(6)) {
      case 0:
        bytes[somewhere()] ^= static_cast<char>(1 << below(8));
        break;
      case 1:
        bytes[somewhere()] = static_cast<char>(random());
        break;
      case 2:
        bytes[somewhere()] = kText[below(kText.size())];
        break;
      case 3:
        bytes.erase(somewhere(), 1 + below(below(2) == 0 ? 4 : bytes.size()));
        break;
      case 4:
        bytes.insert(somewhere(), bytes.substr(somewhere(), 1 + below(20)));
        break;
      default:
        bytes.insert(somewhere(), 1, kText[below(kText.size())]);
    }
}

class DamagedFile : public testing::TestWithParam<Format> {};

TEST_P(DamagedFile, IsReadOrRefused) {
  const Format& format = GetParam();
  const TemporaryFolder folder;
  const fs::path path = folder / format.file;
  format.write(path);
  const Content whole = format.read(path);
  const std::string bytes = read_bytes(path);
  int refused = 0;
  for (unsigned seed = 0; seed < kDamagesPerFormat; ++seed) {
    SCOPED_TRACE(fmt::format("seed {}", seed));
    std::mt19937 random(seed);
    std::string damaged = bytes;
    damage(damaged, format.checked_from_B.value_or(0), random);
    write_bytes(path, damaged);
    try {
      const Content read = format.read(path);
      EXPECT_TRUE(!format.checked_from_B || read == whole) << "read as something else";
    } catch (const InputError& error) {
      ++refused;
      EXPECT_TRUE(std::string_view(error.what()).starts_with((folder / "").string())) << error.what();
    } catch (const std::exception& error) {
      ADD_FAILURE() << error.what();
    }
  }
  EXPECT_GT(refused, 0);
}

INSTANTIATE_TEST_SUITE_P(All, DamagedFile, testing::ValuesIn(kFormats),
                         [](const auto& format) { return std::string(format.param.name); });

}  // namespace
}  // namespace xraycast
