// A device on the reference firmware, the code that a surface's microcontroller would run. Subclasses provide
// the sensors' values.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "shm-protocol/hardware/firmware/device.h"

namespace hardware {

class EmulatedDevice {
 public:
  using Write = std::function<void(const std::uint8_t*, std::size_t)>;

  EmulatedDevice(const EmulatedDevice&) = delete;
  EmulatedDevice& operator=(const EmulatedDevice&) = delete;
  virtual ~EmulatedDevice() = default;

  void receive(std::uint8_t byte) { ssd_receive(&device_, byte); }
  // Ends a control period.
  void period();
  // Simulates a power failure: new boot number, all pins down.
  void restart();
  void report(const char* text) { ssd_report(&device_, text); }

  const ssd_device& firmware() const { return device_; }
  const std::vector<std::uint8_t>& heights() const { return height_; }  // active frame, raw

 protected:
  EmulatedDevice(const char* name, std::uint16_t rows, std::uint16_t columns, float pitch,
                 std::uint32_t period_us, Write);
  std::size_t cell_count() const { return std::size_t{rows_} * columns_; }
  // The channels: sensors first, then the only actuator, `height`, of dtype u8. Constructors call it once.
  void set_channels(std::vector<ssd_channel> sensors, const ssw_channel& height);
  static ssw_channel describe(ssw_direction, ssw_dtype, const char* name, const char* unit, float maximum,
                              float scale);

  // Returns to the state at power-on.
  virtual void reset() = 0;
  // Updates the sensors' values to that tick, one period under the active frame later.
  virtual void sense(std::uint64_t tick) = 0;

  const std::uint16_t rows_, columns_;

 private:
  const char* name_;
  float pitch_;
  std::uint32_t period_us_, boot_ = 0;
  Write write_;
  std::vector<std::uint8_t> height_, height_next_;
  std::vector<ssd_channel> channels_;
  ssd_device device_{};
};

}  // namespace hardware
