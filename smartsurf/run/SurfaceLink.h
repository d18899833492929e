// The simulated surface's end of the shared-memory protocol: its channels, lock-step and controller.
#pragma once

#include <shm_protocol/SurfaceEndpoint.h>
#include <atomic>
#include <chrono>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/run/cli/RunOptions.h"
#include "smartsurf/scene/ChannelData.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/surface/ActuatorArray.h"

namespace smartsurf::run {

class SurfaceLink {
 public:
  // Its channels are those of the surface's sensors; where cells are empty `occupancy`, 1 where there is a
  // cell and 0 where there is none; then those of its actuators. Throws scene::InputError when the name
  // cannot be had.
  SurfaceLink(const std::string& name, RunMode, const scene::SceneSpec&);

  // Writes the frames into shared memory and publishes them.
  [[nodiscard]] shm_protocol::Status publish(std::uint64_t tick, double time_s,
                                             std::span<const scene::ChannelData> sensors) noexcept;

  // Time-step: waits for the answer to the frame published last. Passive: takes the newest frame. Its values go to the
  // actuators, which check them; large frames chunk by chunk while the controller still writes them. Without kOk the
  // physics must not advance: the actuators may then hold a part of an answer.
  [[nodiscard]] shm_protocol::Status receive(std::uint64_t tick, std::chrono::nanoseconds timeout,
                                             const std::atomic<bool>& stop, surface::ActuatorArray&) noexcept;

  shm_protocol::SurfaceEndpoint& endpoint() noexcept { return endpoint_; }
  const std::string& name() const noexcept { return name_; }

 private:
  void receive_chunks(surface::ActuatorArray&, const shm_protocol::WaitOptions&) noexcept;

  std::string name_;
  RunMode mode_;
  shm_protocol::SurfaceEndpoint endpoint_;
  std::vector<float> occupancy_;  // empty where every cell is there
  int first_actuator_channel_;
  std::vector<int> received_;  // cells of each actuator channel of the answer to come that the actuators have
  bool streams_;               // frames are large enough
};

}  // namespace smartsurf::run
