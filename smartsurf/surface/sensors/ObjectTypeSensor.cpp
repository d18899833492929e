#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/sensors/ObjectTypeSensor.h"

namespace smartsurf::surface {

void ObjectTypeSensor::sense(const SensorInput& input, common::ThreadPool& pool) {
  for (std::size_t id = class_of_object_.size(); id < input.catalogue.size(); ++id) {
    const auto next_class = static_cast<float>(class_of_label_.size() + 1);
    class_of_object_.push_back(
        class_of_label_.try_emplace(input.catalogue[id].label, next_class).first->second);
  }
  tags_.resize(input.bodies.size());
  for (std::size_t k = 0; k < tags_.size(); ++k) tags_[k] = class_of_object_[input.bodies[k].id];
  ray_caster_.cast(input.bodies, tags_, 0.0F, input.snapshot.height, pool);
}

}  // namespace smartsurf::surface
