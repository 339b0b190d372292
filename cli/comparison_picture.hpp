#pragma once

#include <filesystem>
#include <span>
#include <string>

namespace xraycast::cli {

/// A frame, the true projection in the same grey window, and their difference side by side, each with its
/// caption, as PNG. The difference is that of the greys, four times as strong about middle grey: light where
/// the frame is lighter than it should be. Pictures are `width` wide; `title` stands above them. Throws
/// InputError when `path` cannot be written, Error when the disk is full.
void write_comparison_picture(const std::string& title, std::span<const float> frame_tau,
                              std::span<const float> true_tau, int width, const std::filesystem::path& path);

}  // namespace xraycast::cli
