// Writes pictures as a film: a pipe to ffmpeg, which must be installed.
#pragma once

#include <sys/types.h>

#include <filesystem>

#include "apron/ui/Image.h"

namespace apron::ui {

class Film {
 public:
  // All pictures will have that size, both edges even. The file appears under its name when finish()
  // succeeds; until then it is FILE.part.mp4. Throws PictureError when ffmpeg is missing, the name does not
  // end in .mp4, or there is no such folder.
  Film(const std::filesystem::path& file, int width, int height, int frames_per_second);
  ~Film();  // without finish(): nothing is left behind
  Film(const Film&) = delete;
  Film& operator=(const Film&) = delete;

  // Both throw PictureError when ffmpeg gives up.
  void add(const Image& image);
  void finish();

 private:
  void start(int width, int height, int frames_per_second);
  int end();

  std::filesystem::path file_, part_;
  pid_t child_ = -1;
  int pipe_ = -1;
};

}  // namespace apron::ui
