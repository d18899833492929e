// Converts camera pixel formats to grey.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "apron/run/media/GreyFrame.h"

namespace apron::run {

// Four characters as Linux numbers them, such as 'YUYV'.
using FourCc = std::uint32_t;

// What a driver says of the pictures that it will give.
struct CaptureFormat {
  FourCc code = 0;
  std::uint32_t width = 0, height = 0;
  std::uint32_t bytes_per_line = 0;  // 0: without gaps; no meaning in compressed formats
};

// The formats that can be read, the most wanted first: grey, then those with grey beside colours, then JPEG.
std::span<const FourCc> supported_formats();
std::string fourcc_name(FourCc code);

// Into the frame, whose memory is used again. False if the bytes are no whole picture of that format, such as
// a frame that the camera cut short; the frame is then as good as empty.
bool convert_to_grey(const CaptureFormat& format, std::span<const std::uint8_t> bytes, GreyFrame& frame);

}  // namespace apron::run
