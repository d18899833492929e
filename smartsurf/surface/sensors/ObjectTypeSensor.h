// The class of the object that each cell's ray hits first: its label as a number.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

class ObjectTypeSensor final : public Sensor {
 public:
  ObjectTypeSensor(const Field& field, const scene::SensorSpec& spec)
      : ray_caster_(field, cell_ray_of(spec)) {}

  void sense(const SensorInput&, common::ThreadPool&) override;
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
