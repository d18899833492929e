#include "apron/ui/Image.h"

#include <png.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <system_error>

namespace apron::ui {
namespace {

// "" or what went wrong.
std::string write(const std::string& path, const Image& image) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (file == nullptr) return std::strerror(errno);
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  errno = 0;  // libpng's own word for what went wrong is "Write Error"
  const bool written = png_image_write_to_stdio(&png, file, 0, image.rgb.data(), 0, nullptr) != 0;
  const bool closed = std::fclose(file) == 0;
  if (written && closed) return "";
  return errno != 0 ? std::strerror(errno) : png.message;
}

}  // namespace

void write_png(const std::filesystem::path& path, const Image& image) {
  const std::filesystem::path part = path.string() + ".part";
  std::string wrong = write(part.string(), image);
  std::error_code error;
  if (wrong.empty()) {
    std::filesystem::rename(part, path, error);
    if (!error) return;
    wrong = error.message();
  }
  std::filesystem::remove(part, error);
  throw PictureError(path.string() + ": cannot write this picture: " + wrong);
}

}  // namespace apron::ui
