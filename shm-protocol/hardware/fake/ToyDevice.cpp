#include "shm-protocol/hardware/fake/ToyDevice.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "shm-protocol/hardware/fake/toy.h"

namespace hardware {
namespace {

constexpr float kPinScale = 0.001F, kHeightScale = 0.02F;

ssw_channel channel(ssw_direction direction, ssw_dtype dtype, const char* name, const char* unit,
                    float maximum, float scale) {
  ssw_channel c{};
  c.direction = static_cast<std::uint8_t>(direction);
  c.dtype = static_cast<std::uint8_t>(dtype);
  c.components = 1;
  c.maximum = maximum;
  c.scale = scale;
  std::strncpy(c.name, name, sizeof c.name);
  std::strncpy(c.unit, unit, sizeof c.unit);
  return c;
}

}  // namespace

ToyDevice::ToyDevice(std::uint16_t rows, std::uint16_t columns, std::uint32_t period_us, Write write)
    : rows_(rows), columns_(columns), period_us_(period_us), write_(std::move(write)) {
  const std::size_t cells = std::size_t{rows} * columns;
  hit_.resize(cells);
  echo_.resize(cells);
  height_.resize(cells);
  height_next_.resize(cells);
  pin_.resize(cells);
  channels_ = {
      {channel(SSW_SENSOR, SSW_U8, "proximity_hit", "", 1, 1), hit_.data(), nullptr},
      {channel(SSW_SENSOR, SSW_U16, "pin_height", "u", TOY_HIGHEST, kPinScale), pin_.data(), nullptr},
      {channel(SSW_SENSOR, SSW_U8, "target_echo", "", 255, 1), echo_.data(), nullptr},
      {channel(SSW_ACTUATOR, SSW_U8, "height", "u", TOY_HIGHEST, kHeightScale), height_.data(),
       height_next_.data()}};
  restart();
}

void ToyDevice::restart() {
  ssw_hello hello{};
  hello.rows = rows_;
  hello.columns = columns_;
  hello.period_us = period_us_;
  hello.pitch = 1;
  hello.boot = ++boot_;
  std::strncpy(hello.name, "toy", sizeof hello.name);
  std::ranges::fill(pin_, std::uint16_t{0});
  ssd_init(
      &device_, &hello, channels_.data(), static_cast<std::uint8_t>(channels_.size()),
      [](void* self, const std::uint8_t* bytes, std::size_t count) {
        static_cast<ToyDevice*>(self)->write_(bytes, count);
      },
      this);
}

void ToyDevice::period() {
  const std::uint64_t tick = std::uint64_t{device_.tick} + 1;
  for (std::uint32_t row = 0, cell = 0; row < rows_; ++row)
    for (std::uint32_t column = 0; column < columns_; ++column, ++cell) {
      hit_[cell] = static_cast<std::uint8_t>(toy_hit(rows_, columns_, tick, row, column));
      const float pin = toy_follow(static_cast<float>(pin_[cell]) * kPinScale,
                                   static_cast<float>(height_[cell]) * kHeightScale);
      pin_[cell] = static_cast<std::uint16_t>(std::lround(pin / kPinScale));
    }
  echo_ = height_;
  ssd_period(&device_);
}

}  // namespace hardware
