#include "shm-protocol/hardware/fake/ToyDevice.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "shm-protocol/hardware/fake/toy.h"

namespace hardware {
namespace {

constexpr float kPinScale = 0.001F, kHeightScale = 0.02F, kMargin = 1.0F;

}  // namespace

ToyDevice::ToyDevice(std::uint16_t rows, std::uint16_t columns, std::uint32_t period_us, Write write,
                     std::optional<std::uint64_t> errors)
    : EmulatedDevice("toy", rows, columns, 1.0F, period_us, std::move(write)),
      hit_(cell_count()),
      echo_(cell_count()),
      pin_(cell_count()),
      commands_(cell_count()) {
  ssw_channel pin = describe(SSW_SENSOR, SSW_U16, "pin_height", "u", TOY_HIGHEST, kPinScale);
  if (errors) {
    pins_.emplace(cell_count(), TOY_HIGHEST, 1e-6 * period_us, *errors);
    pin.minimum = pin.offset = -kMargin;
    pin.maximum += kMargin;
  }
  set_channels({{describe(SSW_SENSOR, SSW_U8, "proximity_hit", "", 1, 1), hit_.data(), nullptr},
                {pin, pin_.data(), nullptr},
                {describe(SSW_SENSOR, SSW_U8, "target_echo", "", 255, 1), echo_.data(), nullptr}},
               {describe(SSW_ACTUATOR, SSW_U8, "height", "u", TOY_HIGHEST, kHeightScale)});
}

void ToyDevice::reset() {
  std::ranges::fill(pin_, std::uint16_t{0});
  if (pins_) pins_->reset();
  is_powered_ = false;
}

// Pins have no power before their first frame.
void ToyDevice::sense_imperfect_pins() {
  std::ranges::transform(heights(), commands_.begin(),
                         [](std::uint8_t raw) { return static_cast<float>(raw) * kHeightScale; });
  if (firmware().in_force != SSW_NONE) is_powered_ = true;
  if (is_powered_) pins_->advance(commands_);
  for (std::size_t cell = 0; cell < pin_.size(); ++cell) {
    const double raw = (pins_->read(cell) + static_cast<double>(kMargin)) / static_cast<double>(kPinScale);
    pin_[cell] = static_cast<std::uint16_t>(std::clamp(std::lround(raw), 0L, 65535L));
  }
}

void ToyDevice::sense(std::uint64_t tick) {
  for (std::uint32_t row = 0, cell = 0; row < rows_; ++row)
    for (std::uint32_t column = 0; column < columns_; ++column, ++cell) {
      hit_[cell] = static_cast<std::uint8_t>(toy_hit(rows_, columns_, tick, row, column));
      if (pins_) continue;
      const float pin = toy_follow(static_cast<float>(pin_[cell]) * kPinScale,
                                   static_cast<float>(heights()[cell]) * kHeightScale);
      pin_[cell] = static_cast<std::uint16_t>(std::lround(pin / kPinScale));
    }
  if (pins_) sense_imperfect_pins();
  std::ranges::copy(heights(), echo_.begin());
}

}  // namespace hardware
