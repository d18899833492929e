// JPEG and BMP through the single-header stb libraries, whose implementation is compiled only here.
#include <cstring>
#include <memory>

#include "apron/run/media/ImageCodec.h"
#include "apron/run/media/MediaError.h"
#include "apron/run/media/MediaFile.h"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wall"
#pragma GCC diagnostic ignored "-Wextra"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#define STB_IMAGE_STATIC
#define STB_IMAGE_IMPLEMENTATION
#define STBI_ONLY_JPEG
#define STBI_ONLY_BMP
#define STBI_NO_STDIO
#include <stb/stb_image.h>
#define STB_IMAGE_WRITE_STATIC
#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STBI_WRITE_NO_STDIO
#include <stb/stb_image_write.h>
#pragma GCC diagnostic pop

namespace apron::run {
namespace {

constexpr int kJpegQuality = 95;
constexpr unsigned char kHuffmanTables = 0xC4, kStartOfScan = 0xDA;  // JPEG markers DHT and SOS

void append_bytes(void* bytes, void* data, int size) {
  static_cast<std::string*>(bytes)->append(static_cast<const char*>(data), size);
}

// The offset of the first JPEG segment with this marker, before the scan data; npos if there is none.
std::size_t find_segment(std::string_view jpeg, unsigned char marker) {
  std::size_t at = 2;  // after the start-of-image marker
  while (at + 4 <= jpeg.size() && jpeg[at] == '\xFF') {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(jpeg[at + i]); };
    if (byte(1) == marker) return at;
    if (byte(1) == kStartOfScan) break;
    at += 2U + (std::size_t{byte(2)} << 8 | byte(3));
  }
  return std::string_view::npos;
}

// The Huffman tables of annex K of the JPEG standard, taken from an image written by stb's encoder.
const std::string& standard_huffman_tables() {
  static const std::string tables = [] {
    const std::string jpeg = encode_jpeg("", {128}, 1, 1);
    const std::size_t at = find_segment(jpeg, kHuffmanTables);
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(jpeg[at + i]); };
    return jpeg.substr(at, 2U + (std::size_t{byte(2)} << 8 | byte(3)));
  }();
  return tables;
}

// stb gives no reason for some failures, and then keeps that of an earlier one.
void forget_failures() { stbi__g_failure_reason = nullptr; }

std::string failure_reason() {
  const char* const reason = stbi_failure_reason();
  return reason == nullptr ? "" : std::string(": ") + reason;
}

std::string require_encoded(const std::string& path, int written, std::string bytes) {
  if (written == 0) throw MediaError(vm::HostStatus::kFailed, "cannot encode '" + path + "'");
  return bytes;
}

}  // namespace

DecodedImage decode_stb(const std::string& path, std::string_view bytes, const vm::Plane* shape) {
  const auto* data = reinterpret_cast<const stbi_uc*>(bytes.data());
  const int size = static_cast<int>(std::min<std::size_t>(bytes.size(), 1U << 30));
  int width = 0, height = 0, channels = 0;
  forget_failures();
  if (stbi_info_from_memory(data, size, &width, &height, &channels) == 0)
    throw_refused(path, "is not a JPEG or BMP picture" + failure_reason());
  const auto columns = static_cast<std::uint32_t>(width), rows = static_cast<std::uint32_t>(height);
  require_size(path, columns, rows, shape);
  forget_failures();
  const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(
      stbi_load_from_memory(data, size, &width, &height, &channels, 1), stbi_image_free);
  if (!pixels) throw_refused(path, "is not a complete JPEG or BMP picture" + failure_reason());
  return {columns, rows, {pixels.get(), pixels.get() + std::size_t{columns} * rows}};
}

bool decode_mjpeg_frame(std::span<const std::uint8_t> bytes, GreyFrame& frame) {
  std::string jpeg(bytes.begin(), bytes.end());
  if (find_segment(jpeg, kHuffmanTables) == std::string::npos) {
    const std::size_t scan = find_segment(jpeg, kStartOfScan);
    if (scan == std::string::npos) return false;
    jpeg.insert(scan, standard_huffman_tables());
  }
  int width = 0, height = 0, channels = 0;
  const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(
      stbi_load_from_memory(reinterpret_cast<const stbi_uc*>(jpeg.data()), static_cast<int>(jpeg.size()),
                            &width, &height, &channels, 1),
      stbi_image_free);
  if (!pixels) return false;
  frame.width = static_cast<std::uint32_t>(width);
  frame.height = static_cast<std::uint32_t>(height);
  frame.pixels.assign(pixels.get(), pixels.get() + std::size_t{frame.width} * frame.height);
  return true;
}

std::string encode_jpeg(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                        std::uint32_t height) {
  std::string bytes;
  const int written = stbi_write_jpg_to_func(append_bytes, &bytes, static_cast<int>(width),
                                             static_cast<int>(height), 1, pixels.data(), kJpegQuality);
  return require_encoded(path, written, std::move(bytes));
}

std::string encode_bmp(const std::string& path, const std::vector<std::uint8_t>& pixels, std::uint32_t width,
                       std::uint32_t height) {
  std::string bytes;
  const int written = stbi_write_bmp_to_func(append_bytes, &bytes, static_cast<int>(width),
                                             static_cast<int>(height), 1, pixels.data());
  return require_encoded(path, written, std::move(bytes));
}

}  // namespace apron::run
