#include "apron/run/ImageFile.h"

#include <cmath>
#include <cstdint>
#include <vector>

#include "apron/run/ImageCodec.h"
#include "apron/run/MediaFile.h"

namespace apron::run {
namespace {

const ImageCodec& codec(const std::string& path) {
  const std::string ending = extension(path);
  for (const ImageCodec& c : image_codecs())
    if (c.ending == ending) return c;
  refuse(path, "is no picture file: the name must end in .png, .pgm, .jpg, .jpeg or .bmp");
}

}  // namespace

void read_image(const std::string& path, const vm::Plane& to) {
  const ImageCodec& format = codec(path);
  const Grey picture = format.decode(path, read_file(path), to);
  for (std::uint32_t y = 0; y < to.height; ++y)
    for (std::uint32_t x = 0; x < to.width; ++x) to.row(y)[x] = picture[std::size_t{y} * to.width + x];
}

void write_image(const std::string& path, const vm::ConstPlane& from) {
  const ImageCodec& format = codec(path);
  std::vector<std::uint8_t> pixels;
  pixels.reserve(from.cell_count());
  for (std::uint32_t y = 0; y < from.height; ++y)
    for (std::uint32_t x = 0; x < from.width; ++x) {
      const float value = from.row(y)[x];
      pixels.push_back(value > 0.0F ? static_cast<std::uint8_t>(std::round(std::fmin(value, 255.0F)))
                                    : std::uint8_t{0});
    }
  write_file(path, format.encode(path, pixels, from.width, from.height));
}

}  // namespace apron::run
