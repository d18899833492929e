// A video of a window's contents, 30 frames per simulated second.
#pragma once

#include <memory>
#include <string>

#include "common/image/Image.h"
#include "common/video/VideoEncoder.h"

namespace smartsurf::view {

class VideoCapture {
 public:
  // Throws as VideoWriter does. Odd edges lose a pixel.
  VideoCapture(const std::string& file, int width, int height, double time_s);

  const std::string& file() const { return file_; }
  // Whether a picture is due at that time; one that is due must be added.
  bool frame_due(double time_s) const { return time_s >= next_frame_s_ - 1e-6; }
  // A picture of the same size, or any other once the window was resized: then it is left out.
  void add(const common::Image& image, double time_s);
  void finish() { encoder_.finish(); }

 private:
  std::string file_;
  int width_, height_;
  double next_frame_s_;
  common::VideoEncoder encoder_;
};

}  // namespace smartsurf::view
