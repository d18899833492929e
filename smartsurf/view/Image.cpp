#include "smartsurf/view/Image.h"

#include <png.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <system_error>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::view {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& reason) {
  throw scene::InputError(path.string() + ": cannot write this picture: " + reason);
}

}  // namespace

void write_png(const std::filesystem::path& path, const Image& image) {
  std::filesystem::path part = path;
  part += ".part";
  std::FILE* file = std::fopen(part.c_str(), "wb");
  if (!file) fail(path, std::strerror(errno));
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  errno = 0;  // libpng's own word for what went wrong is "Write Error"
  const bool written = png_image_write_to_stdio(&png, file, 0, image.rgb.data(), 0, nullptr) != 0;
  const bool closed = std::fclose(file) == 0;
  std::error_code error;
  if (written && closed) {
    std::filesystem::rename(part, path, error);
    if (!error) return;
  }
  const std::string reason = error ? error.message() : errno != 0 ? std::strerror(errno) : png.message;
  std::filesystem::remove(part, error);
  fail(path, reason);
}

}  // namespace smartsurf::view
