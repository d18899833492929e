// What a skin senses of itself, at n × n points of each cell: its height, its strain, the load on it.
#pragma once

#include <vector>

#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

// Component p of a cell is its p-th sample, in row-major order from the cell's north-west corner. Cells beside the skin
// read 0.
class SkinSensor : public Sensor {
 public:
  std::span<const float> values(int /*channel*/) const noexcept final { return values_; }

 protected:
  SkinSensor(const Field&, const scene::SensorSpec&);

  // A point on the skin, and the index in values_ of the sample there.
  struct Sample {
    std::size_t index;
    float x, y;  // u
  };
  Skin skin_;  // its geometry
  int resolution_;
  float pitch_;
  std::size_t cells_;
  std::vector<Sample> samples_;
  std::vector<float> values_;
};

// z, u.
class SkinHeightSensor final : public SkinSensor {
 public:
  SkinHeightSensor(const Field& field, const scene::SensorSpec& spec) : SkinSensor(field, spec) {}
  void sense(const SensorInput&, common::ThreadPool&) override;
};

// Relative increase of the skin's area by its slope, √(1 + |∇z|²) − 1.
class SkinStrainSensor final : public SkinSensor {
 public:
  SkinStrainSensor(const Field& field, const scene::SensorSpec& spec) : SkinSensor(field, spec) {}
  void sense(const SensorInput&, common::ThreadPool&) override;
};

// The vertical force of the objects on the area around each sample, averaged over the tick, mass·u/s²: the samples add up
// to the whole load.
class SkinContactSensor final : public SkinSensor {
 public:
  SkinContactSensor(const Field&, const scene::SensorSpec&);
  void sense(const SensorInput&, common::ThreadPool&) override;
  void archive(common::StateArchive& a) override { a(values_); }
  bool needs_impulses() const noexcept override { return true; }

 private:
  std::vector<std::size_t> value_of_node_;  // index in values_
};

}  // namespace smartsurf::surface
