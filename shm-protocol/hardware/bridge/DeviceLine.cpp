#include "shm-protocol/hardware/bridge/DeviceLine.h"

#include <algorithm>

namespace hardware {

void DeviceLine::open(Port port) {
  port_ = std::move(port);
  damaged_before_ = link_.damaged_packets();
}

std::string DeviceLine::why_undescribed() const {
  const std::uint64_t damaged = link_.damaged_packets() - damaged_before_;
  return "no device describes itself there" +
         (damaged == 0
              ? std::string()
              : "; " + std::to_string(damaged) + " damaged packets came: is the line's speed right?");
}

void DeviceLine::close() {
  port_.reset();
  link_.reset();
  in_begin_ = in_end_ = 0;
  out_.clear();
  answer_bytes_ = 0;
}

bool DeviceLine::flush() {
  if (!port_) return true;
  const std::size_t before = out_.size();
  const bool connected = port_->flush(out_);
  const std::size_t sent = before - out_.size();
  if (answer_bytes_ == 0 || sent == 0) return connected;
  if (sent >= answer_bytes_) ++answers_;
  answer_bytes_ -= std::min(sent, answer_bytes_);
  return connected;
}

void DeviceLine::discard_pending() {
  out_.clear();
  if (answer_bytes_ != 0) ++unsent_;
  answer_bytes_ = 0;
}

void DeviceLine::write_safe_frame(std::uint32_t tick) {
  safe_.resize(link_.actuator_elements());
  for (const DeviceChannel& c : link_.description().channels)
    if (!c.sensor) std::fill_n(safe_.begin() + c.first_element, c.elements, c.safe);
  link_.write_frame(tick, safe_, out_);
}

bool DeviceLine::write_frame(std::uint32_t tick, std::span<const float> values, bool is_answer) {
  if (!out_.empty() && (!flush() || !out_.empty())) {
    ++unsent_;
    return false;
  }
  link_.write_frame(tick, values, out_);
  if (is_answer) answer_bytes_ = out_.size();
  return true;
}

}  // namespace hardware
