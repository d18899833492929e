// A picture in memory and its PNG file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <vector>

namespace apron::ui {

// One line for the user about a file that cannot be written or a program that is missing.
class PictureError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  // height x width x 3, row by row from the top edge; as a screen shows them

  const std::uint8_t* pixel(int x, int y) const {
    return &rgb[(static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                 static_cast<std::size_t>(x)) *
                3];
  }
};

// Writes the file whole or not at all: first beside it as PATH.part, then renamed. Throws PictureError.
void write_png(const std::filesystem::path& path, const Image& image);

}  // namespace apron::ui
