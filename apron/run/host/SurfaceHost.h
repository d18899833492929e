// The VM's host on a surface: maps its channels to the shared-memory protocol.
#pragma once

#include <atomic>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <shm_protocol/ControllerEndpoint.h>

#include "apron/library/ChannelName.h"
#include "apron/run/host/LocalHost.h"
#include "apron/run/host/StepWatchdog.h"

namespace apron::run {

// A channel has the name that the surface gives it. In a channel with several components per cell, 'name[k]'
// is component k, 0-based; with three components also 'name.r', 'name.g' and 'name.b'. Sensor frames are
// copied into registers. Actuator values are written where the surface reads them and published by step(); a
// channel that the program did not write keeps its last frame, initially its safe value. Allocates only in
// the constructor and for error messages.
class SurfaceHost final : public LocalHost {
 public:
  // surface and stop must outlive this.
  SurfaceHost(shm_protocol::ControllerEndpoint& surface, const std::atomic<bool>& stop, Parameters parameters,
              HostEnvironment environment = {});

  // Waits for the first sensor frame; call before the program runs.
  vm::HostStatus await_first_frame();

  vm::HostStatus sense(std::string_view channel, vm::Plane to) override;
  vm::HostStatus actuate(std::string_view channel, vm::ConstPlane from) override;
  vm::HostStatus actuate(std::string_view channel, float value) override;
  // Time-step mode: publishes the answer to the current sensor frame and waits for the next one; after
  // kInterrupted the next call resumes the wait. Passive mode: the same, or, running free, publishes and
  // takes the latest frame, which may be the current one.
  vm::HostStatus step() override;
  void set_free_run(bool free_run) override { free_run_ = free_run; }
  void restart() override {
    LocalHost::restart();
    free_run_ = false;
  }
  bool surface_overdue() const override { return watchdog_ && watchdog_->has_warned(); }
  // Sets the controller's published state to paused or running. The surface waits in either state.
  void publish_paused(bool paused) noexcept;
  // Leaves the surface for another controller. Sensors keep their last values; actuate() and step() return
  // kClosed.
  void close() noexcept;

  std::optional<double> time_s() const override;
  std::optional<double> dt_s() const override;
  std::optional<double> tick() const override;
  bool has(std::string_view channel) const override;

 private:
  shm_protocol::Status publish();
  vm::HostStatus await_frame();
  vm::HostStatus resolve_channel(shm_protocol::Direction direction, std::string_view name,
                                 library::ChannelComponent& target);
  vm::HostStatus check_shape(std::string_view name, const vm::ConstPlane& plane);
  template <class T>
  void copy_sensor(const library::ChannelComponent& target, const vm::Plane& to) const;
  // Fills the next frame of an actuator channel with the values that it continues.
  void continue_frame(std::size_t channel);
  // Calls write(cells, spec) with the component's plane in the next frame, an array of the channel's type.
  template <class Write>
  vm::HostStatus write_plane(std::string_view channel, const vm::ConstPlane* shape, Write write);
  vm::HostStatus to_host_status(shm_protocol::Status status);

  shm_protocol::ControllerEndpoint& surface_;
  std::optional<StepWatchdog> watchdog_;              // of a surface that waits for the program
  std::vector<library::NamedChannel> channel_names_;  // indexed by channel number
  std::vector<bool> is_complete_;  // per channel: every component of its next actuator frame has its value
  bool has_published_ = false;     // at least one frame
  bool free_run_ = false;
  std::atomic<bool> closed_{false};  // read by the user interface's thread
  bool answered_ = false;            // the current frame is answered; waiting for the next was interrupted
};

}  // namespace apron::run
