// The simulated surface as a surface on the shared-memory protocol: its channels, its lock-step, its
// controller.
#pragma once

#include <shm_protocol/SurfaceEndpoint.h>
#include <atomic>
#include <chrono>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/record/Recorder.h"
#include "smartsurf/run/cli/RunOptions.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {

class SurfaceLink {
 public:
  // Its channels are those of the surface's sensors; where cells are empty `occupancy`, 1 where there is a
  // cell and 0 where there is none; then those of its actuators. Throws scene::InputError when the name
  // cannot be had.
  SurfaceLink(const std::string& name, RunMode, const scene::SceneSpec&);

  // Writes the frames into shared memory and publishes them.
  [[nodiscard]] shm_protocol::Status publish(std::uint64_t tick, double time_s,
                                             std::span<const record::ChannelData> sensors) noexcept;

  // Time-step: waits for the answer to the frame published last. Passive: takes the newest there is.
  [[nodiscard]] shm_protocol::Status receive(std::uint64_t tick, std::chrono::nanoseconds timeout,
                                             const std::atomic<bool>& stop) noexcept;

  int actuator_channel_count() const noexcept { return actuator_channel_count_; }
  // Of the n-th actuator channel, rows × columns: the frame received last; the safe values before the first.
  std::span<const float> targets(int channel) const noexcept {
    return endpoint_.actuator<float>(first_actuator_channel_ + channel);
  }

  shm_protocol::SurfaceEndpoint& endpoint() noexcept { return endpoint_; }
  const std::string& name() const noexcept { return name_; }

 private:
  std::string name_;
  RunMode mode_;
  shm_protocol::SurfaceEndpoint endpoint_;
  std::vector<float> occupancy_;  // empty where every cell is there
  int first_actuator_channel_, actuator_channel_count_;
};

}  // namespace smartsurf::run
