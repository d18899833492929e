#include "smartsurf/view/ReadPixels.h"

#include <algorithm>

#include "smartsurf/view/GlObjects.h"

namespace smartsurf::view {

Image read_pixels(unsigned framebuffer, int width, int height) {
  Image image{width, height, std::vector<std::uint8_t>(static_cast<std::size_t>(width) * height * 3)};
  glBindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer);
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glReadPixels(0, 0, width, height, GL_RGB, GL_UNSIGNED_BYTE, image.rgb.data());
  // OpenGL's first row is the bottom one.
  const auto row = [&](int y) { return image.rgb.begin() + static_cast<std::ptrdiff_t>(y) * width * 3; };
  for (int y = 0; y < height / 2; ++y) std::swap_ranges(row(y), row(y + 1), row(height - 1 - y));
  return image;
}

}  // namespace smartsurf::view
