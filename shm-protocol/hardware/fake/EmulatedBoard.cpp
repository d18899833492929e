#include "shm-protocol/hardware/fake/EmulatedBoard.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <utility>

namespace hardware {
namespace {

NoiseOptions with_other_seed(NoiseOptions noise) {
  noise.seed += 0x9E3779B97F4A7C15u;
  return noise;
}

EmulatedLine make_line(const EmulatedBoardOptions& o) {
  if (o.tcp < 0) return EmulatedLine::terminal(o.link);
  return EmulatedLine::tcp(static_cast<std::uint16_t>(o.tcp));
}

}  // namespace

EmulatedBoard::EmulatedBoard(const EmulatedBoardOptions& options, const MakeDevice& make)
    : options_(options),
      line_(make_line(options)),
      from_host_(options.noise),
      to_host_(with_other_seed(options.noise)),
      device_(make([this](const std::uint8_t* bytes, std::size_t count) { return write(bytes, count); })),
      period_end_(now() + std::chrono::microseconds(options.period_us)) {}

EmulatedBoard::Time EmulatedBoard::now() { return std::chrono::steady_clock::now().time_since_epoch(); }

std::uint32_t EmulatedBoard::micros() const {
  const double us = static_cast<double>((period_ends_ ? period_end_ : now()).count()) * 1e-3 *
                    (1.0 + options_.drift_ppm * 1e-6);
  return static_cast<std::uint32_t>(static_cast<std::uint64_t>(us)) + options_.clock_start_us;
}

void EmulatedBoard::set_noise(double drop, double corrupt) {
  from_host_.set_noise(drop, corrupt);
  to_host_.set_noise(drop, corrupt);
}

bool EmulatedBoard::write(const std::uint8_t* bytes, std::size_t count) {
  if (within(options_.silent_at, options_.silent_for)) return true;
  const auto has_room = [&] {
    return to_host_.pending_bytes() + line_.pending_bytes() + count <= options_.queue_bytes;
  };
  while (options_.blocking && !has_room()) {
    ::usleep(1000);
    bytes_.clear();
    to_host_.receive(now(), bytes_);
    line_.write(bytes_);
  }
  if (!has_room()) return false;
  to_host_.send(bytes, count, now());
  return true;
}

EmulatedBoard::Time EmulatedBoard::next_event() const {
  Time until = period_end_;
  for (const NoisyLine* line : {&from_host_, &to_host_})
    if (const auto due = line->next_arrival()) until = std::min(until, *due);
  // A full line is tried again.
  return line_.pending_bytes() == 0 ? until : std::min(until, now() + std::chrono::milliseconds(1));
}

void EmulatedBoard::step() {
  carry();
  if (!is_held_ && now() >= period_end_) return next_period();
  while (is_held_ && now() >= period_end_) period_end_ += period_length(options_.period_us);
}

EmulatedBoard::Time EmulatedBoard::period_length(std::uint32_t us) const {
  return Time(static_cast<Time::rep>(us * 1e3 / (1.0 + options_.drift_ppm * 1e-6)));
}

bool EmulatedBoard::has_answer() const {
  const ssd_device& firmware = device_->firmware();
  return !firmware.running || firmware.in_force == SSW_NONE || firmware.ready_tick == firmware.tick;
}

// Records the latency of the answer to this period's frame, once the answer is complete.
void EmulatedBoard::measure_latency() {
  const ssd_device& firmware = device_->firmware();
  if (firmware.ready_tick != firmware.tick || answered_tick_ == firmware.tick) return;
  answered_tick_ = firmware.tick;
  const auto latency = std::chrono::duration_cast<std::chrono::microseconds>(now() - sent_at_);
  if (latency_us_.size() < kMaxLatencies) latency_us_.push_back(static_cast<std::uint32_t>(latency.count()));
}

// Firmware of version 1 ignores later packets, but takes them as a sign of life.
void EmulatedBoard::deliver(std::uint8_t byte) {
  if (!options_.version_1) return device_->receive(byte);
  ssw_packet packet;
  if (!ssw_receive(&receiver_, byte, &packet)) return;
  if (packet.type >= SSW_DESCRIBE2 && packet.type <= SSW_ARM)
    packet.type = SSW_HEARTBEAT, packet.payload_bytes = 0;
  std::array<std::uint8_t, SSW_MAX_ENCODED + 2> framed;
  const std::size_t count = ssw_write(&packet, framed.data());
  for (std::size_t i = 0; i < count; ++i) device_->receive(framed[i]);
}

void EmulatedBoard::carry() {
  bytes_.clear();
  line_.read(bytes_);
  if (line_.has_host() || (host_seen_at_ && !line_.plugged())) host_seen_at_ = now();
  if (!bytes_.empty()) from_host_.send(bytes_.data(), bytes_.size(), now());
  bytes_.clear();
  from_host_.receive(now(), bytes_);
  for (const std::uint8_t byte : std::exchange(bytes_, {})) {
    deliver(byte);
    measure_latency();
  }
  bytes_.clear();
  to_host_.receive(now(), bytes_);
  line_.write(bytes_);
}

void EmulatedBoard::next_period() {
  ++period_;
  if (options_.restarts && (period_ == options_.unplug_at || period_ == options_.silent_at))
    device_->restart();
  if (within(options_.unplug_at, options_.unplug_for)) {
    line_.unplug();
    from_host_.clear();
    to_host_.clear();
  } else {
    line_.plug();
  }
  sent_at_ = now();
  period_ends_ = true;
  device_->period();
  period_ends_ = false;
  period_end_ += period_length(device_->period_us());
  if (on_period) on_period();
}

}  // namespace hardware
