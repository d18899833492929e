#include "shm-protocol/hardware/fake/EmulatedDevice.h"

#include <signal.h>

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

// Keeps the interrupts of device_emulator, which a timer's signal stands for, away while it lives.
class InterruptLock {
 public:
  InterruptLock() {
    sigset_t alarm;
    sigemptyset(&alarm);
    sigaddset(&alarm, SIGALRM);
    pthread_sigmask(SIG_BLOCK, &alarm, &before_);
  }
  ~InterruptLock() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  InterruptLock(const InterruptLock&) = delete;
  InterruptLock& operator=(const InterruptLock&) = delete;

 private:
  sigset_t before_{};
};

}  // namespace

EmulatedDevice::EmulatedDevice(const char* name, std::uint16_t rows, std::uint16_t columns, float pitch,
                               std::uint32_t period_us, Write write)
    : rows_(rows),
      columns_(columns),
      name_(name),
      pitch_(pitch),
      period_us_(period_us),
      write_(std::move(write)) {}

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

std::size_t EmulatedDevice::bytes_of(const ssw_channel& c) const {
  const std::size_t of_element = c.dtype == SSW_F32 ? 4 : c.dtype == SSW_U16 ? 2 : 1;
  return of_element * c.components * cell_count();
}

void EmulatedDevice::set_channels(std::vector<ssd_channel> sensors,
                                  const std::vector<ssw_channel>& actuators) {
  channels_ = std::move(sensors);
  sensors_ = channels_.size();
  frames_.reserve(2 * actuators.size());
  for (const ssw_channel& actuator : actuators) {
    auto& active = frames_.emplace_back(bytes_of(actuator));
    auto& next = frames_.emplace_back(bytes_of(actuator));
    channels_.push_back({actuator, active.data(), next.data()});
  }
  pins_ = frames_.front().data();
  restart();
}

void EmulatedDevice::become(Board board) {
  board_ = std::move(board);
  motion_.resize(board_.limits ? cell_count() * channels_[sensors_].info.components : 0);
  restart();
}

void EmulatedDevice::keep_pins_in(std::uint8_t* pins) {
  pins_ = pins;
  channels_[sensors_].values = pins;
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
  const InterruptLock lock;
  reset();
  ssd_init(
      &device_, &hello, channels_.data(), static_cast<std::uint8_t>(channels_.size()),
      [](void* self, const std::uint8_t* bytes, std::size_t count) {
        return static_cast<int>(static_cast<EmulatedDevice*>(self)->write_(bytes, count));
      },
      this);
  set_text(device_.board.id, board_.id.c_str());
  if (board_.micros)
    device_.micros = [](void* self) { return static_cast<EmulatedDevice*>(self)->board_.micros(); };
  if (!board_.mask.empty()) device_.mask = board_.mask.data();
  if (!board_.positions.empty()) device_.positions = board_.positions.data();
  if (board_.limits)
    ssd_limit(&device_, static_cast<std::uint8_t>(sensors_), &*board_.limits, motion_.data());
}

void EmulatedDevice::period() {
  sense(std::uint64_t{device_.tick} + 1);
  ssd_period(&device_);
}

}  // namespace hardware
