// A picture in memory and its PNG file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace smartsurf::view {

struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t>
      rgb;  // height × width × 3, row-major, row 0 is the top edge; as a screen shows them

  const std::uint8_t* pixel(int x, int y) const {
    return &rgb[(static_cast<std::size_t>(y) * width + x) * 3];
  }
};

// Writes the file whole or not at all: first beside it as PATH.part, then renamed.
// Throws scene::InputError when it cannot be written (a missing folder, no permission, a full disk).
void write_png(const std::filesystem::path& path, const Image& image);

}  // namespace smartsurf::view
