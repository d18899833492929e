// Reads uncompressed YUV4MPEG2 videos (.y4m) frame by frame.
#pragma once

#include <fstream>
#include <string>

#include "apron/run/media/GreyFrame.h"
#include "apron/vm/Plane.h"

namespace apron::run {

// All functions throw MediaError. https://wiki.multimedia.cx/index.php/YUV4MPEG2
class Y4mReader {
 public:
  explicit Y4mReader(const std::string& path);

  // Copies the next frame's luminance, 0 to 255, to a plane of the video's shape. Loops at the end.
  void read_frame(const vm::Plane& to);
  // Like read_frame(), without a shape check. The reference is valid until the next call.
  const GreyFrame& next_frame();

 private:
  bool read_frame_header();

  std::string path_;
  std::ifstream file_;
  std::streampos first_frame_;
  GreyFrame frame_;
  std::size_t chroma_bytes_ = 0;  // per frame, following the luminance
};

}  // namespace apron::run
