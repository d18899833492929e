// The simulated surface's end of the shared-memory protocol: its channels, lock-step and controller.
#pragma once

#include <shm_protocol/SurfaceEndpoint.h>
#include <shm_protocol/SurfaceName.h>
#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/files/UnfinishedFile.h"
#include "smartsurf/run/options/RunOptions.h"
#include "smartsurf/scene/ChannelData.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/surface/ActuatorArray.h"

namespace smartsurf::run {

// Reserves the name of a surface for a process that will not be able to create files. Throws
// scene::InputError if the name is invalid or in use.
std::shared_ptr<shm_protocol::SurfaceName> reserve_name(const std::string&);

class SurfaceLink {
 public:
  // Creates the segment. Its channels are those of the sensors; `occupancy`, 1 for a cell and 0 for an empty
  // one, if any cell is empty; and those of the actuators. Throws scene::InputError if the name is invalid or
  // in use. reserved: that name, if the process may no longer create files.
  SurfaceLink(const std::string& name, RunMode, const scene::SceneSpec&,
              std::shared_ptr<shm_protocol::SurfaceName> reserved = nullptr);

  // Writes the sensor frames to shared memory and publishes them.
  [[nodiscard]] shm_protocol::Status publish(std::uint64_t tick, double time_s,
                                             std::span<const scene::ChannelData> sensors) noexcept;

  // Time-step mode: waits for the answer to the last published frame. Passive mode: takes the newest frame.
  // Passes the values to the actuators, which clamp them; a large frame arrives in chunks while the
  // controller still writes it, if it calls write(). In time-step mode the physics must not advance unless
  // the result is kOk: the actuators may hold part of a frame.
  [[nodiscard]] shm_protocol::Status receive(std::uint64_t tick, std::chrono::nanoseconds timeout,
                                             const std::atomic<bool>& stop, surface::ActuatorArray&) noexcept;

  shm_protocol::SurfaceEndpoint& endpoint() noexcept { return endpoint_; }
  const std::string& name() const noexcept { return name_; }

 private:
  void receive_chunks(surface::ActuatorArray&, const shm_protocol::WaitOptions&) noexcept;

  std::string name_;
  RunMode mode_;
  common::UnfinishedFile segment_;
  shm_protocol::SurfaceEndpoint endpoint_;
  std::vector<float> occupancy_;  // empty if no cell is empty
  int first_actuator_channel_;
  std::vector<int> received_;  // per actuator channel: cells of the pending answer already passed on
  bool streams_;               // frames are received in chunks
};

}  // namespace smartsurf::run
