// A device without physics on the reference firmware: the code that a surface's microcontroller would run.
//
// Channels: proximity_hit (u8), pin_height (u16, thousandths of a unit), target_echo (u8, the active actuator
// frame) and the actuator height (u8, fiftieths of a unit).
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "shm-protocol/hardware/firmware/device.h"

namespace hardware {

class ToyDevice {
 public:
  using Write = std::function<void(const std::uint8_t*, std::size_t)>;

  ToyDevice(std::uint16_t rows, std::uint16_t columns, std::uint32_t period_us, Write);
  ToyDevice(const ToyDevice&) = delete;
  ToyDevice& operator=(const ToyDevice&) = delete;

  void receive(std::uint8_t byte) { ssd_receive(&device_, byte); }
  // Ends a control period.
  void period();
  // Simulates a power failure: new boot number, all pins down.
  void restart();
  void report(const char* text) { ssd_report(&device_, text); }

  const ssd_device& firmware() const { return device_; }
  const std::vector<std::uint8_t>& heights() const { return height_; }  // active frame, raw

 private:
  std::uint16_t rows_, columns_;
  std::uint32_t period_us_, boot_ = 0;
  Write write_;
  std::vector<std::uint8_t> hit_, echo_, height_, height_next_;
  std::vector<std::uint16_t> pin_;
  std::vector<ssd_channel> channels_;
  ssd_device device_{};
};

}  // namespace hardware
