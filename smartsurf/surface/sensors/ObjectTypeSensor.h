// What kind of object each cell's segment meets first: its label as a number.
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
  // 1 + the index of the label in the order of first appearance, "" being a label like others; 0: no object.
  std::span<const float> values(int /*channel*/) const noexcept override { return ray_caster_.tag(); }

 private:
  RayCaster ray_caster_;
  std::map<std::string, float> class_of_label_;
  std::vector<float> class_of_object_;  // index = id
  std::vector<float> tags_;
};

}  // namespace smartsurf::surface
