// Picture formats in memory, one entry each.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "apron/run/GreyFrame.h"
#include "apron/vm/Plane.h"

namespace apron::run {

using Grey = std::vector<float>;  // 0 to 255, row by row from the top

struct ImageCodec {
  std::string_view ending;
  // The shape is checked before the pixels are unpacked. path is for messages only. Both throw MediaError.
  Grey (*decode)(const std::string& path, std::string_view bytes, const vm::Plane& shape);
  std::string (*encode)(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                        std::uint32_t height);
};

std::span<const ImageCodec> image_codecs();

Grey decode_png(const std::string& path, std::string_view bytes, const vm::Plane& shape);
std::string encode_png(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                       std::uint32_t height);
Grey decode_pgm(const std::string& path, std::string_view bytes, const vm::Plane& shape);
std::string encode_pgm(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                       std::uint32_t height);
// JPEG and BMP.
Grey decode_stb(const std::string& path, std::string_view bytes, const vm::Plane& shape);
std::string encode_jpeg(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                        std::uint32_t height);
// One frame of motion JPEG, which leaves the usual Huffman tables out; false if it is no whole one.
bool decode_motion_jpeg(std::span<const std::uint8_t> bytes, GreyFrame& frame);
std::string encode_bmp(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                       std::uint32_t height);

}  // namespace apron::run
