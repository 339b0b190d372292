#pragma once

#include <cstdint>
#include <vector>

namespace xraycast {

/// From the detector's codes to the greys on the display: logarithm, edge enhancement, recursive temporal
/// filter, window. The window has a fixed width and follows the level of the measuring field.
class DisplayChain {
 public:
  /// For pictures of that size; forgets earlier ones.
  void restart(int width, int height);

  /// The next frame is filtered with none before.
  void forget() { is_first_ = true; }

  /// Makes the table of logarithms unless it is there.
  void set_codes(int bits, float dark);
  void take_logarithm(const std::uint16_t* codes, int count, float* logarithm) const;

  /// The logarithm that is shown in medium grey.
  void set_level(double logarithm) { level_ = logarithm; }

  /// One frame: between these calls the rows, in any order, on any threads. Recorded frames are not filtered
  /// over time.
  void begin(bool is_recording, bool is_processed);
  void show_row(const std::vector<float>& logarithm, int row, std::uint8_t* grey);
  void end() { is_first_ = false; }

 private:
  int width_ = 0, height_ = 0, bits_ = 0;
  float dark_ = 0, weight_ = 1;
  bool is_first_ = true, is_processed_ = true;
  double level_ = 0;
  std::vector<float> logarithms_;  ///< of every code
  std::vector<float> filtered_;    ///< of the frames so far
};

}  // namespace xraycast
