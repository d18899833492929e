// Encodes images as an MP4 file (H.264) through a pipe to ffmpeg, which must be installed.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>

#include "common/files/NewPart.h"
#include "common/image/Image.h"

namespace common {

class VideoEncoder {
 public:
  // All images have this size, in pixels; both edges are even. The file appears under its name when finish()
  // succeeds; until then it is a NewPart, which no failure leaves behind. Throws UserError when ffmpeg is
  // missing, the name does not end in .mp4, the file cannot be written, or the process cannot be started.
  VideoEncoder(const std::filesystem::path& file, int width, int height, int frames_per_second);
  ~VideoEncoder();  // without finish(): discards the video
  VideoEncoder(const VideoEncoder&) = delete;
  VideoEncoder& operator=(const VideoEncoder&) = delete;

  // Both throw UserError when ffmpeg fails, or makes no progress (Supervisor.h). A failure of add() discards
  // the video; further calls then do nothing.
  void add(const Image& image);
  void finish();

 private:
  void start(int frames_per_second);
  int abandon();  // returns as close_and_wait() does
  int close_and_wait();

  std::filesystem::path file_;
  std::optional<NewPart> part_;
  int width_, height_;
  pid_t child_ = -1;
  int socket_ = -1;
};

}  // namespace common
