// The program in odd surroundings: without a home, on full disks of others, in other languages, beside
// another run, and under names that shells and options trip over.
#include "cli/writers.hpp"
#include "support/leftover.hpp"
#include "support/scan_files.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <memory>
#include <sched.h>
#include <sys/mount.h>
#include <thread>

namespace xraycast::cli_environment_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class CliEnvironment : public CliOutput {
 protected:
  /// `line` with PROGRAM for the program, in a shell in the test's folder.
  Finished run_there(const std::string& line) const { return run_in_shell("cd @ && " + line); }

  /// A folder on a disk of its own, which only this process sees; false where that takes rights it has not.
  bool mount_at(const fs::path& folder, unsigned long flags, const char* options) const {
    fs::create_directories(folder);
    return unshare(CLONE_NEWNS) == 0 && mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
           mount("tmpfs", folder.c_str(), "tmpfs", flags, options) == 0;
  }
};

// ---- a home -----------------------------------------------------------------------------------------

struct Disk {
  unsigned long flags;
  const char* options;
};
constexpr Disk kReadOnly{MS_RDONLY, "mode=700"}, kFull{0, "mode=700,size=64k"};
constexpr char kBox[] = "PROGRAM phantom box --size 8x8x8 -o box.nrrd";

TEST_F(CliEnvironment, NeedsNoHome) {
  const Finished done = run_there(std::string("env -u HOME -u XDG_CACHE_HOME -u USER -u LOGNAME ") + kBox);
  EXPECT_EQ(done.status, 0) << done.err;
  EXPECT_EQ(done.err, "");
}

TEST_F(CliEnvironment, TakesAHomeThatIsReadOnlyOrFull) {
  for (const auto& [flags, options] : {kReadOnly, kFull}) {
    if (!mount_at(folder_ / "home", flags, options)) GTEST_SKIP() << "mounting needs CAP_SYS_ADMIN";
    for (const char* variables : {"env -u XDG_CACHE_HOME HOME=@/home ", "env XDG_CACHE_HOME=@/home "}) {
      const Finished done = run_there(std::string(variables) + kBox);
      EXPECT_EQ(done.status, 0) << variables << options << done.err;
      EXPECT_EQ(done.err, "") << variables << options;
    }
    umount((folder_ / "home").c_str());
  }
}

TEST_F(CliEnvironment, SaysWhereKernelsFindNoRoom) {
  for (const auto& [flags, options] : {kReadOnly, kFull}) {
    if (!mount_at(folder_ / "full", flags, options)) GTEST_SKIP() << "mounting needs CAP_SYS_ADMIN";
    const Finished of_the_user = run_there(std::string("env POCL_CACHE_DIR=@/full/kernels ") + kBox);
    EXPECT_EQ(of_the_user.status, 4) << options;
    expect_one_line(of_the_user.err, "/full/kernels, which cannot be written to or has less than 16 MB left");
    const Finished nowhere =
        run_there(std::string("env -u XDG_CACHE_HOME HOME=@/full TMPDIR=@/full ") + kBox);
    EXPECT_EQ(nowhere.status, 4) << options;
    expect_one_line(nowhere.err, "set POCL_CACHE_DIR to one that has");
    umount((folder_ / "full").c_str());
  }
  EXPECT_FALSE(fs::exists(folder_ / "box.nrrd"));
}

TEST_F(CliEnvironment, CompilesKernelsWithoutAWord) {
  make_inputs();
  for (const char* command :
       {"cast ct.nrrd -o map.exr", "project ct.nrrd --opacity spectrum:80 -o drr.exr"}) {
    const Finished done = run_there(fmt::format("env POCL_CACHE_DIR=@/new-kernels PROGRAM -q {}", command));
    EXPECT_EQ(done.status, 0) << command;
    EXPECT_EQ(done.err, "") << command;
  }
}

// ---- another language -------------------------------------------------------------------------------

TEST_F(CliEnvironment, WritesAndReadsTheSameNumbersWhereTheyHaveACommaInThem) {
  make_inputs();
  const Finished made =
      run_there("mkdir locales && localedef --no-archive -i de_DE -f UTF-8 locales/de_DE.UTF-8");
  ASSERT_TRUE(fs::exists(folder_ / "locales/de_DE.UTF-8/LC_NUMERIC")) << made.err;
  const std::string german = "LOCPATH=@/locales LC_ALL=de_DE.UTF-8 ";
  ASSERT_EQ(run_there(german + "/usr/bin/printf %.1f 0,5").out, "0,5") << "the locale is not in force";

  // Text of all kinds: headers, trees, logs, opacities, options, and what is printed.
  const char* const lines[] = {
      "PROGRAM phantom thorax --spacing 12.5 --noise 0.5 -o ct.nrrd --truth truth",
      "PROGRAM convert ct.nrrd -o ct.mha",
      "PROGRAM info ct.mha",
      "PROGRAM cast ct.mha -o map.exr --radii 0,20.5,90.25 --angles 60 --memory-limit 0.5G --json",
      "PROGRAM project ct.mha -o p.nrrd --angle 12.5 --cone 900.5,1200.5 --size 32x32 --pixel 1.5",
      "PROGRAM segment ct.nrrd -o vessels --from-mask truth/mask.nrrd --surface tubes",
      "PROGRAM simulate tree.json --device-model microcatheter-27f --script push.csv -o log.csv",
      "PROGRAM compare ct.mha map.exr --views 2 --json"};
  const auto outputs = [&](const std::string& language, const std::string& folder) {
    std::string said;
    fs::create_directory(folder_ / folder);
    for (const char* file : {"tree.json", "push.csv"}) fs::copy(folder_ / file, folder_ / folder / file);
    for (const std::string line : lines) {
      const Finished done = run_there("cd " + folder + " && " + language + line);
      EXPECT_EQ(done.status, 0) << line << ": " << done.err;
      // The others say how long things took.
      if (line.find("phantom") != std::string::npos || line.find("info") != std::string::npos)
        said += done.out;
    }
    return said;
  };
  EXPECT_EQ(outputs(german, "german"), outputs("LC_ALL=C ", "plain"));
  const Content german_files = content_of(folder_ / "german"), plain = content_of(folder_ / "plain");
  for (const auto& [name, content] : plain) {
    ASSERT_TRUE(german_files.contains(name)) << name;
    EXPECT_EQ(german_files.at(name), content) << name;
  }
}

