// Every benchmark with its baseline in the same run, repeated and interleaved at random, so that their ratio
// survives a machine whose speed drifts. What is held constant: the thorax phantom of 512 x 512 x 720 voxels,
// 360 angles, a radius of 255 pixels about the middle, all cores.
#include "moving.hpp"
#include "scaling.hpp"
#include "suite.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <string_view>

namespace xraycast::bench {
namespace {

namespace fs = std::filesystem;

/// Keeps the median of every benchmark's repetitions, and prints as the console does.
class Collector final : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs)
      if (run.run_type == Run::RT_Aggregate && run.aggregate_name == "median" && !run.error_occurred)
        keep(run);
  }
  Times times;

 private:
  void keep(const Run& run) {
    times[run.run_name.function_name] = run.GetAdjustedRealTime();
    // A baseline that was measured interleaved with its value.
    const auto rtk = run.counters.find("rtk_ms");
    if (rtk != run.counters.end()) times["RTK, " + run.run_name.function_name] = rtk->second.value;
  }
};

/// All benchmarks, and the lines of the table that they make.
std::vector<Row> register_all(Bench& bench) {
  std::vector<Row> rows;
  for (const auto& topic :
       {add_casting, add_projecting, add_drawing, add_segmenting, add_registering, add_simulating})
    for (Row& row : topic(bench)) rows.push_back(std::move(row));
  return rows;
}

/// Times that are made of others.
void derive(Times& times) {
  // The floor of a cast is the slower of reading the bytes and taking the samples.
  if (times.contains("all-core read") && times.contains("samples from cache"))
    times["floor"] = std::max(times["all-core read"], times["samples from cache"]);
  times["5 s"] = 5'000;    // what key maps may take
  times["3 s"] = 3'000;    // what a registration may take
  times["0.3 s"] = 300;    // what the next frame of a film may take
  times["40 s"] = 40'000;  // what a segmentation may take
  if (times.contains("cast_resident_1")) times["cast_vs_opencv"] = times["cast_resident_1"];
}

void measure_rows(Bench& bench, const fs::path& folder) {
  const std::vector<Row> rows = register_all(bench);
  Collector collector;
  benchmark::RunSpecifiedBenchmarks(&collector);
  benchmark::ClearRegisteredBenchmarks();  // with the OpenGL objects they hold, while there is a context
  derive(collector.times);
  print_table(rows, collector.times);
  write_json(rows, collector.times, (folder / "bench.json").string());
}

/// Takes `--lanes N` out of the words, and has PoCL compile kernels for a processor with vectors of so many
/// floats: 8 for AVX2, 4 for SSE4.1. Before OpenCL is first used. The variable is PoCL's for the builds of
/// distributions, which choose by it one of their libraries of built-in functions, and the processor.
void narrow_kernels(std::vector<std::string_view>& words) {
  const auto option = std::ranges::find(words, "--lanes");
  if (option == words.end()) return;
  const std::string_view lanes = option + 1 == words.end() ? "" : option[1];
  if (lanes != "4" && lanes != "8") {
    fmt::print(stderr, "--lanes: give 4 or 8\n");
    std::exit(2);
  }
  setenv("POCL_KERNELLIB_NAME", lanes == "8" ? "avx2" : "sse41", 1);
  words.erase(option, option + 2);
}

}  // namespace
}  // namespace xraycast::bench

/// xraycast_bench [--lanes 4|8] [--scaling | --moving] [FOLDER [PYTHON]], and Google Benchmark's options.
int main(int argc, char** argv) {
  using namespace xraycast::bench;
  benchmark::Initialize(&argc, argv);
  std::vector<std::string_view> words(argv + 1, argv + argc);
  narrow_kernels(words);
  const bool wants_scaling = std::erase(words, "--scaling") > 0,
             wants_moving = std::erase(words, "--moving") > 0;
  const fs::path folder = words.empty() ? "." : words[0];
  Bench bench(folder, words.size() > 1 ? words[1] : "python3");
  if (wants_moving) {
    measure_moving(bench);
  } else if (wants_scaling) {
    measure_drawing_scaling(bench, folder / "scaling-frame.png");
    measure_rod_scaling(folder / "scaling-rod.png");
    measure_segmenting_scaling(bench, folder / "scaling-vesselness.png");
    measure_scaling(bench, folder / "scaling-cast.png");
  } else {
    measure_rows(bench, folder);
  }
  fs::remove(bench.file);
  return 0;
}
