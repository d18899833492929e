#include "apron/run/ImageCodec.h"

#include <png.h>

#include <cctype>
#include <cstring>

#include "apron/run/MediaError.h"
#include "apron/run/MediaFile.h"

namespace apron::run {

std::span<const ImageCodec> image_codecs() {
  static constexpr ImageCodec kCodecs[] = {{"png", decode_png, encode_png},
                                           {"pgm", decode_pgm, encode_pgm},
                                           {"jpg", decode_stb, encode_jpeg},
                                           {"jpeg", decode_stb, encode_jpeg},
                                           {"bmp", decode_stb, encode_bmp}};
  return kCodecs;
}

// ---- PNG
// ------------------------------------------------------------------------------------------------------
namespace {

struct PngImage : png_image {
  PngImage() : png_image{} { version = PNG_IMAGE_VERSION; }
  PngImage(const PngImage&) = delete;
  PngImage& operator=(const PngImage&) = delete;
  ~PngImage() { png_image_free(this); }
};

}  // namespace

Grey decode_png(const std::string& path, std::string_view bytes, const vm::Plane& shape) {
  PngImage image;
  if (png_image_begin_read_from_memory(&image, bytes.data(), bytes.size()) == 0)
    refuse(path, std::string("is not a whole PNG picture: ") + image.message);
  require_shape(path, image.width, image.height, shape);
  image.format = PNG_FORMAT_GRAY;
  std::vector<std::uint8_t> pixels(shape.cell_count());
  const png_color black{0, 0, 0};  // behind transparent pixels
  if (png_image_finish_read(&image, &black, pixels.data(), 0, nullptr) == 0)
    refuse(path, std::string("is not a whole PNG picture: ") + image.message);
  return {pixels.begin(), pixels.end()};
}

std::string encode_png(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                       std::uint32_t height) {
  PngImage image;
  image.width = width;
  image.height = height;
  image.format = PNG_FORMAT_GRAY;
  png_alloc_size_t size = 0;
  std::string bytes;
  if (png_image_write_to_memory(&image, nullptr, &size, 0, pixels.data(), 0, nullptr) != 0) {
    bytes.resize(size);
    if (png_image_write_to_memory(&image, bytes.data(), &size, 0, pixels.data(), 0, nullptr) != 0)
      return bytes;
  }
  throw MediaError(vm::HostStatus::kFailed, "cannot encode '" + path + "': " + image.message);
}

// ---- PGM: https://netpbm.sourceforge.net/doc/pgm.html
// ----------------------------------------------------------
namespace {

class PgmReader {
 public:
  PgmReader(const std::string& path, std::string_view bytes) : path_(path), bytes_(bytes) {}

  std::uint32_t number() {
    skip_blanks();
    std::uint32_t value = 0;
    const std::size_t begin = at_;
    for (; at_ < bytes_.size() && std::isdigit(static_cast<unsigned char>(bytes_[at_])) != 0; ++at_)
      if ((value = value * 10 + static_cast<std::uint32_t>(bytes_[at_] - '0')) > 100'000'000) broken();
    if (at_ == begin) broken();
    return value;
  }
  // One byte, or two with the high one first.
  std::uint32_t raw(std::size_t size) {
    if (bytes_.size() - at_ < size) broken();
    std::uint32_t value = 0;
    while (size-- > 0) value = value << 8 | static_cast<unsigned char>(bytes_[at_++]);
    return value;
  }
  [[noreturn]] void broken() const { refuse(path_, "is not a whole PGM picture"); }

 private:
  void skip_blanks() {
    for (; at_ < bytes_.size(); ++at_) {
      if (bytes_[at_] == '#')
        while (at_ + 1 < bytes_.size() && bytes_[at_] != '\n') ++at_;
      else if (std::isspace(static_cast<unsigned char>(bytes_[at_])) == 0)
        return;
    }
  }

  const std::string& path_;
  std::string_view bytes_;
  std::size_t at_ = 2;  // after "P5" or "P2"
};

}  // namespace

Grey decode_pgm(const std::string& path, std::string_view bytes, const vm::Plane& shape) {
  PgmReader reader(path, bytes);
  const bool plain = bytes.starts_with("P2");
  if (!plain && !bytes.starts_with("P5")) reader.broken();
  const std::uint32_t width = reader.number(), height = reader.number(), white = reader.number();
  require_shape(path, width, height, shape);
  if (white == 0 || white > 65535) reader.broken();
  if (!plain) (void)reader.raw(1);  // the one blank before the pixels
  Grey pixels(shape.cell_count());
  for (float& p : pixels) {
    const std::uint32_t value = plain ? reader.number() : reader.raw(white > 255 ? 2 : 1);
    if (value > white) reader.broken();
    p = white == 255 ? static_cast<float>(value)
                     : static_cast<float>(value) * 255.0F / static_cast<float>(white);
  }
  return pixels;
}

std::string encode_pgm(const std::string&, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                       std::uint32_t height) {
  std::string bytes = "P5\n" + std::to_string(width) + " " + std::to_string(height) + "\n255\n";
  return bytes.append(pixels.begin(), pixels.end());
}

}  // namespace apron::run
