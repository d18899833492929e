#include "common/image/Png.h"

#include <png.h>

#include <string>

#include "common/error/UserError.h"
#include "common/files/AtomicFile.h"
#include "common/files/ReadFile.h"

namespace common {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& reason) {
  throw UserError(path.string() + ": cannot write this picture: " + reason);
}

}  // namespace

Image read_png(const std::filesystem::path& path) {
  constexpr std::size_t kMaxBytes = std::size_t{1} << 28, kMaxPixels = std::size_t{1} << 26;
  std::string encoded;
  const auto fail_to_read = [&](const std::string& reason) {
    throw UserError(path.string() + ": cannot read this picture: " + reason);
  };
  if (const std::error_code error = read_file(path, kMaxBytes, encoded)) fail_to_read(error.message());
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  if (png_image_begin_read_from_memory(&png, encoded.data(), encoded.size()) == 0) fail_to_read(png.message);
  png.format = PNG_FORMAT_RGB;
  if (std::size_t{png.width} * png.height > kMaxPixels) {
    png_image_free(&png);
    fail_to_read("it is too large");
  }
  Image image{static_cast<int>(png.width), static_cast<int>(png.height), {}};
  image.rgb.resize(PNG_IMAGE_SIZE(png));
  const png_color white{255, 255, 255};
  if (png_image_finish_read(&png, &white, image.rgb.data(), 0, nullptr) == 0) fail_to_read(png.message);
  return image;
}

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
