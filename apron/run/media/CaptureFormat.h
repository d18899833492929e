// Converts camera pixel formats to grey.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "apron/run/media/GreyFrame.h"

namespace apron::run {

// A V4L2 pixel format code (V4L2_PIX_FMT_*), four characters such as 'YUYV'.
using FourCc = std::uint32_t;

// The frame format negotiated with a driver.
struct CaptureFormat {
  FourCc code = 0;
  std::uint32_t width = 0, height = 0;  // pixels
  std::uint32_t bytes_per_line = 0;     // 0: no padding; unused for compressed formats
};

// The formats in order of preference: grey, formats with separate luminance, JPEG.
std::span<const FourCc> supported_formats();
std::string fourcc_name(FourCc code);

// Reuses the frame's memory. False if the bytes are not a complete picture, for example because the camera
// truncated it; the frame's contents are then unspecified.
bool convert_to_grey(const CaptureFormat& format, std::span<const std::uint8_t> bytes, GreyFrame& frame);

}  // namespace apron::run
