#include "xraycast/phase_registration/elastix.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/temporary_folder_on_disk.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/motion/itk_transform.hpp"
#include "xraycast/phase_registration/program_run.hpp"

#include <fmt/format.h>
#include <glm/common.hpp>

#include <algorithm>
#include <fstream>
#include <map>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

constexpr const char* kProgram = "elastix";
constexpr int kResolutions = 4, kIterations = 300;

/// How many voxels become one in each resolution and along each axis: halves, but a few are left at least.
std::string pyramid_of(const Index3& size) {
  constexpr std::int64_t kFewest = 16;
  std::string schedule;
  for (int resolution = 0; resolution < kResolutions; ++resolution)
    for (int axis = 0; axis < 3; ++axis)
      schedule +=
          fmt::format(" {}", std::clamp<std::int64_t>(size[axis] / kFewest, 1,
                                                      std::int64_t{1} << (kResolutions - 1 - resolution)));
  return schedule;
}

/// See elastix' manual, 5.0.1. Correlation is from -1 to 0, so that the weight of bending holds for all
/// scans.
std::string parameters_of(const ElastixJob& job) {
  constexpr double kBending = 1;
  constexpr int kSamples = 5000;
  return fmt::format(
      "(FixedInternalImagePixelType \"float\")\n(MovingInternalImagePixelType \"float\")\n"
      "(FixedImageDimension 3)\n(MovingImageDimension 3)\n(UseDirectionCosines \"true\")\n"
      "(Registration \"MultiMetricMultiResolutionRegistration\")\n"
      "(FixedImagePyramid \"FixedRecursiveImagePyramid\")\n(MovingImagePyramid "
      "\"MovingRecursiveImagePyramid\")\n"
      "(NumberOfResolutions {})\n(FixedImagePyramidSchedule{})\n(MovingImagePyramidSchedule{})\n"
      "(Interpolator \"LinearInterpolator\")\n(ResampleInterpolator \"FinalBSplineInterpolator\")\n"
      "(Resampler \"DefaultResampler\")\n"
      "(Metric \"AdvancedNormalizedCorrelation\" \"TransformBendingEnergyPenalty\")\n"
      "(Metric0Weight 1)\n(Metric1Weight {})\n"
      "(Transform \"BSplineTransform\")\n(HowToCombineTransforms \"Compose\")\n"
      "(FinalGridSpacingInPhysicalUnits {})\n"
      "(Optimizer \"AdaptiveStochasticGradientDescent\")\n(MaximumNumberOfIterations {})\n"
      "(AutomaticParameterEstimation \"true\")\n(ASGDParameterEstimationMethod "
      "\"DisplacementDistribution\")\n(RandomSeed 1)\n"
      "(ImageSampler \"RandomCoordinate\")\n(NumberOfSpatialSamples {})\n(NewSamplesEveryIteration "
      "\"true\")\n"
      "(RequiredRatioOfValidSamples 0.05)\n(ErodeMask \"false\")\n"
      "(WriteResultImage \"false\")\n(WriteTransformParametersEachResolution \"false\")\n",
      kResolutions, pyramid_of(job.fixed.geometry().size), pyramid_of(job.moving.geometry().size), kBending,
      job.grid_mm, kIterations, kSamples);
}

/// Not by write_volume: files of a temporary folder are no outputs of a job, which a signal no longer cancels
/// once they have their names.
void write_plain(const fs::path& path, std::string_view content, std::span<const std::int16_t> voxels = {}) {
  std::ofstream file(path, std::ios::binary);
  file << content;
  file.write(reinterpret_cast<const char*>(voxels.data()), static_cast<std::streamsize>(voxels.size_bytes()));
  if (!file.flush()) throw Error("{}: cannot be written; is the disk full?", path.string());
}

void write_meta_image(const Volume& volume, const fs::path& path) {
  const auto& [size, spacing, origin] = volume.geometry();
  write_plain(
      path,
      fmt::format("ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
                  "TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = {} {} {}\nElementSpacing = {} {} {}\n"
                  "DimSize = {} {} {}\nElementType = MET_SHORT\nElementDataFile = LOCAL\n",
                  origin.x, origin.y, origin.z, spacing.x, spacing.y, spacing.z, size.x, size.y, size.z),
      volume.hu());
}

/// What elastix prints: its progress, and its last words.
class Output {
 public:
  Output(const ElastixJob& job, Progress& progress) : progress_(progress) {
    progress.begin(job.stage, kResolutions * kIterations, "iterations");
  }

  void add(std::string_view line) {
    const std::string_view words = trimmed(line);
    if (words.empty()) return;
    // A row of the table of iterations: a number, a tab and others.
    const auto number = words.find_first_not_of("0123456789");
    if (number != 0 && number != std::string_view::npos && words[number] == '\t') {
      if (done_ < kResolutions * kIterations) progress_.advance();
      ++done_;
      return;
    }
    // ITK's exceptions say the cause in a line of their own; what follows says that there was an error.
    const int weight = words.starts_with("Description:")              ? 2
                       : words.find("rror") != std::string_view::npos ? 1
                                                                      : 0;
    if (weight < weight_ || (weight == 2 && weight_ == 2)) return;
    last_ = std::string(words);
    weight_ = weight;
  }

  /// What an exception says; without one the last line that tells of an error, or the last one.
  const std::string& last_words() const { return last_; }

