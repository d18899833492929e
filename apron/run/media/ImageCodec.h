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

struct DecodedImage {
  std::uint32_t width = 0, height = 0;  // pixels
  std::vector<float> pixels;            // 0 to 255, row-major from the top
};

// Both functions throw MediaError; path is for messages only.
struct ImageCodec {
  std::string_view extension;
  // Checks the image's size before it decodes pixels: that of the shape, or any if it is null.
  DecodedImage (*decode)(const std::string& path, std::string_view bytes, const vm::Plane* shape);
  std::string (*encode)(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                        std::uint32_t height);
};

std::span<const ImageCodec> image_codecs();

DecodedImage decode_png(const std::string& path, std::string_view bytes, const vm::Plane* shape);
std::string encode_png(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                       std::uint32_t height);
DecodedImage decode_pgm(const std::string& path, std::string_view bytes, const vm::Plane* shape);
std::string encode_pgm(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                       std::uint32_t height);
// JPEG and BMP.
DecodedImage decode_stb(const std::string& path, std::string_view bytes, const vm::Plane* shape);
std::string encode_jpeg(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                        std::uint32_t height);
// Decodes one frame of Motion JPEG, which may omit the standard Huffman tables. False if it is incomplete.
bool decode_mjpeg_frame(std::span<const std::uint8_t> bytes, GreyFrame& frame);
std::string encode_bmp(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                       std::uint32_t height);

}  // namespace apron::run
