#include "common/image/Png.h"

#include <png.h>

#include <string>

#include "common/error/UserError.h"
#include "common/files/AtomicFile.h"

namespace common {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& reason) {
  throw UserError(path.string() + ": cannot write this picture: " + reason);
}

}  // namespace

void write_png(const std::filesystem::path& path, const Image& image) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  // The upper bound saves encoding the image once more for its size.
  png_alloc_size_t bytes = PNG_IMAGE_PNG_SIZE_MAX(png);
  std::string encoded(bytes, '\0');
  if (png_image_write_to_memory(&png, encoded.data(), &bytes, 0, image.rgb.data(), 0, nullptr) == 0)
    fail(path, png.message);
  encoded.resize(bytes);
  if (const std::error_code error = replace_file(path, encoded)) fail(path, error.message());
}

}  // namespace common