 private:
  Progress& progress_;
  std::string last_;
  int weight_ = 0;  ///< of that line
  std::int64_t done_ = 0;
};

// ---- TransformParameters ----------------------------------------------------------------------------------

/// The lines `(Name value value ...)` of a file.
class ParameterFile {
 public:
  explicit ParameterFile(const fs::path& path) : name_(path.string()) {
    const std::string content = read_whole_file(path);
    for (std::string_view left = content; !left.empty();) {
      std::string_view line = trimmed(take_line(left));
      if (line.empty() || line.front() != '(') continue;
      line = line.substr(1, line.rfind(')') - 1);
      const auto end = std::min(line.find(' '), line.size());
      values_[std::string(line.substr(0, end))] = std::string(trimmed(line.substr(end)));
    }
  }

  /// A text, without its quotes.
  std::string text(const std::string& field) const {
    const auto found = values_.find(field);
    if (found == values_.end()) throw InputError("{}: {} is missing", name_, field);
    const std::string& value = found->second;
    return value.size() >= 2 && value.front() == '"' ? value.substr(1, value.size() - 2) : value;
  }

  /// As many numbers as wanted.
  std::vector<double> numbers(const std::string& field, std::size_t count) const {
    const std::string value = text(field);
    std::vector<double> numbers;
    for (std::string_view left = value; !left.empty();) {
      const auto end = std::min(left.find(' '), left.size());
      double number = 0;
      if (!parse_whole(left.substr(0, end), number))
        throw InputError("{}: {} holds {}, which is no number", name_, field, excerpt(left.substr(0, end)));
      numbers.push_back(number);
      left = trimmed(left.substr(end));
    }
    if (numbers.size() != count)
      throw InputError("{}: {} holds {} numbers, but should hold {}", name_, field, numbers.size(), count);
    return numbers;
  }

  glm::dvec3 vector(const std::string& field) const {
    const std::vector<double> of_axes = numbers(field, 3);
    return {of_axes[0], of_axes[1], of_axes[2]};
  }

  const std::string& name() const { return name_; }

 private:
  std::string name_;
  std::map<std::string, std::string> values_;
};

}  // namespace

std::shared_ptr<const Displacement> read_elastix_spline(const fs::path& path) {
  const ParameterFile file(path);
  if (file.text("Transform") != "BSplineTransform" || file.text("BSplineTransformSplineOrder") != "3" ||
      file.text("UseCyclicTransform") == "true" ||
      file.text("InitialTransformParametersFileName") != "NoInitialTransform")
    throw InputError("{}: is no cubic B-spline alone; run elastix again with BSplineTransform", file.name());
  FieldGrid grid;
  const glm::dvec3 size = file.vector("GridSize"), spacing_mm = file.vector("GridSpacing");
  grid.size = Index3(size);
  grid.origin_mm = file.vector("GridOrigin");
  // ITK's direction by columns: the first three numbers are the first axis.
  const std::vector<double> direction = file.numbers("GridDirection", 9);
  auto number = direction.begin();
  for (int axis = 0; axis < 3; ++axis)
    for (int row = 0; row < 3; ++row) grid.step_mm[axis][row] = *number++ * spacing_mm[axis];
  validate(grid, file.name());
  const auto nodes = static_cast<std::size_t>(grid.nodes());
  const std::vector<double> numbers = file.numbers("TransformParameters", 3 * nodes);
  std::vector<glm::vec3> coefficients_mm(nodes);
  for (std::size_t node = 0; node < nodes; ++node)
    coefficients_mm[node] = {numbers[node], numbers[nodes + node], numbers[2 * nodes + node]};
  return bspline_displacement(grid, std::move(coefficients_mm), 3);
}

void require_elastix(const Progress& progress) {
  if (!run_program(
          {kProgram, "--version"}, [](std::string_view) {}, progress))
    throw InputError(
        "phases are registered by the program elastix, which is not installed; on Debian: apt-get install "
        "elastix");
}

std::shared_ptr<const Displacement> register_by_elastix(const ElastixJob& job, Progress& progress) {
  const TemporaryFolderOnDisk folder("xraycast-elastix-");
  const fs::path fixed = folder.path() / "fixed.mha", moving = folder.path() / "moving.mha",
                 parameters = folder.path() / "parameters.txt",
                 result = folder.path() / "TransformParameters.0.txt";
  write_meta_image(job.fixed, fixed);
  write_meta_image(job.moving, moving);
  write_plain(parameters, parameters_of(job));
  std::vector<std::string> command{kProgram,
                                   "-f",
                                   fixed.string(),
                                   "-m",
                                   moving.string(),
                                   "-p",
                                   parameters.string(),
                                   "-out",
                                   folder.path().string()};
  if (job.mask) {
    const fs::path mask = folder.path() / "mask.mha";
    write_meta_image(*job.mask, mask);
    command.insert(command.end(), {"-fMask", mask.string()});
  }
  Output output(job, progress);
  const std::optional<int> status = run_program(
      command, [&](std::string_view line) { output.add(line); }, progress);
  if (!status) require_elastix(progress);
  if (status != 0 || !fs::exists(result))
    throw Error("{}: elastix failed: {}", job.name,
                output.last_words().empty() ? fmt::format("exit status {}", status.value_or(127))
                                            : output.last_words());
  return read_elastix_spline(result);
}

}  // namespace xraycast
