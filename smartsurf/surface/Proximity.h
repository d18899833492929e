// Distance along a segment from each cell to what it meets first, and whether it meets anything.
#pragma once

#include <vector>

#include "smartsurf/surface/Sensor.h"

namespace smartsurf::surface {

class Proximity final : public Sensor {
 public:
  Proximity(const Field& field, const scene::SensorSpec& spec) : first_(field, segment_of(spec)) {}

  void sense(const Moment& moment, WorkerPool& pool) override {
    if (met_.size() < moment.bodies.size()) met_.resize(moment.bodies.size(), 1.0F);
    first_.sweep(moment.bodies, {met_.data(), moment.bodies.size()}, 1.0F, moment.snapshot.height, pool);
  }
  // 0: the distance, u; the range where nothing is met. 1: 1 where something is, else 0.
  std::span<const float> values(int channel) const noexcept override {
    return channel == 0 ? first_.distance() : first_.mark();
  }

 private:
  FirstHit first_;
  std::vector<float> met_;  // 1 for every body
};

}  // namespace smartsurf::surface
