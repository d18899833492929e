// The senses of a skin, at n × n points of each cell: its height, its strain, the load on it.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "smartsurf/surface/sensors/Sensor.h"

namespace smartsurf::surface {

// Component p of a cell is its p-th sample, in row-major order from the cell's north-west corner. Cells
// beside the skin read 0.
class SkinSensor : public Sensor {
 public:
  std::span<const float> values(int /*channel*/) const noexcept final { return values_; }

 protected:
  SkinSensor(const Field& field, const scene::SensorSpec& spec)
      : skin_(field.skin),
        resolution_(static_cast<int>(spec.number("resolution"))),
        pitch_(field.pitch),
        cells_(field.cells()),
        values_(resolution_ * resolution_ * cells_, 0.0F) {
    const auto offset = [this](int k) {
      return ((static_cast<float>(k) + 0.5F) / static_cast<float>(resolution_) - 0.5F) * pitch_;
    };
    for (int row = 0; row < resolution_; ++row)
      for (int column = 0; column < resolution_; ++column)
        for (int cell = 0; cell < cells_; ++cell) {
          if (!field.is_under_skin(cell)) continue;
          const Eigen::Vector2f centre = field.centre(cell);
          samples_.push_back({(row * resolution_ + column) * cells_ + cell, centre.x() + offset(column),
                              centre.y() - offset(row)});
        }
  }

  // A point on the skin, and the index in values_ of the sample there.
  struct Sample {
    int index;
    float x, y;  // u
  };
  Skin skin_;  // its geometry
  int resolution_;
  float pitch_;
  int cells_;
  std::vector<Sample> samples_;
  std::vector<float> values_;
};

// z, u.
class SkinHeightSensor final : public SkinSensor {
 public:
  SkinHeightSensor(const Field& field, const scene::SensorSpec& spec) : SkinSensor(field, spec) {}
  void sense(const SensorInput& input, common::ThreadPool& /*pool*/) override {
    skin_.height = input.snapshot.skin_height;
    for (const Sample& s : samples_) values_[s.index] = skin_.locate(s.x, s.y).interpolate(skin_.height);
  }
};

// Relative increase of the skin's area by its slope, √(1 + |∇z|²) − 1.
class SkinStrainSensor final : public SkinSensor {
 public:
  SkinStrainSensor(const Field& field, const scene::SensorSpec& spec) : SkinSensor(field, spec) {}
  void sense(const SensorInput& input, common::ThreadPool& /*pool*/) override {
    skin_.height = input.snapshot.skin_height;
    for (const Sample& s : samples_)
      values_[s.index] = std::sqrt(1.0F + skin_.slope_at(s.x, s.y).squaredNorm()) - 1.0F;
  }
};

// The vertical force of the objects on the area around each sample, averaged over the tick, mass·u/s²: the
// samples add up to the whole load.
class SkinContactSensor final : public SkinSensor {
 public:
  SkinContactSensor(const Field& field, const scene::SensorSpec& spec) : SkinSensor(field, spec) {
    // Samples count from the north-west. The skin covers a rectangle of cells and a margin, whose nodes
    // belong to the nearest sample.
    const auto first_cell = static_cast<int>(std::ranges::find(skin_.covers, 1) - skin_.covers.begin());
    const int border = first_cell / std::max(1, field.columns);
    const auto sample_along = [&](float u, int cells) {
      const auto k = static_cast<int>(std::floor((u / pitch_ + 0.5F) * static_cast<float>(resolution_)));
      return std::clamp(k, border * resolution_, (cells - border) * resolution_ - 1);
    };
    for (int r = 0; r < skin_.rows; ++r)
      for (int c = 0; c < skin_.columns; ++c) {
        const Eigen::Vector3f at = skin_.node(r, c);
        const float south = static_cast<float>(field.rows - 1) * pitch_ - at.y();
        const int row = sample_along(south, field.rows), column = sample_along(at.x(), field.columns);
        const int sample = row % resolution_ * resolution_ + column % resolution_;
        value_of_node_.push_back(sample * cells_ + field.index(row / resolution_, column / resolution_));
      }
  }
  void sense(const SensorInput& input, common::ThreadPool& /*pool*/) override {
    constexpr float kMaxForce = 1e6F;  // upper limit of the readings, mass·u/s²
    std::ranges::fill(values_, 0.0F);
    const auto per_second = static_cast<float>(1.0 / input.period_s);
    for (std::size_t i = 0; i < input.skin_impulse.size(); ++i)
      if (input.skin_impulse[i] != 0.0F) values_[value_of_node_[i]] += input.skin_impulse[i] * per_second;
    for (float& force : values_) force = std::clamp(force, 0.0F, kMaxForce);
  }
  void archive(common::StateArchive& a) override { a(values_); }
  bool needs_impulses() const noexcept override { return true; }

 private:
  std::vector<int> value_of_node_;  // index in values_
};

}  // namespace smartsurf::surface
