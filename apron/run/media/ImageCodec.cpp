#include "apron/run/media/ImageCodec.h"

#include <png.h>

#include <algorithm>
#include <cctype>
#include <cstring>

#include "apron/run/media/MediaError.h"
#include "apron/run/media/MediaFile.h"

namespace apron::run {

std::span<const ImageCodec> image_codecs() {
  static constexpr ImageCodec kCodecs[] = {{"png", decode_png, encode_png},
                                           {"pgm", decode_pgm, encode_pgm},
                                           {"jpg", decode_stb, encode_jpeg},
                                           {"jpeg", decode_stb, encode_jpeg},
                                           {"bmp", decode_stb, encode_bmp}};
  return kCodecs;
}

// ---- PNG --------------------------------------------------------------------------------------------------

namespace {

struct PngImage : png_image {
  PngImage() : png_image{} { version = PNG_IMAGE_VERSION; }
  PngImage(const PngImage&) = delete;
  PngImage& operator=(const PngImage&) = delete;
  ~PngImage() { png_image_free(this); }
};

// BT.601, rounded down as stb does for the other formats.
float luma(std::uint32_t red, std::uint32_t green, std::uint32_t blue) {
  return static_cast<float>((77 * red + 150 * green + 29 * blue) >> 8U);
}

// The file without the chunks that relate its values to light, by which libpng would change them.
std::string without_color_space(std::string_view bytes) {
  constexpr std::string_view kChunks[] = {"gAMA", "cHRM", "sRGB", "iCCP", "cICP"};
  std::size_t at = 8;  // after the signature
  std::string kept(bytes.substr(0, at));
  while (at + 12 <= bytes.size()) {
    std::size_t size = 12;  // length, name and checksum, around the data
    for (std::size_t i = 0; i < 4; ++i)
      size += std::size_t{static_cast<unsigned char>(bytes[at + i])} << (24 - 8 * i);
    const std::string_view chunk = bytes.substr(at, size);
    if (std::ranges::find(kChunks, chunk.substr(4, 4)) == std::end(kChunks)) kept += chunk;
    at += chunk.size();
  }
  return kept.append(bytes.substr(std::min(at, bytes.size())));
}

}  // namespace

DecodedImage decode_png(const std::string& path, std::string_view bytes, const vm::Plane* shape) {
  const std::string values = without_color_space(bytes);
  PngImage image;
  if (png_image_begin_read_from_memory(&image, values.data(), values.size()) == 0)
    throw_refused(path, std::string("is not a complete PNG picture: ") + image.message);
  require_size(path, image.width, image.height, shape);
  // libpng's own grey weighs colours in linear light, and takes 16 bits for linear light.
  image.format = PNG_FORMAT_RGBA;
  image.flags |= PNG_IMAGE_FLAG_16BIT_sRGB;
  std::vector<std::uint8_t> pixels(PNG_IMAGE_SIZE(image));
  if (png_image_finish_read(&image, nullptr, pixels.data(), 0, nullptr) == 0)
    throw_refused(path, std::string("is not a complete PNG picture: ") + image.message);
  DecodedImage grey{image.width, image.height, {}};
  grey.pixels.reserve(pixels.size() / 4);
  for (std::size_t i = 0; i < pixels.size(); i += 4)
    grey.pixels.push_back(luma(pixels[i], pixels[i + 1], pixels[i + 2]));
  return grey;
}

std::string encode_png(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                       std::uint32_t height) {
  PngImage image;
  image.width = width;
  image.height = height;
  image.format = PNG_FORMAT_GRAY;
  png_alloc_size_t encoded_size = 0;
  std::string bytes;
  if (png_image_write_to_memory(&image, nullptr, &encoded_size, 0, pixels.data(), 0, nullptr) != 0) {
    bytes.resize(encoded_size);
    if (png_image_write_to_memory(&image, bytes.data(), &encoded_size, 0, pixels.data(), 0, nullptr) != 0)
      return bytes;
  }
  throw MediaError(vm::HostStatus::kFailed, "cannot encode '" + path + "': " + image.message);
}

// ---- PGM: https://netpbm.sourceforge.net/doc/pgm.html -----------------------------------------------------

namespace {

class PgmReader {
 public:
  PgmReader(const std::string& path, std::string_view bytes) : path_(path), bytes_(bytes) {}

  std::uint32_t read_number() {
    skip_whitespace();
    std::uint32_t value = 0;
    const std::size_t begin = position_;
    for (; position_ < bytes_.size() && std::isdigit(static_cast<unsigned char>(bytes_[position_])) != 0;
         ++position_)
      if ((value = value * 10 + static_cast<std::uint32_t>(bytes_[position_] - '0')) > 100'000'000)
        throw_invalid();
    if (position_ == begin) throw_invalid();
    return value;
  }
  // Reads a big-endian number of one or two bytes.
  std::uint32_t read_raw(std::size_t size) {
    if (bytes_.size() - position_ < size) throw_invalid();
    std::uint32_t value = 0;
    while (size-- > 0) value = value << 8 | static_cast<unsigned char>(bytes_[position_++]);
    return value;
  }
  [[noreturn]] void throw_invalid() const { throw_refused(path_, "is not a complete PGM picture"); }

 private:
  void skip_whitespace() {
    for (; position_ < bytes_.size(); ++position_) {
      if (bytes_[position_] == '#')
        while (position_ + 1 < bytes_.size() && bytes_[position_] != '\n') ++position_;
      else if (std::isspace(static_cast<unsigned char>(bytes_[position_])) == 0)
        return;
    }
  }

  const std::string& path_;
  std::string_view bytes_;
  std::size_t position_ = 2;  // after "P5" or "P2"
};

}  // namespace

DecodedImage decode_pgm(const std::string& path, std::string_view bytes, const vm::Plane* shape) {
  PgmReader reader(path, bytes);
  const bool plain = bytes.starts_with("P2");
  if (!plain && !bytes.starts_with("P5")) reader.throw_invalid();
  const std::uint32_t width = reader.read_number(), height = reader.read_number(),
                      max_value = reader.read_number();
  require_size(path, width, height, shape);
  if (max_value == 0 || max_value > 65535) reader.throw_invalid();
  if (!plain) (void)reader.read_raw(1);  // the single whitespace before the pixels
  DecodedImage image{width, height, std::vector<float>(std::size_t{width} * height)};
  for (float& pixel : image.pixels) {
    const std::uint32_t value = plain ? reader.read_number() : reader.read_raw(max_value > 255 ? 2 : 1);
    if (value > max_value) reader.throw_invalid();
    pixel = max_value == 255 ? static_cast<float>(value)
                             : static_cast<float>(value) * 255.0F / static_cast<float>(max_value);
  }
  return image;
}

std::string encode_pgm(const std::string&, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                       std::uint32_t height) {
  std::string bytes = "P5\n" + std::to_string(width) + " " + std::to_string(height) + "\n255\n";
  return bytes.append(pixels.begin(), pixels.end());
}

}  // namespace apron::run
