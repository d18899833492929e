// The VM's host on a surface: maps its channels to the shared-memory protocol.
#pragma once

#include <atomic>
#include <string>
#include <string_view>
#include <vector>

#include <shm_protocol/ControllerEndpoint.h>

#include "apron/run/host/LocalHost.h"

namespace apron::run {

// A channel is named as the surface names it; of a channel with several components a cell, 'name[k]' is
// component k, counted from 0, and of three components 'name.r', 'name.g' and 'name.b'. Sensor frames are
// copied into registers; actuator frames are staged here and sent by step(), and a channel that was not
// staged again is sent as it was (at first its safe value). No allocation after construction but for
// messages.
class SurfaceHost final : public LocalHost {
 public:
  // The endpoint and the flag must outlive the host.
  SurfaceHost(shm_protocol::ControllerEndpoint& surface, const std::atomic<bool>& stop, Parameters parameters,
              HostEnvironment environment = {});

  // Waits for the first sensor frame; the program begins with it.
  vm::HostStatus await_first_frame();

  vm::HostStatus sense(std::string_view channel, vm::Plane to) override;
  vm::HostStatus actuate(std::string_view channel, vm::ConstPlane from) override;
  vm::HostStatus actuate(std::string_view channel, float value) override;
  // Time-step mode: publishes the answer to the frame at hand and waits for the next; after kInterrupted the
  // next call goes on waiting. Passive: publishes and takes the newest frame, which may still be the one at
  // hand.
  vm::HostStatus step() override;
  // Tells onlookers whether a person holds the program still. The surface waits in either case.
  void publish_paused(bool paused) noexcept;

  std::optional<double> time_s() const override;
  std::optional<double> dt_s() const override;
  std::optional<double> tick() const override;
  bool has(std::string_view channel) const override;

 private:
  // One plane of a channel.
  struct ChannelComponent {
    int channel = -1;
    std::size_t component = 0;
  };
  struct StagedFrame {
    int channel;
    std::vector<float> cells;  // components x rows x columns
  };

  shm_protocol::Status publish_staged();
  vm::HostStatus await_frame();
  vm::HostStatus resolve_channel(shm_protocol::Direction direction, std::string_view name,
                                 ChannelComponent& target);
  std::string unknown_channel_message(shm_protocol::Direction direction, std::string_view name) const;
  vm::HostStatus check_shape(std::string_view name, const vm::ConstPlane& plane);
  template <class T>
  void copy_sensor(const ChannelComponent& target, const vm::Plane& to) const;
  template <class T>
  void send(const StagedFrame& staged);
  float* staged_plane(const ChannelComponent& target);
  vm::HostStatus to_host_status(shm_protocol::Status status);

  shm_protocol::ControllerEndpoint& surface_;
  std::vector<StagedFrame> staged_;  // one an actuator channel
  bool published_ = false;           // the frame at hand, by a step that was interrupted before the next came
};

}  // namespace apron::run
