// The distance along each cell's ray to its closest hit, and whether there is one.
#pragma once

#include <vector>

#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

class ProximitySensor final : public Sensor {
 public:
  ProximitySensor(const Field& field, const scene::SensorSpec& spec)
      : ray_caster_(field, cell_ray_of(spec)) {}

  void sense(const SensorInput& input, common::ThreadPool& pool) override {
    if (body_tags_.size() < input.bodies.size()) body_tags_.resize(input.bodies.size(), 1.0F);
    ray_caster_.cast(input.bodies, {body_tags_.data(), input.bodies.size()}, 1.0F, input.snapshot.height,
                     pool);
  }
  // Channel 0: distance, u; the range without a hit. Channel 1: 1 with a hit, else 0.
  std::span<const float> values(int channel) const noexcept override {
    return channel == 0 ? ray_caster_.distance() : ray_caster_.tag();
  }

 private:
  RayCaster ray_caster_;
  std::vector<float> body_tags_;  // 1 for every body
};

}  // namespace smartsurf::surface
