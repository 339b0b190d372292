#include "xraycast/window/cine_exporter.hpp"

namespace xraycast {

CineExporter::CineExporter(const std::filesystem::path& folder, const CArmPose& start)
    : folder_(folder),
      pictures_(folder, kWidth, kHeight),
      animation_(folder / "turn.gif", kWidth, kHeight),
      pose_(start) {
  std::filesystem::create_directories(folder);
}

void CineExporter::export_frame(const Draw& draw) {
  const std::vector<std::uint8_t> rgb = draw(pose_);
  pictures_.add(rgb);
  animation_.add(rgb);
  pose_.rotate(360.0 / kFrames);
  if (++frame_ < kFrames) return;
  pictures_.finish();
  animation_.finish();
}

}  // namespace xraycast
