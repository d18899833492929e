// A device without physics: what it senses depends on the tick alone, so that any frame can be verified.
//
// Channels: proximity_hit (u8), pin_height (u16, thousandths of a unit), target_echo (u8, the active actuator
// frame) and the actuator height (u8, fiftieths of a unit).
#pragma once

#include <optional>

#include "shm-protocol/hardware/fake/EmulatedDevice.h"
#include "shm-protocol/hardware/fake/ImperfectPins.h"

namespace hardware {

class ToyDevice final : public EmulatedDevice {
 public:
  // `errors`: the seed of imperfect pins, whose sensors say up to a unit less and more than the range.
  ToyDevice(std::uint16_t rows, std::uint16_t columns, std::uint32_t period_us, Write,
            std::optional<std::uint64_t> errors = {});

  // Null: all pins are alike.
  const ImperfectPins* imperfect() const { return pins_ ? &*pins_ : nullptr; }

 private:
  void reset() override;
  void sense(std::uint64_t tick) override;
  void sense_imperfect_pins();

  std::vector<std::uint8_t> hit_, echo_;
  std::vector<std::uint16_t> pin_;
  std::optional<ImperfectPins> pins_;
  std::vector<float> commands_;
  bool is_powered_ = false;
};

}  // namespace hardware
