// A full disk, and Ctrl-C: neither leaves anything behind.
#include "cli/cli_fixture.hpp"

namespace xraycast::cli_test {
namespace {

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

}  // namespace
}  // namespace xraycast::cli_test
