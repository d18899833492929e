// Drives all sensors of the surface: turns snapshots into readings per channel.
//
// The true values that the sensor models measure and the readings with errors are kept separately; a sensor
// without errors stores them once. Not thread-safe.
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
  // Creates the sensors of the scene's surface. `field` gives the cell geometry and is not retained. The
  // world's seed determines all random errors. Throws scene::InputError for an unknown sensor model, or an
  // invalid calibration or fault map.
  SensorArray(const scene::SceneSpec&, const Field& field, const FaultMap& = {});
  ~SensorArray();

  bool needs_impulses() const noexcept { return !impulse_.empty(); }
  // Adds the impulses of one physics step, mass·u/s: Field::impulse, Field::tip_impulse and Skin::impulse.
  // Costs nothing unless a sensor needs impulses.
  void accumulate_impulses(std::span<const float> cells, std::span<const Eigen::Vector3f> tips = {},
                           std::span<const float> skin = {}) noexcept;

  // Call at the end of every tick. Allocates only when objects are added.
  void sense(const scene::Snapshot&, std::span<const scene::ObjectSpec> catalogue, common::ThreadPool&);

  // Channels of all sensors, in the order of the sensors.
  std::span<const scene::SensorChannel> channels() const noexcept { return channels_; }
  // components × rows × columns, one plane per component, row-major, row 0 north, in the channel's unit. The
  // spans stay valid for the lifetime of the array.
  std::span<const float> readings(int channel) const noexcept;
  std::span<const float> truth(int channel) const noexcept;

  // Saves or restores the state of sensors with the same scene and fault map. `snapshot`: the one sensed
  // last.
  void archive(common::StateArchive&, const scene::Snapshot& snapshot,
               std::span<const scene::ObjectSpec> catalogue, common::ThreadPool&);

 private:
  struct SensorInstance {
    std::unique_ptr<Sensor> sensor;
    SensorErrorModel error_model;
    std::vector<std::span<const float>> truth;  // one per channel
  };
  void clear_impulses() noexcept;
  struct ChannelRef {
    std::size_t sensor;
    int channel;
  };

  double period_s_;
  std::vector<SensorInstance> sensors_;
  std::vector<scene::SensorChannel> channels_;
  std::vector<ChannelRef> channel_refs_;  // one per channel
  RayBodies bodies_;
  // Sums since the last sense(); empty if no sensor needs them.
  std::vector<float> impulse_, skin_impulse_;
  std::vector<Eigen::Vector3f> tip_impulse_;
  std::uint64_t tick_ = 0;  // number of sense() calls so far
};

}  // namespace smartsurf::surface
