// Writes pictures as a film: a pipe to ffmpeg, which must be installed.
#pragma once

#include <filesystem>
#include <memory>

#include "smartsurf/view/Image.h"

namespace smartsurf::view {

class VideoWriter {
 public:
  // All pictures will have that size, both edges even. The file appears under its name when finish()
  // succeeds; until then it is FILE.part.mp4. Throws scene::InputError when ffmpeg is missing, the name does
  // not end in .mp4, or the folder does not exist.
  VideoWriter(const std::filesystem::path& file, int width, int height, int frames_per_second);
  ~VideoWriter();  // without finish(): nothing is left behind

  // Throws std::runtime_error when ffmpeg gives up.
  void add(const Image&);
  void finish();

 private:
  struct Pipe;
  std::unique_ptr<Pipe> pipe_;
};

}  // namespace smartsurf::view
