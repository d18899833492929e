#include "apron/run/media/ImageFile.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "apron/run/media/ImageCodec.h"
#include "apron/run/media/MediaFile.h"

namespace apron::run {
namespace {

const ImageCodec* find_codec(const std::string& path) {
  const std::string ending = extension(path);
  for (const ImageCodec& c : image_codecs())
    if (c.extension == ending) return &c;
  return nullptr;
}

const ImageCodec& require_codec(const std::string& path) {
  if (const ImageCodec* codec = find_codec(path)) return *codec;
  throw_refused(path, "is not a picture file: the name must end in .png, .pgm, .jpg, .jpeg or .bmp");
}

std::uint8_t to_byte(float value) {
  return value > 0.0F ? static_cast<std::uint8_t>(std::round(std::fmin(value, 255.0F))) : std::uint8_t{0};
}

}  // namespace

bool is_image_name(const std::string& path) { return find_codec(path) != nullptr; }

void read_image(const std::string& path, const vm::Plane& to) {
  const DecodedImage image = require_codec(path).decode(path, read_file(path), &to);
  for (std::uint32_t y = 0; y < to.height; ++y)
    std::copy_n(image.pixels.begin() + std::ptrdiff_t{y} * to.width, to.width, to.row(y));
}

GreyFrame read_frame(const std::string& path) {
  const DecodedImage image = require_codec(path).decode(path, read_file(path), nullptr);
  GreyFrame frame{image.width, image.height, {}};
  frame.pixels.resize(image.pixels.size());
  std::ranges::transform(image.pixels, frame.pixels.begin(), to_byte);
  return frame;
}

void write_image(const std::string& path, const vm::ConstPlane& from) {
  const ImageCodec& image_codec = require_codec(path);
  std::vector<std::uint8_t> pixels;
  pixels.reserve(from.cell_count());
  for (std::uint32_t y = 0; y < from.height; ++y)
    for (std::uint32_t x = 0; x < from.width; ++x) pixels.push_back(to_byte(vm::cell_as_float(from, x, y)));
  write_file(path, image_codec.encode(path, pixels, from.width, from.height));
}

}  // namespace apron::run
