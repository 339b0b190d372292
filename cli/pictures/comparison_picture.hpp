#pragma once

#include <filesystem>
#include <span>
#include <string>

namespace xraycast::cli {

/// A frame, the DRR in the same grey window, and their difference side by side, each with its caption, as
/// PNG. The difference is that of the greys, amplified four times about middle grey: bright where the frame
/// is too bright. Pictures are `width` wide; `title` stands above them. Throws InputError when `path` cannot
/// be written, Error when the disk is full.
void write_comparison_picture(const std::string& title, std::span<const float> frame_tau,
                              std::span<const float> drr_tau, int width, const std::filesystem::path& path);

}  // namespace xraycast::cli
