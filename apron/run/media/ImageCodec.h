// Encodes and decodes grey images in memory, by format.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "apron/run/media/GreyFrame.h"
#include "apron/vm/Plane.h"

namespace apron::run {

using GreyPixels = std::vector<float>;  // 0 to 255, row-major from the top

// Both functions throw MediaError; path is for messages only.
struct ImageCodec {
  std::string_view extension;
  // Checks the image's size against the shape before it decodes pixels.
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
// Decodes one frame of Motion JPEG, which may omit the standard Huffman tables. False if it is incomplete.
bool decode_mjpeg_frame(std::span<const std::uint8_t> bytes, GreyFrame& frame);
std::string encode_bmp(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                       std::uint32_t height);

}  // namespace apron::run
