#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/blood_flow/heart_waveform.hpp"

#include <string_view>
#include <utility>

namespace xraycast {
namespace {

/// Two numbers in a line without blanks around it; false for every other line.
bool parse_sample(std::string_view line, HeartWaveform::Sample& sample) {
  const std::size_t first_end = line.find_first_of(", \t");
  if (first_end == std::string_view::npos) return false;
  std::string_view rest = trimmed(line.substr(first_end));
  if (!rest.empty() && rest.front() == ',') rest = trimmed(rest.substr(1));
  return parse_whole(line.substr(0, first_end), sample.time_s) && parse_whole(rest, sample.ml_s);
}

/// Of columns.
bool has_names(std::string_view line) {
  const char first = line.front();
  return (first >= 'a' && first <= 'z') || (first >= 'A' && first <= 'Z') || first == '"' || first == '#';
}

}  // namespace

HeartWaveform HeartWaveform::parse(const std::string& text, const std::string& origin) {
  std::vector<Sample> samples;
  std::string_view rest = text;
  if (rest.starts_with("\xEF\xBB\xBF")) rest.remove_prefix(3);  // the byte order mark that spreadsheets write
  bool is_first = true;
  for (int line_number = 1; !rest.empty(); ++line_number) {
    const std::string_view line = trimmed(take_line(rest));
    if (line.empty() || (std::exchange(is_first, false) && has_names(line))) continue;
    Sample sample;
    if (!parse_sample(line, sample))
      throw InputError("{}: line {}: \"{}\" must be a time in s and a flow in ml/s, such as 0.12,310", origin,
                       line_number, excerpt(line));
    samples.push_back(sample);
  }
  return of(std::move(samples), origin);
}

HeartWaveform HeartWaveform::of(std::vector<Sample> samples, const std::string& origin) {
  if (!samples.empty()) {
    const double first_s = samples.front().time_s;
    for (Sample& sample : samples) sample.time_s -= first_s;
  }
  HeartWaveform waveform{std::move(samples)};
  check(waveform, origin);
  return waveform;
}

HeartWaveform HeartWaveform::read(const std::filesystem::path& path) {
  return parse(read_whole_file(path), path.string());
}

}  // namespace xraycast
