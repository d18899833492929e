#include "smartsurf/view/output/VideoCapture.h"

#include <algorithm>
#include <utility>

namespace smartsurf::view {
namespace {

constexpr int kFramesPerSecond = 30;
constexpr double kFramePeriod_s = 1.0 / kFramesPerSecond;
constexpr double kMaxGap_s = 1.0;  // longer gaps in simulated time are skipped instead of repeating a frame

}  // namespace

VideoCapture::VideoCapture(const std::string& file, int width, int height, double time_s)
    : file_(file),
      width_(width & ~1),
      height_(height & ~1),
      next_frame_s_(time_s),
      encoder_(file, width_, height_, kFramesPerSecond) {}

void VideoCapture::add(const common::Image& image, double time_s) {
  common::Image canvas{width_, height_, std::vector<std::uint8_t>(std::size_t{3} * width_ * height_)};
  const int columns = std::min(width_, image.width), rows = std::min(height_, image.height);
  const int left = (width_ - columns) / 2, top = (height_ - rows) / 2;
  for (int y = 0; y < rows; ++y) {
    const std::uint8_t* const from = image.pixel((image.width - columns) / 2, (image.height - rows) / 2 + y);
    std::copy_n(from, 3 * columns, &canvas.rgb[std::size_t{3} * ((top + y) * width_ + left)]);
  }
  if (time_s > next_frame_s_ + kMaxGap_s) next_frame_s_ = time_s;
  for (; frame_due(time_s); next_frame_s_ += kFramePeriod_s)
    encoder_.add(frame_due(time_s - kFramePeriod_s) && !last_.rgb.empty() ? last_ : canvas);
  last_ = std::move(canvas);
}

}  // namespace smartsurf::view
