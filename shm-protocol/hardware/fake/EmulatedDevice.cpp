#include "shm-protocol/hardware/fake/EmulatedDevice.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace hardware {
namespace {

// Copies a text to a field that is zero and need not end with one.
template <std::size_t kSize>
void set_text(char (&field)[kSize], const char* text) {
  std::copy_n(text, std::min(std::strlen(text), kSize), field);
}

}  // namespace

EmulatedDevice::EmulatedDevice(const char* name, std::uint16_t rows, std::uint16_t columns, float pitch,
                               std::uint32_t period_us, Write write)
    : rows_(rows),
      columns_(columns),
      name_(name),
      pitch_(pitch),
      period_us_(period_us),
      write_(std::move(write)),
      height_(cell_count()),
      height_next_(cell_count()) {}

ssw_channel EmulatedDevice::describe(ssw_direction direction, ssw_dtype dtype, const char* name,
                                     const char* unit, float maximum, float scale) {
  ssw_channel c{};
  c.direction = static_cast<std::uint8_t>(direction);
  c.dtype = static_cast<std::uint8_t>(dtype);
  c.components = 1;
  c.maximum = maximum;
  c.scale = scale;
  set_text(c.name, name);
  set_text(c.unit, unit);
  return c;
}

void EmulatedDevice::set_channels(std::vector<ssd_channel> sensors, const ssw_channel& height) {
  channels_ = std::move(sensors);
  channels_.push_back({height, height_.data(), height_next_.data()});
  restart();
}

void EmulatedDevice::restart() {
  ssw_hello hello{};
  hello.rows = rows_;
  hello.columns = columns_;
  hello.period_us = period_us_;
  hello.pitch = pitch_;
  hello.boot = ++boot_;
  set_text(hello.name, name_);
  reset();
  ssd_init(
      &device_, &hello, channels_.data(), static_cast<std::uint8_t>(channels_.size()),
      [](void* self, const std::uint8_t* bytes, std::size_t count) {
        static_cast<EmulatedDevice*>(self)->write_(bytes, count);
      },
      this);
}

void EmulatedDevice::period() {
  sense(std::uint64_t{device_.tick} + 1);
  ssd_period(&device_);
}

}  // namespace hardware
