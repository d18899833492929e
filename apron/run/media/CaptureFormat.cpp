#include "apron/run/media/CaptureFormat.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <array>

#include "apron/run/media/ImageCodec.h"

namespace apron::run {
namespace {

// The luminance bytes of an uncompressed format: one per pixel, `stride` bytes apart, the first at `offset`.
struct LuminanceLayout {
  FourCc code;
  std::size_t stride, offset;
};

constexpr LuminanceLayout kUncompressedFormats[] = {{V4L2_PIX_FMT_GREY, 1, 0},   {V4L2_PIX_FMT_YUYV, 2, 0},
                                                    {V4L2_PIX_FMT_UYVY, 2, 1},   {V4L2_PIX_FMT_NV12, 1, 0},
                                                    {V4L2_PIX_FMT_YUV420, 1, 0}, {V4L2_PIX_FMT_YVU420, 1, 0}};

constexpr std::array kSupportedFormats = {V4L2_PIX_FMT_GREY,  V4L2_PIX_FMT_YUYV,   V4L2_PIX_FMT_UYVY,
                                          V4L2_PIX_FMT_NV12,  V4L2_PIX_FMT_YUV420, V4L2_PIX_FMT_YVU420,
                                          V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_JPEG};

bool copy_luminance(const LuminanceLayout& layout, const CaptureFormat& format,
                    std::span<const std::uint8_t> bytes, GreyFrame& frame) {
  const std::size_t row_bytes = std::size_t{format.width} * layout.stride;
  const std::size_t pitch = std::max<std::size_t>(format.bytes_per_line, row_bytes);
  if (format.width == 0 || format.height == 0 || bytes.size() < pitch * (format.height - 1) + row_bytes)
    return false;
  frame.width = format.width;
  frame.height = format.height;
  frame.pixels.resize(std::size_t{format.width} * format.height);
  auto pixel = frame.pixels.begin();
  for (std::uint32_t y = 0; y < format.height; ++y) {
    const std::uint8_t* from = bytes.data() + y * pitch + layout.offset;
    for (std::uint32_t x = 0; x < format.width; ++x, from += layout.stride) *pixel++ = *from;
  }
  return true;
}

}  // namespace

std::span<const FourCc> supported_formats() { return kSupportedFormats; }

std::string fourcc_name(FourCc code) {
  std::string name;
  for (int i = 0; i < 4; ++i, code >>= 8) {
    const auto c = static_cast<char>(code & 0x7F);
    name += c >= ' ' && c <= '~' ? c : '?';
  }
  return name;
}

bool convert_to_grey(const CaptureFormat& format, std::span<const std::uint8_t> bytes, GreyFrame& frame) {
  const auto* const layout =
      std::find_if(std::begin(kUncompressedFormats), std::end(kUncompressedFormats),
                   [&](const LuminanceLayout& one) { return one.code == format.code; });
  if (layout != std::end(kUncompressedFormats)) return copy_luminance(*layout, format, bytes, frame);
  return decode_mjpeg_frame(bytes, frame);
}

}  // namespace apron::run
