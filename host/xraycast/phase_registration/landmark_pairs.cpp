#include "xraycast/phase_registration/landmark_pairs.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/whole_file.hpp"

#include <cmath>
#include <string>
#include <string_view>

namespace xraycast {
namespace {

/// The numbers of a row; none where one of its cells is no finite number.
std::vector<double> numbers_of(std::string_view row) {
  std::vector<double> numbers;
  for (;;) {
    const auto end = std::min(row.find(','), row.size());
    double number = 0;
    if (!parse_whole(trimmed(row.substr(0, end)), number) || !std::isfinite(number)) return {};
    numbers.push_back(number);
    if (end == row.size()) return numbers;
    row = row.substr(end + 1);
  }
}

}  // namespace

std::vector<std::vector<LandmarkPair>> read_landmark_pairs(const std::filesystem::path& path,
                                                           std::size_t phases) {
  const std::string content = read_whole_file(path);
  std::vector<std::vector<LandmarkPair>> pairs(phases);
  int line = 0;
  for (std::string_view left = content; !left.empty();) {
    const std::string_view row = trimmed(take_line(left));
    ++line;
    if (row.empty()) continue;
    const std::vector<double> numbers = numbers_of(row);
    if (numbers.empty() && line == 1) continue;
    if (numbers.size() != 7)
      throw InputError(
          "{}: line {} must be seven numbers: a phase's number, x, y and z in the reference, x, y and z "
          "in the phase, in mm",
          path.string(), line);
    const double number = numbers[0];
    if (!(number >= 1 && number <= static_cast<double>(phases) && number == std::floor(number)))
      throw InputError("{}: line {} is of phase {}, but there are {}; they count from 1", path.string(), line,
                       number, pluralize(phases, "phase"));
    pairs[static_cast<std::size_t>(number) - 1].push_back(
        {{numbers[1], numbers[2], numbers[3]}, {numbers[4], numbers[5], numbers[6]}});
  }
  return pairs;
}

}  // namespace xraycast
