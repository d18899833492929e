// What kind of object each cell's segment meets first: its label as a number.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "smartsurf/surface/Sensor.h"

namespace smartsurf::surface {

class ObjectType final : public Sensor {
 public:
  ObjectType(const Field& field, const scene::SensorSpec& spec) : first_(field, segment_of(spec)) {}

  void sense(const Moment&, WorkerPool&) override;
  // 1 + the index of the label in the order of first appearance, "" being a label like others; 0: no object.
  std::span<const float> values(int /*channel*/) const noexcept override { return first_.mark(); }

 private:
  FirstHit first_;
  std::map<std::string, float> type_of_label_;
  std::vector<float> type_of_object_;  // index = id
  std::vector<float> marks_;
};

}  // namespace smartsurf::surface
