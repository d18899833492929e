// Image formats in memory.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "apron/run/media/GreyFrame.h"
#include "apron/vm/Plane.h"

namespace apron::run {

using GreyPixels = std::vector<float>;  // 0 to 255, row by row from the top

struct ImageCodec {
  std::string_view extension;
  // The shape is checked before the pixels are unpacked. path is for messages only. Both throw MediaError.
  GreyPixels (*decode)(const std::string& path, std::string_view bytes, const vm::Plane& shape);
  std::string (*encode)(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                        std::uint32_t height);
};

std::span<const ImageCodec> image_codecs();

GreyPixels decode_png(const std::string& path, std::string_view bytes, const vm::Plane& shape);
std::string encode_png(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                       std::uint32_t height);
GreyPixels decode_pgm(const std::string& path, std::string_view bytes, const vm::Plane& shape);
std::string encode_pgm(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                       std::uint32_t height);
// JPEG and BMP.
GreyPixels decode_stb(const std::string& path, std::string_view bytes, const vm::Plane& shape);
std::string encode_jpeg(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                        std::uint32_t height);
// One frame of motion JPEG, which leaves the usual Huffman tables out; false if it is no whole one.
bool decode_mjpeg_frame(std::span<const std::uint8_t> bytes, GreyFrame& frame);
std::string encode_bmp(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                       std::uint32_t height);

}  // namespace apron::run
