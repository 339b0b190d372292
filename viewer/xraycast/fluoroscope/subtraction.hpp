#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// How far a mask's picture is moved, in pixels.
struct PixelShift {
  double right = 0, down = 0;
  friend bool operator==(const PixelShift&, const PixelShift&) = default;
};

/// Digital subtraction angiography: the picture of what has come since the mask was taken.
///
/// Pictures are optical depths as a detector measures them, minus the logarithm of its signal, up to a
/// constant; height x width, row 0 on top. A difference is above zero where a frame attenuates more than the
/// mask. Subtracting two frames doubles the variance of the noise; a mask of k frames adds a k-th only.
class Subtraction {
 public:
  Subtraction(int width, int height);

  /// Adds a frame to the mask, which is the mean of all that were added. Throws InputError, with `name` in
  /// front, for a picture of another size.
  void add_to_mask(std::span<const float> frame, const std::string& name = "mask");

  /// Another mask instead of all that were added, one frame. Throws as add_to_mask.
  void set_mask(std::span<const float> frame);

  int mask_frames() const { return mask_frames_; }

  /// Moves the mask under the frames (pixel shift), to fractions of a pixel by cubic interpolation; beyond
  /// its edge the mask continues as it ends.
  void shift_mask(PixelShift shift);

  /// The frame minus the mask; zeros while there is no mask. The size must be the mask's.
  void subtract(std::span<const float> frame, std::span<float> difference);

 private:
  void move_mask();

  int width_, height_, mask_frames_ = 0;
  PixelShift shift_;
  std::vector<float> mask_, moved_;
  bool is_moved_ = true;  ///< `moved_` is up to date
};

/// Keeps, for every pixel, the largest of all differences that it has seen: a vessel tree that fills bit by
/// bit is shown as a whole (maximum opacification, "trace subtract").
class MaximumOpacification {
 public:
  void add(std::span<const float> difference);
  void clear() { largest_.clear(); }

  /// Empty until a difference was added.
  std::span<const float> picture() const { return largest_; }

 private:
  std::vector<float> largest_;
};

/// Greys of differences: zero is light, contrast agent dark.
struct SubtractionWindow {
  double black = 0.3;       ///< the optical depth of black
  double background = 0.8;  ///< the grey of zero, 0 to 1
};

/// 8-bit greys.
std::vector<std::uint8_t> subtraction_greys(std::span<const float> difference,
                                            const SubtractionWindow& window);

/// The same as RGB.
std::vector<std::uint8_t> subtraction_picture(std::span<const float> difference,
                                              const SubtractionWindow& window);

/// A window for a single picture: black is what a thousandth of the pixels exceed.
SubtractionWindow automatic_subtraction_window(std::span<const float> difference);

}  // namespace xraycast
