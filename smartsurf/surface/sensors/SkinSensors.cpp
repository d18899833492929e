#include "smartsurf/surface/sensors/SkinSensors.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::surface {
namespace {

constexpr float kMaxForce = 1e6F;  // upper limit of the readings, mass·u/s²

}  // namespace

SkinSensor::SkinSensor(const Field& field, const scene::SensorSpec& spec)
    : skin_(field.skin),
      resolution_(static_cast<int>(spec.number("resolution"))),
      pitch_(field.pitch),
      cells_(static_cast<std::size_t>(field.cells())) {
  const auto n = static_cast<std::size_t>(resolution_);
  values_.assign(n * n * cells_, 0.0F);
  const auto offset = [this](int k) {
    return ((static_cast<float>(k) + 0.5F) / static_cast<float>(resolution_) - 0.5F) * pitch_;
  };
  for (int row = 0; row < resolution_; ++row)
    for (int column = 0; column < resolution_; ++column)
      for (std::size_t cell = 0; cell < cells_; ++cell) {
        if (!field.is_under_skin(cell)) continue;
        const Eigen::Vector2f centre = field.centre(static_cast<int>(cell));
        const auto sample = static_cast<std::size_t>(row * resolution_ + column);
        samples_.push_back({sample * cells_ + cell, centre.x() + offset(column), centre.y() - offset(row)});
      }
}

void SkinHeightSensor::sense(const SensorInput& input, common::ThreadPool& /*pool*/) {
  skin_.height = input.snapshot.skin_height;
  for (const Sample& s : samples_) values_[s.index] = skin_.locate(s.x, s.y).interpolate(skin_.height);
}

void SkinStrainSensor::sense(const SensorInput& input, common::ThreadPool& /*pool*/) {
  skin_.height = input.snapshot.skin_height;
  for (const Sample& s : samples_)
    values_[s.index] = std::sqrt(1.0F + skin_.slope_at(s.x, s.y).squaredNorm()) - 1.0F;
}

SkinContactSensor::SkinContactSensor(const Field& field, const scene::SensorSpec& spec)
    : SkinSensor(field, spec) {
  // Samples count from the north-west; the sheet lies over a rectangle of cells and a margin, whose nodes belong to the
  // nearest sample.
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
      const int cell = field.index(row / resolution_, column / resolution_);
      value_of_node_.push_back(static_cast<std::size_t>(sample) * cells_ + static_cast<std::size_t>(cell));
    }
}

void SkinContactSensor::sense(const SensorInput& input, common::ThreadPool& /*pool*/) {
  std::ranges::fill(values_, 0.0F);
  const auto per_second = static_cast<float>(1.0 / input.period_s);
  for (std::size_t i = 0; i < input.skin_impulse.size(); ++i)
    if (input.skin_impulse[i] != 0.0F) values_[value_of_node_[i]] += input.skin_impulse[i] * per_second;
  for (float& force : values_) force = std::clamp(force, 0.0F, kMaxForce);
}

}  // namespace smartsurf::surface
