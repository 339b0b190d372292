#include "calls/blood.hpp"

#include "calls/arguments.hpp"
#include "calls/values.hpp"
#include "xraycast/base/error.hpp"

#include <memory>
#include <utility>
#include <vector>

namespace xraycast::python {
namespace {

HeartWaveform waveform_of(const nb::object& given) {
  if (is_path(given)) return HeartWaveform::read(path_of(given));
  const Numbers numbers = numbers_of(given, "heart_waveform");
  if (numbers.shape.size() != 2 || numbers.shape[1] != 2)
    throw InputError("heart_waveform: must be a file or (samples, 2): time in s and flow in ml/s");
  std::vector<HeartWaveform::Sample> samples;
  for (std::size_t i = 0; i < numbers.shape[0]; ++i)
    samples.push_back({numbers.values[2 * i], numbers.values[2 * i + 1]});
  return HeartWaveform::of(std::move(samples), "heart_waveform");
}

}  // namespace

Blood blood_of(const nb::object& heart_rate_bpm, const nb::object& heart_waveform) {
  Blood blood;
  if (!heart_rate_bpm.is_none() && !heart_waveform.is_none())
    throw InputError("heart_waveform: paces the heart; leave heart_rate_bpm out");
  if (!heart_rate_bpm.is_none()) blood.heart_rate_bpm = number_of(heart_rate_bpm, "heart_rate_bpm");
  if (!heart_waveform.is_none())
    blood.heart = std::make_shared<const HeartWaveform>(waveform_of(heart_waveform));
  return blood;
}

}  // namespace xraycast::python
