// The line to a device: the port, the byte protocol on it, and the bytes that wait to be sent. What the
// bridges of one device and of a table share.
//
// Never blocks. One thread at a time. Once the device is described, nothing here allocates.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "shm-protocol/hardware/bridge/DeviceLink.h"
#include "shm-protocol/hardware/bridge/Port.h"

namespace hardware {

class DeviceLine {
 public:
  // Pending bytes above which nothing but stops is added.
  static constexpr std::size_t kMaxPendingBytes = 1 << 16;

  DeviceLine() { out_.reserve(kMaxPendingBytes); }

  const DeviceLink& link() const { return link_; }
  bool is_open() const { return port_.has_value(); }
  int descriptor() const { return port_ ? port_->descriptor() : -1; }
  void open(Port port);
  // Why the line is open, but the device is not described: "no device describes itself there", …
  std::string why_undescribed() const;
  // Forgets the device's description and what waits.
  void close();

  // Calls on_event(event) for each byte that is there, until more() is false; later bytes wait for the next
  // call. Returns false if the line is lost.
  template <class More, class OnEvent>
  bool receive(More more, OnEvent on_event) {
    for (int round = 0; round < 16 && more(); ++round) {
      if (!has_unread()) {
        const auto got = port_->read(in_);
        if (!got) return false;
        if (*got == 0) return true;
        in_begin_ = 0, in_end_ = *got;
      }
      while (has_unread() && more()) on_event(link_.receive(in_[in_begin_++]));
    }
    return true;
  }
  bool has_unread() const { return in_begin_ != in_end_; }

  // Sends what waits, as far as the line takes it. Returns false if the line is lost.
  bool flush();
  // Discards what waits: a stop does not wait behind frames.
  void discard_pending();
  std::size_t pending_bytes() const { return out_.size(); }

  // These add to what waits; see DeviceLink.
  void write(std::uint8_t type, std::uint32_t tick) { link_.write(type, tick, out_); }
  void write_sync(const ssw_sync& sync, std::uint32_t tick) { link_.write_sync(sync, tick, out_); }
  void write_reason(std::uint8_t type, std::uint32_t reason) { link_.write_reason(type, reason, out_); }
  // The safe values of all actuators.
  void write_safe_frame(std::uint32_t tick);
  // An actuator frame; none, and false, if earlier bytes still wait. `is_answer`: it counts as one once its
  // last byte is sent.
  bool write_frame(std::uint32_t tick, std::span<const float> values, bool is_answer);

  std::uint64_t answers() const { return answers_; }  // that were sent
  std::uint64_t unsent() const { return unsent_; }    // frames that were not, because the line is too slow

 private:
  std::optional<Port> port_;
  DeviceLink link_;
  std::array<std::uint8_t, 4096> in_;
  std::size_t in_begin_ = 0, in_end_ = 0;  // what is unread of in_
  std::vector<std::uint8_t> out_;
  std::vector<float> safe_;
  std::size_t answer_bytes_ = 0;  // of out_, up to the end of an answer; 0: none waits
  std::uint64_t answers_ = 0, unsent_ = 0;
  std::uint64_t damaged_before_ = 0;  // packets, when the line was opened
};

}  // namespace hardware
