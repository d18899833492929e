#include "apron/run/media/ImageFile.h"

#include <cmath>
#include <cstdint>
#include <vector>

#include "apron/run/media/ImageCodec.h"
#include "apron/run/media/MediaFile.h"

namespace apron::run {
namespace {

const ImageCodec& find_codec(const std::string& path) {
  const std::string ending = extension(path);
  for (const ImageCodec& c : image_codecs())
    if (c.extension == ending) return c;
  throw_refused(path, "is not a picture file: the name must end in .png, .pgm, .jpg, .jpeg or .bmp");
}

}  // namespace

void read_image(const std::string& path, const vm::Plane& to) {
  const ImageCodec& image_codec = find_codec(path);
  const GreyPixels pixels = image_codec.decode(path, read_file(path), to);
  for (std::uint32_t y = 0; y < to.height; ++y)
    for (std::uint32_t x = 0; x < to.width; ++x) to.row(y)[x] = pixels[std::size_t{y} * to.width + x];
}

void write_image(const std::string& path, const vm::ConstPlane& from) {
  const ImageCodec& image_codec = find_codec(path);
  std::vector<std::uint8_t> pixels;
  pixels.reserve(from.cell_count());
  for (std::uint32_t y = 0; y < from.height; ++y)
    for (std::uint32_t x = 0; x < from.width; ++x) {
      const float value = from.row(y)[x];
      pixels.push_back(value > 0.0F ? static_cast<std::uint8_t>(std::round(std::fmin(value, 255.0F)))
                                    : std::uint8_t{0});
    }
  write_file(path, image_codec.encode(path, pixels, from.width, from.height));
}

}  // namespace apron::run
