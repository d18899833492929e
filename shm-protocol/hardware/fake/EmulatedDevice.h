// A device on the reference firmware, the code that a surface's microcontroller would run. Subclasses provide
// the sensors' values.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "shm-protocol/hardware/firmware/device.h"

namespace hardware {

class EmulatedDevice {
 public:
  // Takes a whole packet, or returns false and takes nothing.
  using Write = std::function<bool(const std::uint8_t*, std::size_t)>;

  // What version 2 of the byte protocol adds to a device.
  struct Board {
    std::string id;
    std::optional<ssw_limits> limits;       // of the first actuator
    std::function<std::uint32_t()> micros;  // the device's clock; empty: it has none
    std::vector<std::uint8_t> mask;         // by cell, 1: it exists; empty: all exist
    std::vector<float> positions;           // x, y, z by cell; empty: a grid
  };

  EmulatedDevice(const EmulatedDevice&) = delete;
  EmulatedDevice& operator=(const EmulatedDevice&) = delete;
  virtual ~EmulatedDevice() = default;

  void receive(std::uint8_t byte) { ssd_receive(&device_, byte); }
  // Ends a control period.
  void period();
  // Simulates a power failure: new boot number, all pins down.
  void restart();
  void report(const char* text) { ssd_report(&device_, text); }
  // Restarts the device as that board.
  void become(Board);
  // Keeps the first actuator's active frame, of dtype u8, in `pins`, and restarts the device.
  void keep_pins_in(std::uint8_t* pins);
  // What a timer's and a stop line's interrupts do; may be called from a signal handler.
  void watchdog(std::uint32_t elapsed_us) { ssd_watchdog(&device_, elapsed_us); }
  void press_stop() { ssd_stop(&device_, SSW_STOP_BY_LINE); }
  // The length of the period that has begun. Call once after each period().
  std::uint32_t period_us() { return ssd_period_us(&device_); }

  const ssd_device& firmware() const { return device_; }
  // The first actuator's active frame, raw, of dtype u8.
  std::span<const std::uint8_t> heights() const { return {pins_, cell_count()}; }

 protected:
  EmulatedDevice(const char* name, std::uint16_t rows, std::uint16_t columns, float pitch,
                 std::uint32_t period_us, Write);
  std::size_t cell_count() const { return std::size_t{rows_} * columns_; }
  // Constructors call it once.
  void set_channels(std::vector<ssd_channel> sensors, const std::vector<ssw_channel>& actuators);
  std::size_t bytes_of(const ssw_channel&) const;
  // The active frame of the actuator `index`.
  std::span<const std::uint8_t> active(std::size_t index) const {
    return {static_cast<const std::uint8_t*>(channels_[sensors_ + index].values), frames_[2 * index].size()};
  }
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
  Board board_;
  std::vector<std::vector<std::uint8_t>> frames_;  // of each actuator the active and the next one
  std::uint8_t* pins_ = nullptr;                   // the first actuator's active frame
  std::vector<ssd_motion> motion_;
  std::vector<ssd_channel> channels_;
  std::size_t sensors_ = 0;  // the first channels
  ssd_device device_{};
};

}  // namespace hardware
