// A module of its own, which slice_morphology.cpp loads. It uses of this project only what headers hold.

#include "xraycast/mask/slice_morphology.hpp"

#include <cstddef>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace xraycast {
namespace {

cv::Mat image_of(const MaskSlice& slice) { return {slice.rows, slice.columns, CV_8UC1, slice.voxels}; }

cv::Mat kernel_of(const StructuringElement& element) {
  const bool is_rectangle = element.shape == StructuringElement::Shape::rectangle;
  return cv::getStructuringElement(is_rectangle ? cv::MORPH_RECT : cv::MORPH_ELLIPSE,
                                   {element.columns, element.rows});
}

class OpenCvMorphology final : public SliceMorphology {
 public:
  OpenCvMorphology() { cv::setNumThreads(1); }  // slices run in parallel already

  void dilate(const MaskSlice& slice, const StructuringElement& element) const override {
    apply(cv::MORPH_DILATE, slice, element);
  }
  void open(const MaskSlice& slice, const StructuringElement& element) const override {
    apply(cv::MORPH_OPEN, slice, element);
  }
  void close(const MaskSlice& slice, const StructuringElement& element) const override {
    apply(cv::MORPH_CLOSE, slice, element);
  }

  void for_each_hole(const MaskSlice& slice,
                     const std::function<void(std::span<const int>)>& visit) const override {
    const cv::Mat background = image_of(slice) == 0;
    cv::Mat labels, stats, centroids;
    const int count = cv::connectedComponentsWithStats(background, labels, stats, centroids, 4, CV_32S);
    std::vector<int> offsets;
    for (int label = 1; label < count; ++label) {
      const int* s = stats.ptr<int>(label);
      const cv::Rect box(s[cv::CC_STAT_LEFT], s[cv::CC_STAT_TOP], s[cv::CC_STAT_WIDTH],
                         s[cv::CC_STAT_HEIGHT]);
      if (box.x == 0 || box.y == 0 || box.br().x == slice.columns || box.br().y == slice.rows) continue;
      offsets.clear();
      for (int y = box.y; y < box.br().y; ++y)
        for (int x = box.x; x < box.br().x; ++x)
          if (labels.at<int>(y, x) == label) offsets.push_back(y * slice.columns + x);
      visit(offsets);
    }
  }

 private:
  static void apply(cv::MorphTypes operation, const MaskSlice& slice, const StructuringElement& element) {
    const cv::Mat image = image_of(slice);
    cv::morphologyEx(image, image, operation, kernel_of(element));
  }
};

}  // namespace
}  // namespace xraycast

extern "C" const xraycast::SliceMorphology* xraycast_morphology() {
  static const xraycast::OpenCvMorphology morphology;
  return &morphology;
}
