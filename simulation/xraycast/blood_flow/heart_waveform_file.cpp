#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/blood_flow/heart_waveform.hpp"

#include <string_view>

namespace xraycast {
namespace {

/// Two numbers in a line; false for every other line.
bool parse_sample(std::string_view line, HeartWaveform::Sample& sample) {
  const std::string_view both = trimmed(line);
  const std::size_t first_end = both.find_first_of(", \t");
  if (first_end == std::string_view::npos) return false;
  std::string_view rest = trimmed(both.substr(first_end));
  if (!rest.empty() && rest.front() == ',') rest = trimmed(rest.substr(1));
  return parse_whole(both.substr(0, first_end), sample.time_s) && parse_whole(rest, sample.ml_s);
}

}  // namespace

HeartWaveform HeartWaveform::parse(const std::string& text, const std::string& origin) {
  HeartWaveform waveform;
  std::string_view rest = text;
  for (int line_number = 1; !rest.empty(); ++line_number) {
    const std::string_view line = take_line(rest);
    if (trimmed(line).empty()) continue;
    Sample sample;
    if (parse_sample(line, sample))
      waveform.samples.push_back(sample);
    else if (line_number > 1)
      throw InputError("{}: line {}: \"{}\" is not a time in s and a flow in ml/s, such as 0.12,310", origin,
                       line_number, excerpt(trimmed(line)));
  }
  if (!waveform.samples.empty()) {
    const double first_s = waveform.samples.front().time_s;
    for (Sample& sample : waveform.samples) sample.time_s -= first_s;
  }
  check(waveform, origin);
  return waveform;
}

HeartWaveform HeartWaveform::read(const std::filesystem::path& path) {
  return parse(read_whole_file(path), path.string());
}

}  // namespace xraycast
