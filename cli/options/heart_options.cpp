#include "options/heart_options.hpp"

#include <memory>

namespace xraycast::cli {

void add_heart_options(CLI::App& command, HeartOptions& options) {
  CLI::Option* rate =
      command
          .add_option(
              "--heart-rate", options.rate_bpm,
              "Heart rate in beats per minute, which paces the blood's flow and pressure; 0: it flows "
              "steadily")
          ->capture_default_str()
          ->type_name("BPM");
  command
      .add_option("--heart-waveform", options.waveform,
                  "What the heart ejects into the aorta over a beat, as measured: lines of a time in s and a "
                  "flow in ml/s. Its mean is the heart's output")
      ->excludes(rate)
      ->type_name("CSV");
}

Blood parse_heart(const HeartOptions& options) {
  Blood blood{.heart_rate_bpm = options.rate_bpm};
  if (!options.waveform.empty())
    blood.heart = std::make_shared<const HeartWaveform>(HeartWaveform::read(options.waveform));
  return blood;
}

}  // namespace xraycast::cli
