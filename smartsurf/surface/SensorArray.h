// All sensors of the surface as one: snapshots in, readings by channel out.
//
// The truth that the models measure and the readings that their imperfections make of it are kept apart; a
// sensor without imperfections has the two in one place.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/FaultMap.h"
#include "smartsurf/surface/sensors/Sensor.h"
#include "smartsurf/surface/sensors/SensorErrorModel.h"

namespace smartsurf::surface {

class SensorArray {
 public:
  // The sensors of the scene's surface. field: where the cells stand; kept by nobody. The world's seed draws
  // all that is random. Throws scene::InputError for a sensor of an unknown model, a calibration or a map
  // that does not fit.
  SensorArray(const scene::SceneSpec&, const Field& field, const FaultMap& = {});
  ~SensorArray();

  // Takes in what the objects did to the cells in one physics step: rows × columns, mass·u/s. Costs nothing
  // unless a sensor feels.
  void accumulate_impulses(std::span<const float> impulse) noexcept;

  // At the end of every tick, in their order.
  void sense(const scene::Snapshot&, std::span<const scene::ObjectSpec> catalogue, common::ThreadPool&);

  // In the order of the sensors.
  std::span<const scene::SensorChannel> channels() const noexcept { return channels_; }
  // components × rows × columns, each component a whole plane, row 0 north. The memory stays the same.
  std::span<const float> readings(int channel) const noexcept;
  std::span<const float> truth(int channel) const noexcept;

 private:
  struct SensorInstance {
    std::unique_ptr<Sensor> sensor;
    SensorErrorModel error_model;
    std::vector<std::span<const float>> truth;  // one a channel
  };
  struct ChannelRef {
    std::size_t sensor;
    int channel;
  };

  double period_s_;
  std::vector<SensorInstance> sensors_;
  std::vector<scene::SensorChannel> channels_;
  std::vector<ChannelRef> channel_refs_;  // one a channel
  RayBodies bodies_;
  std::vector<float> impulse_;  // since the last sense(); empty: nobody asks
  std::uint64_t tick_ = 0;      // sensed so far
};

}  // namespace smartsurf::surface
