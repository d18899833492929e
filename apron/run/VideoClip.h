// A video read frame by frame: uncompressed YUV4MPEG2 files (.y4m), which other tools make of any video.
#pragma once

#include <fstream>
#include <string>

#include "apron/vm/Plane.h"

namespace apron::run {

// All functions throw MediaError. https://wiki.multimedia.cx/index.php/YUV4MPEG2
class VideoClip {
 public:
  explicit VideoClip(const std::string& path);

  // The next frame's luminance, 0 to 255; after the last the first again. The plane must be of the video's
  // shape.
  void read(const vm::Plane& to);

 private:
  bool frame_header();

  std::string path_;
  std::ifstream file_;
  std::streampos first_frame_;
  std::uint32_t width_ = 0, height_ = 0;
  std::size_t colour_bytes_ = 0;  // of a frame, after its luminance
};

}  // namespace apron::run
