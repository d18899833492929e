// The class of the object that each cell's ray hits first: its label as a number.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

class ObjectTypeSensor final : public Sensor {
 public:
  ObjectTypeSensor(const Field& field, const scene::SensorSpec& spec)
      : ray_caster_(field, cell_ray_of(spec)) {}

  void sense(const SensorInput& input, common::ThreadPool& pool) override {
    if (input.restored) class_of_object_.clear(), class_of_label_.clear();
    for (std::size_t id = class_of_object_.size(); id < input.catalogue.size(); ++id) {
      const auto next_class = static_cast<float>(class_of_label_.size() + 1);
      class_of_object_.push_back(
          class_of_label_.try_emplace(input.catalogue[id].label, next_class).first->second);
    }
    tags_.resize(input.bodies.size());
    for (std::size_t k = 0; k < tags_.size(); ++k) tags_[k] = class_of_object_[input.bodies[k].id];
    ray_caster_.cast(input.bodies, tags_, 0.0F, input.snapshot.height, pool);
  }

  // 1 + the index of the object's label, in order of first appearance ("" is a label too); 0 without an
  // object.
  std::span<const float> values(int /*channel*/) const noexcept override { return ray_caster_.tag(); }

 private:
  RayCaster ray_caster_;
  std::map<std::string, float> class_of_label_;
  std::vector<float> class_of_object_;  // index = id
  std::vector<float> tags_;
};

}  // namespace smartsurf::surface
