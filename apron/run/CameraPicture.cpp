#include "apron/run/CameraPicture.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <array>

#include "apron/run/ImageCodec.h"

namespace apron::run {
namespace {

// Where an uncompressed format keeps the luminance: one byte a pixel, `stride` apart, from `first` on.
struct Luminance {
  FourCc code;
  std::size_t stride, first;
};

constexpr Luminance kUncompressed[] = {{V4L2_PIX_FMT_GREY, 1, 0},   {V4L2_PIX_FMT_YUYV, 2, 0},
                                       {V4L2_PIX_FMT_UYVY, 2, 1},   {V4L2_PIX_FMT_NV12, 1, 0},
                                       {V4L2_PIX_FMT_YUV420, 1, 0}, {V4L2_PIX_FMT_YVU420, 1, 0}};

constexpr std::array kReadable = {V4L2_PIX_FMT_GREY,  V4L2_PIX_FMT_YUYV,   V4L2_PIX_FMT_UYVY,
                                  V4L2_PIX_FMT_NV12,  V4L2_PIX_FMT_YUV420, V4L2_PIX_FMT_YVU420,
                                  V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_JPEG};

bool copy_luminance(const Luminance& where, const PictureFormat& format, std::span<const std::uint8_t> bytes,
                    GreyFrame& frame) {
  const std::size_t line = std::size_t{format.width} * where.stride;
  const std::size_t pitch = std::max<std::size_t>(format.bytes_per_line, line);
  if (format.width == 0 || format.height == 0 || bytes.size() < pitch * (format.height - 1) + line)
    return false;
  frame.width = format.width;
  frame.height = format.height;
  frame.pixels.resize(std::size_t{format.width} * format.height);
  auto pixel = frame.pixels.begin();
  for (std::uint32_t y = 0; y < format.height; ++y) {
    const std::uint8_t* from = bytes.data() + y * pitch + where.first;
    for (std::uint32_t x = 0; x < format.width; ++x, from += where.stride) *pixel++ = *from;
  }
  return true;
}

}  // namespace

std::span<const FourCc> readable_formats() { return kReadable; }

std::string format_name(FourCc code) {
  std::string name;
  for (int i = 0; i < 4; ++i, code >>= 8) {
    const auto c = static_cast<char>(code & 0x7F);
    name += c >= ' ' && c <= '~' ? c : '?';
  }
  return name;
}

bool make_grey(const PictureFormat& format, std::span<const std::uint8_t> bytes, GreyFrame& frame) {
  const auto* const where = std::find_if(std::begin(kUncompressed), std::end(kUncompressed),
                                         [&](const Luminance& one) { return one.code == format.code; });
  if (where != std::end(kUncompressed)) return copy_luminance(*where, format, bytes, frame);
  return decode_motion_jpeg(bytes, frame);
}

}  // namespace apron::run