// ---- another run ------------------------------------------------------------------------------------

TEST_F(CliEnvironment, TwoRunsWriteTheSameFile) {
  // Of what is being written; a file that only tries whether it can be is empty.
  const auto part_B = [&] {
    std::uintmax_t sum = 0;
    std::error_code gone;
    for (const auto& entry : fs::directory_iterator(folder_ / ""))
      if (is_leftover(entry.path()))
        if (const auto size_B = entry.file_size(gone); !gone) sum += size_B;
    return sum;
  };
  Process slow(command("phantom thorax --size 256x256x200 -o @/ct.nrrd -q"));
  while (part_B() == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  slow.send(SIGSTOP);
  const auto before_B = part_B();
  ASSERT_GT(before_B, 0) << "it was written before it could be stopped";
  const Finished quick = run("phantom box --size 8x8x8 -o @/ct.nrrd -q");
  EXPECT_EQ(quick.status, 0) << quick.err;
  EXPECT_LT(fs::file_size(folder_ / "ct.nrrd"), 10'000);
  EXPECT_GE(part_B(), before_B) << "what the other one writes was touched";
  slow.send(SIGCONT);
  EXPECT_EQ(slow.finish().status, 0);
  EXPECT_GT(fs::file_size(folder_ / "ct.nrrd"), 256U * 256 * 200 * 2);
  EXPECT_EQ(content_of(folder_ / "").size(), 1U) << "something was left behind";
}

TEST_F(CliEnvironment, ManyRunsWriteTheSameFilesAtOnce) {
  make_inputs();
  const std::string line =
      "cast @/ct.nrrd --angles 60 -o @/out/map.exr --preview @/out/map.png --keep-basis @/out/b -q";
  ASSERT_EQ(run(line).status, 0);
  const Content alone = content_of(folder_ / "out");
  {
    std::vector<std::unique_ptr<Process>> runs;
    for (int i = 0; i < 6; ++i) runs.push_back(std::make_unique<Process>(command(line)));
    for (const auto& one : runs) {
      const Finished done = one->finish();
      EXPECT_EQ(done.status, 0) << done.err;
    }
  }
  const Content together = content_of(folder_ / "out");
  ASSERT_EQ(together.size(), alone.size());
  for (const auto& [name, content] : alone) EXPECT_EQ(together.at(name).first, content.first) << name;
}

// ---- names ------------------------------------------------------------------------------------------

TEST_F(CliEnvironment, TakesNamesOfAnyLetters) {
  // As one word of bash.
  for (const std::string name : {"'a b'", "'  two  '", "$'two\\nlines'", "'Größe 体'", "-dash", "--help",
                                 "'$HOME'", "'quote\"'", "\"it's\"", "$'\\xff\\xfe'", "'%s{}'", "'*'"}) {
    const std::string steps[] = {
        "phantom sphere --size 16x16x16 --output=" + name + ".nrrd",
        "info -- " + name + ".nrrd",
        "convert --output=" + name + ".mha -- " + name + ".nrrd",
        "cast --angles 30 --preview=" + name + ".png --output=" + name + ".exr -- " + name + ".mha",
        "render --size 16x16 --output=" + name + "-frame.png -- " + name + ".exr",
        "project --size 16x16 --output=" + name + ".tif -- " + name + ".nrrd",
        "convert --output=" + name + " -- " + name + ".nrrd",
        "info -- " + name};
    for (const std::string& step : steps) {
      const Finished done = run_there("PROGRAM " + step);
      EXPECT_EQ(done.status, 0) << step << ": " << done.err;
      EXPECT_EQ(done.err, "") << step;
    }
    EXPECT_EQ(content_of(folder_ / "").size(), 6U + 16U) << name;
    EXPECT_EQ(run_there("rm -r -- * .[!.]* 2>/dev/null; true").status, 0);
    EXPECT_THAT(content_of(folder_ / ""), IsEmpty()) << name;
  }
}

TEST_F(CliEnvironment, ComplainsOfNamesOfAnyLettersInOneLine) {
  for (const std::string name : {"$'two\\nlines'", "$'\\x1b[2J'", "$'\\xff'", "''", "'a b'"}) {
    for (const std::string& line :
         {"info -- " + name, "cast -- " + name + " -o map.exr", "phantom box --output=" + name,
          "render -o " + name + ".png -- " + name}) {
      const Finished done = run_there("PROGRAM " + line);
      EXPECT_THAT(done.status, testing::AnyOf(2, 3)) << line;
      expect_one_line(done.err, "");
    }
  }
}

}  // namespace
}  // namespace xraycast::cli_environment_test
