// Records a window's contents as a video with 30 frames per simulated second.
#pragma once

#include <memory>
#include <string>

#include "common/image/Image.h"
#include "common/video/VideoEncoder.h"

namespace smartsurf::view {

class VideoCapture {
 public:
  // width, height: pixels; odd sizes are cropped by one pixel. time_s: simulated time of the first frame.
  // Throws as common::VideoEncoder does.
  VideoCapture(const std::string& file, int width, int height, double time_s);

  const std::string& file() const { return file_; }
  // True if a frame is due at that simulated time; then call add().
  bool frame_due(double time_s) const { return time_s >= next_frame_s_ - 1e-6; }
  // Adds a frame; the previous one stands until its time. A frame of another size (after a resize) is
  // cropped, or framed in black.
  void add(const common::Image& image, double time_s);
  void finish() { encoder_.finish(); }

 private:
  std::string file_;
  int width_, height_;
  double next_frame_s_;
  common::Image last_{};
  common::VideoEncoder encoder_;
};

}  // namespace smartsurf::view
