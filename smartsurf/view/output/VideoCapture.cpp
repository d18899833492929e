#include "smartsurf/view/output/VideoCapture.h"

#include <algorithm>

namespace smartsurf::view {
namespace {

constexpr int kFramesPerSecond = 30;
constexpr double kLongestStill_s = 1.0;  // a jump in time is not filled up with stills

}  // namespace

VideoCapture::VideoCapture(const std::string& file, int width, int height, double time_s)
    : file_(file),
      width_(width & ~1),
      height_(height & ~1),
      next_s_(time_s),
      writer_(file, width_, height_, kFramesPerSecond) {}

void VideoCapture::add(const common::Image& image, double time_s) {
  if (image.width < width_ || image.height < height_) return;
  common::Image cut{width_, height_, {}};
  cut.rgb.reserve(static_cast<std::size_t>(width_) * height_ * 3);
  for (int y = 0; y < height_; ++y)
    cut.rgb.insert(cut.rgb.end(), image.pixel(0, y),
                   image.pixel(0, y) + 3 * static_cast<std::ptrdiff_t>(width_));
  if (time_s > next_s_ + kLongestStill_s) next_s_ = time_s;
  for (; due(time_s); next_s_ += 1.0 / kFramesPerSecond) writer_.add(cut);
}

}  // namespace smartsurf::view
