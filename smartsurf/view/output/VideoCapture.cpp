#include "smartsurf/view/output/VideoCapture.h"

#include <algorithm>

namespace smartsurf::view {
namespace {

constexpr int kFramesPerSecond = 30;
constexpr double kMaxGap_s = 1.0;  // longer gaps in simulated time are skipped instead of repeating a frame

}  // namespace

VideoCapture::VideoCapture(const std::string& file, int width, int height, double time_s)
    : file_(file),
      width_(width & ~1),
      height_(height & ~1),
      next_frame_s_(time_s),
      encoder_(file, width_, height_, kFramesPerSecond) {}

void VideoCapture::add(const common::Image& image, double time_s) {
  if (image.width < width_ || image.height < height_) return;
  common::Image cropped{width_, height_, {}};
  cropped.rgb.reserve(static_cast<std::size_t>(width_) * height_ * 3);
  for (int y = 0; y < height_; ++y)
    cropped.rgb.insert(cropped.rgb.end(), image.pixel(0, y),
                       image.pixel(0, y) + 3 * static_cast<std::ptrdiff_t>(width_));
  if (time_s > next_frame_s_ + kMaxGap_s) next_frame_s_ = time_s;
  for (; frame_due(time_s); next_frame_s_ += 1.0 / kFramesPerSecond) encoder_.add(cropped);
}

}  // namespace smartsurf::view
