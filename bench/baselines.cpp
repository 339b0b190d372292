#include "baselines.hpp"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fcntl.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <thread>
#include <unistd.h>
#include <vector>

namespace xraycast::bench {
namespace {

constexpr int kSlices = 16;

/// Sixteen floats or shorts that the compiler keeps in vector registers; a GNU extension of GCC and Clang.
using Floats = float __attribute__((vector_size(kSlices * sizeof(float))));
using Shorts = std::int16_t __attribute__((vector_size(kSlices * sizeof(std::int16_t))));

template <typename Work>
void on_all_cores(const Work& work) {
  const int cores = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  std::vector<std::jthread> threads;
  for (int i = 0; i < cores; ++i) threads.emplace_back([&work, i, cores] { work(i, cores); });
}

/// Into `to`: how vectors of 64 bytes are returned depends on the processor.
void load(const std::int16_t* from, Floats& to) {
  Shorts shorts;
  std::memcpy(&shorts, from, sizeof shorts);
  to = __builtin_convertvector(shorts, Floats);
}

float take_samples(std::int64_t samples) {
  constexpr int kSide = 16;  // 16 x 16 pixels of 16 slices: 8 KiB
  alignas(64) std::array<std::int16_t, (kSide + 1) * (kSide + 1) * kSlices> block;
  for (std::size_t i = 0; i < block.size(); ++i) block[i] = static_cast<std::int16_t>(i * 37 % 2000 - 1000);
  Floats sum{};
  float x = 0.3f, y = 0.7f;
  for (std::int64_t i = 0; i < samples; ++i) {
    x += 0.61f;
    y += 0.79f;
    if (x >= kSide - 1) x -= kSide - 1;
    if (y >= kSide - 1) y -= kSide - 1;
    const int ix = static_cast<int>(x), iy = static_cast<int>(y);
    const float fx = x - static_cast<float>(ix), fy = y - static_cast<float>(iy);
    const std::int16_t* upper = block.data() + (iy * (kSide + 1) + ix) * kSlices;
    const std::int16_t* lower = upper + (kSide + 1) * kSlices;
    Floats a, b, c, d;
    load(upper, a);
    load(upper + kSlices, b);
    load(lower, c);
    load(lower + kSlices, d);
    const Floats ab = a + fx * (b - a), cd = c + fx * (d - c);
    const Floats mu = 0.02f / 1024 * (ab + fy * (cd - ab)) + 0.02f;
    sum += mu > 0 ? mu : Floats{};
  }
  float total = 0;
  for (int s = 0; s < kSlices; ++s) total += sum[s];
  return total;
}

}  // namespace

void read_all(const Volume& volume) {
  on_all_cores([&](int core, int cores) {
    const std::size_t share = volume.hu().size() / static_cast<std::size_t>(cores);
    const std::int16_t* from = volume.hu().data() + share * static_cast<std::size_t>(core);
    std::uint64_t sum[8]{};
    for (std::size_t i = 0; i + 32 <= share; i += 32) {
      std::uint64_t words[8];
      std::memcpy(words, from + i, sizeof words);
      for (int w = 0; w < 8; ++w) sum[w] += words[w];
    }
    benchmark::DoNotOptimize(sum);
  });
}

void sample_from_cache(std::int64_t samples) {
  on_all_cores([&](int, int cores) { benchmark::DoNotOptimize(take_samples(samples / cores)); });
}

void read_file(const std::filesystem::path& path) {
  const auto bytes = std::filesystem::file_size(path);
  const auto memory = std::make_unique_for_overwrite<char[]>(bytes);
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  for (std::size_t done = 0; done < bytes;) {
    const ssize_t got = read(file, memory.get() + done, bytes - done);
    if (got <= 0) break;
    done += static_cast<std::size_t>(got);
  }
  close(file);
  benchmark::DoNotOptimize(memory.get());
}

void map_by_opencv(const Volume& volume, double radius_vox) {
  const Index3 size = volume.geometry().size;
  const int width = static_cast<int>(size.x), height = static_cast<int>(size.y);
  cv::parallel_for_(cv::Range(0, static_cast<int>(size.z)), [&](const cv::Range& range) {
    cv::Mat mu, polar, map;
    for (int z = range.start; z < range.end; ++z) {
      const cv::Mat slice(height, width, CV_16S, const_cast<std::int16_t*>(volume.slices(z, 1).data()));
      slice.convertTo(mu, CV_32F, 0.02 / 1024, 0.02);
      cv::max(mu, 0, mu);
      cv::warpPolar(mu, polar, cv::Size(static_cast<int>(radius_vox), 360),
                    cv::Point2f(0.5f * static_cast<float>(width), 0.5f * static_cast<float>(height)),
                    radius_vox, cv::INTER_LINEAR);
      cv::reduce(polar, map, 1, cv::REDUCE_SUM);
      benchmark::DoNotOptimize(map.data);
    }
  });
}

}  // namespace xraycast::bench
