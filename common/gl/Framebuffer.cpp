#include "common/gl/Framebuffer.h"

#include <epoxy/gl.h>

#include <algorithm>

namespace common {

Image read_framebuffer(int width, int height) {
  Image image{width, height, std::vector<std::uint8_t>(std::size_t{3} * width * height)};
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glReadPixels(0, 0, width, height, GL_RGB, GL_UNSIGNED_BYTE, image.rgb.data());
  // OpenGL's first row is the bottom row.
  const auto row = [&](int y) { return image.rgb.begin() + std::ptrdiff_t{y} * width * 3; };
  for (int y = 0; y < height / 2; ++y) std::swap_ranges(row(y), row(y + 1), row(height - 1 - y));
  return image;
}

}  // namespace common
