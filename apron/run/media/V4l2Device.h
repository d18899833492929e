// The Video4Linux2 system calls, behind an interface that tests replace.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace apron::run {

class V4l2Device {
 public:
  virtual ~V4l2Device() = default;

  // ioctl(), again when a signal interrupts it: 0 or errno.
  virtual int control(unsigned long request, void* argument) = 0;
  // mmap() of one of the driver's buffers, until the device is closed; empty: it cannot be had.
  virtual std::span<const std::uint8_t> map(std::size_t bytes, std::int64_t offset) = 0;
  // poll() for a filled buffer: 0, ETIMEDOUT, EINTR or another errno.
  virtual int wait(int milliseconds) = 0;
};

// Opens the device, which is closed with it. Throws MediaError: no such device, no right to it, no device at
// all.
std::unique_ptr<V4l2Device> open_v4l2_device(const std::string& path);

}  // namespace apron::run
